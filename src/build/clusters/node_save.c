/* Nodes as they are taken, one record after the other, so that a checkpoint need not tell all of them anew. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "build/clusters/hierarchy.h"
#include "build/saved.h"

#define NEIGHBOUR_BYTES 8u
#define NODE_BYTES 256u /* what write_node writes */
#define MOST_COORDINATE (INT64_C(1) << 40)

/* ---- writing ---- */

static void write_record(const strl_node *record, strl_writer *writer)
{
    const int64_t *const points[] = {record->anchor, record->box_min, record->box_max, record->group_box_min,
                                     record->group_box_max};
    const float errors[] = {record->geometric_min,  record->geometric_max,   record->appearance_min,
                            record->appearance_max, record->group_geometric, record->group_appearance};
    const uint32_t counts[] = {record->group_size,     record->vertex_count,        record->base_vertex_count,
                               record->triangle_count, record->base_triangle_count, record->step_count,
                               record->boundary_steps, record->shared_vertices,     record->rung};
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < 3; k++)
            strl_writer_i64(writer, points[i][k]);
    for (int i = 0; i < 6; i++)
        strl_writer_f32(writer, errors[i]);
    for (int i = 0; i < 9; i++)
        strl_writer_u32(writer, counts[i]);
}

static void write_node(uint32_t self, const strl_node_state *state, uint32_t neighbours, strl_writer *writer)
{
    strl_writer_u32(writer, self);
    write_record(&state->record, writer);
    strl_writer_u64(writer, state->payload_at);
    strl_writer_u32(writer, state->payload_bytes);
    strl_writer_u64(writer, state->mesh_at);
    strl_writer_u32(writer, state->mesh_bytes);
    strl_writer_u64(writer, state->anchors_at);
    strl_writer_u64(writer, state->anchors_bytes);
    strl_writer_f32(writer, state->claims.least);
    strl_writer_f32(writer, state->claims.most);
    strl_writer_f32(writer, state->claims.group);
    strl_writer_u32(writer, state->point_count);
    strl_writer_u32(writer, state->outer_shared);
    strl_writer_u32(writer, state->group);
    strl_writer_u32(writer, state->needs_payload);
    strl_writer_u32(writer, neighbours);
}

strl_status strl_node_state_save(strl_level *level, uint32_t self, const strl_made_node *made, strl_error *err)
{
    strl_saved_writer saved = {.spill = level->states};
    write_node(self, &level->nodes[self], (uint32_t)made->neighbour_count, &saved.bytes);
    for (size_t i = 0; i < 2 * made->neighbour_count; i++)
        strl_writer_u32(&saved.bytes, made->next_neighbour[i]);
    return strl_saved_finish(&saved, STRL_OK, err);
}

/* ---- reading ---- */

static bool read_record(strl_cursor *cursor, strl_node *record)
{
    int64_t *const points[] = {record->anchor, record->box_min, record->box_max, record->group_box_min,
                               record->group_box_max};
    float *const errors[] = {&record->geometric_min,  &record->geometric_max,   &record->appearance_min,
                             &record->appearance_max, &record->group_geometric, &record->group_appearance};
    uint32_t *const counts[] = {&record->group_size,     &record->vertex_count,        &record->base_vertex_count,
                                &record->triangle_count, &record->base_triangle_count, &record->step_count,
                                &record->boundary_steps, &record->shared_vertices,     &record->rung};
    bool good = true;
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < 3; k++) {
            points[i][k] = strl_cursor_i64(cursor);
            good &= points[i][k] >= -MOST_COORDINATE && points[i][k] <= MOST_COORDINATE;
        }
    for (int i = 0; i < 6; i++) {
        *errors[i] = strl_cursor_f32(cursor);
        good &= *errors[i] >= 0 && isfinite(*errors[i]);
    }
    for (int i = 0; i < 9; i++)
        *counts[i] = strl_cursor_u32(cursor);
    record->decode_parent = STRL_NONE;
    return good && record->vertex_count <= STRL_PM_MAX_VERTICES && record->triangle_count <= STRL_PM_MAX_TRIANGLES &&
           record->group_size >= 1 && record->group_size <= STRL_GROUP_MAX && record->rung <= STRL_RUNG_CLUSTERING;
}

static bool read_claims(strl_cursor *cursor, strl_node_claims *claims)
{
    float *const all[] = {&claims->least, &claims->most, &claims->group};
    bool good = true;
    for (int i = 0; i < 3; i++) {
        *all[i] = strl_cursor_f32(cursor);
        good &= *all[i] >= 0 && isfinite(*all[i]);
    }
    return good;
}

static bool is_within(uint64_t at, uint64_t bytes, const strl_spill *spill)
{
    uint64_t end = spill ? strl_spill_bytes(spill) : UINT64_MAX;
    return at <= end && bytes <= end - at;
}

/* One node; *neighbours pairs follow. */
static bool read_node(strl_cursor *cursor, strl_level *level, uint32_t groups, uint32_t *self, uint32_t *neighbours)
{
    strl_node_state state = {0};
    *self = strl_cursor_u32(cursor);
    bool good = read_record(cursor, &state.record);
    state.payload_at = strl_cursor_u64(cursor);
    state.payload_bytes = strl_cursor_u32(cursor);
    state.mesh_at = strl_cursor_u64(cursor);
    state.mesh_bytes = strl_cursor_u32(cursor);
    state.anchors_at = strl_cursor_u64(cursor);
    state.anchors_bytes = strl_cursor_u64(cursor);
    good = read_claims(cursor, &state.claims) && good;
    state.point_count = strl_cursor_u32(cursor);
    state.outer_shared = strl_cursor_u32(cursor);
    state.group = strl_cursor_u32(cursor);
    state.needs_payload = strl_cursor_u32(cursor);
    *neighbours = strl_cursor_u32(cursor);
    good = good && !cursor->failed && *self < level->count && state.payload_bytes > 0 && state.group < groups &&
           is_within(state.payload_at, state.payload_bytes, level->payloads) &&
           is_within(state.mesh_at, state.mesh_bytes, level->meshes) &&
           is_within(state.anchors_at, state.anchors_bytes, level->anchors);
    if (!good || level->nodes[*self].payload_bytes) /* each once */
        return false;
    level->nodes[*self] = state;
    return true;
}

static strl_status read_neighbours(strl_saved_reader *saved, const strl_level *level, uint32_t self, uint32_t count,
                                   strl_adjacency *next, strl_error *err)
{
    strl_status status = strl_saved_get(saved, (uint64_t)count * NEIGHBOUR_BYTES, err);
    for (uint32_t i = 0; i < count && !status; i++) {
        uint32_t other = strl_cursor_u32(&saved->cursor), points = strl_cursor_u32(&saved->cursor);
        if (other >= (level->count + 1) / 2 || other == self >> 1)
            status = strl_saved_fail("the neighbours of a node", err);
        else if (next && !strl_adjacency_add(next, self >> 1, other, points))
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the neighbours of a level");
    }
    return status;
}

strl_status strl_node_states_restore(strl_level *level, uint32_t groups, strl_adjacency *next, uint32_t *count,
                                     strl_error *err)
{
    strl_saved_reader saved = {.spill = level->states};
    strl_status status = STRL_OK;
    for (*count = 0; strl_saved_left(&saved) && !status; ++*count) {
        uint32_t self, neighbours;
        status = strl_saved_get(&saved, NODE_BYTES, err);
        if (!status && !read_node(&saved.cursor, level, groups, &self, &neighbours))
            status = strl_saved_fail("a node of a level", err);
        if (!status)
            status = read_neighbours(&saved, level, self, neighbours, next, err);
    }
    strl_saved_reader_deinit(&saved);
    return status;
}
