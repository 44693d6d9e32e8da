/* Payload pages: docs/format.md, "Payload pages". */
#include <inttypes.h>

#include "base/fail.h"
#include "base/hash.h"
#include "container/treelet.h"
#include "geometry/payload.h"
#include "geometry/sample_payload.h"

/* Every mesh within the limits of progressive.h decodes in less. */
#define MOST_SCRATCH_BYTES ((size_t)64 << 20)

strl_status strl_page_check(const strl_page_ref *ref, const void *data, size_t size, strl_error *err)
{
    if (size != ref->bytes)
        return strl__fail(err, STRL_ERR_FORMAT, "page at byte %" PRIu64 ": %zu bytes, expected %" PRIu32, ref->offset,
                          size, ref->bytes);
    uint64_t found = strl__checksum(data, size);
    if (found != ref->checksum)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "page at byte %" PRIu64 ": checksum is %016" PRIx64 ", expected %016" PRIx64, ref->offset,
                          found, ref->checksum);
    return STRL_OK;
}

/* Before anything is allocated: a record that lies must not make its payload expensive. */
static strl_status check_sizes(const strl_node *record, const uint8_t *payload, size_t bytes, strl_error *err)
{
    strl_payload_sizes sizes;
    strl_status status = strl_payload_peek(payload, bytes, &sizes, err);
    if (status != STRL_OK)
        return status;
    if (sizes.vertex_count != record->vertex_count || sizes.base_vertex_count != record->base_vertex_count ||
        sizes.triangle_count != record->triangle_count || sizes.base_triangle_count != record->base_triangle_count ||
        sizes.step_count != record->step_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "it has %" PRIu32 " vertices, %" PRIu32 " triangles and %" PRIu32 " steps, expected %" PRIu32
                          ", %" PRIu32 " and %" PRIu32 " from its node's record, or other base counts",
                          sizes.vertex_count, sizes.triangle_count, sizes.step_count, record->vertex_count,
                          record->triangle_count, record->step_count);
    return STRL_OK;
}

static strl_status check_positions(const strl_node *record, const strl_pm *mesh, strl_error *err)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (int axis = 0; axis < 3; axis++) {
            int64_t at = record->anchor[axis] + mesh->position[v][axis]; /* both far below 2^63 */
            if (at < record->box_min[axis] || at > record->box_max[axis])
                return strl__fail(err, STRL_ERR_FORMAT,
                                  "vertex %" PRIu32 " lies at %" PRId64
                                  " on axis %d, expected within its node's box, %" PRId64 " to %" PRId64,
                                  v, at, axis, record->box_min[axis], record->box_max[axis]);
        }
    return STRL_OK;
}

static strl_status check_claim(const char *what, float base, float finest, float most, float least, strl_error *err)
{
    if (base <= most && finest <= least)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT, "%s errors are %g to %g, expected at most %g to %g from its node's record",
                      what, (double)finest, (double)base, (double)least, (double)most);
}

static strl_status check_mesh(const strl_node *record, const strl_pm *mesh, strl_error *err)
{
    uint32_t last = mesh->step_count;
    strl_status status = check_positions(record, mesh, err);
    if (status == STRL_OK)
        status = check_claim("geometric", mesh->geometric_error[0], mesh->geometric_error[last], record->geometric_max,
                             record->geometric_min, err);
    if (status == STRL_OK)
        status = check_claim("appearance", mesh->appearance_error[0], mesh->appearance_error[last],
                             record->appearance_max, record->appearance_min, err);
    return status;
}

/* What the head alone cannot say: its record bounds it. */
static strl_status check_head(const strl_node *record, const strl_brick_head *head, strl_error *err)
{
    if (head->error[0] > record->geometric_max)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "a brick has cells of the size %g, expected at most %g from its node's record",
                          (double)head->error[0], (double)record->geometric_max);
    for (uint32_t i = 0; i < strl_brick_splats(head); i++)
        for (int axis = 0; axis < 3; axis++) {
            int64_t at = record->anchor[axis] + head->splat[i].centre[axis];
            if (at < record->box_min[axis] || at > record->box_max[axis])
                return strl__fail(err, STRL_ERR_FORMAT,
                                  "splat %" PRIu32 " lies at %" PRId64
                                  " on axis %d, expected within its node's box, %" PRId64 " to %" PRId64,
                                  i, at, axis, record->box_min[axis], record->box_max[axis]);
        }
    return STRL_OK;
}

/* The node's bytes in its page, and what stands there before the mesh: head_bytes of them. */
static strl_status find_payload(const strl_node *record, const uint8_t *page, size_t size, strl_arena *arena,
                                const uint8_t **payload, strl_brick_head *head, size_t *head_bytes, strl_error *err)
{
    *head = (strl_brick_head){0};
    *payload = NULL;
    *head_bytes = 0;
    if (record->payload_bytes == 0 || record->payload_offset > size ||
        record->payload_bytes > size - record->payload_offset)
        return strl__fail(err, STRL_ERR_FORMAT, "its %" PRIu32 " bytes pass the end of a page of %zu bytes",
                          record->payload_bytes, size);
    *payload = page + record->payload_offset;
    if (record->rung != STRL_RUNG_SAMPLED)
        return STRL_OK;
    strl_status status =
        strl_brick_head_read(*payload, record->payload_bytes, record->triangle_count, arena, head, head_bytes, err);
    return status ? status : check_head(record, head, err);
}

strl_status strl_page_head(const strl_node *record, const void *page, size_t size, strl_arena *arena,
                           strl_brick_head *head, strl_error *err)
{
    const uint8_t *payload;
    size_t bytes;
    return find_payload(record, page, size, arena, &payload, head, &bytes, err);
}

strl_status strl_page_far(const strl_node *record, const void *page, size_t size, strl_far *far, strl_error *err)
{
    strl_arena arena;
    strl_brick_head head;
    strl_pm mesh;
    *far = (strl_far){0};
    strl_arena_init(&arena, MOST_SCRATCH_BYTES);
    strl_status status = strl_page_mesh(record, page, size, NULL, &arena, &head, &mesh, err);
    if (status == STRL_OK)
        *far = strl_far_of_mesh(&mesh, &head);
    strl_arena_deinit(&arena);
    return status;
}

void strl_page_place(strl_payload_reference *reference, const int64_t anchor[3], const strl_node *record)
{
    for (int axis = 0; axis < 3; axis++) /* modulo 2^32: what is further off than that is not the same place */
        reference->offset[axis] = (int32_t)(uint32_t)((uint64_t)anchor[axis] - (uint64_t)record->anchor[axis]);
}

static strl_status decode(const strl_node *record, const uint8_t *page, size_t size,
                          const strl_payload_reference *reference, strl_arena *arena, strl_brick_head *head,
                          strl_pm *mesh, strl_error *err)
{
    const uint8_t *payload;
    size_t head_bytes;
    strl_status status = find_payload(record, page, size, arena, &payload, head, &head_bytes, err);
    if (status == STRL_OK)
        status = check_sizes(record, payload + head_bytes, record->payload_bytes - head_bytes, err);
    if (status == STRL_OK)
        status =
            strl_payload_decode(payload + head_bytes, record->payload_bytes - head_bytes, reference, arena, mesh, err);
    return status == STRL_OK ? check_mesh(record, mesh, err) : status;
}

strl_status strl_page_mesh(const strl_node *record, const void *page, size_t size,
                           const strl_payload_reference *reference, strl_arena *arena, strl_brick_head *head,
                           strl_pm *mesh, strl_error *err)
{
    strl_brick_head unwanted;
    *mesh = (strl_pm){0};
    strl_arena_mark mark = strl_arena_get_mark(arena);
    strl_status status = decode(record, page, size, reference, arena, head ? head : &unwanted, mesh, err);
    if (status == STRL_OK)
        return STRL_OK;
    strl_arena_rewind(arena, mark);
    *mesh = (strl_pm){0};
    return strl__fail_context(err, status, "page at byte %" PRIu64 ", payload at its byte %" PRIu32,
                              record->page.offset, record->payload_offset);
}
