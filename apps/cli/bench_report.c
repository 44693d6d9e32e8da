/* What `stroll bench` prints: figures with median and spread, and the machine that they belong to. */
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "bench.h"
#include "platform/thread.h"
#include "stroll/version.h"

#if defined(__clang__)
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "gcc " __VERSION__
#endif

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double strl_bench_median(double *values, size_t count)
{
    qsort(values, count, sizeof *values, by_value);
    return (values[(count - 1) / 2] + values[count / 2]) / 2;
}

void strl_bench_print_text(const strl_bench *bench)
{
    char cpu[128];
    strl_cpu_model(cpu, sizeof cpu);
    printf("stroll %s, %s; %s, %u processors\n", STRL_VERSION, COMPILER, cpu, strl_cpu_count());
    printf("scene isosurface of %" PRIu64 " triangles; runs: %u\n\n", bench->triangles, bench->runs);
    printf("%-16s %10s %10s %10s  %-14s %s\n", "figure", "median", "least", "most", "unit", "with");
    for (size_t f = 0; f < bench->figure_count; f++) {
        strl_bench_figure figure = bench->figures[f];
        if (figure.count == 0) {
            printf("%-16s %10s %10s %10s  %-14s %s\n", figure.name, "-", "-", "-", figure.unit, figure.note);
            continue;
        }
        double median = strl_bench_median(figure.values, figure.count);
        printf("%-16s %10.4g %10.4g %10.4g  %-14s %s\n", figure.name, median, figure.values[0],
               figure.values[figure.count - 1], figure.unit, figure.note);
    }
}

static json_t *figure_to_json(const strl_bench_figure *figure)
{
    json_t *object = json_pack("{s:s,s:s,s:s,s:I}", "name", figure->name, "unit", figure->unit, "note", figure->note,
                               "runs", (json_int_t)figure->count);
    bool measured = figure->count > 0;
    double median = measured ? strl_bench_median(figure->values, figure->count) : 0;
    json_object_set_new(object, "median", measured ? json_real(median) : json_null());
    json_object_set_new(object, "min", measured ? json_real(figure->values[0]) : json_null());
    json_object_set_new(object, "max", measured ? json_real(figure->values[figure->count - 1]) : json_null());
    return object;
}

strl_status strl_bench_print_json(const strl_bench *bench, strl_error *err)
{
    char cpu[128];
    strl_cpu_model(cpu, sizeof cpu);
    json_t *machine = json_pack("{s:s,s:I}", "cpu", cpu, "cores", (json_int_t)strl_cpu_count());
    json_t *figures = json_array();
    for (size_t f = 0; f < bench->figure_count; f++)
        json_array_append_new(figures, figure_to_json(&bench->figures[f]));
    json_t *root = json_pack("{s:s,s:s,s:o,s:s,s:I,s:I,s:I,s:o}", "version", STRL_VERSION, "compiler", COMPILER,
                             "machine", machine, "scene", "isosurface", "triangles", (json_int_t)bench->triangles,
                             "runs", (json_int_t)bench->runs, "jobs", (json_int_t)bench->jobs, "benchmarks", figures);
    bool good = root && json_dumpf(root, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(6)) == 0 && putchar('\n') != EOF;
    json_decref(root);
    return good ? STRL_OK : strl__fail(err, STRL_ERR_IO, "cannot write the report");
}
