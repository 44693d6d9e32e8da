/* Levels above the leaves: groups of nodes made from the base meshes of their children. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "build/clusters/hierarchy.h"
#include "build/clusters/pm_spill.h"
#include "build/saved.h"
#include "geometry/record.h"
#include "geometry/simplify.h"

/* The boundary of a group is simplified up to a little more than the error that its nodes' children have reached
 * anyway. */
#define BOUNDARY_ERROR_SHARE 1.25f

/* A node with more before it is simplified holds what cannot be simplified: then duplicate faces go. */
#define CROWDED_TRIANGLES 8192u

/* Bounds of what errors grow by where triangles are halved; a level of few nodes does not say enough. */
#define LEAST_GROWTH 1.3
#define MOST_GROWTH 4.
#define LEAST_EVEN_NODES 16u

typedef struct made_group {
    uint32_t count;
    strl_made_node node[STRL_GROUP_MAX];
} made_group;

typedef struct level_stage {
    strl_hierarchy *hierarchy;
    strl_level *level; /* being made */
    const strl_level *children;
    strl_groups groups;
    uint32_t level_index;
    uint32_t first_group; /* that is made: those before are restored */
    made_group *slots;
    strl_arena *arenas; /* per worker */
} level_stage;

/* The meshes of one group and what is known of their points. */
typedef struct group_work {
    uint32_t count;         /* members */
    const uint32_t *member; /* node indices of the level */
    uint32_t child_count;
    uint32_t child_triangles[2 * STRL_GROUP_MAX];
    strl_node_mesh merged;
    uint32_t *owner;                   /* per triangle of merged: index of the member */
    uint32_t *outside_first, *outside; /* per point: holders that are not members, ascending */
    uint32_t steps;                    /* collapses of the boundary */
    strl_simplify_rung rung;
    strl_anchors shares[STRL_GROUP_MAX]; /* what each member stands for */
} group_work;

/* A base mesh comes from its spill, and from the node's payload where that has the positions. */
static strl_status read_child(const strl_level *children, uint32_t index, strl_arena *arena, strl_arena *scratch,
                              strl_node_mesh *child, strl_error *err)
{
    const strl_node_state *state = &children->nodes[index];
    void *mesh = strl_arena_alloc(scratch, state->mesh_bytes, 1);
    void *payload = strl_arena_alloc(scratch, state->payload_bytes, 1);
    strl_pm decoded, *given = state->needs_payload ? &decoded : NULL;
    if (!mesh || !payload)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u bytes", state->payload_bytes);
    strl_status status = strl_spill_read(children->meshes, state->mesh_at, mesh, state->mesh_bytes, err);
    if (!status && given)
        status = strl_spill_read(children->payloads, state->payload_at, payload, state->payload_bytes, err);
    if (!status && given)
        status = strl_pm_spill_read(payload, state->payload_bytes, scratch, given, err);
    return status ? status : strl_node_mesh_read(mesh, state->mesh_bytes, given, arena, child, err);
}

static strl_status read_children(const level_stage *stage, group_work *work, strl_node_mesh *child, strl_arena *arena,
                                 strl_error *err)
{
    strl_arena scratch = {0};
    strl_arena_mark mark = strl_arena_get_mark(&scratch);
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < 2 * work->count && !status; i++) {
        status = read_child(stage->children, 2 * work->member[i / 2] + (i & 1), arena, &scratch, &child[i], err);
        strl_arena_rewind(&scratch, mark);
        work->child_triangles[i] = status ? 0 : child[i].mesh.triangle_count;
    }
    strl_arena_deinit(&scratch);
    work->child_count = 2 * work->count;
    return status;
}

static uint32_t member_index(const group_work *work, uint32_t node)
{
    for (uint32_t i = 0; i < work->count; i++)
        if (work->member[i] == node)
            return i;
    return UINT32_MAX;
}

/* A holder of a point that is not a member of the group. */
typedef struct outsider {
    uint32_t point, node;
} outsider;

static int compare_outsiders(const void *a, const void *b)
{
    const outsider *x = a, *y = b;
    if (x->point != y->point)
        return x->point < y->point ? -1 : 1;
    return x->node < y->node ? -1 : x->node > y->node;
}

/* Fills the merged mesh's holders and flags, and the list of outsiders of each point. */
static bool find_holders(group_work *work, const strl_node_mesh *children, uint32_t *const *point_of, strl_arena *arena)
{
    strl_mesh *mesh = &work->merged.mesh;
    size_t total = 0, count = 0;
    for (uint32_t i = 0; i < work->child_count; i++)
        total += children[i].share_first ? children[i].share_first[children[i].mesh.point_count] : 0;
    outsider *list = strl_arena_alloc(arena, total, sizeof *list);
    mesh->holders = strl_arena_alloc_zero(arena, mesh->point_count, 1);
    work->outside_first = strl_arena_alloc(arena, (size_t)mesh->point_count + 1, sizeof *work->outside_first);
    work->outside = strl_arena_alloc(arena, total, sizeof *work->outside);
    if (!list || !mesh->holders || !work->outside_first || !work->outside)
        return false;
    for (uint32_t i = 0; i < work->child_count; i++) {
        const strl_node_mesh *child = &children[i];
        for (uint32_t p = 0; p < child->mesh.point_count; p++) {
            mesh->holders[point_of[i][p]] |= (uint8_t)(1u << i / 2);
            for (uint32_t s = child->share_first ? child->share_first[p] : 0;
                 child->share_first && s < child->share_first[p + 1]; s++)
                if (member_index(work, child->share[s] >> 1) == UINT32_MAX)
                    list[count++] = (outsider){point_of[i][p], child->share[s] >> 1};
        }
    }
    qsort(list, count, sizeof *list, compare_outsiders);
    uint32_t kept = 0, at = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        work->outside_first[p] = kept;
        for (; at < count && list[at].point == p; at++)
            if (kept == work->outside_first[p] || work->outside[kept - 1] != list[at].node)
                work->outside[kept++] = list[at].node;
        bool several = (mesh->holders[p] & (mesh->holders[p] - 1)) != 0, outside = kept > work->outside_first[p];
        mesh->flags[p] = (uint8_t)((several && !outside ? 0 : STRL_POINT_KEPT) | (outside ? STRL_POINT_OUTSIDE : 0));
    }
    work->outside_first[mesh->point_count] = kept;
    return true;
}

/* The diagonal of the box that holds the group and the input it stands for: that of the children's groups, because a
 * triangle may have taken over what one of another member of its group stood for. */
static float diagonal_of_group(const level_stage *stage, const group_work *work)
{
    double squared = 0;
    for (int k = 0; k < 3; k++) {
        int64_t least = INT64_MAX, most = INT64_MIN;
        for (uint32_t i = 0; i < work->child_count; i++) {
            const strl_node *record = &stage->children->nodes[2 * work->member[i / 2] + (i & 1)].record;
            least = record->group_box_min[k] < least ? record->group_box_min[k] : least;
            most = record->group_box_max[k] > most ? record->group_box_max[k] : most;
        }
        squared += (double)(most - least) * (double)(most - least);
    }
    return nextafterf((float)sqrt(squared) + work->merged.mesh.start_error, INFINITY);
}

static strl_status merge_into_one(const level_stage *stage, group_work *work, const strl_node_mesh *children,
                                  strl_arena *arena, strl_error *err)
{
    const strl_node_mesh *list[2 * STRL_GROUP_MAX];
    uint32_t *point_of[2 * STRL_GROUP_MAX];
    for (uint32_t i = 0; i < work->child_count; i++)
        list[i] = &children[i];
    strl_status status =
        strl_node_mesh_merge(list, work->child_count, arena, &work->merged, &work->owner, point_of, err);
    if (status)
        return status;
    work->merged.mesh.most_error = diagonal_of_group(stage, work);
    for (uint32_t t = 0; t < work->merged.mesh.triangle_count; t++)
        work->owner[t] /= 2;
    if (work->merged.mesh.triangle_count > work->count * CROWDED_TRIANGLES) {
        uint32_t dropped = 0;
        if (!strl__drop_duplicate_pairs(&work->merged.mesh, work->owner, &dropped, arena))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a group");
        work->steps += dropped;
        work->rung = dropped ? STRL_SIMPLIFY_CLUSTERING : work->rung;
    }
    return find_holders(work, children, point_of, arena) ? STRL_OK
                                                         : strl__fail(err, STRL_ERR_MEMORY, "no memory for a group");
}

/* The children's own meshes are gone again when this ends. */
static strl_status merge_children(const level_stage *stage, group_work *work, strl_arena *arena, strl_error *err)
{
    strl_node_mesh children[2 * STRL_GROUP_MAX];
    strl_arena own = {0};
    strl_status status = read_children(stage, work, children, &own, err);
    if (!status)
        status = merge_into_one(stage, work, children, arena, err);
    strl_arena_deinit(&own);
    return status;
}

static float boundary_limit(const level_stage *stage, const group_work *work)
{
    double sum = 0;
    for (uint32_t i = 0; i < work->child_count; i++) {
        const strl_node *record = &stage->children->nodes[2 * work->member[i / 2] + (i & 1)].record;
        sum += fmaxf(record->geometric_max, record->appearance_max);
    }
    return (float)(BOUNDARY_ERROR_SHARE * sum / work->child_count);
}

/* Collapses points that several members have and nobody else (paper, 4.4), on the merged mesh, before any progressive
 * mesh of the level begins. */
static strl_status collapse_boundary(const level_stage *stage, group_work *work, strl_arena *own, strl_arena *arena,
                                     strl_error *err)
{
    strl_simplify_desc desc = {.error_limit = boundary_limit(stage, work),
                               .last_rung = STRL_SIMPLIFY_SEAMS,
                               .normal_weight = STRL_NORMAL_WEIGHT,
                               .colour_weight = STRL_COLOUR_WEIGHT};
    strl_mesh *mesh = &work->merged.mesh, after;
    strl_simplified simplified;
    uint32_t *point_map = strl_arena_alloc(own, mesh->point_count, sizeof *point_map);
    strl_status status = point_map ? strl_simplify(mesh, &desc, own, &simplified, err)
                                   : strl__fail(err, STRL_ERR_MEMORY, "no memory for a group");
    if (!status)
        status = strl_mesh_after(mesh, &simplified, point_map, arena, &after, err);
    if (status)
        return status;
    uint32_t triangles = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (simplified.removed_at[t] == UINT32_MAX)
            work->owner[triangles++] = work->owner[t];
    uint32_t at = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++) { /* new indices ascend with the old ones */
        if (point_map[p] == UINT32_MAX)
            continue;
        uint32_t begin = work->outside_first[p], end = work->outside_first[p + 1], to = point_map[p];
        work->outside_first[to] = at;
        for (uint32_t i = begin; i < end; i++)
            work->outside[at++] = work->outside[i];
    }
    work->outside_first[after.point_count] = at;
    work->steps += simplified.collapse_count;
    work->rung = simplified.rung > work->rung ? simplified.rung : work->rung;
    *mesh = after;
    return STRL_OK;
}

/* What the simplifier holds of a whole group is gone again when this ends. */
static strl_status simplify_boundary(const level_stage *stage, group_work *work, strl_arena *arena, strl_error *err)
{
    strl_arena own = {0};
    if (work->count == 1)
        return STRL_OK;
    strl_status status = collapse_boundary(stage, work, &own, arena, err);
    strl_arena_deinit(&own);
    return status;
}

/* Who has each point after the boundary has changed: from the triangles. */
static bool recount_holders(group_work *work, strl_arena *arena)
{
    strl_mesh *mesh = &work->merged.mesh;
    mesh->holders = strl_arena_alloc_zero(arena, mesh->point_count, 1);
    if (!mesh->holders)
        return false;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            mesh->holders[mesh->wedge[mesh->triangle[t][c]].point] |= (uint8_t)(1u << work->owner[t]);
    return true;
}

/* A member's own mesh, with shares by the names of this level. */
static strl_status extract_member(const group_work *work, uint32_t which, strl_arena *arena, strl_node_mesh *node,
                                  strl_error *err)
{
    const strl_mesh *mesh = &work->merged.mesh;
    uint32_t *point_of = strl_arena_alloc(arena, mesh->point_count, sizeof *point_of);
    *node = (strl_node_mesh){0};
    memcpy(node->anchor, work->merged.anchor, sizeof node->anchor);
    strl_status status = point_of ? strl_mesh_extract(mesh, work->owner, which, arena, &node->mesh, point_of, err)
                                  : strl__fail(err, STRL_ERR_MEMORY, "no memory for a node");
    if (status)
        return status;
    size_t most = work->outside_first[mesh->point_count] + (size_t)node->mesh.point_count * work->count;
    node->share_first = strl_arena_alloc(arena, (size_t)node->mesh.point_count + 1, sizeof *node->share_first);
    node->share = strl_arena_alloc(arena, most, sizeof *node->share);
    if (!node->share_first || !node->share)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node");
    uint32_t at = 0, next = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        if (point_of[p] == UINT32_MAX)
            continue;
        uint32_t begin = at;
        node->share_first[next] = at;
        for (uint32_t m = 0; m < work->count; m++)
            if (m != which && mesh->holders[p] >> m & 1)
                node->share[at++] = work->member[m];
        for (uint32_t i = work->outside_first[p]; i < work->outside_first[p + 1]; i++)
            node->share[at++] = work->outside[i];
        for (uint32_t i = begin + 1; i < at; i++) /* both runs ascend: few moves */
            for (uint32_t k = i; k > begin && node->share[k - 1] > node->share[k]; k--) {
                uint32_t swap = node->share[k];
                node->share[k] = node->share[k - 1];
                node->share[k - 1] = swap;
            }
        node->mesh.flags[next++] = at > begin ? STRL_POINT_KEPT | STRL_POINT_OUTSIDE : 0;
    }
    node->share_first[next] = at;
    return STRL_OK;
}

static uint32_t half_of_children(const group_work *work, uint32_t which)
{
    uint32_t sum = work->child_triangles[2 * which] + work->child_triangles[2 * which + 1];
    return (sum + 1) / 2;
}

static strl_status make_group(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    level_stage *stage = context;
    index += stage->first_group;
    strl_arena *arena = &stage->arenas[worker];
    made_group *made = &stage->slots[slot];
    strl_arena_mark mark = strl_arena_get_mark(arena);
    group_work work = {.count = stage->groups.first[index + 1] - stage->groups.first[index],
                       .member = stage->groups.member + stage->groups.first[index]};
    *made = (made_group){.count = work.count};
    strl_status status = merge_children(stage, &work, arena, err);
    if (!status)
        status = simplify_boundary(stage, &work, arena, err);
    if (!status && !recount_holders(&work, arena))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a group");
    if (!status && stage->children->anchors)
        status = strl_group_anchors(stage->children, work.member, work.count, &work.merged, work.owner, arena,
                                    work.shares, err);
    for (uint32_t m = 0; m < work.count && !status; m++) {
        strl_node_mesh node;
        strl_node *record = &made->node[m].state.record;
        status = extract_member(&work, m, arena, &node, err);
        if (!status)
            status = strl_make_node(stage->hierarchy, &node, &work.shares[m], work.member[m],
                                    half_of_children(&work, m), arena, &made->node[m], err);
        strl_anchors_deinit(&work.shares[m]);
        record->boundary_steps = work.steps;
        if (work.steps && (uint32_t)work.rung > record->rung)
            record->rung = work.rung;
        made->node[m].state.group = (uint32_t)index;
    }
    for (uint32_t m = 0; m < work.count; m++)
        strl_anchors_deinit(&work.shares[m]);
    strl_arena_rewind(arena, mark);
    return status;
}

static void include_box(int64_t least[3], int64_t most[3], const int64_t other_least[3], const int64_t other_most[3])
{
    for (int k = 0; k < 3; k++) {
        least[k] = other_least[k] < least[k] ? other_least[k] : least[k];
        most[k] = other_most[k] > most[k] ? other_most[k] : most[k];
    }
}

/* A node's errors and box cover its own mesh (which may have got points of its neighbours), its children's and those of
 * their groups; so every rule that holds for a child's group holds for the groups above it, and a cut chosen by groups
 * is closed. */
static void raise_to_children(const level_stage *stage, uint32_t self, strl_node *record, int64_t group_least[3],
                              int64_t group_most[3])
{
    for (uint32_t i = 0; i < 2; i++) {
        const strl_node *child = &stage->children->nodes[2 * self + i].record;
        include_box(record->box_min, record->box_max, child->box_min, child->box_max);
        include_box(group_least, group_most, child->group_box_min, child->group_box_max);
        record->geometric_min = fmaxf(record->geometric_min, fmaxf(child->geometric_max, child->group_geometric));
        record->appearance_min = fmaxf(record->appearance_min, fmaxf(child->appearance_max, child->group_appearance));
        /* its rims end where they did not in the input: whoever holds them says so */
        if (child->rung == STRL_SIMPLIFY_CLUSTERING)
            record->rung = child->rung;
    }
    record->geometric_max = fmaxf(record->geometric_max, record->geometric_min);
    record->appearance_max = fmaxf(record->appearance_max, record->appearance_min);
    include_box(group_least, group_most, record->box_min, record->box_max);
}

static void finish_records(const level_stage *stage, made_group *made, const uint32_t *member)
{
    int64_t least[3] = {INT64_MAX, INT64_MAX, INT64_MAX}, most[3] = {INT64_MIN, INT64_MIN, INT64_MIN};
    float geometric = 0, appearance = 0;
    for (uint32_t m = 0; m < made->count; m++) {
        strl_node *record = &made->node[m].state.record;
        raise_to_children(stage, member[m], record, least, most);
        geometric = fmaxf(geometric, record->geometric_min);
        appearance = fmaxf(appearance, record->appearance_min);
    }
    for (uint32_t m = 0; m < made->count; m++) {
        strl_node *record = &made->node[m].state.record;
        memcpy(record->group_box_min, least, sizeof least);
        memcpy(record->group_box_max, most, sizeof most);
        record->group_geometric = geometric;
        record->group_appearance = appearance;
        record->group_size = made->count;
    }
}

static void made_group_deinit(made_group *made)
{
    for (uint32_t m = 0; m < STRL_GROUP_MAX; m++)
        strl_made_node_deinit(&made->node[m]);
    *made = (made_group){0};
}

static strl_status take_group(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    level_stage *stage = context;
    made_group *made = &stage->slots[slot];
    index += stage->first_group;
    const uint32_t *member = stage->groups.member + stage->groups.first[index];
    strl_status status = STRL_OK;
    (void)worker;
    finish_records(stage, made, member);
    strl_group_claims(stage->children, member, made->count, made->node);
    for (uint32_t i = 0; i < 2 * made->count; i++) { /* nobody else reads a child */
        const strl_node_state *child = &stage->children->nodes[2 * member[i / 2] + (i & 1)];
        strl_spill_drop(stage->children->meshes, child->mesh_at, child->mesh_bytes);
        if (stage->children->anchors)
            strl_spill_drop(stage->children->anchors, child->anchors_at, child->anchors_bytes);
    }
    for (uint32_t m = 0; m < made->count && !status; m++)
        status = strl_take_node(stage->hierarchy, stage->level, member[m], &made->node[m], err);
    made_group_deinit(made);
    if (!status)
        status = strl_clusters_note(stage->hierarchy, stage->level_index, (uint32_t)index + 1, err);
    return status ? status
                  : strl__build_report(stage->hierarchy->context, stage->groups.first[index + 1], stage->level->count,
                                       err);
}

float strl_node_error(const strl_node *record)
{
    return fmaxf(record->geometric_max, record->appearance_max);
}

static int compare_floats(const void *a, const void *b)
{
    float x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return x < y ? -1 : x > y;
}

float strl_median(float *values, uint32_t count)
{
    qsort(values, count, sizeof *values, compare_floats);
    return count ? values[count / 2] : 0;
}

/* If a growth of g left a share r of the triangles, g to the power ln 2 / ln (1 / r) would have left half. */
bool strl_choose_even_error(strl_hierarchy *hierarchy, const strl_level *level)
{
    float *errors = strl__alloc(level->count, sizeof *errors);
    double finest = 0, base = 0;
    if (!errors)
        return false;
    for (uint32_t i = 0; i < level->count; i++) {
        errors[i] = strl_node_error(&level->nodes[i].record);
        finest += level->nodes[i].record.triangle_count;
        base += level->nodes[i].record.base_triangle_count;
    }
    double left = fmin(fmax(base / finest, 0.35), 0.7);
    hierarchy->growth = (float)fmin(fmax(pow(hierarchy->growth, log(0.5) / log(left)), LEAST_GROWTH), MOST_GROWTH);
    hierarchy->even_error =
        level->count >= LEAST_EVEN_NODES ? hierarchy->growth * strl_median(errors, level->count) : 0;
    strl__free(errors);
    return true;
}

/* The groups are chosen anew: those that are restored must be the first of them. */
static bool fits_restored(const level_stage *stage)
{
    for (uint32_t g = 0; g < stage->first_group; g++)
        for (uint32_t i = stage->groups.first[g]; i < stage->groups.first[g + 1]; i++) {
            const strl_node_state *state = &stage->level->nodes[stage->groups.member[i]];
            if (state->group != g || !state->payload_bytes)
                return false;
        }
    return true;
}

static strl_status choose_groups(level_stage *stage, strl_error *err)
{
    strl_hierarchy *hierarchy = stage->hierarchy;
    strl_status status = strl_groups_choose(stage->children, &hierarchy->current, stage->level->count,
                                            hierarchy->partition->depth - stage->level_index,
                                            hierarchy->context->desc->no_dependencies, &stage->groups, err);
    strl_adjacency_deinit(&hierarchy->current);
    if (status)
        return status;
    stage->level->group_count = stage->groups.count;
    return stage->first_group <= stage->groups.count && fits_restored(stage)
               ? STRL_OK
               : strl_saved_fail("the groups of a level", err);
}

strl_status strl_make_level(strl_hierarchy *hierarchy, uint32_t level, uint32_t first, strl_error *err)
{
    strl_pool *pool = hierarchy->context->pool;
    level_stage stage = {.hierarchy = hierarchy,
                         .level = &hierarchy->levels[level],
                         .children = &hierarchy->levels[level - 1],
                         .level_index = level,
                         .first_group = first};
    unsigned workers = strl_pool_workers(pool);
    strl_status status = choose_groups(&stage, err);
    stage.slots = strl__alloc_zero(strl_pool_window(pool, 0), sizeof *stage.slots);
    stage.arenas = strl__alloc_zero(workers, sizeof *stage.arenas);
    if (!status && (!stage.slots || !stage.arenas))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u workers", workers);
    if (!status)
        status = strl_pool_ordered(pool, stage.groups.count - first, 0, make_group, take_group, &stage, NULL, err);
    for (unsigned i = 0; stage.slots && i < strl_pool_window(pool, 0); i++)
        made_group_deinit(&stage.slots[i]);
    for (unsigned i = 0; stage.arenas && i < workers; i++)
        strl_arena_deinit(&stage.arenas[i]);
    strl__free(stage.slots);
    strl__free(stage.arenas);
    strl_groups_deinit(&stage.groups);
    return status;
}
