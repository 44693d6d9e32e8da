/* Hostile bricks of sample trees. An input is the number of triangles that the node's record says (u32), then the
 * payload. Two readers of the head, one written from the format's text alone, agree on what they refuse; what is
 * accepted comes back from another round; and what a walk makes of the whole keeps to its arrays in every state. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/cursor.h"
#include "container/treelet.h"
#include "verify/mesh.h"
#include "walk/internal.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define REACH ((int64_t)1 << 24) /* of the node's box, to both sides of its anchor */
#define LARGEST_CELL 1e9f

static void require(bool promise)
{
    if (!promise)
        abort();
}

static strl_node make_record(uint32_t triangles, size_t bytes)
{
    strl_node record = {.parent = STRL_NONE,
                        .first_child = STRL_NONE,
                        .decode_parent = STRL_NONE,
                        .group_size = 1,
                        .rung = STRL_RUNG_SAMPLED,
                        .geometric_min = LARGEST_CELL,
                        .geometric_max = LARGEST_CELL,
                        .group_geometric = LARGEST_CELL,
                        .triangle_count = triangles,
                        .base_triangle_count = triangles,
                        .payload_bytes = (uint32_t)bytes};
    for (int k = 0; k < 3; k++)
        record.box_min[k] = -REACH, record.box_max[k] = REACH;
    return record;
}

/* Of the same record, as the second reader has it. */
static strl_status check_by_text(const strl_node *record, const uint8_t *payload, strl_arena *arena, size_t *bytes)
{
    strl__vnode node = {.geometric_max = record->geometric_max,
                        .triangle_count = record->triangle_count,
                        .rung = (uint8_t)record->rung,
                        .payload_bytes = record->payload_bytes};
    for (int k = 0; k < 3; k++)
        node.box[0][k] = record->box_min[k], node.box[1][k] = record->box_max[k];
    return strl__v_brick_check(payload, &node, arena, bytes, NULL);
}

static void check_head(const strl_brick_head *head, uint32_t triangles)
{
    uint64_t sum = 0;
    require(head->level_count >= 1 && head->level_count <= STRL_BRICK_LEVELS &&
            strl_brick_splats(head) <= STRL_BRICK_SPLATS);
    for (uint32_t i = 0; i < head->level_count; i++)
        require(head->error[i] >= 0 && head->error[i] <= (i ? head->error[i - 1] : LARGEST_CELL));
    for (uint32_t i = 0; i < head->run_count; i++)
        sum += head->run[i].count;
    require(sum == triangles);
}

static bool same_splat(const strl_splat *a, const strl_splat *b)
{
    return memcmp(a->centre, b->centre, sizeof a->centre) == 0 && a->side == b->side && a->coverage == b->coverage &&
           memcmp(a->normal, b->normal, sizeof a->normal) == 0 && a->parallel == b->parallel && a->rgba == b->rgba;
}

/* Tables may be others, and so bytes; what they say is the same. */
static void write_again(const strl_brick_head *head, uint32_t triangles, strl_arena *arena)
{
    strl_writer writer = {0};
    strl_brick_head again;
    size_t bytes;
    require(strl_brick_head_write(head, &writer, NULL) == STRL_OK && !writer.failed);
    require(strl_brick_head_read(writer.data, writer.size, triangles, arena, &again, &bytes, NULL) == STRL_OK);
    require(bytes == writer.size && again.level_count == head->level_count && again.run_count == head->run_count);
    for (uint32_t i = 0; i < head->level_count; i++)
        require(again.error[i] == head->error[i] && again.splat_end[i] == head->splat_end[i]);
    for (uint32_t i = 0; i < strl_brick_splats(head); i++)
        require(same_splat(&again.splat[i], &head->splat[i]));
    require(memcmp(again.run, head->run, head->run_count * sizeof *head->run) == 0);
    strl__free(writer.data);
}

/* Every state draws vertices that are there. */
static void check_states(strl__mesh *mesh)
{
    for (uint32_t state = 0; state <= mesh->step_count; state++) {
        uint32_t first = UINT32_MAX, end = 0;
        require(mesh->triangle_end[state] <= mesh->triangle_count &&
                (state == 0 || mesh->triangle_end[state] >= mesh->triangle_end[state - 1]));
        strl__mesh_set_state(mesh, state, &first, &end);
        for (uint32_t i = 0; i < 3 * mesh->triangle_end[state]; i++)
            require(mesh->indices[i] < mesh->vertex_count);
    }
    require(mesh->triangle_end[mesh->step_count] == mesh->triangle_count);
    for (uint32_t s = 1; s < mesh->step_count; s++)
        require(mesh->splat_end[s] >= mesh->splat_end[s - 1]);
}

/* Whole, and with its coarse states alone. */
static void walk_brick(strl_node *record, const strl_brick_head *head, const uint8_t *payload, size_t head_bytes,
                       strl_arena *arena)
{
    strl_payload_sizes sizes;
    strl_pm pm;
    strl__mesh mesh;
    strl_error err = {0};
    if (strl_payload_peek(payload + head_bytes, record->payload_bytes - head_bytes, &sizes, &err) != STRL_OK)
        return;
    record->vertex_count = sizes.vertex_count;
    record->base_vertex_count = sizes.base_vertex_count;
    record->step_count = sizes.step_count;
    strl_status status = strl_page_mesh(record, payload, record->payload_bytes, NULL, arena, NULL, &pm, &err);
    require(status == STRL_OK || (status == STRL_ERR_FORMAT && err.message[0]));
    strl_status made = strl__mesh_create(record, payload, record->payload_bytes, NULL, true, false, 0, &mesh, &err);
    require(made == STRL_OK || (made == STRL_ERR_FORMAT && err.message[0]));
    require(status == STRL_OK || made != STRL_OK);
    if (status == STRL_OK)
        require(pm.triangle_count == record->triangle_count && strl_pm_check(&pm, NULL) == STRL_OK);
    if (made == STRL_OK)
        check_states(&mesh);
    strl__mesh_deinit(&mesh);
    for (uint32_t held = 0; held < head->level_count && made == STRL_OK; held++) {
        require(strl__mesh_create(record, payload, record->payload_bytes, NULL, true, false, head->error[held], &mesh,
                                  &err) == STRL_OK);
        require(mesh.held <= mesh.step_count && (mesh.held == mesh.step_count || mesh.held <= held));
        check_states(&mesh);
        strl__mesh_deinit(&mesh);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    strl_arena arena;
    strl_brick_head head;
    strl_error err = {0};
    size_t bytes = 0, text_bytes = 0;
    if (size < 5)
        return 0;
    const uint8_t *payload = data + 4;
    strl_node record = make_record((uint32_t)strl__load_le(data, 4) & 0x1ffff, size - 4);
    strl_arena_init(&arena, (size_t)512 << 20);
    strl_status status = strl_page_head(&record, payload, size - 4, &arena, &head, &err);
    require(status == STRL_OK || (status == STRL_ERR_FORMAT && err.message[0]));
    require((status == STRL_OK) == (check_by_text(&record, payload, &arena, &text_bytes) == STRL_OK));
    if (status == STRL_OK) {
        require(strl_brick_head_read(payload, size - 4, record.triangle_count, &arena, &head, &bytes, &err) == STRL_OK);
        require(bytes == text_bytes);
        check_head(&head, record.triangle_count);
        write_again(&head, record.triangle_count, &arena);
        walk_brick(&record, &head, payload, bytes, &arena);
    }
    strl_arena_deinit(&arena);
    return 0;
}
