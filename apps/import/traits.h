/* What a scene says about directions, lengths and colours. */
#ifndef STRL_IMPORT_TRAITS_H
#define STRL_IMPORT_TRAITS_H

#include <assimp/scene.h>
#include <stdint.h>

#include "output.h"

/* Sets up and unit_metres: of the scene as assimp gives it, which for some formats is not what the file says. */
void import_traits_directions(const struct aiScene *scene, const char *extension, import_facts *facts);
/* sRGB-encoded RGBA8, R in the lowest byte. */
uint32_t import_traits_colour(const struct aiColor4D *colour);
/* name: at least STRL_IMPORT_NAME_MOST + 1 bytes. */
uint32_t import_traits_material(const struct aiMaterial *material, char *name);

#endif
