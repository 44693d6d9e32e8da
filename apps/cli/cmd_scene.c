/* stroll scene: writes a seeded model. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "interrupt.h"
#include "jobs/pool.h"
#include "options.h"
#include "platform/thread.h"
#include "progress.h"
#include "scenes/scene.h"
#include "shared/importer.h"

static bool show_progress(void *context, const char *phase, uint64_t done, uint64_t total)
{
    strl_cli_progress_update(context, phase, done, total, "steps");
    return !strl_cli_interrupted();
}

static int write_scene(strl_cli_args *args, strl_scene_desc *desc, uint64_t jobs)
{
    strl_error err;
    strl_scene_result result;
    strl_cli_progress line;
    strl_cli_catch_interrupts();
    strl_status status = strl_pool_create((unsigned)jobs - 1, &desc->pool, &err); /* the caller works too */
    if (status == STRL_OK) {
        strl_cli_progress_init(&line, args->quiet);
        const strl_scene_progress progress = {show_progress, &line};
        status = strl_scene_write(desc, &progress, &result, &err);
        strl_cli_progress_end(&line);
    }
    strl_pool_destroy(desc->pool);
    if (status != STRL_OK)
        return strl_cli_fail(&err);
    if (!args->quiet)
        printf("%s: %" PRIu64 " triangle%s, %" PRIu64 " vertices, %" PRIu64 " bytes\n", desc->path, result.triangles,
               strl_cli_plural(result.triangles), result.vertices, result.bytes);
    return 0;
}

static const strl_scene_info *find_scene(const char *name)
{
    const strl_scene_info *info;
    for (size_t i = 0; (info = strl_scene_at(i)) != NULL; i++)
        if (!strcmp(info->name, name))
            return info;
    return NULL;
}

static void describe_scenes(char *text, size_t size)
{
    size_t used = (size_t)snprintf(text, size, "scenes:\n");
    const strl_scene_info *info;
    for (size_t i = 0; used < size && (info = strl_scene_at(i)) != NULL; i++)
        used += (size_t)snprintf(text + used, size - used, "  %-14s %s\n", info->name, info->summary);
}

static int run(strl_cli_args *args)
{
    char notes[2048];
    describe_scenes(notes, sizeof notes);
    strl_scene_desc desc = {.triangles = 1000000};
    uint64_t jobs = strl_cpu_count();
    strl_cli_list names;
    const strl_cli_option options[] = {
        {.name = "output",
         .letter = 'o',
         .kind = STRL_CLI_STRING,
         .value = &desc.path,
         .argument = "FILE.ply|.stl|.gltf|.obj",
         .help =
             "the file to write; its ending says the format; .gltf is for array and chessboard, it and .obj for plant and landscape",
         .required = true},
        {.name = "triangles",
         .letter = 'n',
         .kind = STRL_CLI_COUNT,
         .value = &desc.triangles,
         .help = "how many, K M G are powers of 1000 (1M)",
         .least = 1,
         .most = 4e9},
        {.name = "of",
         .kind = STRL_CLI_STRING,
         .value = &desc.of,
         .argument = "FILE",
         .help =
             "of array: the mesh file that is copied; copies in it are written out, of meshes of 256 triangles or more up to ten times their triangles"},
        {.name = "copies",
         .kind = STRL_CLI_COUNT,
         .value = &desc.copies,
         .help = "of array: how many (100)",
         .least = 1,
         .most = 16000000},
        {.name = "seed", .kind = STRL_CLI_COUNT, .value = &desc.seed, .help = "another one is another model (0)"},
        {.name = "no-normals", .kind = STRL_CLI_FLAG, .value = &desc.no_normals, .help = "positions only"},
        {.name = "shuffle",
         .kind = STRL_CLI_FLAG,
         .value = &desc.shuffle,
         .help = "vertices and triangles in a random order, which the seed fixes"},
        {.name = "memory", .kind = STRL_CLI_BYTES, .value = &desc.memory_bytes, .help = "budget of the buffers (256M)"},
        {.name = "jobs",
         .letter = 'j',
         .kind = STRL_CLI_COUNT,
         .value = &jobs,
         .help = "threads (all processors)",
         .least = 1,
         .most = 1024},
    };
    const strl_cli_usage usage = {.positional = "NAME",
                                  .least = 1,
                                  .most = 1,
                                  .notes = notes,
                                  .options = options,
                                  .option_count = STRL_CLI_COUNT_OF(options)};
    int stop = strl_cli_parse(args, &usage, &names);
    if (stop >= 0)
        return stop;
    desc.name = names.items[0];
    const strl_scene_info *info = find_scene(desc.name);
    if (!info)
        return strl_cli_usage_error(args, "there is no scene \"%s\"", desc.name);
    if (info->copies != (desc.of != NULL))
        return strl_cli_usage_error(args, info->copies ? "scene %s needs --of FILE" : "scene %s takes no --of",
                                    info->name);
    desc.importer = strl_importer();
    if (desc.triangles < info->triangles_min || desc.triangles > info->triangles_max)
        return strl_cli_usage_error(args, "scene %s has %" PRIu64 " to %" PRIu64 " triangles, not %" PRIu64, info->name,
                                    info->triangles_min, info->triangles_max, desc.triangles);
    return write_scene(args, &desc, jobs);
}

STRL_CLI_COMMAND(scene, "write a seeded model for tests and benchmarks", run);
