/* stroll render: images of a model without a window. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "coarse.h"
#include "interrupt.h"
#include "options.h"
#include "platform/thread.h"
#include "progress.h"
#include "remote.h"
#include "render_model.h"
#include "render_output.h"
#include "shared/camera_path.h"
#include "shared/units.h"

#define DEFAULT_FPS 60.0
#define WALKER_METRES 1.7

/* The command line, with its defaults. */
typedef struct render_options {
    const char *input, *camera, *path, *save_path, *output, *stats;
    uint64_t frames, seed, supersample, memory_bytes, gpu_memory_bytes;
    uint64_t begun_ns;
    uint32_t size[2];
    double error_px, splat_px, fps;
    bool full, realtime, depth, wireframe, flat, no_occlusion, frames_given, quiet;
    int backend, debug, cull;
    strl_cli_remote remote;
} render_options;

#define DEFAULT_MEMORY_BYTES (512ull << 20)
#define SHOWN_BYTES 300 /* of an address, in a sentence */

static const char *const backend_words = "auto|gl45|gl3|null|gles";
enum { BACKEND_AUTO, BACKEND_GL45, BACKEND_GL3, BACKEND_NULL, BACKEND_GLES };

/* ---- cameras */

/* What a path probe needs: the model is drawn at the probe's size, then the renderer gets its own size back. */
typedef struct prober {
    strl_render_model *model;
    strl_renderer *renderer;
    uint32_t lacks; /* nodes that an image was without, at most */
} prober;

static strl_status probe(void *context, const strl_camera *camera, float *depth, strl_error *err)
{
    prober *self = context;
    strl_image_stats stats = {0};
    const strl_draw_options options = {0};
    strl_status status = strl_renderer_resize(self->renderer, camera->width, camera->height, err);
    if (status == STRL_OK)
        status = self->model->klass->draw(self->model, self->renderer, camera, &options, &stats, err);
    self->lacks = stats.missing_nodes > self->lacks ? stats.missing_nodes : self->lacks;
    return status == STRL_OK ? strl_renderer_read_depth(self->renderer, depth, err) : status;
}

static strl_path_site make_site(const strl_render_model *model, prober *looks)
{
    strl_path_site site = {.up_axis = model->up_axis, .probe = probe, .context = looks};
    double centre[3], radius, metres = strl_unit_metres(model->unit);
    memcpy(site.bounds, model->bounds, sizeof site.bounds);
    strl_path_sphere(site.bounds, centre, &radius);
    site.eye_height = metres > 0 ? WALKER_METRES / metres : radius / 50;
    return site;
}

/* What needs an image of the surface. */
static bool is_along_surface(const char *path)
{
    return strcmp(path, "walk") == 0 || strcmp(path, "flythrough") == 0;
}

static bool is_named_path(const char *path)
{
    return strcmp(path, "orbit") == 0 || is_along_surface(path);
}

static strl_status load_path(const char *file, strl_camera_path *path, strl_error *err)
{
    strl_status status = strl_path_load(file, path, err);
    if (status == STRL_ERR_IO)
        return strl__fail_context(err, status, "--path is orbit, walk, flythrough or a path file");
    return status;
}

/* A path along the surface shows that to the probe: any size the renderer had is restored. *lacks: nodes that the
 * surface was without. */
static strl_status make_path(const render_options *o, strl_render_model *model, strl_renderer *renderer,
                             strl_camera_path *path, uint32_t *lacks, strl_error *err)
{
    prober looks = {model, renderer, 0};
    strl_path_site site = make_site(model, &looks);
    strl_status status;
    if (o->camera || !o->path)
        status = strl_path_parse(&site, o->camera ? o->camera : "", path, err);
    else if (strcmp(o->path, "orbit") == 0)
        status = strl_path_orbit(&site, o->frames, path, err);
    else if (strcmp(o->path, "walk") == 0)
        status = strl_path_walk(&site, o->frames, o->seed, path, err);
    else if (strcmp(o->path, "flythrough") == 0)
        status = strl_path_flythrough(&site, o->frames, o->seed, path, err);
    else
        status = load_path(o->path, path, err);
    if (status == STRL_OK)
        status = strl_renderer_resize(renderer, o->size[0], o->size[1], err);
    *lacks = looks.lacks;
    return status;
}

/* ---- frames */

static strl_draw_options draw_options(const render_options *o, const strl_render_model *model)
{
    strl_draw_options options = {
        .debug = (strl_debug_colour)o->debug, .wireframe = o->wireframe, .flat = o->flat, .background = {30, 33, 38}};
    options.sky_up[model->up_axis] = 1;
    return options;
}

/* Of the images drawn so far, those that lack something which could not be read. Zero-initialise. */
typedef struct lacking_images {
    uint64_t frames;
    uint32_t most_nodes; /* that one of them lacks */
} lacking_images;

/* What failed and was there in the end is in the lines of --stats alone. Without waiting something is always on its
 * way: there it is what the last image lacks after reads that failed. */
static void count_lacking(const render_options *o, const strl_image_stats *stats, lacking_images *lacking)
{
    if (o->realtime)
        *lacking = (lacking_images){0};
    if (stats->missing_nodes == 0 || (o->realtime && stats->faults == 0))
        return;
    lacking->frames++;
    lacking->most_nodes = stats->missing_nodes > lacking->most_nodes ? stats->missing_nodes : lacking->most_nodes;
}

/* The images are written all the same. Whoever waits for them was promised all of it: a failure. */
static strl_status judge(const render_options *o, size_t frames, const strl_image_stats *last,
                         const lacking_images *lacking, const strl_cli_coarse *coarse, strl_error *err)
{
    if (!o->quiet)
        strl_cli_coarse_report(coarse, o->memory_bytes);
    if (lacking->frames == 0)
        return STRL_OK;
    char shown[SHOWN_BYTES];
    const char *name = strl_location_shown(o->input, shown, sizeof shown);
    if (!o->realtime)
        return strl__fail(err, STRL_ERR_IO,
                          "%s: %" PRIu64 " of %zu frame%s coarser than asked for, %" PRIu32
                          " node%s could not be read, the last fault: %.200s",
                          name, lacking->frames, frames, frames == 1 ? " is" : "s are", lacking->most_nodes,
                          strl_cli_plural(lacking->most_nodes), last->last_fault);
    if (!o->quiet)
        fprintf(stderr,
                "stroll: %s: the last frame is without %" PRIu32 " node%s that had not come; %" PRIu64
                " read%s failed before it, the last because %s\n",
                name, lacking->most_nodes, strl_cli_plural(lacking->most_nodes), last->faults,
                strl_cli_plural(last->faults), last->last_fault);
    return STRL_OK;
}

/* Holds a realtime path to its rate; late frames follow at once. */
static void keep_pace(const render_options *o, strl_render_model *model, uint64_t start_ns, size_t frame)
{
    uint64_t due = start_ns + (uint64_t)((double)frame * 1e9 / o->fps), now = strl_clock_ns();
    if (o->realtime && now < due && model->klass->idle)
        model->klass->idle(model, due - now);
}

static strl_status render_frames(const render_options *o, strl_render_model *model, strl_renderer *renderer,
                                 const strl_camera_path *path, strl_cli_progress *progress, strl_error *err)
{
    strl_render_output output;
    strl_draw_options options = draw_options(o, model);
    strl_render_output_desc desc = {.path = o->output,
                                    .stats = o->stats,
                                    .depth = o->depth,
                                    .realtime = o->realtime,
                                    .size = {o->size[0], o->size[1]},
                                    .cameras = path};
    memcpy(desc.background, options.background, sizeof desc.background);
    strl_status status = strl_render_output_init(&output, &desc, err);
    if (status != STRL_OK)
        return status;
    uint64_t start = strl_clock_ns();
    strl_image_stats stats = {0};
    strl_cli_coarse coarse = {0};
    lacking_images lacking = {0};
    for (size_t f = 0; status == STRL_OK && f < path->count; f++) {
        strl_camera camera = strl_path_camera(path, f, o->size);
        stats = (strl_image_stats){0};
        keep_pace(o, model, start, f);
        uint64_t disk_waits = strl_thread_disk_waits();
        status = model->klass->draw(model, renderer, &camera, &options, &stats, err);
        stats.disk_waits = strl_thread_disk_waits() - disk_waits;
        stats.elapsed_ns = strl_clock_ns() - o->begun_ns;
        if (status == STRL_OK)
            status = strl_render_output_add(&output, f, renderer, &stats, err);
        strl_cli_coarse_add(&coarse, o->error_px, o->splat_px, stats.allowed_error_px, stats.max_error_px);
        count_lacking(o, &stats, &lacking);
        strl_cli_progress_update(progress, "render", f + 1, path->count, "frames");
        if (status == STRL_OK)
            status = strl_cli_check_interrupt(err);
    }
    if (status == STRL_OK)
        status = strl_render_output_finish(&output, err);
    strl_render_output_deinit(&output);
    strl_cli_progress_end(progress);
    if (status == STRL_OK)
        status = judge(o, path->count, &stats, &lacking, &coarse, err);
    return status;
}

/* Before anything is read or drawn. */
static strl_status check_outputs(const render_options *o, strl_error *err)
{
    strl_status status = strl_render_output_check(o->output, err);
    if (status == STRL_OK && o->stats)
        status = strl_output_check(o->stats, err);
    if (status == STRL_OK && o->save_path)
        status = strl_output_check(o->save_path, err);
    return status;
}

static strl_status open_renderer(const render_options *o, uint64_t supersample, strl_renderer **renderer,
                                 strl_error *err)
{
    static const strl_backend backends[] = {STRL_BACKEND_DEFAULT, STRL_BACKEND_GL45, STRL_BACKEND_GL3,
                                            STRL_BACKEND_NULL, STRL_BACKEND_GL3};
    const strl_renderer_desc desc = {.backend = backends[o->backend],
                                     .gles = o->backend == BACKEND_GLES,
                                     .width = o->size[0],
                                     .height = o->size[1],
                                     .supersample = (uint32_t)supersample,
                                     .gpu_memory_bytes = o->gpu_memory_bytes};
    return strl_renderer_create(&desc, renderer, err);
}

/* A path along the surface of a container is one for all that render it, however they draw it: it is made in a walk of
 * its own, with the defaults, that waits for all it wants, and is none where the walk can't have that. Others are made
 * round the model that is drawn. */
static strl_status survey_path(const render_options *o, const strl_location *location, strl_camera_path *path,
                               strl_error *err)
{
    const strl_render_model_desc desc = {
        .location = *location, .error_px = 1, .splat_px = 1, .memory_bytes = DEFAULT_MEMORY_BYTES};
    uint32_t lacks = 0;
    strl_render_model *model = NULL;
    strl_renderer *renderer = NULL;
    bool is_container = false;
    if (!o->path || !is_along_surface(o->path))
        return STRL_OK;
    strl_status status = strl_location_is_container(&desc.location, &is_container, err);
    if (status == STRL_OK && is_container)
        status = open_renderer(o, 1, &renderer, err);
    if (status == STRL_OK && is_container)
        status = strl_render_walk_open(&desc, &model, err);
    if (status == STRL_OK && is_container)
        status = make_path(o, model, renderer, path, &lacks, err);
    if (model)
        model->klass->close(model);
    strl_renderer_destroy(renderer);
    char shown[SHOWN_BYTES];
    if (status == STRL_OK && lacks)
        return strl__fail(
            err, STRL_ERR_IO,
            "%s: %" PRIu32
            " node%s of the surface that --path %s goes along could not be read: try again, or give a path file",
            strl_location_shown(o->input, shown, sizeof shown), lacks, strl_cli_plural(lacks), o->path);
    return status;
}

/* *camera_wrong: it is the specification of the camera that fails. */
static strl_status render(render_options *o, strl_cli_progress *progress, bool *camera_wrong, strl_error *err)
{
    strl_render_model *model = NULL;
    strl_renderer *renderer = NULL;
    strl_camera_path path = {0};
    uint32_t lacks; /* of the surface of what is no container: nothing */
    strl_render_model_desc desc = {.full = o->full,
                                   .realtime = o->realtime,
                                   .error_px = o->error_px,
                                   .splat_px = o->splat_px,
                                   .cull = (strl_cull)o->cull,
                                   .memory_bytes = o->memory_bytes,
                                   .progress = progress};
    strl_cli_catch_interrupts();
    strl_status status = check_outputs(o, err);
    if (status == STRL_OK)
        status = strl_cli_locate(&o->remote, o->input, &desc.location, err);
    if (status == STRL_OK)
        status = survey_path(o, &desc.location, &path, err);
    if (status == STRL_OK)
        status = open_renderer(o, o->supersample, &renderer, err);
    if (status == STRL_OK)
        status = strl_render_model_open(&desc, &model, err);
    if (status == STRL_OK && path.count == 0) {
        status = make_path(o, model, renderer, &path, &lacks, err);
        *camera_wrong = o->camera && status == STRL_ERR_ARGUMENT;
    }
    if (status == STRL_OK && o->save_path)
        status = strl_path_save(&path, o->save_path, err);
    if (status == STRL_OK)
        status = render_frames(o, model, renderer, &path, progress, err);
    strl_path_deinit(&path);
    if (model)
        model->klass->close(model);
    strl_renderer_destroy(renderer);
    return status;
}

/* ---- the command */

static int check(const strl_cli_args *args, const render_options *o)
{
    if (o->camera && o->path)
        return strl_cli_usage_error(args, "--camera and --path exclude each other");
    if (!o->output && !o->stats && !o->save_path)
        return strl_cli_usage_error(args, "nothing to write: give -o, --stats or --save-path");
    if (o->frames_given && !(o->path && is_named_path(o->path)))
        return strl_cli_usage_error(args, "--frames says how many frames --path orbit, walk or flythrough gets; %s",
                                    o->path ? "a path file has its own" : "there is no such path here");
    if (o->backend == BACKEND_NULL && o->output)
        return strl_cli_usage_error(
            args, "the null backend draws no image for -o %s: leave -o out or choose another backend", o->output);
    if (o->backend == BACKEND_NULL && o->path && is_along_surface(o->path))
        return strl_cli_usage_error(
            args, "the null backend sees no surface to go along: save the path with another one and load it");
    if (o->full && o->realtime)
        return strl_cli_usage_error(args, "--full draws everything and --realtime what is there: choose one");
    return -1;
}

/* Fills o from the command line. Returns as strl_cli_parse does. */
static int parse(strl_cli_args *args, render_options *o)
{
    const strl_cli_option options[] = {
        {.name = "camera",
         .kind = STRL_CLI_STRING,
         .value = &o->camera,
         .argument = "SPEC",
         .help = "one image: \"eye x y z target x y z up x y z fov DEG\" (the orbit's first frame)"},
        {.name = "path",
         .kind = STRL_CLI_STRING,
         .value = &o->path,
         .argument = "FILE|orbit|walk|flythrough",
         .help =
             "many images; walk and flythrough go along the surface, of a container in the same places however it is drawn"},
        {.name = "frames",
         .kind = STRL_CLI_COUNT,
         .value = &o->frames,
         .given = &o->frames_given,
         .help = "of a named path (60)",
         .least = 1,
         .most = 1e6},
        {.name = "seed", .kind = STRL_CLI_COUNT, .value = &o->seed, .help = "of a named path (1)"},
        {.name = "save-path",
         .kind = STRL_CLI_STRING,
         .value = &o->save_path,
         .argument = "FILE",
         .help = "write the cameras as JSON, for --path of another render"},
        {.name = "size", .kind = STRL_CLI_SIZE, .value = o->size, .help = "pixels of an image (1280x720)"},
        {.name = "error",
         .kind = STRL_CLI_REAL,
         .value = &o->error_px,
         .argument = "PX",
         .help = "allowed pixel error (1)",
         .least = 1e-6,
         .most = 1e6},
        {.name = "splat",
         .kind = STRL_CLI_REAL,
         .value = &o->splat_px,
         .argument = "PX",
         .help =
             "of sample trees: cells that cover no more than PX x PX pixels are drawn as splats of that size, which is the error that "
             "they are allowed then (as --error)",
         .least = 1,
         .most = 64},
        {.name = "cull",
         .kind = STRL_CLI_ENUM,
         .value = &o->cull,
         .argument = "none|back",
         .help = "faces not to be drawn: back = those whose corners come clockwise as seen; for closed models (none)"},
        {.name = "full",
         .kind = STRL_CLI_FLAG,
         .value = &o->full,
         .help = "the finest level of a container; the triangles of a mesh file as read, held in memory"},
        {.name = "realtime",
         .kind = STRL_CLI_REAL,
         .value = &o->fps,
         .argument = "FPS",
         .given = &o->realtime,
         .value_optional = true,
         .help = "never wait for bytes; keep this rate (60)",
         .least = 1e-3,
         .most = 1e6},
        {.name = "no-occlusion",
         .kind = STRL_CLI_FLAG,
         .value = &o->no_occlusion,
         .help = "draw hidden nodes too (always so in this version)"},
        {.name = "memory",
         .letter = 'm',
         .kind = STRL_CLI_BYTES,
         .value = &o->memory_bytes,
         .help = "decoded nodes held (512M)",
         .least = 1 << 20,
         .most = 0x1p50},
        {.name = "gpu-memory",
         .kind = STRL_CLI_BYTES,
         .value = &o->gpu_memory_bytes,
         .help = "buffers of nodes (512M)",
         .least = STRL_RENDERER_LEAST_GPU_BYTES,
         .most = 0x1p50},
        {.name = "supersample",
         .kind = STRL_CLI_COUNT,
         .value = &o->supersample,
         .argument = "K",
         .help = "draw K times wider and higher, filter in linear light (1)",
         .least = 1,
         .most = 8},
        {.name = "depth",
         .kind = STRL_CLI_FLAG,
         .value = &o->depth,
         .help = "write linear depth too: frame_00000.pfm, 32-bit floats, infinity = background"},
        {.name = "output",
         .letter = 'o',
         .kind = STRL_CLI_STRING,
         .value = &o->output,
         .argument = "PNG or DIR",
         .help = "where images go: frame_00000.png ..., contact.png and path.json in a folder"},
        {.name = "stats",
         .kind = STRL_CLI_STRING,
         .value = &o->stats,
         .argument = "FILE.jsonl",
         .help = "one JSON object a frame"},
        STRL_CLI_REMOTE_OPTIONS(&o->remote),
        {.name = "backend",
         .kind = STRL_CLI_ENUM,
         .value = &o->backend,
         .argument = backend_words,
         .help = "what draws (auto)"},
        {.name = "debug",
         .kind = STRL_CLI_ENUM,
         .value = &o->debug,
         .argument = "none|cluster|level|error",
         .help = "colour by it (none)"},
        {.name = "wireframe", .kind = STRL_CLI_FLAG, .value = &o->wireframe, .help = "edges only"},
        {.name = "flat", .kind = STRL_CLI_FLAG, .value = &o->flat, .help = "normals of triangles instead of vertices"},
    };
    const strl_cli_usage usage = {
        .positional = "MODEL",
        .least = 1,
        .most = 1,
        .options = options,
        .option_count = STRL_CLI_COUNT_OF(options),
        .notes =
            "MODEL is a container, as a file or behind http:// or https://, or with --full also a PLY, STL, OBJ or glTF\n"
            "file. In the lines of --stats max_error_px is the largest pixel error of what was drawn, of splats their\n"
            "size, and null where the eye is inside a node's box: no pixel error bounds what is that near. allowed_error_px\n"
            "is --error, or more where --memory is short."};
    strl_cli_list inputs;
    int stop = strl_cli_parse(args, &usage, &inputs);
    if (stop >= 0)
        return stop;
    o->input = inputs.items[0];
    o->quiet = args->quiet;
    return check(args, o);
}

static int run(strl_cli_args *args)
{
    render_options o = {.frames = 60,
                        .seed = 1,
                        .supersample = 1,
                        .memory_bytes = DEFAULT_MEMORY_BYTES,
                        .gpu_memory_bytes = 512ull << 20,
                        .size = {1280, 720},
                        .error_px = 1,
                        .fps = DEFAULT_FPS,
                        .begun_ns = strl_clock_ns()};
    strl_cli_progress progress;
    strl_error err = {0};
    bool camera_wrong = false;
    int stop = parse(args, &o);
    if (stop >= 0)
        return stop;
    strl_cli_progress_init(&progress, o.quiet);
    strl_status status = render(&o, &progress, &camera_wrong, &err);
    strl_cli_progress_end(&progress);
    if (camera_wrong)
        return strl_cli_usage_error(args, "%s", err.message);
    return status == STRL_OK ? 0 : strl_cli_fail(&err);
}

STRL_CLI_COMMAND(render, "draw images of a model without a window", run);
