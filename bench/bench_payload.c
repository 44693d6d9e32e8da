/* How small and how fast the payload codec is: encodes and decodes displaced grids, whose half of the vertices are
 * steps, and prints one JSON line a grid with medians and the range of the timed rounds. One core, processor time. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "geometry/payload.h"
#include "geometry/test_pm.h"

enum { WARM_UP = 5, ROUNDS = 51 };

struct timing {
    double median, fastest, slowest; /* seconds */
};

/* The thread's own time: a machine that does other work too slows the caches, but takes nothing away. */
static double now_s(void)
{
    struct timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static int compare_seconds(const void *a, const void *b)
{
    double p = *(const double *)a, q = *(const double *)b;
    return p < q ? -1 : p > q;
}

static struct timing summarise(double *seconds)
{
    qsort(seconds, ROUNDS, sizeof *seconds, compare_seconds);
    return (struct timing){seconds[ROUNDS / 2], seconds[0], seconds[ROUNDS - 1]};
}

static strl_status time_encode(const strl_pm *pm, strl_arena *scratch, strl_writer *payload, struct timing *timing,
                               strl_error *err)
{
    double seconds[ROUNDS];
    strl_status status = STRL_OK;
    for (int round = -WARM_UP; round < ROUNDS && !status; round++) {
        payload->size = 0;
        double start = now_s();
        status = strl_payload_encode(pm, NULL, scratch, payload, NULL, err);
        if (round >= 0)
            seconds[round] = now_s() - start;
    }
    if (!status)
        *timing = summarise(seconds);
    return status;
}

static strl_status time_decode(const strl_writer *payload, strl_arena *arena, struct timing *timing, strl_error *err)
{
    double seconds[ROUNDS];
    strl_status status = STRL_OK;
    strl_arena_mark mark = strl_arena_get_mark(arena);
    for (int round = -WARM_UP; round < ROUNDS && !status; round++) {
        strl_pm pm;
        double start = now_s();
        status = strl_payload_decode(payload->data, payload->size, NULL, arena, &pm, err);
        if (round >= 0)
            seconds[round] = now_s() - start;
        strl_arena_rewind(arena, mark);
    }
    if (!status)
        *timing = summarise(seconds);
    return status;
}

static void print_cpu(void)
{
    char line[256] = "", *colon = NULL;
    FILE *file = fopen("/proc/cpuinfo", "r");
    while (file && !colon && fgets(line, sizeof line, file))
        colon = strncmp(line, "model name", 10) ? NULL : strchr(line, ':');
    if (file)
        fclose(file);
    if (colon)
        colon[strcspn(colon, "\n\"")] = 0;
    printf("\"cpu\":\"%s\"", colon && colon[1] ? colon + 2 : "unknown");
}

/* side * side vertices, `spacing` lattice units apart. */
static strl_status bench_hills(uint32_t side, double spacing, double rough, strl_error *err)
{
    strl_arena mesh_arena, scratch, decoded;
    strl_writer payload = {0};
    strl_pm pm;
    struct timing encode = {0}, decode = {0};
    strl_arena_init(&mesh_arena, 0);
    strl_arena_init(&scratch, 0);
    strl_arena_init(&decoded, 0);
    struct test_mesh mesh = test_mesh_hills(side, side, spacing, rough, 7, &mesh_arena);
    struct test_pm_desc desc = {.seed = 1, .keep = mesh.vertex_count / 2, .keep_shape = true};
    test_pm_make(&mesh, &desc, &mesh_arena, &pm);
    strl_status status = time_encode(&pm, &scratch, &payload, &encode, err);
    if (!status)
        status = time_decode(&payload, &decoded, &decode, err);
    if (!status) {
        double mtri = 1e-6 * pm.triangle_count;
        printf("{\"bench\":\"payload\",\"commit\":\"%s\",", STRL_COMMIT);
        print_cpu();
        printf(",\"spacing\":%g,\"rough\":%g,\"vertices\":%" PRIu32 ",\"triangles\":%" PRIu32 ",\"steps\":%" PRIu32
               ",\"bytes\":%zu,\"bytes_per_vertex\":%.3f,\"decode_mtri_per_s\":%.2f,\"decode_slowest\":%.2f,"
               "\"decode_fastest\":%.2f,"
               "\"encode_mtri_per_s\":%.2f,\"encode_slowest\":%.2f,\"encode_fastest\":%.2f}\n",
               spacing, rough, pm.vertex_count, pm.triangle_count, pm.step_count, payload.size,
               (double)payload.size / pm.vertex_count, mtri / decode.median, mtri / decode.slowest,
               mtri / decode.fastest, mtri / encode.median, mtri / encode.slowest, mtri / encode.fastest);
    }
    strl__free(payload.data);
    strl_arena_deinit(&decoded);
    strl_arena_deinit(&scratch);
    strl_arena_deinit(&mesh_arena);
    return status;
}

int main(void)
{
    strl_error err = {0};
    strl_status status = bench_hills(64, 300, 0.3, &err);
    if (!status)
        status = bench_hills(64, 8000, 0.3, &err);
    if (!status)
        status = bench_hills(200, 300, 0.3, &err);
    if (status)
        fprintf(stderr, "bench_payload: %s\n", err.message);
    return status ? 1 : 0;
}
