/* Materials come down to one colour, the base colour's factor, linear in the file, and its image,
 * which the vertices' colours take in. Of alpha modes,
 * OPAQUE makes alpha 1, BLEND keeps it, MASK makes it 0 or 1 by the cutoff, vertex by vertex. */
#include <math.h>
#include <string.h>

#include "readers/gltf.h"

static uint8_t mask_or_blend(const strl__gltf_material *material, double alpha)
{
    if (material->is_opaque)
        return 255;
    if (material->cutoff < 0)
        return strl__colour_channel(STRL__F64, alpha);
    return alpha >= material->cutoff ? 255 : 0;
}

/* The reader's user multiplies it with the material's, which for a mask is 0 or 1 already. */
uint8_t strl__gltf_alpha(const strl__gltf *gltf, uint32_t index, double alpha)
{
    static const strl__gltf_material standard = {.is_opaque = true};
    const strl__gltf_material *material = index == STRL__NO_ITEM ? &standard : &gltf->materials[index];
    return mask_or_blend(material, material->cutoff < 0 ? alpha : alpha * material->alpha);
}

/* Returns the member that tells of the image, or NULL. */
static const json_t *parse_base(strl__fields *fields, const json_t *value, double factor[4])
{
    const json_t *rough = strl__fields_object(fields, value, "pbrMetallicRoughness");
    const json_t *glossy = strl__fields_extension(fields, value, "KHR_materials_pbrSpecularGlossiness");
    const json_t *image = strl__fields_object(fields, rough, "baseColorTexture");
    if (strl__fields_numbers(fields, rough, "baseColorFactor", factor, 4) || image)
        return image;
    strl__fields_numbers(fields, glossy, "diffuseFactor", factor, 4);
    return strl__fields_object(fields, glossy, "diffuseTexture");
}

strl_status strl__gltf_parse_material(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    double factor[4] = {1, 1, 1, 1};
    strl__gltf_material material = {.cutoff = -1, .listed = STRL__NO_ITEM, .texture = STRL__NO_TEXTURE};
    const char *name = strl__fields_text(fields, value, "name");
    const char *mode = strl__fields_text(fields, value, "alphaMode");
    const double cutoff = strl__fields_number(fields, value, "alphaCutoff", 0.5);
    strl__gltf_parse_map_use(fields->path, &material, parse_base(fields, value, factor));
    material.is_opaque = !mode || (strcmp(mode, "MASK") != 0 && strcmp(mode, "BLEND") != 0);
    if (mode && strcmp(mode, "MASK") == 0)
        material.cutoff = fmax(cutoff, 0);
    material.alpha = factor[3];
    const strl__srgb *srgb = &gltf->reader->textures.srgb;
    material.rgba = strl__pack_colour(strl__srgb_encode(srgb, factor[0]), strl__srgb_encode(srgb, factor[1]),
                                      strl__srgb_encode(srgb, factor[2]), mask_or_blend(&material, factor[3]));
    if (fields->status)
        return fields->status;
    if (name && !(material.name = strl__gltf_keep(gltf, strlen(name) + 1, fields->err)))
        return gltf->is_counting ? STRL_ERR_LIMIT : STRL_ERR_MEMORY;
    if (name)
        strcpy(material.name, name);
    strl_status status = strl__gltf_add(gltf, &gltf->materials, &gltf->material_count, &gltf->material_capacity,
                                        sizeof material, fields->err);
    if (!status)
        gltf->materials[gltf->material_count - 1] = material;
    return status;
}
