/* What the file says of runs of placements: docs/format.md, "Run". Colours and normals are looks, which nothing relies
 * on. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/memory.h"
#include "verify/mesh.h"

#define RUN_BYTES 80u
#define MOST_NORMAL 1023u
#define ROUNDING 1e-4 /* of sums of 512 f32 numbers, and of their parts */

#define RUN_RULE(model, condition, run, ...)                                                                           \
    do {                                                                                                               \
        strl__v_checked((model)->checks, STRL_VERIFY_TABLES, 1);                                                       \
        if (!(condition))                                                                                              \
            strl__v_flaw((model)->checks, STRL_VERIFY_TABLES, (uint64_t)STRL__RUNS << 56 | (run), __VA_ARGS__);        \
    } while (0)

strl_status strl__v_runs_create(strl__model *model, strl_error *err)
{
    uint64_t count = model->sections[STRL__RUNS].item_count; /* the file has room for so many */
    if (count == 0)
        return STRL_OK;
    if (count > UINT32_MAX || count * sizeof *model->runs > model->memory_bytes / 4)
        return strl__fail(err, STRL_ERR_MEMORY, "%" PRIu64 " runs of placements do not fit into a quarter of --memory",
                          count);
    model->runs = strl__alloc_zero((size_t)count, sizeof *model->runs);
    model->run_count = model->runs ? (uint32_t)count : 0;
    return model->runs ? STRL_OK
                       : strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu64 " runs of placements", count);
}

/* ---- the table of runs */

void strl__v_run_read(strl__model *model, uint64_t number, const uint8_t *bytes, size_t size)
{
    strl_cursor cursor = strl_cursor_make(bytes, size);
    strl__vrun run = {.found = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}};
    bool good = true;
    for (unsigned i = 0; i < 6; i++)
        run.box[i / 3][i % 3] = strl_cursor_f64(&cursor);
    for (unsigned k = 0; k < 3; k++)
        good = good && isfinite(run.box[0][k]) && isfinite(run.box[1][k]) && run.box[0][k] <= run.box[1][k];
    run.area = strl_cursor_f32(&cursor);
    strl_cursor_u32(&cursor);
    strl_cursor_u16(&cursor); /* any number is a direction and a spread */
    uint32_t normal = strl_cursor_u16(&cursor);
    run.page.bytes = strl_cursor_u32(&cursor);
    run.page.offset = strl_cursor_u64(&cursor);
    run.page.checksum = strl_cursor_u64(&cursor);
    RUN_RULE(model, size == RUN_BYTES, number, "run %" PRIu64 ": %zu bytes, expected %u", number, size, RUN_BYTES);
    RUN_RULE(model, good, number, "run %" PRIu64 ": its box is not finite or upside down", number);
    RUN_RULE(model, isfinite(run.area) && run.area >= 0 && normal <= MOST_NORMAL, number,
             "run %" PRIu64 ": area %g, second number %u of its normal", number, (double)run.area, normal);
    if (number < model->run_count)
        model->runs[number] = run;
}

/* ---- the table of placements */

static strl__vrun *run_of(const strl__model *model, uint64_t item)
{
    uint64_t run = item / STRL__RUN_PLACEMENTS;
    return run < model->run_count ? &model->runs[run] : NULL;
}

void strl__v_run_page(strl__model *model, uint64_t first, uint64_t count, const strl__place *place)
{
    uint64_t left = model->sections[STRL__PLACEMENTS].item_count - first;
    uint64_t expected = left < STRL__RUN_PLACEMENTS ? left : STRL__RUN_PLACEMENTS;
    const strl__vrun *run = run_of(model, first);
    RUN_RULE(model, first % STRL__RUN_PLACEMENTS == 0 && count == expected, first / STRL__RUN_PLACEMENTS,
             "page of placements from %" PRIu64 ": %" PRIu64
             " of them, expected 512 on each page and the rest on the last",
             first, count);
    if (run)
        RUN_RULE(model,
                 run->page.offset == place->offset && run->page.bytes == place->bytes &&
                     run->page.checksum == place->checksum,
                 first / STRL__RUN_PLACEMENTS,
                 "run %" PRIu64 ": its page is said to be %u bytes at byte %" PRIu64
                 ", the table of placements has %u at byte %" PRIu64,
                 first / STRL__RUN_PLACEMENTS, run->page.bytes, run->page.offset, place->bytes, place->offset);
}

void strl__v_run_placement(strl__model *model, uint64_t item, const double low[3], const double high[3])
{
    strl__vrun *run = run_of(model, item);
    for (unsigned k = 0; run && k < 3; k++) {
        run->found[0][k] = fmin(run->found[0][k], low[k]);
        run->found[1][k] = fmax(run->found[1][k], high[k]);
    }
}

/* The smallest box, but for the rounding of sums. */
void strl__v_run_end(strl__model *model, uint64_t first)
{
    const strl__vrun *run = run_of(model, first);
    double scale = 0;
    for (unsigned i = 0; run && i < 6; i++)
        scale = fmax(scale, fabs(run->found[i / 3][i % 3]));
    for (unsigned i = 0; run && i < 6; i++)
        RUN_RULE(model, fabs(run->found[i / 3][i % 3] - run->box[i / 3][i % 3]) <= 1e-12 * scale,
                 first / STRL__RUN_PLACEMENTS,
                 "run %" PRIu64 ": bound %u of its box is %.17g, its placements' is %.17g",
                 first / STRL__RUN_PLACEMENTS, i, run->box[i / 3][i % 3], run->found[i / 3][i % 3]);
}

/* ---- areas */

/* The largest eigenvalue of the transposed times itself, by the cosine of a third of an angle (Smith 1961). */
double strl__v_area_scale(const double transform[12])
{
    double a[3][3] = {{0}}, b[3][3];
    for (unsigned i = 0; i < 9; i++)
        for (unsigned row = 0; row < 3; row++)
            a[i / 3][i % 3] += transform[4 * row + i / 3] * transform[4 * row + i % 3];
    double mean = (a[0][0] + a[1][1] + a[2][2]) / 3, square = 0;
    for (unsigned i = 0; i < 9; i++) {
        b[i / 3][i % 3] = a[i / 3][i % 3] - (i % 4 == 0 ? mean : 0);
        square += b[i / 3][i % 3] * b[i / 3][i % 3];
    }
    double spread = sqrt(square / 6), determinant = 0;
    if (!(spread > 0))
        return mean;
    for (unsigned k = 0; k < 3; k++)
        determinant += b[0][k] / spread *
                       (b[1][(k + 1) % 3] / spread * (b[2][(k + 2) % 3] / spread) -
                        b[1][(k + 2) % 3] / spread * (b[2][(k + 1) % 3] / spread));
    return mean + 2 * spread * cos(acos(fmin(fmax(determinant / 2, -1), 1)) / 3);
}

void strl__v_run_area(strl__model *model, uint64_t first, double area, bool samples)
{
    const strl__vrun *run = run_of(model, first);
    if (!run || !(area < 1e37))
        return;
    double said = (double)run->area;
    RUN_RULE(model, said >= area * (1 - ROUNDING) && (samples || said <= area * (1 + ROUNDING)),
             first / STRL__RUN_PLACEMENTS, "run %" PRIu64 ": its area is said to be %g, its placements' roots have %g",
             first / STRL__RUN_PLACEMENTS, said, area);
}

static double area_of_mesh(const strl__vmesh *mesh)
{
    double area = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        double u[3], v[3];
        for (unsigned k = 0; k < 3; k++) {
            u[k] = (double)mesh->position[mesh->triangle[t][1]][k] - mesh->position[mesh->triangle[t][0]][k];
            v[k] = (double)mesh->position[mesh->triangle[t][2]][k] - mesh->position[mesh->triangle[t][0]][k];
        }
        double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
        area += sqrt(x * x + y * y + z * z) / 2;
    }
    return area;
}

strl_status strl__v_check_run_areas(strl__model *model, strl_error *err)
{
    if (model->run_count == 0)
        return STRL_OK;
    double *area = strl__alloc_zero(model->tree_count, sizeof *area);
    strl__worker *workers = strl__v_workers_create(model);
    strl_status status =
        area && workers ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u trees", model->tree_count);
    for (uint32_t t = 0; status == STRL_OK && t < model->tree_count; t++) {
        strl__vmesh mesh;
        status = strl__v_load_mesh(model, &model->trees[t], 0, workers, &mesh, err);
        if (status == STRL_OK)
            area[t] = area_of_mesh(&mesh) * model->trees[t].step * model->trees[t].step;
    }
    if (status == STRL_OK)
        status = strl__v_read_areas(model, area, err);
    strl__v_workers_destroy(model, workers);
    strl__free(area);
    return status;
}
