/* The placements of a model, and boxes over them: a frame looks at those whose boxes the camera sees.
 *
 * A file has placements that are near each other in order (build/place.c). Boxes are over runs of them as they come, so they need
 * no table in the file; where a file has another order they are only larger. All placements are in memory: at most half of
 * memory_bytes, and where they are many counted with the records. */
#include "walk/internal.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define MAX_PLACEMENTS (1u << 24)
#define RUN 16u /* items under one box */
#define PLACEMENT_BYTES (sizeof(strl__placement) + (sizeof(strl_box) + sizeof(strl__far)) / (RUN - 1) + 1) /* with its share of the boxes */

/* The largest singular value of a placement: the root of the largest eigenvalue of its transposed
 * times itself, by Jacobi rotations; a little more for rounding, because errors must stay bounds.
 */
static double largest_scale(const double transform[12])
{
    double a[3][3] = {{0}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int row = 0; row < 3; row++)
                a[i][j] += transform[4 * row + i] * transform[4 * row + j];
    for (int sweep = 0; sweep < 12; sweep++)
        for (int p = 0; p < 2; p++)
            for (int q = p + 1; q < 3; q++) {
                if (a[p][q] == 0)
                    continue;
                double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1));
                double c = 1 / sqrt(t * t + 1), s = t * c, shift = t * a[p][q];
                int r = 3 - p - q;
                double rp = a[r][p], rq = a[r][q];
                a[p][p] -= shift, a[q][q] += shift;
                a[p][q] = a[q][p] = 0;
                a[r][p] = a[p][r] = c * rp - s * rq;
                a[r][q] = a[q][r] = s * rp + c * rq;
            }
    double largest = sqrt(fmax(a[0][0], fmax(a[1][1], a[2][2])));
    return largest == 1 ? 1 : largest * (1 + 1e-12);
}

/* is_used: [tree_count], none yet. */
static strl_status load_all(strl_walk *walk, bool *is_used, strl_error *err)
{
    uint64_t count = strl_container_get_info(walk->container)->placement_count;
    if (count == 0 || count > MAX_PLACEMENTS || count > walk->memory_bytes / 2 / PLACEMENT_BYTES)
        return strl__fail(err, count ? STRL_ERR_LIMIT : STRL_ERR_FORMAT,
                          "the container has %" PRIu64
                          " placements, expected at least 1 and no more than memory for walking allows",
                          count);
    walk->placements = strl__alloc((size_t)count, sizeof *walk->placements);
    if (!walk->placements)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu64 " placements", count);
    for (; walk->placement_count < count; walk->placement_count++) {
        strl__placement *placement = &walk->placements[walk->placement_count];
        strl_placement stored;
        strl_status status = strl_container_placement(walk->container, walk->placement_count, &stored, err);
        if (status != STRL_OK)
            return status;
        const strl_tree *tree = strl_container_tree(walk->container, stored.tree);
        if (!tree)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "placement %" PRIu32 " names tree %" PRIu32 ", expected less than %" PRIu32,
                              walk->placement_count, stored.tree, walk->tree_count);
        placement->tree = stored.tree;
        placement->own_part = stored.own_part;
        memcpy(placement->transform, stored.transform, sizeof placement->transform);
        placement->length_scale = largest_scale(stored.transform) * tree->step;
        if (tree->structure == STRL_STRUCTURE_SAMPLES)
            placement->length_scale /= walk->splat_ratio;
        if (!isfinite(placement->length_scale))
            return strl__fail(err, STRL_ERR_FORMAT, "placement %" PRIu32 ": its transform is not finite",
                              walk->placement_count);
        walk->trees[stored.tree].shared = is_used[stored.tree];
        is_used[stored.tree] = true;
    }
    return STRL_OK;
}

/* ---- boxes */

static strl_box box_of(const strl_walk *walk, uint32_t index)
{
    const strl__placement *placement = &walk->placements[index];
    const strl_tree *tree = walk->trees[placement->tree].tree;
    return strl__world_box(tree, placement, tree->box_min, tree->box_max);
}

static void include(strl_box *box, const strl_box *other)
{
    for (int axis = 0; axis < 3; axis++) {
        box->min[axis] = fmin(box->min[axis], other->min[axis]);
        box->max[axis] = fmax(box->max[axis], other->max[axis]);
    }
}

/* A model of few placements is looked at whole, so that its draw lists tell of all of them. */
static bool is_small(const strl_walk *walk)
{
    return walk->placement_count <= RUN;
}

/* One box for each run of the level below, or of placements. */
static strl_status add_level(strl_walk *walk, const strl__bound_level *below, uint32_t items, strl_error *err)
{
    strl__bound_level *level = &walk->bound_levels[walk->bound_level_count];
    level->count = (items - 1) / RUN + 1;
    level->boxes = strl__alloc(level->count, sizeof *level->boxes);
    level->fars = strl__alloc(level->count, sizeof *level->fars);
    walk->bound_level_count++;
    if (!level->boxes || !level->fars)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the boxes of %" PRIu32 " placements", walk->placement_count);
    strl__far_sums sums = {0};
    for (uint32_t i = 0; i < items; i++) {
        strl_box box = below ? below->boxes[i] : box_of(walk, i);
        strl__far far = below ? below->fars[i] : strl__far_of_placement(walk, &walk->placements[i]);
        if (i % RUN == 0) {
            level->boxes[i / RUN] = box;
            sums = (strl__far_sums){0};
        } else {
            include(&level->boxes[i / RUN], &box);
        }
        strl__far_add(&sums, &far);
        if (i % RUN == RUN - 1 || i + 1 == items)
            level->fars[i / RUN] = strl__far_end(&sums);
    }
    return STRL_OK;
}

strl_status strl__placements_load(strl_walk *walk, strl_error *err)
{
    bool *is_used = strl__alloc_zero(walk->tree_count, sizeof *is_used);
    strl_status status = is_used ? load_all(walk, is_used, err) : strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu32 " trees", walk->tree_count);
    strl__free(is_used);
    if (status == STRL_OK && !is_small(walk)) {
        walk->placement_bytes += walk->placement_count * PLACEMENT_BYTES;
        walk->resident_bytes += walk->placement_count * PLACEMENT_BYTES;
    }
    return status;
}

strl_status strl__placements_bound(strl_walk *walk, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t tree = 0; tree < walk->tree_count; tree++)
        if (walk->trees[tree].root)
            strl__far_of_tree(&walk->trees[tree]);
    const strl__bound_level *below = NULL;
    for (uint32_t items = walk->placement_count; status == STRL_OK && (items > 1 || !below);) {
        status = add_level(walk, below, items, err);
        if (status == STRL_OK) {
            below = &walk->bound_levels[walk->bound_level_count - 1];
            items = below->count;
        }
    }
    if (status == STRL_OK)
        memcpy(walk->bounds, &walk->bound_levels[walk->bound_level_count - 1].boxes[0], sizeof walk->bounds);
    return status;
}

void strl__placements_deinit(strl_walk *walk)
{
    for (uint32_t i = 0; i < walk->bound_level_count; i++) {
        strl__free(walk->bound_levels[i].boxes);
        strl__free(walk->bound_levels[i].fars);
    }
    strl__free(walk->placements);
}

/* ---- looking */

/* True where the camera looks past it, or sees no more of it than a point, which is drawn. */
static bool passes_over(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl__far *far, strl_status *status,
                        strl_error *err)
{
    double px;
    if (!strl_view_sees(cut->view, box))
        return true;
    if (!strl__is_far(cut, box, &px))
        return false;
    if (cut->kind == STRL__CUT_FRONT)
        *status = strl__far_draw(walk, cut, box, far, px, err);
    return true;
}

strl_status strl__placements_next(strl_walk *walk, const strl__cut *cut, uint32_t from, uint32_t *next, strl_error *err)
{
    uint32_t at = from;
    strl_status status = STRL_OK;
    while (!is_small(walk) && at < walk->placement_count && !status) {
        /* The highest box that begins here is looked at first, then those in it. */
        uint32_t level = 0, run = RUN, passed = 0;
        while (at % RUN == 0 && level + 1 < walk->bound_level_count && at % (run * RUN) == 0)
            level++, run *= RUN;
        for (bool more = at % RUN == 0; more && !passed; more = level-- > 0, run /= RUN)
            if (passes_over(walk, cut, &walk->bound_levels[level].boxes[at / run], &walk->bound_levels[level].fars[at / run], &status, err))
                passed = run;
        if (!passed) {
            strl_box box = box_of(walk, at);
            strl__far far = strl__far_of_placement(walk, &walk->placements[at]);
            if (!passes_over(walk, cut, &box, &far, &status, err))
                break;
            passed = 1;
        }
        at += passed;
    }
    *next = at < walk->placement_count ? at : walk->placement_count;
    return status;
}
