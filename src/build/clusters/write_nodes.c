/* The last stage: nodes into the container, breadth first. Until here progressive meshes wait in scratch (pm_spill.h),
 * because children are made before their parents; now each is encoded, told by its parent's finest state, which holds
 * most of its base mesh.
 *
 * No checkpoint is made meanwhile: the one of the finished levels stays in place, and with it the payloads that are
 * used up here. A build that is resumed begins this stage anew. */
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "build/clusters/hierarchy.h"
#include "build/clusters/pm_spill.h"
#include "container/treelet.h"
#include "geometry/payload.h"

typedef struct written_node {
    strl_node record;
    strl_writer payload;
    strl_writer order; /* for its children; empty at leaves */
} written_node;

#define SIBLINGS 2u

/* A parent is read once for all that it tells. */
typedef struct written_siblings {
    written_node node[SIBLINGS];
    uint32_t first, count; /* in their level */
} written_siblings;

typedef struct write_stage {
    const strl_hierarchy *hierarchy;
    strl_container_writer *writer;
    strl_arena *arenas;         /* [workers] */
    written_siblings *slots;    /* [window] */
    strl_level *level, *above;  /* above: NULL at the root */
    uint32_t index, group_base; /* of the level; its first group */
    uint64_t done, total;
} write_stage;

/* ---- orders on their way to the next level, in the machine's own byte order: what a reader will have is the
 * waiting mesh in another order */

static bool order_create(strl_payload_order *order, const strl_pm *pm, strl_arena *arena)
{
    order->vertex = strl_arena_alloc(arena, pm->vertex_count, sizeof *order->vertex);
    order->triangle = strl_arena_alloc(arena, pm->triangle_count, sizeof *order->triangle);
    return order->vertex && order->triangle;
}

/* Vertices of steps keep their places. */
static void keep_order(const strl_pm *pm, const strl_payload_order *order, strl_writer *out)
{
    strl_writer_bytes(out, order->vertex, pm->vertex_end[0] * sizeof *order->vertex);
    strl_writer_bytes(out, order->triangle, pm->triangle_count * sizeof *order->triangle);
}

static strl_status load_order(const strl_level *level, const strl_node_state *state, const strl_pm *pm,
                              strl_arena *arena, strl_payload_order *order, strl_error *err)
{
    uint32_t base = pm->vertex_end[0];
    if (!order_create(order, pm, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", pm->triangle_count);
    for (uint32_t v = base; v < pm->vertex_count; v++)
        order->vertex[v] = (uint16_t)v;
    strl_status status =
        strl_spill_read(level->meshes, state->mesh_at, order->vertex, base * sizeof *order->vertex, err);
    if (!status)
        status = strl_spill_read(level->meshes, state->mesh_at + base * sizeof *order->vertex, order->triangle,
                                 pm->triangle_count * sizeof *order->triangle, err);
    return status;
}

/* The finest state of pm as it will be after decoding. */
static strl_status put_in_order(const strl_pm *pm, const strl_payload_order *order, strl_arena *arena, strl_pm *finest,
                                strl_error *err)
{
    *finest = (strl_pm){.vertex_count = pm->vertex_count, .triangle_count = pm->triangle_count};
    finest->position = strl_arena_alloc(arena, pm->vertex_count, sizeof *finest->position);
    finest->normal = strl_arena_alloc(arena, pm->vertex_count, sizeof *finest->normal);
    finest->triangle = strl_arena_alloc(arena, pm->triangle_count, sizeof *finest->triangle);
    uint16_t *number = strl_arena_alloc(arena, pm->vertex_count, sizeof *number);
    if (!finest->position || !finest->normal || !finest->triangle || !number)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", pm->triangle_count);
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        memcpy(finest->position[v], pm->position[order->vertex[v]], sizeof *finest->position);
        memcpy(finest->normal[v], pm->normal[order->vertex[v]], sizeof *finest->normal);
        number[order->vertex[v]] = (uint16_t)v;
    }
    for (uint32_t t = 0; t < pm->triangle_count; t++)
        for (uint32_t k = 0; k < 3; k++)
            finest->triangle[t][k] = number[pm->triangle[order->triangle[t] / 4][(order->triangle[t] % 4 + k) % 3]];
    return STRL_OK;
}

/* ---- one node */

/* Node ids are breadth first: node i of the level at depth d has id 2^d - 1 + i. */
static void place_in_tree(const write_stage *stage, uint32_t index, strl_node *record)
{
    uint32_t depth = stage->hierarchy->partition->depth - stage->index, id = (1u << depth) - 1 + index;
    record->parent = record->decode_parent = depth ? (id - 1) / SIBLINGS : STRL_NONE;
    record->first_child = stage->index ? SIBLINGS * id + 1 : STRL_NONE;
    record->child_count = stage->index ? SIBLINGS : 0;
    record->level = stage->index;
    record->group = stage->group_base + stage->level->nodes[index].group;
    const strl_node_claims *claims = &stage->level->nodes[index].claims;
    record->geometric_min = claims->least;
    record->geometric_max = claims->most;
    record->group_geometric = claims->group;
}

static strl_status read_alone(const strl_level *level, const strl_node_state *state, strl_arena *arena, strl_pm *pm,
                              strl_error *err)
{
    void *payload = strl_arena_alloc(arena, state->payload_bytes, 1);
    if (!payload)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a payload of %u bytes", state->payload_bytes);
    strl_status status = strl_spill_read(level->payloads, state->payload_at, payload, state->payload_bytes, err);
    return status ? status : strl_pm_spill_read(payload, state->payload_bytes, arena, pm, err);
}

/* Not placed yet. */
static strl_status load_parent(const write_stage *stage, uint32_t index, strl_arena *arena,
                               strl_payload_reference *reference, strl_error *err)
{
    const strl_node_state *state = &stage->above->nodes[index];
    strl_pm alone, finest;
    strl_payload_order order;
    strl_status status = read_alone(stage->above, state, arena, &alone, err);
    if (!status)
        status = load_order(stage->above, state, &alone, arena, &order, err);
    if (!status)
        status = put_in_order(&alone, &order, arena, &finest, err);
    if (!status)
        *reference = strl_payload_reference_of(&finest);
    return status;
}

static strl_status encode_node(const write_stage *stage, uint32_t index, strl_payload_reference *parent,
                               written_node *node, strl_arena *arena, strl_error *err)
{
    strl_pm pm;
    strl_payload_order order;
    node->payload.size = node->order.size = 0;
    node->record = stage->level->nodes[index].record;
    place_in_tree(stage, index, &node->record);
    if (parent)
        strl_page_place(parent, stage->above->nodes[index / SIBLINGS].record.anchor, &node->record);
    strl_status status = read_alone(stage->level, &stage->level->nodes[index], arena, &pm, err);
    if (!status && !order_create(&order, &pm, arena))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", pm.triangle_count);
    if (!status)
        status = strl_payload_encode(&pm, parent, arena, &node->payload, &order, err);
    if (!status && stage->index)
        keep_order(&pm, &order, &node->order);
    return status || !node->order.failed ? status : strl__fail(err, STRL_ERR_MEMORY, "no memory for a node");
}

/* index: of the parent in its level. */
static strl_status work(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    write_stage *stage = context;
    written_siblings *siblings = &stage->slots[slot];
    strl_arena *arena = &stage->arenas[worker];
    strl_arena_mark mark = strl_arena_get_mark(arena);
    strl_payload_reference parent;
    strl_status status = stage->above ? load_parent(stage, (uint32_t)index, arena, &parent, err) : STRL_OK;
    siblings->first = (uint32_t)index * SIBLINGS;
    siblings->count = stage->above ? SIBLINGS : 1;
    for (uint32_t i = 0; i < siblings->count && !status; i++) {
        strl_arena_mark own = strl_arena_get_mark(arena);
        status = encode_node(stage, siblings->first + i, stage->above ? &parent : NULL, &siblings->node[i], arena, err);
        strl_arena_rewind(arena, own);
    }
    strl_arena_rewind(arena, mark);
    return status;
}

static strl_status finish_node(write_stage *stage, uint32_t index, const written_node *node, strl_error *err)
{
    strl_node_state *state = &stage->level->nodes[index];
    if (stage->index)
        state->mesh_at = strl_spill_bytes(stage->level->meshes);
    else
        strl_spill_drop(stage->level->payloads, state->payload_at, state->payload_bytes);
    strl_status status =
        strl_container_writer_add_node(stage->writer, &node->record, node->payload.data, node->payload.size, err);
    if (!status && stage->index)
        status = strl_spill_append(stage->level->meshes, node->order.data, node->order.size, err);
    return status ? status : strl__build_report(stage->hierarchy->context, ++stage->done, stage->total, err);
}

static strl_status finish(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    write_stage *stage = context;
    const written_siblings *siblings = &stage->slots[slot];
    strl_status status = STRL_OK;
    (void)index;
    (void)worker;
    for (uint32_t i = 0; i < siblings->count && !status; i++)
        status = finish_node(stage, siblings->first + i, &siblings->node[i], err);
    return status;
}

/* ---- levels */

static strl_status close_above(write_stage *stage, strl_error *err)
{
    strl_status status = strl_spill_close_and_delete(stage->above->meshes, err);
    stage->above->meshes = NULL;
    if (!status)
        status = strl_spill_close_and_delete(stage->above->payloads, err);
    stage->above->payloads = NULL;
    return status;
}

static strl_status write_level(write_stage *stage, strl_error *err)
{
    strl_build_context *context = stage->hierarchy->context;
    char name[32];
    snprintf(name, sizeof name, "order-%02u", stage->index);
    strl_status status = stage->index ? strl_spill_open(context->spills, name, 0, &stage->level->meshes, err) : STRL_OK;
    if (!status)
        status =
            strl_pool_ordered(context->pool, stage->above ? stage->above->count : 1, 0, work, finish, stage, NULL, err);
    if (!status && stage->index)
        status = strl_spill_flush(stage->level->meshes, err);
    return status || !stage->above ? status : close_above(stage, err);
}

static strl_status write_levels(write_stage *stage, strl_error *err)
{
    uint32_t depth = stage->hierarchy->partition->depth;
    strl_status status = STRL_OK;
    stage->total = (2ull << depth) - 1;
    for (uint32_t d = 0; d <= depth && !status; d++) {
        stage->above = stage->level;
        stage->index = depth - d;
        stage->level = &stage->hierarchy->levels[stage->index];
        status = write_level(stage, err);
        stage->group_base += stage->level->group_count;
    }
    stage->hierarchy->context->result->groups += stage->group_base;
    return status;
}

strl_status strl_write_nodes(const strl_hierarchy *hierarchy, strl_container_writer *writer, strl_error *err)
{
    strl_pool *pool = hierarchy->context->pool;
    unsigned workers = strl_pool_workers(pool), window = strl_pool_window(pool, 0);
    write_stage stage = {.hierarchy = hierarchy, .writer = writer};
    strl_status status = STRL_OK;
    strl__build_stage(hierarchy->context, "write");
    stage.arenas = strl__alloc_zero(workers, sizeof *stage.arenas);
    stage.slots = strl__alloc_zero(window, sizeof *stage.slots);
    status = stage.arenas && stage.slots ? write_levels(&stage, err)
                                         : strl__fail(err, STRL_ERR_MEMORY, "no memory to write nodes");
    for (unsigned i = 0; stage.arenas && i < workers; i++)
        strl_arena_deinit(&stage.arenas[i]);
    for (unsigned i = 0; stage.slots && i < window * SIBLINGS; i++) {
        strl__free(stage.slots[i / SIBLINGS].node[i % SIBLINGS].payload.data);
        strl__free(stage.slots[i / SIBLINGS].node[i % SIBLINGS].order.data);
    }
    strl__free(stage.arenas);
    strl__free(stage.slots);
    return status;
}
