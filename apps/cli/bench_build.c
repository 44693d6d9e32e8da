/* From nothing to decoded nodes: writing a scene, reading it, building a container, decoding its payloads. */
#include <inttypes.h>
#include <stdio.h>

#include "base/fail.h"
#include "base/memory.h"
#include "bench.h"
#include "stroll/build.h"
#include "container/treelet.h"
#include "geometry/payload.h"
#include "jobs/pool.h"
#include "platform/thread.h"
#include "readers/reader.h"
#include "scenes/scene.h"

#define BUILD_MEMORY_BYTES (1ull << 30)
#define READ_TRIANGLES 4096u
#define MOST_PAYLOAD_BYTES ((size_t)16 << 20) /* enough to leave every cache, little enough for every machine */

static double seconds_since(uint64_t start_ns)
{
    return (double)(strl_clock_ns() - start_ns) * 1e-9;
}

static double millions_per_second(uint64_t count, double seconds)
{
    return seconds > 0 ? 1e-6 * (double)count / seconds : 0;
}

/* ---- scene */

static bool report_scene(void *context, const char *phase, uint64_t done, uint64_t total)
{
    strl_bench *bench = context;
    strl_cli_progress_update(bench->progress, phase, done, total, "steps");
    return !bench->stopped();
}

static strl_status write_scene(strl_bench *bench, double *seconds, strl_error *err)
{
    strl_scene_desc desc = {.name = "isosurface", .path = bench->scene, .triangles = bench->triangles, .seed = 1};
    const strl_scene_progress progress = {report_scene, bench};
    strl_scene_result result = {0};
    strl_status status = strl_pool_create(bench->jobs - 1, &desc.pool, err); /* the caller works too */
    uint64_t start = strl_clock_ns();
    if (status == STRL_OK)
        status = strl_scene_write(&desc, &progress, &result, err);
    *seconds = seconds_since(start);
    strl_pool_destroy(desc.pool);
    bench->has_scene = status == STRL_OK;
    bench->scene_triangles = result.triangles;
    return status;
}

static strl_status need_scene(strl_bench *bench, strl_error *err)
{
    double seconds;
    return bench->has_scene ? STRL_OK : write_scene(bench, &seconds, err);
}

strl_status strl_bench_scene(strl_bench *bench, strl_error *err)
{
    strl_bench_figure *figure;
    strl_status status = strl_bench_add_figure(bench, "scene", "M triangles/s", &figure, err);
    for (unsigned run = 0; status == STRL_OK && run < bench->runs; run++) {
        double seconds = 0;
        status = write_scene(bench, &seconds, err);
        figure->values[figure->count++] = millions_per_second(bench->scene_triangles, seconds);
    }
    if (status == STRL_OK)
        snprintf(figure->note, sizeof figure->note, "isosurface, threads: %u", bench->jobs);
    return status;
}

/* ---- read */

static strl_status read_all(strl_bench *bench, strl_reader *reader, strl_triangle *triangles, uint64_t *read,
                            strl_error *err)
{
    size_t count = 1;
    strl_status status = STRL_OK;
    *read = 0;
    while (status == STRL_OK && count > 0) {
        status = strl_reader_next(reader, triangles, READ_TRIANGLES, &count, err);
        *read += status == STRL_OK ? count : 0;
        strl_cli_progress_update(bench->progress, "read", *read, bench->scene_triangles, "triangles");
        if (status == STRL_OK && bench->stopped())
            status = strl__fail(err, STRL_ERR_CANCELLED, "stopped while reading %s", bench->scene);
    }
    return status;
}

static strl_status read_scene(strl_bench *bench, double *rate, strl_error *err)
{
    const strl_reader_desc desc = {.path = bench->scene, .scratch_dir = bench->folder};
    strl_reader *reader = NULL;
    uint64_t read = 0;
    strl_triangle *triangles = strl__alloc(READ_TRIANGLES, sizeof *triangles);
    if (!triangles)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to read triangles");
    uint64_t start = strl_clock_ns();
    strl_status status = strl_reader_open(&desc, &reader, err);
    if (status == STRL_OK)
        status = read_all(bench, reader, triangles, &read, err);
    *rate = millions_per_second(read, seconds_since(start));
    strl_reader_close(reader);
    strl__free(triangles);
    return status;
}

strl_status strl_bench_read(strl_bench *bench, strl_error *err)
{
    strl_bench_figure *figure;
    double warm_up;
    strl_status status = strl_bench_add_figure(bench, "read", "M triangles/s", &figure, err);
    if (status == STRL_OK)
        status = need_scene(bench, err);
    if (status == STRL_OK)
        status = read_scene(bench, &warm_up, err);
    for (unsigned run = 0; status == STRL_OK && run < bench->runs; run++)
        status = read_scene(bench, &figure->values[figure->count++], err);
    if (status == STRL_OK)
        snprintf(figure->note, sizeof figure->note, "binary PLY with normals, one thread, file in the system's cache");
    return status;
}

/* ---- build */

static bool report_build(void *context, const strl_build_progress *progress)
{
    strl_bench *bench = context;
    strl_cli_progress_update(bench->progress, progress->stage, progress->done, progress->total, "items");
    return !bench->stopped();
}

static strl_status build(strl_bench *bench, unsigned jobs, strl_build_result *result, strl_error *err)
{
    const char *input = bench->scene;
    const strl_build_desc desc = {.inputs = &input,
                                  .input_count = 1,
                                  .output = bench->container,
                                  .jobs = jobs,
                                  .memory_bytes = BUILD_MEMORY_BYTES,
                                  .progress = report_build,
                                  .context = bench};
    strl_status status = need_scene(bench, err);
    if (status == STRL_OK)
        status = strl_build_clusters(&desc, result, err);
    bench->has_container = bench->has_container || status == STRL_OK;
    return status;
}

strl_status strl_bench_need_container(strl_bench *bench, strl_error *err)
{
    strl_build_result result;
    return bench->has_container ? STRL_OK : build(bench, bench->jobs, &result, err);
}

/* One build, its rate and its peak. A peak that was there before the build, and stayed, tells nothing about it. */
static strl_status measure_build(strl_bench *bench, unsigned jobs, strl_bench_figure *rate, strl_bench_figure *memory,
                                 strl_error *err)
{
    strl_build_result result;
    strl_status status = need_scene(bench, err);
    uint64_t before = strl_process_peak_rss_bytes();
    strl_process_forget_peak();
    uint64_t start = strl_clock_ns();
    if (status == STRL_OK)
        status = build(bench, jobs, &result, err);
    double seconds = seconds_since(start);
    uint64_t after = strl_process_peak_rss_bytes();
    if (status != STRL_OK)
        return status;
    rate->values[rate->count++] = millions_per_second(result.triangles_in, seconds);
    if (memory && after != before)
        memory->values[memory->count++] = (double)after / (1 << 20);
    return STRL_OK;
}

strl_status strl_bench_build(strl_bench *bench, strl_error *err)
{
    strl_bench_figure *one, *all, *memory;
    strl_status status = strl_bench_add_figure(bench, "build_one_core", "M triangles/s", &one, err);
    if (status == STRL_OK)
        status = strl_bench_add_figure(bench, "build", "M triangles/s", &all, err);
    if (status == STRL_OK)
        status = strl_bench_add_figure(bench, "build_memory", "MiB", &memory, err);
    /* in turns, so that a slow minute of the machine meets both */
    for (unsigned run = 0; status == STRL_OK && run < bench->runs; run++) {
        status = measure_build(bench, 1, one, NULL, err);
        if (status == STRL_OK)
            status = measure_build(bench, bench->jobs, all, memory, err);
    }
    if (status != STRL_OK)
        return status;
    snprintf(one->note, sizeof one->note, "--jobs 1, output included");
    snprintf(all->note, sizeof all->note, "--jobs %u, output included", bench->jobs);
    snprintf(memory->note, sizeof memory->note,
             memory->count ? "peak of build, --memory 1G"
                           : "this system does not tell the peak of a part of a process");
    return STRL_OK;
}

/* ---- decode */

/* Payloads one behind the other. */
typedef struct payload_set {
    uint8_t *bytes; /* owned */
    size_t size, capacity;
    strl_node *nodes; /* [count], owned */
    size_t count, node_capacity;
    strl_pm *meshes; /* [count], by which the children are decoded; owned with what they point at */
    strl_arena arena;
} payload_set;

static strl_status add_payload(payload_set *set, strl_container *container, const strl_node *node, strl_error *err)
{
    if (!strl__grow(&set->bytes, &set->capacity, set->size + node->payload_bytes, 1) ||
        !strl__grow(&set->nodes, &set->node_capacity, set->count + 1, sizeof *set->nodes))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu payloads", set->count + 1);
    strl_status status = strl_source_read(strl_container_source(container), node->page.offset + node->payload_offset,
                                          set->bytes + set->size, node->payload_bytes, err);
    set->size += node->payload_bytes;
    set->nodes[set->count++] = *node;
    return status;
}

static strl_status load_payloads(payload_set *set, const char *path, strl_error *err)
{
    strl_container *container = NULL;
    strl_status status = strl_container_open_path(path, &container, err);
    uint32_t nodes = status == STRL_OK ? strl_container_tree(container, 0)->node_count : 0;
    for (uint32_t id = 0; status == STRL_OK && id < nodes && set->size < MOST_PAYLOAD_BYTES; id++) {
        strl_node node;
        status = strl_container_node(container, 0, id, &node, err);
        if (status == STRL_OK)
            status = add_payload(set, container, &node, err);
    }
    strl_container_close(container);
    return status;
}

/* A payload is told by its parent's mesh, whose id is lower. */
static strl_status decode_payload(const payload_set *set, size_t index, const uint8_t *payload, strl_arena *arena,
                                  strl_pm *mesh, strl_error *err)
{
    const strl_node *node = &set->nodes[index];
    strl_payload_reference reference, *given = NULL;
    if (node->decode_parent != STRL_NONE) {
        reference = strl_payload_reference_of(&set->meshes[node->decode_parent]);
        strl_page_place(&reference, set->nodes[node->decode_parent].anchor, node);
        given = &reference;
    }
    return strl_payload_decode(payload, node->payload_bytes, given, arena, mesh, err);
}

static strl_status keep_meshes(payload_set *set, strl_error *err)
{
    const uint8_t *payload = set->bytes;
    set->meshes = strl__alloc_zero(set->count, sizeof *set->meshes);
    strl_status status =
        set->meshes ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu meshes", set->count);
    for (size_t i = 0; status == STRL_OK && i < set->count; i++) {
        status = decode_payload(set, i, payload, &set->arena, &set->meshes[i], err);
        payload += set->nodes[i].payload_bytes;
    }
    return status;
}

static void payload_set_deinit(payload_set *set)
{
    strl_arena_deinit(&set->arena);
    strl__free(set->meshes);
    strl__free(set->nodes);
    strl__free(set->bytes);
}

static strl_status decode_payloads(const payload_set *set, double *rate, strl_error *err)
{
    strl_arena arena;
    strl_status status = STRL_OK;
    uint64_t triangles = 0;
    const uint8_t *payload = set->bytes;
    strl_arena_init(&arena, 0);
    strl_arena_mark mark = strl_arena_get_mark(&arena);
    uint64_t start = strl_clock_ns();
    for (size_t p = 0; status == STRL_OK && p < set->count; p++) {
        strl_pm mesh;
        status = decode_payload(set, p, payload, &arena, &mesh, err);
        triangles += status == STRL_OK ? mesh.triangle_count : 0;
        payload += set->nodes[p].payload_bytes;
        strl_arena_rewind(&arena, mark);
    }
    *rate = millions_per_second(triangles, seconds_since(start));
    strl_arena_deinit(&arena);
    return status;
}

strl_status strl_bench_decode(strl_bench *bench, strl_error *err)
{
    strl_bench_figure *figure;
    payload_set set = {0};
    double warm_up;
    strl_status status = strl_bench_add_figure(bench, "decode", "M triangles/s", &figure, err);
    if (status == STRL_OK)
        status = strl_bench_need_container(bench, err);
    if (status == STRL_OK)
        status = load_payloads(&set, bench->container, err);
    if (status == STRL_OK)
        status = keep_meshes(&set, err);
    if (status == STRL_OK)
        status = decode_payloads(&set, &warm_up, err);
    for (unsigned run = 0; status == STRL_OK && run < bench->runs; run++) {
        status = strl_bench_check(bench, "decode", run, err);
        if (status == STRL_OK)
            status = decode_payloads(&set, &figure->values[figure->count++], err);
    }
    if (status == STRL_OK)
        snprintf(figure->note, sizeof figure->note, "payloads of %zu nodes, %.2f MB, one thread", set.count,
                 (double)set.size * 1e-6);
    payload_set_deinit(&set);
    return status;
}
