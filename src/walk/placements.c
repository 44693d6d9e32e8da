/* The placements of a model, and boxes over them: a frame looks at those whose boxes the camera sees.
 *
 * A file has placements that are near each other in order (build/place.c), in runs of one page each. What a run looks
 * like from outside is in memory from the beginning, and boxes over 16 runs, 16 of these, and so on; its placements,
 * with boxes over 16 of them, come when the camera sees more of it than a point, and go when others need the room
 * (runs.c). Where all placements are one run, they are in memory as long as the walk. */
#include "walk/internal.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "walk/descent.h"

#define MAX_PLACEMENTS (1u << 24)
#define FEW 16u
/* with its share of the boxes */
#define RUN_STAYS (sizeof(strl__run) + (sizeof(strl_box) + sizeof(strl_far)) / (STRL__FAN - 1) + 1)

/* ---- opening */

bool strl__placements_are_few(const strl_walk *walk)
{
    return walk->placement_count <= FEW;
}

static strl_status load_page(strl_walk *walk, strl_error *err)
{
    strl__run_page *page = walk->runs[0].page = strl__run_page_create(walk->placement_count);
    strl_status status =
        page ? STRL_OK
             : strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu32 " placements", walk->placement_count);
    for (uint32_t i = 0; status == STRL_OK && i < walk->placement_count; i++) {
        strl_placement stored;
        status = strl_container_placement(walk->container, i, &stored, err);
        if (status == STRL_OK)
            status = strl__run_page_place(walk, page, i, i, &stored, err);
        if (status != STRL_OK)
            return status;
        strl__walk_tree *tree = &walk->trees[stored.tree];
        tree->shared = tree->used;
        tree->used = true;
    }
    return status;
}

/* Which trees are used would be known only after reading all pages. */
static strl_status load_runs(strl_walk *walk, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t tree = 0; tree < walk->tree_count; tree++)
        walk->trees[tree].used = walk->trees[tree].shared = true;
    for (uint32_t run = 0; status == STRL_OK && run < walk->run_count; run++)
        status = strl_container_run(walk->container, run, &walk->runs[run].facts, err);
    return status;
}

strl_status strl__placements_load(strl_walk *walk, strl_error *err)
{
    uint64_t count = strl_container_get_info(walk->container)->placement_count;
    uint64_t runs = (count + STRL_RUN_PLACEMENTS - 1) / STRL_RUN_PLACEMENTS;
    uint64_t bytes = runs == 1 ? strl__run_bytes((uint32_t)count) : runs * RUN_STAYS;
    if (count == 0 || count > MAX_PLACEMENTS || (count > FEW && bytes > walk->memory_bytes / 2))
        return strl__fail(err, count ? STRL_ERR_LIMIT : STRL_ERR_FORMAT,
                          "the container has %" PRIu64
                          " placements, expected at least 1 and no more than memory for walking allows",
                          count);
    walk->runs = strl__alloc_zero((size_t)runs, sizeof *walk->runs);
    if (!walk->runs)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu64 " placements", count);
    walk->placement_count = (uint32_t)count;
    walk->run_count = (uint32_t)runs;
    if (!strl__placements_are_few(walk)) {
        walk->placement_bytes += bytes;
        walk->resident_bytes += bytes;
    }
    return runs == 1 ? load_page(walk, err) : load_runs(walk, err);
}

/* ---- boxes */

void strl__box_include(strl_box *box, const strl_box *other)
{
    for (int axis = 0; axis < 3; axis++) {
        box->min[axis] = fmin(box->min[axis], other->min[axis]);
        box->max[axis] = fmax(box->max[axis], other->max[axis]);
    }
}

static strl_box box_of_run(const strl__run *run)
{
    strl_box box;
    memcpy(box.min, run->facts.box_min, sizeof box.min);
    memcpy(box.max, run->facts.box_max, sizeof box.max);
    return box;
}

/* As the file tells it where there are several. */
static void bound_only_run(strl_walk *walk)
{
    strl__run *run = &walk->runs[0];
    strl__run_page_bound(walk, run->page);
    strl_far_sums sums = {0};
    strl_box box = run->page->boxes[0];
    for (uint32_t i = 0; i <= (run->page->count - 1) / STRL__FAN; i++) {
        strl__box_include(&box, &run->page->boxes[i]);
        strl_far_add(&sums, &run->page->fars[i]);
    }
    memcpy(run->facts.box_min, box.min, sizeof box.min);
    memcpy(run->facts.box_max, box.max, sizeof box.max);
    run->facts.far = strl_far_end(&sums);
}

/* One box for each STRL__FAN of the level below, or of runs. */
static strl_status add_level(strl_walk *walk, const strl__bound_level *below, uint32_t items, strl_error *err)
{
    strl__bound_level *level = &walk->bound_levels[walk->bound_level_count];
    level->count = (items - 1) / STRL__FAN + 1;
    level->boxes = strl__alloc(level->count, sizeof *level->boxes);
    level->fars = strl__alloc(level->count, sizeof *level->fars);
    walk->bound_level_count++;
    if (!level->boxes || !level->fars)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the boxes of %" PRIu32 " placements",
                          walk->placement_count);
    strl_far_sums sums = {0};
    for (uint32_t i = 0; i < items; i++) {
        strl_box box = below ? below->boxes[i] : box_of_run(&walk->runs[i]);
        const strl_far *far = below ? &below->fars[i] : &walk->runs[i].facts.far;
        if (i % STRL__FAN == 0) {
            level->boxes[i / STRL__FAN] = box;
            sums = (strl_far_sums){0};
        } else {
            strl__box_include(&level->boxes[i / STRL__FAN], &box);
        }
        strl_far_add(&sums, far);
        if (i % STRL__FAN == STRL__FAN - 1 || i + 1 == items)
            level->fars[i / STRL__FAN] = strl_far_end(&sums);
    }
    return STRL_OK;
}

strl_status strl__placements_bound(strl_walk *walk, strl_error *err)
{
    strl_status status = STRL_OK;
    const strl__bound_level *below = NULL;
    if (walk->run_count == 1)
        bound_only_run(walk);
    for (uint32_t items = walk->run_count; status == STRL_OK && items > 1; items = below->count) {
        status = add_level(walk, below, items, err);
        below = &walk->bound_levels[walk->bound_level_count - 1];
    }
    if (status != STRL_OK)
        return status;
    const strl_box whole = below ? below->boxes[0] : box_of_run(&walk->runs[0]);
    memcpy(walk->bounds, whole.min, sizeof whole.min);
    memcpy(walk->bounds + 3, whole.max, sizeof whole.max);
    return STRL_OK;
}

void strl__placements_deinit(strl_walk *walk)
{
    for (uint32_t i = 0; i < walk->bound_level_count; i++) {
        strl__free(walk->bound_levels[i].boxes);
        strl__free(walk->bound_levels[i].fars);
    }
    for (uint32_t i = 0; walk->runs && i < walk->run_count; i++)
        strl__free(walk->runs[i].page);
    strl__free(walk->runs);
}

/* ---- looking */

typedef struct looking {
    strl_walk *walk;
    strl__cut *cut;
    strl_status status;
    strl_error *err;
} looking;

static void draw(looking *self, const strl_box *box, const strl_far *far, double px, uint32_t own_part)
{
    if (self->cut->kind == STRL__CUT_FRONT)
        self->status = strl__far_draw(self->walk, self->cut, box, far, px, own_part, self->err);
}

static void draw_missing(looking *self, const strl_box *box, const strl_far *far)
{
    if (self->cut->kind == STRL__CUT_FRONT)
        self->status = strl__far_fill(self->walk, self->cut, box, far, self->err);
}

/* True where the camera looks past it, or sees no more of it than a point, which is drawn. Else *px is how large it is.
 */
static bool passes_over(looking *self, const strl_box *box, const strl_far *far, double *px)
{
    if (!strl_view_sees(self->cut->view, box))
        return true;
    if (!strl__is_far(self->cut, box, px))
        return false;
    draw(self, box, far, *px, 0);
    return true;
}

/* How many runs from this one on are passed over by a box above them; the highest that begins here is looked at first.
 */
static uint32_t pass_runs(looking *self, uint32_t run)
{
    const strl_walk *walk = self->walk;
    uint32_t level = 0, size = 1;
    double px;
    for (; level < walk->bound_level_count && run % (size * STRL__FAN) == 0; level++)
        size *= STRL__FAN;
    for (; level > 0; level--, size /= STRL__FAN) {
        const strl__bound_level *bounds = &walk->bound_levels[level - 1];
        if (passes_over(self, &bounds->boxes[run / size], &bounds->fars[run / size], &px))
            return size;
    }
    return 0;
}

/* Asks for its page, unless that has failed and waits. */
static void want_run(looking *self, strl__run *run, double px)
{
    strl_walk *walk = self->walk;
    strl__cut *cut = self->cut;
    bool is_front = cut->kind == STRL__CUT_FRONT;
    cut->missing++;
    if (run->residency == STRL__ABSENT && strl__is_waiting(walk, &run->retry)) {
        cut->waits |= !strl__is_given_up(walk, &run->retry);
        return;
    }
    cut->waits = cut->records_missing = true;
    if (run->residency == STRL__PENDING)
        run->request->touched_frame = walk->frame;
    else if (is_front) /* without memory it is asked for in a later frame */
        strl__add_run(&walk->missing, run, px);
    else
        strl__add_run(&walk->prefetch, run, STRL__PREFETCH_SHARE * px / cut->allowed_px);
}

/* The placements of a run that the camera sees; NULL where they are not there, or the cut has no room for them. */
static const strl__run_page *open_run(looking *self, strl__run *run, double px)
{
    strl_walk *walk = self->walk;
    strl__cut *cut = self->cut;
    if (walk->run_count == 1)
        return run->page;
    const strl_box box = box_of_run(run);
    uint64_t bytes = strl__run_bytes(strl__run_placements(walk, run));
    if (cut->bytes > cut->capacity_bytes || bytes > cut->capacity_bytes - cut->bytes) {
        cut->overflow = !cut->stop_at_capacity;
        draw_missing(self, &box, &run->facts.far);
        return NULL;
    }
    cut->bytes += bytes;
    if (run->residency != STRL__RESIDENT) {
        want_run(self, run, px);
        draw_missing(self, &box, &run->facts.far);
        return NULL;
    }
    if (cut->kind != STRL__CUT_FRONT)
        strl__run_touch(walk, run);
    else if (strl__grow(&walk->wanted_runs.items, &walk->wanted_runs.capacity, walk->wanted_runs.count + 1,
                        sizeof *walk->wanted_runs.items))
        walk->wanted_runs.items[walk->wanted_runs.count++] = run;
    else
        self->status = strl__no_memory(self->err);
    return run->page;
}

/* How many placements from the first of a run on are passed over; 0: its page is there and to be looked at. */
static uint32_t pass_run(looking *self, uint32_t at)
{
    strl_walk *walk = self->walk;
    strl__run *run = &walk->runs[at / STRL_RUN_PLACEMENTS];
    uint32_t passed = pass_runs(self, at / STRL_RUN_PLACEMENTS) * STRL_RUN_PLACEMENTS;
    const strl_box box = box_of_run(run);
    double px;
    if (passed)
        return passed;
    return passes_over(self, &box, &run->facts.far, &px) || !open_run(self, run, px) ? STRL_RUN_PLACEMENTS : 0;
}

/* The same of a placement whose page is there, and of the box that begins with it. */
static uint32_t pass_placement(looking *self, uint32_t at)
{
    const strl__run_page *page = self->walk->runs[at / STRL_RUN_PLACEMENTS].page;
    uint32_t within = at % STRL_RUN_PLACEMENTS;
    double px;
    if (within % STRL__FAN == 0 &&
        passes_over(self, &page->boxes[within / STRL__FAN], &page->fars[within / STRL__FAN], &px))
        return STRL__FAN;
    const strl_box box = strl__placement_box(self->walk, &page->items[within]);
    if (!strl_view_sees(self->cut->view, &box))
        return 1;
    if (!strl__is_far(self->cut, &box, &px))
        return 0;
    const strl_far far = strl__placement_far(self->walk, &page->items[within]);
    draw(self, &box, &far, px, page->items[within].own_part);
    return 1;
}

strl_status strl__placements_next(strl_walk *walk, strl__cut *cut, uint32_t from, uint32_t *next,
                                  const strl__placement **placed, strl_error *err)
{
    looking self = {walk, cut, STRL_OK, err};
    uint32_t at = from, passed = strl__placements_are_few(walk) ? 0 : 1;
    while (at < walk->placement_count && passed && !self.status && !cut->overflow) {
        passed = at % STRL_RUN_PLACEMENTS == 0 ? pass_run(&self, at) : 0;
        if (!passed && !self.status)
            passed = pass_placement(&self, at);
        at = passed < walk->placement_count - at ? at + passed : walk->placement_count;
    }
    bool found = at < walk->placement_count && !passed && !self.status;
    *next = found ? at : walk->placement_count;
    *placed = found ? &walk->runs[at / STRL_RUN_PLACEMENTS].page->items[at % STRL_RUN_PLACEMENTS] : NULL;
    return self.status;
}
