/* Certificates of a group: what its members stand for, and what they claim. */
#include <math.h>

#include "base/fail.h"
#include "build/clusters/hierarchy.h"

/* Of what children claim: a piece that reaches beyond its member's boundary by so little may be measured there. */
#define TOLERANCE 0.5

/* Claims of no more lattice units, some times what rounding costs, are left as they are: flat places, where drifts do
 * not grow and what pieces lose at boundaries would count. */
#define SMALL_CLAIM 4.f
/* For each triangle: a soup is no surface to measure. */
#define MOST_POINTS 2u

strl_anchor_plan strl_hierarchy_anchor_plan(const strl_hierarchy *hierarchy, uint32_t level)
{
    uint32_t depth = hierarchy->partition->depth;
    bool certify = hierarchy->context->desc->certify;
    uint32_t first = strl_anchor_first_level(depth, certify);
    float claim = first == 0 ? INFINITY : 0;
    uint64_t points = 0, triangles = 0;
    if (level < first)
        return (strl_anchor_plan){0};
    for (uint32_t i = 0; first > 0 && i < hierarchy->levels[first - 1].count; i++) {
        const strl_node_state *state = &hierarchy->levels[first - 1].nodes[i];
        claim = fmaxf(claim, state->claims.most);
        points += state->point_count;
        triangles += state->record.base_triangle_count;
    }
    bool is_worth_it = claim > SMALL_CLAIM && points <= MOST_POINTS * triangles;
    return is_worth_it ? strl_anchor_plan_of(level, depth, certify) : (strl_anchor_plan){0};
}

static strl_status read_anchors(const strl_level *children, uint32_t index, const int64_t origin[3], strl_arena *arena,
                                strl_pieces *all, strl_error *err)
{
    const strl_node_state *state = &children->nodes[index];
    const int64_t *anchor = state->record.anchor;
    strl_arena_mark mark = strl_arena_get_mark(arena);
    int64_t moved[3] = {anchor[0] - origin[0], anchor[1] - origin[1], anchor[2] - origin[2]};
    void *data = strl_arena_alloc(arena, state->anchors_bytes, 1);
    strl_status status = data ? strl_spill_read(children->anchors, state->anchors_at, data, state->anchors_bytes, err)
                              : strl__fail(err, STRL_ERR_MEMORY, "no memory for the anchors of a node");
    if (!status)
        status = strl_pieces_read(data, state->anchors_bytes, moved, all, err);
    strl_arena_rewind(arena, mark);
    return status;
}

/* What a node's two children claim. */
static float children_claim(const strl_level *children, uint32_t node)
{
    const strl_node_claims *a = &children->nodes[2 * node].claims, *b = &children->nodes[2 * node + 1].claims;
    return fmaxf(fmaxf(a->most, a->group), fmaxf(b->most, b->group));
}

strl_status strl_group_anchors(const strl_level *children, const uint32_t *member, uint32_t count,
                               const strl_node_mesh *merged, const uint32_t *owner, strl_arena *arena,
                               strl_anchors *shares, strl_error *err)
{
    strl_pieces own[STRL_GROUP_MAX] = {0};
    double claimed = 0;
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < 2 * count && !status; i++) {
        uint32_t child = 2 * member[i / 2] + (i & 1);
        status = read_anchors(children, child, merged->anchor, arena, count == 1 ? &shares[0].own : &own[i / 2], err);
        claimed += children->nodes[child].claims.most * TOLERANCE / (2. * count);
    }
    if (!status && count > 1)
        status = strl_anchors_divide(&merged->mesh, owner, count, claimed, own, arena, shares, err);
    if (!status && !strl_anchors_find_beside(shares, count, claimed))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the anchors of a group");
    for (uint32_t m = 0; m < count; m++) {
        shares[m].granted = children_claim(children, member[m]);
        strl_pieces_deinit(&own[m]);
    }
    return status;
}

void strl_group_claims(const strl_level *children, const uint32_t *member, uint32_t count, strl_made_node *made)
{
    float group = 0;
    for (uint32_t m = 0; m < count; m++) {
        strl_node_claims *own = &made[m].state.claims;
        own->least = fmaxf(own->least, children_claim(children, member[m]));
        own->most = fmaxf(own->most, own->least);
        group = fmaxf(group, own->least);
    }
    for (uint32_t m = 0; m < count; m++)
        made[m].state.claims.group = group;
}
