/* A walk through a container. Settled: fronts are selected until the wanted one is resident, then drawn. Realtime:
 * one front, drawn as far as it is there. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "interrupt.h"
#include "jobs/pool.h"
#include "platform/thread.h"
#include "render_container.h"
#include "render_model.h"
#include "shared/naming.h"
#include "stroll/walk.h"

#define READ_THREADS 2u
#define WAIT_NS 200000u
#define QUIET_FRONTS 16u  /* without news double the wait, */
#define MOST_DOUBLINGS 4u /* so often: a network takes its time */
/* Fronts after which a settled image is given up where nothing is under way: two seconds of nothing. What is under way
 * is answered: a source that fails says so in its time. */
#define MOST_IDLE_FRONTS 650u

typedef struct walk_model {
    strl_render_model base;
    strl_walk *walk;
    strl_pool *pool;
    strl_executor executor;
    const char *path; /* borrowed, for sentences */
    bool realtime;
} walk_model;

static strl_status submit(void *context, void (*run)(void *job), void *job, strl_error *err)
{
    return strl_pool_submit(context, run, job, err);
}

static strl_status fail_unsettled(const strl_walk_stats *stats, strl_error *err)
{
    return strl__fail(err, STRL_ERR_IO, "the front does not become resident: %" PRIu32 " nodes are missing%s%.200s",
                      stats->missing_nodes, stats->last_fault[0] ? ", last fault: " : " and nothing arrives",
                      stats->last_fault);
}

static void wait_for_news(uint32_t quiet)
{
    uint32_t doublings = quiet / QUIET_FRONTS;
    strl_sleep_ns(WAIT_NS << (doublings < MOST_DOUBLINGS ? doublings : MOST_DOUBLINGS));
}

/* Selects until nothing is missing. */
static strl_status settle(walk_model *self, const strl_camera *camera, strl_draw_list *list, strl_image_stats *stats,
                          strl_error *err)
{
    uint32_t quiet = 0, idle = 0;
    for (;;) {
        strl_status status = strl_walk_frame(self->walk, camera, list, err);
        const strl_walk_stats *now = strl_walk_get_stats(self->walk);
        stats->fronts++;
        stats->requests += now->requests;
        stats->bytes_read += now->bytes_read;
        stats->select_ns = now->select_ns;
        if (status != STRL_OK || self->realtime || strl_walk_settled(self->walk))
            return status;
        status = strl_cli_check_interrupt(err);
        if (status != STRL_OK)
            return status;
        bool busy = now->bytes_read || now->splits || now->collapses || now->vertex_splits || now->vertex_collapses;
        quiet = busy ? 0 : quiet + 1;
        idle = busy || now->requests_pending ? 0 : idle + 1;
        if (idle > MOST_IDLE_FRONTS)
            return fail_unsettled(now, err);
        if (!busy)
            wait_for_news(quiet);
    }
}

static void fill_stats(const strl_walk_stats *walk, strl_image_stats *stats)
{
    stats->nodes_culled = walk->nodes_culled;
    stats->nodes_backfacing = walk->nodes_backfacing;
    stats->resident_bytes = walk->resident_bytes;
    stats->missing_nodes = walk->missing_nodes;
    stats->splats = walk->splats;
    stats->max_error_px = walk->max_error_px;
    stats->allowed_error_px = walk->allowed_error_px;
    stats->faults = walk->faults;
    stats->remote = walk->remote;
    stats->network = walk->network;
    memcpy(stats->last_fault, walk->last_fault, sizeof stats->last_fault);
}

static strl_status walk_draw(strl_render_model *model, strl_renderer *renderer, const strl_camera *camera,
                             const strl_draw_options *options, strl_image_stats *stats, strl_error *err)
{
    walk_model *self = (walk_model *)model;
    strl_draw_list list;
    uint64_t start = strl_clock_ns();
    strl_status status = settle(self, camera, &list, stats, err);
    if (status != STRL_OK)
        return strl_name_file(self->path, status, err);
    fill_stats(strl_walk_get_stats(self->walk), stats);
    uint64_t selected = strl_clock_ns();
    strl_render_stats drawn;
    status = strl_renderer_draw(renderer, camera, &list, options, &drawn, err);
    strl_renderer_finish(renderer);
    uint64_t end = strl_clock_ns();
    stats->draw_ns = end - selected;
    stats->frame_ns = end - start;
    strl_render_add_stats(stats, &drawn);
    return status;
}

static void walk_idle(strl_render_model *model, uint64_t budget_ns)
{
    (void)model;
    strl_sleep_ns(budget_ns); /* reading and decoding have threads of their own */
}

static void walk_close(strl_render_model *model)
{
    walk_model *self = (walk_model *)model;
    strl_walk_close(self->walk);
    strl_pool_destroy(self->pool);
    strl__free(self);
}

static const strl_render_model_class walk_class = {.draw = walk_draw, .idle = walk_idle, .close = walk_close};

static strl_status open_walk(walk_model *self, const strl_render_model_desc *desc, strl_error *err)
{
    strl_source *source = NULL;
    unsigned processors = strl_cpu_count();
    strl_status status = strl_pool_create(processors > 1 ? processors - 1 : 1, &self->pool, err);
    if (status == STRL_OK)
        status = strl_location_open_source(&desc->location, READ_THREADS, &source, err);
    if (status != STRL_OK)
        return status;
    self->executor = (strl_executor){self->pool, submit};
    const strl_walk_desc walk = {.memory_bytes = desc->memory_bytes,
                                 .error_px = desc->error_px,
                                 .splat_px = desc->splat_px,
                                 .cull = desc->cull,
                                 .executor = &self->executor};
    status = strl_walk_open(source, &walk, &self->walk, err);
    if (status == STRL_OK) /* up axis and unit are not the walk's business */
        strl_render_container_facts(strl_walk_container(self->walk), &self->base);
    return status;
}

strl_status strl_render_walk_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err)
{
    walk_model *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a model");
    self->base.klass = &walk_class;
    self->realtime = desc->realtime;
    self->path = desc->location.name;
    strl_status status = strl_name_file(self->path, open_walk(self, desc, err), err);
    if (status != STRL_OK) {
        walk_close(&self->base);
        return status;
    }
    *model = &self->base;
    return STRL_OK;
}
