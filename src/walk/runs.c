/* Pages of placements in memory: made from the bytes of a file, kept by age, under the budget of all. */
#include "walk/internal.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "container/cut.h"

uint32_t strl__run_placements(const strl_walk *walk, const strl__run *run)
{
    uint32_t left = walk->placement_count - (uint32_t)(run - walk->runs) * STRL_RUN_PLACEMENTS;
    return left < STRL_RUN_PLACEMENTS ? left : STRL_RUN_PLACEMENTS;
}

uint64_t strl__run_bytes(uint32_t placements)
{
    return sizeof(strl__run_page) + placements * sizeof(strl__placement);
}

/* ---- pages */

strl__run_page *strl__run_page_create(uint32_t placements)
{
    strl__run_page *page = strl__alloc(1, (size_t)strl__run_bytes(placements));
    if (page)
        page->count = placements;
    return page;
}

/* Errors must stay bounds: a little more for rounding. */
static double stretch(const double transform[12])
{
    double most = strl_transform_stretch(transform);
    return most == 1 ? 1 : most * (1 + 1e-12);
}

double strl__splat_ratio(const strl_walk *walk, const strl_tree *tree)
{
    return tree->structure == STRL_STRUCTURE_SAMPLES ? walk->splat_ratio : 1;
}

strl_status strl__run_page_place(const strl_walk *walk, strl__run_page *page, uint32_t within, uint64_t index,
                                 const strl_placement *stored, strl_error *err)
{
    strl__placement *placement = &page->items[within];
    const strl_tree *tree = walk->trees[stored->tree].tree; /* its number was checked with the bytes */
    placement->tree = stored->tree;
    memcpy(placement->transform, stored->transform, sizeof placement->transform);
    placement->own_part = stored->own_part;
    placement->length_scale = stretch(stored->transform) * tree->step;
    return isfinite(placement->length_scale)
               ? STRL_OK
               : strl__fail(err, STRL_ERR_FORMAT, "placement %" PRIu64 ": its transform is not finite", index);
}

strl_box strl__placement_box(const strl_walk *walk, const strl__placement *placement)
{
    const strl_tree *tree = walk->trees[placement->tree].tree;
    return strl__world_box(tree, placement, tree->box_min, tree->box_max);
}

strl_far strl__placement_far(const strl_walk *walk, const strl__placement *placement)
{
    const strl__walk_tree *tree = &walk->trees[placement->tree];
    return strl_far_place(&tree->far, placement->transform, placement->length_scale);
}

void strl__run_page_bound(const strl_walk *walk, strl__run_page *page)
{
    strl_far_sums sums;
    for (uint32_t i = 0; i < page->count; i++) {
        const strl_box box = strl__placement_box(walk, &page->items[i]);
        const strl_far far = strl__placement_far(walk, &page->items[i]);
        if (i % STRL__FAN == 0) {
            page->boxes[i / STRL__FAN] = box;
            sums = (strl_far_sums){0};
        } else {
            strl__box_include(&page->boxes[i / STRL__FAN], &box);
        }
        strl_far_add(&sums, &far);
        if (i % STRL__FAN == STRL__FAN - 1 || i + 1 == page->count)
            page->fars[i / STRL__FAN] = strl_far_end(&sums);
    }
}

/* ---- residency */

static void unlink_run(strl_walk *walk, strl__run *run)
{
    *(run->older ? &run->older->newer : &walk->oldest_run) = run->newer;
    *(run->newer ? &run->newer->older : &walk->newest_run) = run->older;
    run->older = run->newer = NULL;
}

static void link_newest(strl_walk *walk, strl__run *run)
{
    run->older = walk->newest_run;
    run->newer = NULL;
    *(walk->newest_run ? &walk->newest_run->newer : &walk->oldest_run) = run;
    walk->newest_run = run;
}

void strl__run_reserve(strl_walk *walk, strl__run *run, strl__request *request)
{
    run->residency = STRL__PENDING;
    run->request = request;
    walk->resident_bytes += strl__run_bytes(strl__run_placements(walk, run));
}

void strl__run_release(strl_walk *walk, strl__run *run)
{
    run->residency = STRL__ABSENT;
    run->request = NULL;
    walk->resident_bytes -= strl__run_bytes(strl__run_placements(walk, run));
}

strl_status strl__run_load(strl_walk *walk, strl__run *run, const void *data, size_t size, strl_error *err)
{
    uint32_t number = (uint32_t)(run - walk->runs), count = strl__run_placements(walk, run);
    strl_status status = strl_run_check(walk->container, number, &run->facts, data, size, err);
    strl__run_page *page = status == STRL_OK ? strl__run_page_create(count) : NULL;
    if (status == STRL_OK && !page)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu32 " placements", count);
    for (uint32_t i = 0; status == STRL_OK && i < count; i++) {
        uint64_t index = (uint64_t)number * STRL_RUN_PLACEMENTS + i;
        strl_placement stored;
        status = strl_run_placement(walk->container, index, data, &stored, err);
        if (status == STRL_OK)
            status = strl__run_page_place(walk, page, i, index, &stored, err);
    }
    if (status != STRL_OK) {
        strl__free(page);
        return status;
    }
    strl__run_page_bound(walk, page);
    run->page = page;
    run->residency = STRL__RESIDENT;
    run->request = NULL;
    run->retry = (strl__retry){0};
    run->touched_frame = walk->frame;
    link_newest(walk, run);
    return STRL_OK;
}

void strl__run_touch(strl_walk *walk, strl__run *run)
{
    run->touched_frame = walk->frame;
    if (run->residency != STRL__RESIDENT || walk->newest_run == run)
        return;
    unlink_run(walk, run);
    link_newest(walk, run);
}

void strl__run_evict(strl_walk *walk, strl__run *run)
{
    unlink_run(walk, run);
    strl__free(run->page);
    run->page = NULL;
    strl__run_release(walk, run);
}
