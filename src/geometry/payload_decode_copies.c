/* What a base mesh has of its reference. docs/format-payload.md, "Copies", is normative. */
#include "geometry/payload_decode.h"

#include <inttypes.h>

#include "base/fail.h"
#include "geometry/payload_reference.h"

static bool copy_triangle(struct strl__decoder *d, struct strl__copy *copy, const uint16_t from[3])
{
    struct strl__mesh *mesh = &d->mesh;
    uint32_t corner[3], before = mesh->vertex_count ? mesh->vertex_count - 1 : 0;
    if (mesh->triangle_count >= d->sizes.base_triangle_count)
        return false;
    for (unsigned k = 0; k < 3; k++) {
        corner[k] = copy->number[from[k]];
        if (corner[k] == STRL__NO_NUMBER) {
            corner[k] = mesh->vertex_count;
            if (corner[k] >= d->sizes.base_vertex_count)
                return false;
            mesh->vertex_count++;
            copy->number[from[k]] = (uint16_t)corner[k];
            d->copied_from[corner[k]] = from[k];
            d->from[corner[k]] = (uint16_t)before;
            strl__reference_place(d->reference, from[k], mesh->position[corner[k]]);
        }
        before = corner[k];
    }
    strl__mesh_add_triangle(mesh, corner[0], corner[1], corner[2]);
    return true;
}

strl_status strl__decode_copies(struct strl__decoder *d)
{
    struct strl__copy copy;
    if (!d->reference)
        return STRL_OK;
    d->copied_from = strl_arena_alloc(d->scratch, d->sizes.base_vertex_count, sizeof *d->copied_from);
    if (!d->copied_from || !strl__copy_init(&copy, d->reference, d->scratch))
        return strl__fail(d->err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    for (uint32_t t = 0; t < d->reference->triangle_count; t++) {
        const uint16_t *from = d->reference->triangle[t];
        uint32_t left = strl__pull(&d->in, STRL__STREAM_SELECT + strl__copy_context(&copy, from));
        if (left > 1 || d->in.failed || (!left && !copy_triangle(d, &copy, from)))
            return strl__fail(d->err, STRL_ERR_FORMAT,
                              "node payload's copies are broken at triangle %" PRIu32 " of %" PRIu32
                              " of the node that they come from",
                              t, d->reference->triangle_count);
        strl__copy_mark(&copy, from, left);
    }
    d->copied = d->mesh.vertex_count;
    return STRL_OK;
}
