/* Normals for triangles that came without: by position, angle-weighted, with a crease of 40 degrees. Holds the whole
 * mesh in memory (about 70 bytes a triangle): for reference images, not for builds. */
#ifndef STRL_CLI_RENDER_NORMALS_H
#define STRL_CLI_RENDER_NORMALS_H

#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

typedef struct strl_smooth_normals strl_smooth_normals;

/* add every triangle -> finish -> corner, with the triangles numbered as added. */
strl_status strl_smooth_normals_create(strl_smooth_normals **normals, strl_error *err);
strl_status strl_smooth_normals_add(strl_smooth_normals *normals, const float position[3][3], strl_error *err);
strl_status strl_smooth_normals_finish(strl_smooth_normals *normals, strl_error *err);
void strl_smooth_normals_corner(const strl_smooth_normals *normals, uint64_t triangle, int corner, float normal[3]);
void strl_smooth_normals_destroy(strl_smooth_normals *normals); /* NULL is legal */

#endif
