#include "readers/gltf.h"

/* A corner that is looked up by itself takes some reads of a few bytes, as long as loading so many
 * vertices in a row. */
#define ROW_VERTICES 16u

static strl_status measure(strl__gltf *gltf, strl__gltf_primitive *primitive, uint64_t elements, strl_error *err)
{
    const uint64_t most = STRL__GLTF_CHUNK / 3 * 3;
    uint32_t lowest = UINT32_MAX, highest = 0;
    strl_status status = STRL_OK;
    for (uint64_t first = 0; first < elements && !status; first += most) {
        size_t count = (size_t)(elements - first < most ? elements - first : most);
        status = strl__gltf_read_elements(gltf, primitive, first, count, gltf->elements, err);
        for (size_t i = 0; i < count && !status; i++) {
            uint32_t index = gltf->elements[i];
            lowest = index < lowest ? index : lowest;
            highest = index > highest ? index : highest;
        }
    }
    primitive->lowest = lowest;
    primitive->highest = highest;
    primitive->has_range = !status;
    return status;
}

strl_status strl__gltf_find_range(strl__gltf *gltf, strl__gltf_primitive *primitive, uint64_t elements, strl_error *err)
{
    strl__gltf_pass *pass = &gltf->pass;
    strl_status status = STRL_OK;
    if (!primitive->has_range)
        status = measure(gltf, primitive, elements, err);
    if (status)
        return status;
    /* An index that is too large is refused with its triangle, when that is read. */
    const uint64_t end =
        primitive->highest < pass->vertex_count ? (uint64_t)primitive->highest + 1 : pass->vertex_count;
    pass->first_loaded = primitive->lowest < end ? primitive->lowest : end;
    pass->loaded_count = end - pass->first_loaded;
    pass->is_scattered = pass->loaded_count > STRL__GLTF_CHUNK + ROW_VERTICES * elements;
    if (pass->is_scattered)
        pass->loaded_count = 0;
    return STRL_OK;
}
