/* What is in memory, under one budget: treelets, meshes, placements (runs.c) and pages (pages.c), and the reservations
 * of those on their way. */
#include "walk/internal.h"

#include <math.h>

/* Ids are breadth first, so the children of 128 nodes fill at most this many treelets. */
#define MAX_CHILD_TREELETS (STRL_NODE_MAX_CHILDREN + 1)
#define SHARE_KEEPS 0.998  /* with each brick that comes: half after some 350 */
#define SURFACE_HALVINGS 3 /* before any brick has come: of a surface so many times halved all is shown */
#define SPARE_FRAMES 60u   /* what has been idle for longer makes room for what is only likely to be wanted */

/* ---- meshes */

static void unlink_node(strl_walk *walk, strl__node *node)
{
    *(node->older ? &node->older->newer : &walk->oldest) = node->newer;
    *(node->newer ? &node->newer->older : &walk->newest) = node->older;
    node->older = node->newer = NULL;
}

static void link_newest(strl_walk *walk, strl__node *node)
{
    node->older = walk->newest;
    node->newer = NULL;
    *(walk->newest ? &walk->newest->newer : &walk->oldest) = node;
    walk->newest = node;
}

bool strl__node_hold(strl_walk *walk, strl__node *node)
{
    if (node->record->decode_parent == STRL_NONE)
        return true;
    strl__node *by = strl__node_find(walk, node->treelet->tree, node->record->decode_parent);
    if (!by || by->residency == STRL__ABSENT)
        return false;
    node->decoded_by = by;
    by->decoding++;
    by->treelet->pins++;
    return true;
}

void strl__node_let_go(strl__node *node)
{
    if (!node->decoded_by)
        return;
    node->decoded_by->decoding--;
    node->decoded_by->treelet->pins--;
    node->decoded_by = NULL;
}

uint64_t strl__node_held_bytes(const strl_walk *walk, const strl__node *node)
{
    return strl__node_bytes(node->record, walk->labels) - node->mesh.spare_bytes;
}

bool strl__opens_partly(const strl_walk *walk, const strl__node *node)
{
    return node->record->rung == STRL_RUNG_SAMPLED && node->record->child_count == 0 &&
           !walk->trees[node->treelet->tree].shared;
}

uint64_t strl__node_excess(const strl_walk *walk, const strl__node *node, float closed_size)
{
    bool may_go = node->residency == STRL__RESIDENT && !node->request && strl__opens_partly(walk, node);
    return may_go ? strl__brick_excess(&node->mesh, closed_size) : 0;
}

/* By bytes, of the last some hundred bricks. What a brick does not have all of tells nothing of finer cells than it
 * has. */
static void learn_shares(strl_walk *walk, const strl__node *node)
{
    const strl__mesh *mesh = &node->mesh;
    double held = (double)strl__node_held_bytes(walk, node),
           whole = (double)strl__node_bytes(node->record, walk->labels);
    float size = node->record->geometric_max;
    for (unsigned halvings = 0; halvings < STRL__HALVINGS; halvings++, size /= 2) {
        if (mesh->held < mesh->step_count && mesh->errors[mesh->held] > size)
            return;
        double shown = held - (double)strl__node_excess(walk, node, size);
        walk->opened_bytes[halvings] = SHARE_KEEPS * walk->opened_bytes[halvings] + shown;
        walk->brick_bytes[halvings] = SHARE_KEEPS * walk->brick_bytes[halvings] + whole;
    }
}

void strl__expect_nothing(strl_walk *walk)
{
    for (unsigned halvings = 0; halvings < STRL__HALVINGS; halvings++) {
        walk->brick_bytes[halvings] = 1;
        walk->opened_bytes[halvings] = fmin(ldexp(1, 2 * ((int)halvings - SURFACE_HALVINGS)), 1);
    }
}

uint64_t strl__expected_bytes(const strl_walk *walk, const strl__node *node, float closed_size)
{
    double whole = (double)strl__node_bytes(node->record, walk->labels), share = 0;
    double all = walk->opened_bytes[STRL__HALVINGS - 1] / walk->brick_bytes[STRL__HALVINGS - 1];
    double most = ceil(log2((double)node->record->geometric_max / closed_size)); /* a size of 0: no end of them */
    for (unsigned halvings = 0; halvings < STRL__HALVINGS && (halvings == 0 || !(halvings > most)); halvings++)
        share = fmax(share, walk->opened_bytes[halvings] / walk->brick_bytes[halvings]);
    return (uint64_t)(whole * (closed_size > 0 ? fmin(walk->share_guard * share, all) : all));
}

void strl__node_reserve(strl_walk *walk, strl__node *node)
{
    walk->renewals += node->residency == STRL__RESIDENT;
    if (node->residency == STRL__ABSENT)
        node->residency = STRL__PENDING;
    node->treelet->pins++;
    walk->resident_bytes += strl__node_bytes(node->record, walk->labels);
}

void strl__node_release(strl_walk *walk, strl__node *node)
{
    strl__node_let_go(node);
    walk->renewals -= node->residency == STRL__RESIDENT;
    if (node->residency == STRL__PENDING)
        node->residency = STRL__ABSENT;
    node->request = NULL;
    node->treelet->pins--;
    walk->resident_bytes -= strl__node_bytes(node->record, walk->labels);
}

/* Another mesh comes in its place. */
static void retire_mesh(strl_walk *walk, strl__node *node)
{
    unlink_node(walk, node);
    walk->renewals--;
    walk->resident_bytes -= strl__node_held_bytes(walk, node);
    node->treelet->pins--;
    walk->retired[walk->retired_count++] = node->mesh.vertices;
    node->mesh = (strl__mesh){0};
}

void strl__retired_free(strl_walk *walk)
{
    while (walk->retired_count > 0)
        strl__free(walk->retired[--walk->retired_count]);
}

void strl__node_install(strl_walk *walk, strl__node *node, const strl__mesh *mesh)
{
    strl__node_let_go(node);
    if (node->residency == STRL__RESIDENT)
        retire_mesh(walk, node);
    node->residency = STRL__RESIDENT;
    node->request = NULL;
    node->mesh = *mesh;
    walk->resident_bytes -= mesh->spare_bytes;
    if (strl__opens_partly(walk, node))
        learn_shares(walk, node);
    node->load = ++walk->loads;
    node->retry = (strl__retry){0};
    node->touched_frame = walk->frame;
    node->drawn_frame = 0; /* what was drawn of an earlier load has another key */
    link_newest(walk, node);
}

void strl__node_touch(strl_walk *walk, strl__node *node)
{
    node->touched_frame = walk->frame;
    if (node->residency != STRL__RESIDENT || walk->newest == node)
        return;
    unlink_node(walk, node);
    link_newest(walk, node);
}

/* Of what this frame wants, the next brick that holds more than it needs. False where there is none. No list has
 * borrowed its mesh: the one of the last frame is no more, that of this one is not made yet. */
static bool trim_next(strl_walk *walk)
{
    while (walk->looked_at < walk->wanted.count) {
        strl__node *node = walk->wanted.items[walk->looked_at++];
        uint64_t excess = strl__node_excess(walk, node, node->closed_size);
        if (excess > 0 && node->front_frame != walk->frame)
            node->mesh.state = 0; /* in which it was drawn earlier */
        if (excess == 0 || !strl__brick_trim(&node->mesh, node->closed_size))
            continue;
        walk->resident_bytes -= excess;
        node->load = ++walk->loads; /* drawn by another key, so from the first index on */
        node->dirty_first = 0;
        node->dirty_end = 3 * node->mesh.triangle_end[node->mesh.state];
        return true;
    }
    return false;
}

static void evict(strl_walk *walk, strl__node *node)
{
    unlink_node(walk, node);
    walk->resident_bytes -= strl__node_held_bytes(walk, node);
    node->treelet->pins--;
    node->residency = STRL__ABSENT;
    strl__mesh_deinit(&node->mesh);
}

/* False where nothing may go. */
static bool evict_oldest(strl_walk *walk, uint64_t evict_before)
{
    /* What is wanted is touched last of all, so the oldest one tells for the rest. */
    strl__node *oldest = walk->oldest;
    strl__run *run = walk->oldest_run;
    bool may_go = oldest && oldest->wanted_frame != walk->frame && oldest->touched_frame < evict_before;
    if (run && run->wanted_frame != walk->frame && run->touched_frame < evict_before &&
        (!may_go || run->touched_frame < oldest->touched_frame)) {
        strl__run_evict(walk, run);
        return true;
    }
    if (may_go && (oldest->decoding || oldest->request)) { /* as good as wanted */
        oldest->wanted_frame = walk->frame;
        strl__node_touch(walk, oldest);
    } else if (may_go) {
        evict(walk, oldest);
    }
    return may_go;
}

uint64_t strl__idle_since(const strl_walk *walk)
{
    return walk->frame > SPARE_FRAMES ? walk->frame - SPARE_FRAMES : 0;
}

bool strl__make_room(strl_walk *walk, uint64_t bytes, uint64_t evict_before)
{
    uint64_t idle_since = strl__idle_since(walk);
    if (bytes > walk->memory_bytes)
        return false;
    while (walk->resident_bytes > walk->memory_bytes - bytes)
        if (!evict_oldest(walk, evict_before < idle_since ? evict_before : idle_since) &&
            !strl__page_drop_oldest(walk) && !evict_oldest(walk, evict_before) &&
            !(evict_before > walk->frame && walk->is_tight && trim_next(walk)))
            break;
    if (walk->resident_bytes > walk->memory_bytes - bytes)
        strl__treelet_evict_cold(walk, evict_before < walk->frame ? evict_before : walk->frame);
    return walk->resident_bytes <= walk->memory_bytes - bytes;
}

/* ---- treelets */

static void release_treelet(strl_walk *walk, strl__treelet *treelet)
{
    walk->resident_bytes -= treelet->bytes;
    walk->treelet_bytes -= treelet->bytes;
    strl__treelets_remove(&walk->treelets, treelet);
}

void strl__treelet_evict_cold(strl_walk *walk, uint64_t before_frame)
{
    for (size_t slot = 0; slot < walk->treelets.capacity;) {
        strl__treelet *treelet = walk->treelets.slots[slot];
        bool cold = treelet && treelet->pins == 0 && treelet->residency != STRL__PENDING &&
                    treelet->touched_frame < before_frame;
        if (cold)
            release_treelet(walk, treelet); /* another may have moved into the slot */
        else
            slot++;
    }
}

strl__treelet *strl__treelet_reserve(strl_walk *walk, uint32_t tree, uint32_t index, const strl_treelet_ref *ref)
{
    uint64_t bytes = sizeof(strl__treelet) + MAX_CHILD_TREELETS * sizeof(strl_treelet_ref);
    /* Records may take an eighth of the budget before old ones go, and half of it in the end. */
    if (walk->treelet_bytes + bytes > walk->memory_bytes / 8)
        strl__treelet_evict_cold(walk, walk->frame);
    if (walk->treelet_bytes + bytes > walk->memory_bytes / 2 ||
        walk->treelet_bytes + bytes + walk->root_bytes > walk->memory_bytes ||
        !strl__make_room(walk, bytes, walk->frame + 1))
        return NULL;
    strl__treelet *treelet = strl__alloc_zero(1, sizeof *treelet);
    if (!treelet)
        return NULL;
    treelet->tree = tree, treelet->index = index, treelet->ref = *ref;
    treelet->bytes = bytes;
    treelet->touched_frame = walk->frame;
    if (!strl__treelets_insert(&walk->treelets, treelet)) {
        strl__free(treelet);
        return NULL;
    }
    walk->resident_bytes += bytes;
    walk->treelet_bytes += bytes;
    return treelet;
}

strl_status strl__treelet_load(strl_walk *walk, strl__treelet *treelet, const void *data, size_t size, strl_error *err)
{
    strl_status status = strl_treelet_decode(walk->container, treelet->tree, treelet->index, &treelet->ref, data, size,
                                             &treelet->data, err);
    treelet->residency = status == STRL_OK ? STRL__RESIDENT : STRL__ABSENT;
    if (status != STRL_OK)
        return status;
    treelet->retry = (strl__retry){0};
    for (uint32_t i = 0; i < treelet->data.node_count; i++) {
        treelet->nodes[i].record = &treelet->data.nodes[i];
        treelet->nodes[i].treelet = treelet;
    }
    return STRL_OK;
}

strl__node *strl__node_find(strl_walk *walk, uint32_t tree, uint32_t id)
{
    strl__treelet *treelet = strl__treelets_find(&walk->treelets, tree, id / STRL_TREELET_NODES);
    if (!treelet)
        return NULL;
    treelet->touched_frame = walk->frame;
    uint32_t i = id % STRL_TREELET_NODES;
    return treelet->residency == STRL__RESIDENT && i < treelet->data.node_count ? &treelet->nodes[i] : NULL;
}
