/* What a base mesh has of its reference. docs/format-payload.md, "Copies", is normative. */
#include "geometry/payload_decode.h"

#include <inttypes.h>

#include "base/fail.h"
#include "geometry/payload_reference.h"

/* Runs of triangles that are taken and left in turn, one sequence a context. */
struct runs {
    uint32_t left[STRL__SELECT_CONTEXTS]; /* of the run */
    uint8_t leaves[STRL__SELECT_CONTEXTS];
};

/* Which triangles are taken, in order. No branch but for the ends of runs: what is taken cannot be foreseen well. */
static bool select_triangles(struct strl__decoder *d, struct strl__copy *copy, uint32_t *taken, uint32_t *count)
{
    struct runs runs = {.leaves = {1, 1, 1, 1}};
    *count = 0;
    for (uint32_t t = 0; t < copy->from->triangle_count; t++) {
        const uint16_t *from = copy->from->triangle[t];
        unsigned context = strl__copy_context(copy, from);
        while (runs.left[context] == 0) {
            runs.left[context] = strl__pull(&d->in, STRL__STREAM_SELECT + context);
            runs.leaves[context] ^= 1;
            if (d->in.failed)
                return false;
        }
        runs.left[context]--;
        unsigned leave = runs.leaves[context];
        strl__copy_mark(copy, from, leave);
        taken[*count] = t;
        *count += !leave;
    }
    for (unsigned i = 0; i < STRL__SELECT_CONTEXTS; i++)
        if (runs.left[i])
            return false;
    return *count <= d->sizes.base_triangle_count;
}

/* Without a branch on whether a corner is new, for the same reason. */
static bool copy_triangles(struct strl__decoder *d, struct strl__copy *copy, const uint32_t *taken, uint32_t count)
{
    uint32_t vertices = 0, most = d->sizes.base_vertex_count;
    for (uint32_t i = 0; i < count; i++) {
        const uint16_t *from = copy->from->triangle[taken[i]];
        uint32_t corner[3], before = vertices ? vertices - 1 : 0;
        for (unsigned k = 0; k < 3; k++) {
            uint32_t number = copy->number[from[k]], is_new = number == STRL__NO_NUMBER;
            corner[k] = is_new ? vertices : number;
            copy->number[from[k]] = (uint16_t)corner[k];
            d->copied_from[vertices] = from[k]; /* there is room for three more than there may be */
            d->from[vertices] = (uint16_t)before;
            before = corner[k];
            vertices += is_new;
        }
        if (vertices > most)
            return false;
        strl__mesh_add_triangle(&d->mesh, corner[0], corner[1], corner[2]);
    }
    for (uint32_t v = 0; v < vertices; v++)
        strl__reference_place(copy->from, d->copied_from[v], d->mesh.position[v]);
    d->mesh.vertex_count = d->copied = vertices;
    return true;
}

strl_status strl__decode_copies(struct strl__decoder *d)
{
    struct strl__copy copy;
    uint32_t count, *taken;
    if (!d->reference)
        return STRL_OK;
    d->copied_from = strl_arena_alloc(d->scratch, (size_t)d->sizes.base_vertex_count + 3, sizeof *d->copied_from);
    taken = strl_arena_alloc(d->scratch, (size_t)d->reference->triangle_count + 1, sizeof *taken);
    if (!d->copied_from || !taken || !strl__copy_init(&copy, d->reference, d->scratch))
        return strl__fail(d->err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    if (!select_triangles(d, &copy, taken, &count) || !copy_triangles(d, &copy, taken, count))
        return strl__fail(d->err, STRL_ERR_FORMAT,
                          "node payload's copies of the %" PRIu32 " triangles of another node are broken",
                          d->reference->triangle_count);
    return STRL_OK;
}
