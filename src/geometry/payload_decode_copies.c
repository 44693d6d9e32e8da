/* What a base mesh has of its reference. docs/format-payload.md, "Copies", is normative. */
#include "geometry/payload_decode.h"

#include <inttypes.h>

#include "base/fail.h"
#include "geometry/payload_reference.h"

/* The copy of the reference's vertex `from`: a new vertex, one beside another copy, or that copy itself. */
static bool copy_vertex(struct strl__decoder *d, struct strl__copy *copy, uint32_t from, uint32_t before, uint32_t *vertex)
{
    struct strl__mesh *mesh = &d->mesh;
    uint32_t code = strl__pull(&d->in, STRL__STREAM_COPY), count = mesh->vertex_count;
    uint32_t other = count - 1 - ((code - 1) >> 1);
    int32_t position[3];
    strl__reference_place(d->reference, from, position);
    if (code && ((code - 1) >> 1 >= count || !strl__is_at(mesh->position[other], position)))
        return false;
    if (code && !(code & 1)) {
        *vertex = other;
    } else if (count >= d->sizes.base_vertex_count) {
        return false;
    } else {
        *vertex = mesh->vertex_count++;
        d->copied_from[count] = (uint16_t)from;
        d->from[count] = (uint16_t)before;
        for (unsigned k = 0; k < 3; k++)
            mesh->position[count][k] = position[k];
        if (code)
            strl__twin_join(mesh->twin, other, count);
    }
    copy->number[from] = (uint16_t)*vertex;
    return true;
}

static bool copy_triangle(struct strl__decoder *d, struct strl__copy *copy, const uint16_t from[3])
{
    uint32_t corner[3], before = d->mesh.vertex_count ? d->mesh.vertex_count - 1 : 0;
    if (d->mesh.triangle_count >= d->sizes.base_triangle_count)
        return false;
    for (unsigned k = 0; k < 3; k++) {
        corner[k] = copy->number[from[k]];
        if (corner[k] == STRL__NO_NUMBER && !copy_vertex(d, copy, from[k], before, &corner[k]))
            return false;
        before = corner[k];
    }
    strl__mesh_add_triangle(&d->mesh, corner[0], corner[1], corner[2]);
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
