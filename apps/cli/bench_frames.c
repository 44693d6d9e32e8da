/* Walking: selecting and refining the front, and whole frames, on one smooth path. */
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "bench.h"
#include "platform/thread.h"
#include "render_model.h"
#include "shared/camera_path.h"

#define PATH_FRAMES 120u
#define ORBIT_FRAMES 720u /* half a degree from one frame to the next */
#define PATH_NEARER 0.6   /* of the way to the middle, at the end */
#define ERROR_PX 1.0
#define MEMORY_BYTES (512ull << 20)
#define WARM_UP_NS 30000000000u /* what is not resident by then is measured as missing */
#define WAIT_NS 500000u

static const uint32_t image_size[2] = {1280, 720};

typedef struct walk_bench {
    strl_render_model *model;
    strl_renderer *null, *target; /* selecting alone; what is measured. May be the same */
    strl_camera_path path;
    double *frames_ms; /* [path.count], owned */
    uint64_t missing_nodes;
} walk_bench;

/* A share of an orbit that comes nearer: splits, collapses and turning in one. */
static strl_status make_path(const strl_render_model *model, strl_camera_path *path, strl_error *err)
{
    strl_path_site site = {.up_axis = model->up_axis};
    memcpy(site.bounds, model->bounds, sizeof site.bounds);
    strl_status status = strl_path_orbit(&site, ORBIT_FRAMES, path, err);
    if (status != STRL_OK)
        return status;
    path->count = PATH_FRAMES;
    for (size_t f = 0; f < path->count; f++) {
        strl_path_frame *frame = &path->frames[f];
        double share = PATH_NEARER * (double)f / (double)(path->count - 1);
        for (int i = 0; i < 3; i++)
            frame->eye[i] += share * (frame->target[i] - frame->eye[i]);
    }
    return STRL_OK;
}

static strl_status draw(walk_bench *self, strl_renderer *renderer, size_t frame, strl_image_stats *stats,
                        strl_error *err)
{
    strl_camera camera = strl_path_camera(&self->path, frame, image_size);
    strl_draw_options options = {0};
    options.sky_up[self->model->up_axis] = 1;
    *stats = (strl_image_stats){0};
    return self->model->klass->draw(self->model, renderer, &camera, &options, stats, err);
}

/* Until all that the path wants is resident: what is measured afterwards does not depend on the disk. */
static strl_status warm_up(const strl_bench *bench, walk_bench *self, strl_error *err)
{
    uint64_t start = strl_clock_ns();
    strl_status status = STRL_OK;
    for (size_t f = 0; status == STRL_OK && f < self->path.count; f++) {
        strl_image_stats stats;
        do {
            status = draw(self, self->null, f, &stats, err);
            strl_cli_progress_update(bench->progress, "load", f + 1, self->path.count, "frames");
            if (status == STRL_OK && bench->stopped())
                status = strl__fail(err, STRL_ERR_CANCELLED, "stopped while loading nodes");
            if (stats.missing_nodes > 0)
                strl_sleep_ns(WAIT_NS);
        } while (status == STRL_OK && stats.missing_nodes > 0 && strl_clock_ns() - start < WARM_UP_NS);
    }
    /* the first image of a system makes its shaders */
    strl_image_stats stats;
    return status == STRL_OK ? draw(self, self->target, 0, &stats, err) : status;
}

/* One pass; its median of the figure. */
static strl_status walk_once(const strl_bench *bench, walk_bench *self, bool selecting, double *median, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t f = 0; status == STRL_OK && f < self->path.count; f++) {
        strl_image_stats stats;
        status = draw(self, self->target, f, &stats, err);
        self->frames_ms[f] = 1e-6 * (double)(selecting ? stats.select_ns : stats.frame_ns);
        self->missing_nodes += stats.missing_nodes;
        strl_cli_progress_update(bench->progress, selecting ? "select" : "draw", f + 1, self->path.count, "frames");
        if (status == STRL_OK && bench->stopped())
            status = strl__fail(err, STRL_ERR_CANCELLED, "stopped while walking");
    }
    if (status == STRL_OK)
        *median = strl_bench_median(self->frames_ms, self->path.count);
    return status;
}

static strl_status open_walk(strl_bench *bench, walk_bench *self, strl_error *err)
{
    const strl_render_model_desc desc = {.location = {.name = bench->container},
                                         .realtime = true,
                                         .error_px = ERROR_PX,
                                         .cull = bench->cull,
                                         .memory_bytes = MEMORY_BYTES,
                                         .progress = bench->progress};
    const strl_renderer_desc null = {.backend = STRL_BACKEND_NULL, .width = image_size[0], .height = image_size[1]};
    strl_status status = strl_bench_need_container(bench, err);
    if (status == STRL_OK)
        status = strl_renderer_create(&null, &self->null, err);
    if (status == STRL_OK)
        status = strl_render_model_open(&desc, &self->model, err);
    if (status == STRL_OK)
        status = make_path(self->model, &self->path, err);
    if (status == STRL_OK) {
        self->frames_ms = strl__alloc(self->path.count, sizeof *self->frames_ms);
        if (!self->frames_ms)
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu frames", self->path.count);
    }
    return status;
}

static void close_walk(walk_bench *self)
{
    if (self->target != self->null)
        strl_renderer_destroy(self->target);
    strl_renderer_destroy(self->null);
    if (self->model)
        self->model->klass->close(self->model);
    strl_path_deinit(&self->path);
    strl__free(self->frames_ms);
}

static void write_note(const walk_bench *self, strl_cull cull, strl_bench_figure *figure)
{
    static const char *const backends[] = {
        [STRL_BACKEND_GL45] = "gl45", [STRL_BACKEND_GL3] = "gl3", [STRL_BACKEND_NULL] = "null"};
    int used =
        snprintf(figure->note, sizeof figure->note, "%ux%u at 1 px%s, %s", image_size[0], image_size[1],
                 cull == STRL_CULL_BACK ? " without back faces" : "", backends[strl_renderer_backend(self->target)]);
    if (self->target != self->null)
        used += snprintf(figure->note + used, sizeof figure->note - (size_t)used, ": %.80s",
                         strl_renderer_device(self->target));
    if (self->missing_nodes > 0)
        snprintf(figure->note + used, sizeof figure->note - (size_t)used, "; %llu nodes missing",
                 (unsigned long long)self->missing_nodes);
}

static strl_status measure(const strl_bench *bench, walk_bench *self, bool selecting, strl_bench_figure *figure,
                           strl_error *err)
{
    strl_status status = warm_up(bench, self, err);
    for (unsigned run = 0; status == STRL_OK && run < bench->runs; run++)
        status = walk_once(bench, self, selecting, &figure->values[figure->count++], err);
    if (status == STRL_OK)
        write_note(self, bench->cull, figure);
    return status;
}

strl_status strl_bench_select(strl_bench *bench, strl_error *err)
{
    walk_bench self = {0};
    strl_bench_figure *figure;
    strl_status status = strl_bench_add_figure(bench, "select", "ms", &figure, err);
    if (status == STRL_OK)
        status = open_walk(bench, &self, err);
    self.target = self.null;
    if (status == STRL_OK)
        status = measure(bench, &self, true, figure, err);
    close_walk(&self);
    return status;
}

/* A system without OpenGL has no such figure, and the report says so. */
strl_status strl_bench_draw(strl_bench *bench, strl_error *err)
{
    const strl_renderer_desc desc = {.width = image_size[0], .height = image_size[1]};
    walk_bench self = {0};
    strl_bench_figure *figure;
    strl_status status = strl_bench_add_figure(bench, "draw", "ms", &figure, err);
    if (status != STRL_OK)
        return status;
    strl_error missing = {0};
    status = strl_renderer_create(&desc, &self.target, &missing);
    if (status == STRL_ERR_UNSUPPORTED) {
        snprintf(figure->note, sizeof figure->note, "%.150s", missing.message);
        return STRL_OK;
    }
    if (status != STRL_OK) {
        *err = missing;
        return status;
    }
    status = open_walk(bench, &self, err);
    if (status == STRL_OK)
        status = measure(bench, &self, false, figure, err);
    close_walk(&self);
    return status;
}
