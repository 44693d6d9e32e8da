/* stroll view: a window on a container. */
#include <stdio.h>

#include "options.h"
#include "stroll/render.h"
#include "viewer/viewer.h"

static int run(strl_cli_args *args)
{
    static const strl_backend backends[] = {STRL_BACKEND_DEFAULT, STRL_BACKEND_GL45, STRL_BACKEND_GL3};
    strl_viewer_desc desc = {
        .size = {1280, 720}, .error_px = 1, .memory_bytes = 512u << 20, .gpu_memory_bytes = 512u << 20};
    int backend = 0;
    const strl_cli_option options[] = {
        {.name = "size", .kind = STRL_CLI_SIZE, .value = desc.size, .help = "of the window (1280x720)"},
        {.name = "error",
         .kind = STRL_CLI_REAL,
         .value = &desc.error_px,
         .argument = "PX",
         .help = "allowed pixel error (1)",
         .least = 1e-6,
         .most = 1e6},
        {.name = "memory",
         .letter = 'm',
         .kind = STRL_CLI_BYTES,
         .value = &desc.memory_bytes,
         .help = "decoded nodes held (512M)",
         .least = 1 << 20,
         .most = 0x1p50},
        {.name = "gpu-memory",
         .kind = STRL_CLI_BYTES,
         .value = &desc.gpu_memory_bytes,
         .help = "buffers of nodes (512M)",
         .least = STRL_RENDERER_LEAST_GPU_BYTES,
         .most = 0x1p50},
        {.name = "screenshots",
         .kind = STRL_CLI_STRING,
         .value = &desc.screenshots,
         .argument = "DIR",
         .help = "where key P saves pictures (the current folder)"},
        {.name = "backend",
         .kind = STRL_CLI_ENUM,
         .value = &backend,
         .argument = "auto|gl45|gl3",
         .help = "what draws (auto)"},
    };
    char notes[2048];
    snprintf(notes, sizeof notes, "MODEL is a container. In the window:\n\n%s", strl_viewer_keys);
    const strl_cli_usage usage = {.positional = "MODEL",
                                  .least = 1,
                                  .most = 1,
                                  .notes = notes,
                                  .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    strl_cli_list inputs;
    int stop = strl_cli_parse(args, &usage, &inputs);
    if (stop >= 0)
        return stop;
    strl_error err = {0};
    desc.path = inputs.items[0];
    desc.backend = backends[backend];
    return strl_viewer_run(&desc, &err) == STRL_OK ? 0 : strl_cli_fail(&err);
}

STRL_CLI_COMMAND(view, "walk through a container in a window", run);
