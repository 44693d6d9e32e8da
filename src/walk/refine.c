/* States of the front's progressive meshes: the coarsest that keeps to the allowed error, reached
 * from the last frame's. */
#include "walk/descent.h"

/* What decides on a state: its error, projected over the node's box. */
typedef struct projector {
    const strl_sight *sight;
    const float *errors; /* by state, never increasing */
    double length_scale;
    double splat_ratio, allowed_px;
} projector;

static bool suffices(const projector *p, uint32_t state)
{
    return strl_sight_error_px(p->sight, p->errors[state] * p->length_scale) / p->splat_ratio <= p->allowed_px;
}

/* The first state in (low, high] that suffices, where low does not and high does. */
static uint32_t bisect(const projector *p, uint32_t low, uint32_t high)
{
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (suffices(p, middle))
            high = middle;
        else
            low = middle;
    }
    return high;
}

/* Gallops from the last state, which is close in a smooth walk; the answer does not depend on where
 * it begins. */
static uint32_t coarsest_state(const projector *p, uint32_t begin, uint32_t finest)
{
    uint32_t stride = 1, low = begin, high = begin;
    if (suffices(p, begin)) {
        while (low > 0 && suffices(p, low)) {
            high = low;
            low = low > stride ? low - stride : 0;
            stride *= 2;
        }
        return high == 0 || suffices(p, low) ? low : bisect(p, low, high);
    }
    while (high < finest && !suffices(p, high)) {
        low = high;
        high = finest - high > stride ? high + stride : finest;
        stride *= 2;
    }
    return suffices(p, high) ? bisect(p, low, high) : finest;
}

static uint32_t choose_state(const strl_walk *walk, const strl__active *active)
{
    const strl__mesh *mesh = &active->node->mesh;
    const projector p = {&active->sight, mesh->errors, active->placed->length_scale,
                         strl__splat_ratio(walk, walk->trees[active->placed->tree].tree), walk->stats.allowed_error_px};
    /* Beside what is below it a brick shows no splats: its record may open it before its own, smaller cells ask for
     * that. */
    return active->open ? mesh->step_count : coarsest_state(&p, mesh->state, mesh->step_count);
}

/* Of a brick that does not have all of its states: more, where the wanted one is not among them, or is the last, so
 * that it is near. */
static void ask_for_more(strl_walk *walk, const strl__active *active, uint32_t wanted)
{
    strl__node *node = active->node;
    const strl__mesh *mesh = &node->mesh;
    const strl_tree *tree = walk->trees[active->placed->tree].tree;
    const bool lacks = wanted > mesh->held;
    if (mesh->held == mesh->step_count || wanted < mesh->held || active->sight.empty)
        return;
    walk->stats.missing_nodes += lacks;
    if (node->request)
        node->request->touched_frame = walk->frame;
    bool waiting = strl__is_waiting(walk, &node->retry);
    if (lacks && !(waiting && strl__is_given_up(walk, &node->retry)))
        walk->settled = false;
    float closed_size = strl__closed_size(walk, tree, &active->sight, active->placed->length_scale,
                                          walk->stats.allowed_error_px, strl__reserve(walk));
    bool reaches_further = mesh->errors[mesh->held] > closed_size;
    if (node->request || waiting || !(lacks || reaches_further))
        return;
    double px = strl_sight_error_px(&active->sight, mesh->errors[mesh->held] * active->placed->length_scale) /
                strl__splat_ratio(walk, tree);
    node->closed_size = reaches_further ? closed_size : 0; /* whole, whatever sizes the file tells */
    /* without memory it is asked for in a later frame */
    strl__add_candidate(lacks ? &walk->missing : &walk->prefetch, node, STRL_NONE,
                        lacks ? px : STRL__PREFETCH_SHARE * px / walk->stats.allowed_error_px);
}

/* was_drawn: in the frame before. */
static void apply_state(strl_walk *walk, strl__node *node, uint32_t state, bool was_drawn)
{
    strl__mesh *mesh = &node->mesh;
    uint32_t before = mesh->state;
    uint32_t count_before = 3 * mesh->triangle_end[before], count = 3 * mesh->triangle_end[state];
    uint32_t first = UINT32_MAX, end = 0;
    /* in a brick no vertex moves */
    uint32_t moves = mesh->splat_end ? 0 : state > before ? state - before : before - state;
    *(state > before ? &walk->stats.vertex_splits : &walk->stats.vertex_collapses) += moves;
    if (state != before)
        strl__mesh_set_state(mesh, state, &first, &end);
    if (!was_drawn) {
        first = 0, end = count;
    } else if (count > count_before) { /* not uploaded while they were not drawn */
        first = first < count_before ? first : count_before;
        end = count;
    }
    end = end < count ? end : count;
    node->dirty_first = first < end ? first : 0;
    node->dirty_end = first < end ? end : 0;
}

void strl__refine_front(strl_walk *walk)
{
    for (size_t i = 0; i < walk->front.count; i++) {
        strl__active *active = &walk->front.items[i];
        strl__node *node = active->node;
        uint32_t wanted = choose_state(walk, active);
        active->state = wanted < node->mesh.held ? wanted : node->mesh.held;
        ask_for_more(walk, active, wanted);
        if (!node->mesh.shared)
            apply_state(walk, node, active->state, node->drawn_frame > 0 && node->drawn_frame + 1 == walk->frame);
        node->front_frame = walk->frame;
        if (active->sight.seen)
            node->drawn_frame = walk->frame;
    }
}
