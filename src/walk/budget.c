/* The allowed error under a tight budget. It moves on a geometric scale of quarter octaves: up at
 * once where the wanted cut does not fit, down by a step a frame where the finer cut would leave
 * some room, so that it does not swing. Bytes are known from records before anything is fetched, but for those of
 * bricks that are opened partly: these are estimated from what came of late, so that under a tight budget what fits
 * depends a little on the way there. */
#include "walk/internal.h"

#include <math.h>

#define STEPS_PER_OCTAVE 4.0
/* Beyond 2^16 times the error the cut simply stops where memory does: next to the eye the error has
 * no bound. */
#define MOST_COARSENING 64u
/* A finer cut must fit into this share of what there is. */
#define REFINE_SHARE 0.9
#define GUARD_SINKS 0.9 /* in a frame in which the camera moves */
/* Less is held than this: what more may come of it has room. */
#define TIGHT_SHARE 0.5
/* Records idle for longer make room for nodes. */
#define COLD_FRAMES 64u

static double allowed_px(const strl_walk *walk, uint32_t coarsening)
{
    return walk->error_px * exp2(coarsening / STEPS_PER_OCTAVE);
}

static strl_status run_at(strl_walk *walk, const strl_view *view, strl__cut_kind kind, uint32_t coarsening,
                          double share, strl__cut *cut, strl_error *err)
{
    uint64_t capacity = walk->memory_bytes - walk->treelet_bytes - walk->placement_bytes;
    *cut = (strl__cut){.kind = kind,
                       .view = view,
                       .allowed_px = allowed_px(walk, coarsening),
                       .capacity_bytes = share < 1 ? (uint64_t)(share * (double)capacity) : capacity,
                       .stop_at_capacity = kind == STRL__CUT_FRONT && coarsening == MOST_COARSENING};
    return strl__cut_run(walk, cut, err);
}

/* A step finer, where that fits. *pending: it cannot be told before more records are here. */
static strl_status try_finer(strl_walk *walk, const strl_view *view, strl__cut *cut, bool *pending, strl_error *err)
{
    strl__cut probe;
    size_t asked = walk->prefetch.count;
    strl_status status = run_at(walk, view, STRL__CUT_PROBE, walk->coarsening - 1, REFINE_SHARE, &probe, err);
    *pending = false;
    if (probe.overflow) /* it is known without them, and to fetch them might evict what the probe has looked at */
        walk->prefetch.count = asked;
    if (status != STRL_OK || probe.overflow)
        return status;
    *pending = true;
    if (probe.records_missing)
        return STRL_OK;
    walk->coarsening--;
    walk->went_finer = true;
    return run_at(walk, view, STRL__CUT_FRONT, walk->coarsening, 1, cut, err);
}

strl_status strl__budget_cut(strl_walk *walk, const strl_view *view, strl__cut *cut, strl_error *err)
{
    bool moved = false, pending = false;
    walk->is_tight = walk->coarsening > 0 || walk->lacked_room ||
                     (double)walk->resident_bytes > TIGHT_SHARE * (double)walk->memory_bytes;
    if (walk->coarsening > 0 && walk->frame > COLD_FRAMES)
        strl__treelet_evict_cold(walk, walk->frame - COLD_FRAMES);
    strl_status status = run_at(walk, view, STRL__CUT_FRONT, walk->coarsening, 1, cut, err);
    walk->went_finer &= walk->stands;
    if (cut->overflow && walk->went_finer) /* a finer cut seemed to fit, and what came of it did not */
        walk->share_guard *= 2;
    else if (!walk->stands)
        walk->share_guard = fmax(STRL__LEAST_GUARD, GUARD_SINKS * walk->share_guard);
    walk->went_finer &= !cut->overflow;
    while (status == STRL_OK && cut->overflow) {
        walk->coarsening++;
        moved = true;
        status = run_at(walk, view, STRL__CUT_FRONT, walk->coarsening, 1, cut, err);
    }
    if (status == STRL_OK && !moved && walk->coarsening > 0)
        status = try_finer(walk, view, cut, &pending, err);
    cut->waits |= moved || pending;
    walk->stats.allowed_error_px = allowed_px(walk, walk->coarsening);
    return status;
}
