/* stroll view: a window on a container. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "coarse.h"
#include "options.h"
#include "remote.h"
#include "stroll/render.h"
#include "user_folder.h"
#include "viewer/viewer.h"

/* All frames of a session. */
typedef struct session {
    uint64_t frames, total_ns, longest_ns, select_ns;
    strl_viewer_frame last;
    strl_cli_coarse coarse;
} session;

static void add_frame(void *context, const strl_viewer_frame *frame)
{
    session *all = context;
    all->frames++;
    all->total_ns += frame->frame_ns;
    all->select_ns += frame->select_ns;
    if (frame->frame_ns > all->longest_ns)
        all->longest_ns = frame->frame_ns;
    all->last = *frame;
    strl_cli_coarse_add(&all->coarse, frame->asked_px, frame->splat_px, frame->allowed_px, frame->max_error_px);
}

static void print_session(const session *all)
{
    double frames = (double)all->frames;
    printf("%" PRIu64 " frame%s: mean %.2f ms, longest %.2f ms, selecting %.3f ms\n", all->frames,
           strl_cli_plural(all->frames), (double)all->total_ns * 1e-6 / frames, (double)all->longest_ns * 1e-6,
           (double)all->select_ns * 1e-6 / frames);
    printf("last frame: %" PRIu64 " triangle%s, %" PRIu32 " missing node%s, ", all->last.triangles,
           strl_cli_plural(all->last.triangles), all->last.missing_nodes, strl_cli_plural(all->last.missing_nodes));
    if (isfinite(all->last.max_error_px))
        printf("errors up to %.3g pixels\n", all->last.max_error_px);
    else
        printf("the eye inside a node's box\n");
}

/* Fills desc from the command line. Returns as strl_cli_parse does. */
static int parse(strl_cli_args *args, strl_viewer_desc *desc, strl_cli_remote *remote)
{
    static const strl_backend backends[] = {STRL_BACKEND_DEFAULT, STRL_BACKEND_GL45, STRL_BACKEND_GL3};
    int backend = 0, cull = STRL_CULL_NONE;
    const strl_cli_option options[] = {
        {.name = "size",
         .kind = STRL_CLI_SIZE,
         .value = desc->size,
         .help = "of the window (as it was last, at first 1280x720)"},
        {.name = "error",
         .kind = STRL_CLI_REAL,
         .value = &desc->error_px,
         .argument = "PX",
         .help = "allowed pixel error (as it was last, at first 1)",
         .least = 1e-6,
         .most = 1e6},
        {.name = "splat",
         .kind = STRL_CLI_REAL,
         .value = &desc->splat_px,
         .argument = "PX",
         .help =
             "of sample trees: cells that cover no more than PX x PX pixels are drawn as splats of that size, more or less as the "
             "allowed error is changed (as --error)",
         .least = 1,
         .most = 64},
        {.name = "memory",
         .letter = 'm',
         .kind = STRL_CLI_BYTES,
         .value = &desc->memory_bytes,
         .help = "decoded nodes held (as it was last, at first 512M)",
         .least = 1 << 20,
         .most = 0x1p50},
        {.name = "gpu-memory",
         .kind = STRL_CLI_BYTES,
         .value = &desc->gpu_memory_bytes,
         .help = "buffers of nodes (as it was last, at first 512M)",
         .least = STRL_RENDERER_LEAST_GPU_BYTES,
         .most = 0x1p50},
        {.name = "frames",
         .kind = STRL_CLI_COUNT,
         .value = &desc->frames,
         .help = "close the window after N frames and print how long they took (when it is closed)",
         .least = 1,
         .most = 1e9},
        {.name = "screenshots",
         .kind = STRL_CLI_STRING,
         .value = &desc->screenshots,
         .argument = "DIR",
         .help = "where pictures and paths are saved (the current folder)"},
        {.name = "path",
         .kind = STRL_CLI_STRING,
         .value = &desc->camera_path,
         .argument = "FILE",
         .help = "a camera path to replay at once, as render --path reads it"},
        {.name = "log",
         .kind = STRL_CLI_STRING,
         .value = &desc->journal,
         .argument = "FILE",
         .help = "write what is opened, picked and measured, one JSON object a line"},
        {.name = "cull",
         .kind = STRL_CLI_ENUM,
         .value = &cull,
         .argument = "none|back",
         .help = "faces not to be drawn: back = those whose corners come clockwise as seen; for closed models (none)"},
        {.name = "backend",
         .kind = STRL_CLI_ENUM,
         .value = &backend,
         .argument = "auto|gl45|gl3",
         .help = "what draws (auto)"},
        STRL_CLI_REMOTE_OPTIONS(remote),
    };
    char notes[2048];
    snprintf(notes, sizeof notes, "MODEL is a container, as a file or behind http:// or https://. In the window:\n\n%s",
             strl_viewer_keys);
    const strl_cli_usage usage = {.positional = "MODEL",
                                  .least = 1,
                                  .most = 1,
                                  .notes = notes,
                                  .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    strl_cli_list inputs;
    int stop = strl_cli_parse(args, &usage, &inputs);
    if (stop < 0) {
        desc->location.name = inputs.items[0];
        desc->backend = backends[backend];
        desc->cull = (strl_cull)cull;
    }
    return stop;
}

static int run(strl_cli_args *args)
{
    session all = {0};
    strl_error err = {0};
    char settings[4096], cache[4096];
    strl_cli_remote remote = {0};
    strl_viewer_desc desc = {.shown = add_frame, .context = &all};
    int stop = parse(args, &desc, &remote);
    if (stop >= 0)
        return stop;
    strl_cli_user_path(settings, sizeof settings, "XDG_CONFIG_HOME", ".config", "/viewer.json");
    strl_cli_cache_folder(cache, sizeof cache);
    /* A window that closes by itself is a measurement: it depends on nothing that somebody did before. */
    desc.settings = settings[0] && desc.frames == 0 ? settings : NULL;
    desc.cache = cache[0] ? cache : NULL;
    if (strl_cli_locate(&remote, desc.location.name, &desc.location, &err) != STRL_OK ||
        strl_viewer_run(&desc, &err) != STRL_OK)
        return strl_cli_fail(&err);
    if (args->quiet)
        return 0;
    if (desc.frames > 0 && all.frames > 0)
        print_session(&all);
    strl_cli_coarse_report(&all.coarse, all.last.memory_bytes);
    return 0;
}

STRL_CLI_COMMAND(view, "walk through a container in a window", run);
