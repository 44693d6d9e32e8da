/* How fine a grid, and how many levels of noise, give the wanted number of triangles.
 *
 * All levels are tried from the coarsest on, counted exactly at the coarsest useful sampling (two cells per
 * coefficient, which is 1/5 to 1/20 of the work of the final grid), until the wanted count is in reach with at most
 * CELLS_MAX cells per coefficient. For a given level the count grows with the square of the resolution, nearly; how
 * nearly is measured, on a sample of boxes counted at both resolutions. Small surfaces are counted exactly instead, as
 * often as it takes. */
#include "scenes/generator.h"

#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "base/fail.h"
#include "base/hash.h"

#define CELLS_MAX 5.5     /* per coefficient; noise of the finest level has a wavelength of about 8 to 14 cells */
#define EXACT_MAX 250000u /* triangles up to which every try is counted exactly */

enum {
    BOX = 7 /* coefficients along the side of a sampled box */,
    BOXES_MIN = 64,
    BOXES_MAX = 1536,
    TRIES = 160,
    SECANT_TRIES = 6
};

typedef struct counting {
    const strl__isosurface *surface;
    strl__grid grid;
    double cells_per_coefficient; /* of the sampled boxes' finer count */
    uint64_t boxes[3];
    atomic_uint_least64_t coarse;
    atomic_uint_least64_t fine;
} counting;

static strl__grid make_grid(uint64_t cells_x, uint64_t cells_y, double step)
{
    strl__grid grid = {.cells = {cells_x, cells_y, (uint64_t)ceil(STRL__FIELD_HEIGHT / step)}, .step = step};
    for (int axis = 0; axis < 3; axis++)
        grid.tiles[axis] = (grid.cells[axis] + STRL__TILE_CELLS - 1) / STRL__TILE_CELLS;
    return grid;
}

static strl_status count_tile(void *context, uint64_t index, unsigned worker, strl_error *err)
{
    (void)err;
    counting *work = context;
    const strl__grid *grid = &work->grid;
    uint64_t tile[3] = {index / (grid->tiles[1] * grid->tiles[2]), index / grid->tiles[2] % grid->tiles[1],
                        index % grid->tiles[2]};
    int64_t first[3];
    unsigned cells[3];
    for (int axis = 0; axis < 3; axis++) {
        uint64_t left = grid->cells[axis] - tile[axis] * STRL__TILE_CELLS;
        first[axis] = (int64_t)(tile[axis] * STRL__TILE_CELLS);
        cells[axis] = left < STRL__TILE_CELLS ? (unsigned)left : STRL__TILE_CELLS;
    }
    const strl__isosurface *surface = work->surface;
    atomic_fetch_add(&work->fine, strl__tile_count(&surface->field, grid->step, first, cells, &surface->table,
                                                   &surface->scratch[worker]));
    return STRL_OK;
}

static strl_status count_grid(const strl__scene_run *run, const strl__isosurface *surface, strl__grid grid,
                              uint64_t *triangles, strl_error *err)
{
    counting work = {.surface = surface, .grid = grid};
    strl_status status = strl_pool_for(run->desc->pool, grid.tiles[0] * grid.tiles[1] * grid.tiles[2], count_tile,
                                       &work, run->desc->cancel, err);
    *triangles = atomic_load(&work.fine);
    return status;
}

static strl_status count_box(void *context, uint64_t index, unsigned worker, strl_error *err)
{
    (void)err;
    counting *work = context;
    const strl__isosurface *surface = work->surface;
    uint64_t choice = strl__mix64(surface->field.seed + 0x9e3779b97f4a7c15u * (index + 1));
    int64_t box[3];
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = (int64_t)(choice % work->boxes[axis]);
        choice /= work->boxes[axis];
    }
    double spacing = strl__field_spacing(&surface->field);
    unsigned sides[2] = {2 * BOX, (unsigned)lround(BOX * work->cells_per_coefficient)};
    for (int i = 0; i < 2; i++) {
        const int64_t first[3] = {box[0] * sides[i], box[1] * sides[i], box[2] * sides[i]};
        const unsigned cells[3] = {sides[i], sides[i], sides[i]};
        uint64_t triangles = strl__tile_count(&surface->field, BOX * spacing / sides[i], first, cells, &surface->table,
                                              &surface->scratch[worker]);
        atomic_fetch_add(i ? &work->fine : &work->coarse, triangles);
    }
    return STRL_OK;
}

/* How many times more triangles there are at so many cells per coefficient than at two. */
static strl_status measure_growth(const strl__scene_run *run, const strl__isosurface *surface,
                                  double cells_per_coefficient, double *growth, strl_error *err)
{
    double spacing = strl__field_spacing(&surface->field);
    uint64_t across = (uint64_t)(1.0 / (BOX * spacing));
    uint64_t up = (uint64_t)(STRL__FIELD_HEIGHT / (BOX * spacing));
    counting work = {.surface = surface,
                     .cells_per_coefficient = cells_per_coefficient,
                     .boxes = {across ? across : 1, across ? across : 1, up ? up : 1}};
    uint64_t boxes = across * across * up / 16;
    boxes = boxes < BOXES_MIN ? BOXES_MIN : boxes > BOXES_MAX ? BOXES_MAX : boxes;
    strl_status status = strl_pool_for(run->desc->pool, boxes, count_box, &work, run->desc->cancel, err);
    double fine = (double)atomic_load(&work.fine);
    double coarse = (double)atomic_load(&work.coarse);
    double exact = BOX * cells_per_coefficient;
    double scale = exact / (double)lround(exact);
    *growth = coarse > 0 ? fine / coarse * scale * scale : cells_per_coefficient * cells_per_coefficient / 4;
    return status;
}

/* Tries grids near the estimate, counted exactly, and keeps the best. First the secant; where one more cell is already
 * too much, grids of nearly the same size that sample the field elsewhere: their counts scatter round the wanted one.
 */
static strl_status search_exactly(const strl__scene_run *run, strl__isosurface *surface, double cells, strl_error *err)
{
    double wanted = (double)run->desc->triangles;
    double best = INFINITY;
    double best_cells = cells;
    for (unsigned try = 0; try < TRIES && best > 0.003; try++) {
        bool secant = try < SECANT_TRIES;
        uint64_t side = (uint64_t)lround(secant ? cells : best_cells);
        uint64_t along = side + (secant ? 0 : try % 3);
        double shift = secant ? 0 : (double)(try * 37 % 64) / 64 - 0.5;
        strl__grid grid = make_grid(side, along - (along > side + 1 ? 3 : 0), (1.0 + shift / cells) / (double)side);
        uint64_t triangles = 0;
        strl_status status = count_grid(run, surface, grid, &triangles, err);
        if (status != STRL_OK)
            return status;
        double miss = fabs((double)triangles / wanted - 1.0);
        if (miss < best) {
            best = miss;
            best_cells = (double)side;
            surface->grid = grid;
        }
        cells *= !secant ? 1.0 : triangles ? sqrt(wanted / (double)triangles) : 1.5;
    }
    return STRL_OK;
}

/* The finest level that the wanted count needs, and its cells per coefficient by the square law. */
static strl_status choose_levels(const strl__scene_run *run, strl__isosurface *surface, double *cells_per_coefficient,
                                 double *coarse_count, strl_error *err)
{
    double wanted = (double)run->desc->triangles;
    for (unsigned levels = 1; levels <= STRL__FIELD_LEVELS_MAX; levels++) {
        surface->field.levels = levels;
        double step = 0.5 * strl__field_spacing(&surface->field);
        uint64_t side = (uint64_t)lround(1.0 / step);
        uint64_t triangles;
        strl_status status = strl__scene_report(run, "calibrating", levels, 0, err);
        if (status == STRL_OK)
            status = count_grid(run, surface, make_grid(side, side, step), &triangles, err);
        if (status != STRL_OK)
            return status;
        *coarse_count = (double)triangles;
        *cells_per_coefficient = triangles ? 2.0 * sqrt(wanted / *coarse_count) : INFINITY;
        if (*cells_per_coefficient <= CELLS_MAX)
            return STRL_OK;
    }
    return strl__fail(err, STRL_ERR_INTERNAL, "%u levels of noise give no isosurface of %.0f triangles",
                      STRL__FIELD_LEVELS_MAX, wanted);
}

strl_status strl__isosurface_calibrate(const strl__scene_run *run, strl__isosurface *surface, strl_error *err)
{
    double wanted = (double)run->desc->triangles;
    double coarse_count = 0;
    double per_coefficient = 0;
    strl_status status = choose_levels(run, surface, &per_coefficient, &coarse_count, err);
    if (status != STRL_OK)
        return status;
    double coefficients = 1.0 / strl__field_spacing(&surface->field);
    if (run->desc->triangles <= EXACT_MAX)
        return search_exactly(run, surface, per_coefficient * coefficients, err);
    for (int round = 0; round < 2 && status == STRL_OK; round++) {
        double growth;
        status = measure_growth(run, surface, per_coefficient, &growth, err);
        per_coefficient *= sqrt(wanted / (coarse_count * growth));
        per_coefficient = per_coefficient < CELLS_MAX + 1.0 ? per_coefficient : CELLS_MAX + 1.0;
    }
    /* One cell more or less along one side is the finest adjustment. */
    double side = per_coefficient * coefficients;
    uint64_t across = (uint64_t)side;
    uint64_t along = (uint64_t)lround(side * side / (double)across);
    surface->grid = make_grid(across, along, 1.0 / (double)across);
    return status;
}
