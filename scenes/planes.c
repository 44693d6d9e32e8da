/* Scenes `painted-plane` and `plain-plane`: the unit square as a regular grid with a slight jitter inside the plane.
 * The painted one carries what a simplifier must not smear: checkers, rings, strokes like those of text and thin lines,
 * all with sharp edges. The geometry of both is the same flat square, which needs two triangles. */
#include "scenes/generator.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define JITTER 0.25 /* of a cell, to each side */

enum { RECORD_BYTES = 15 };

/* Uniform in [0, 1). */
static double uniform(uint64_t key)
{
    return (double)(strl__mix64(key) >> 11) * 0x1p-53;
}

static void set_colour(uint8_t colour[3], unsigned red, unsigned green, unsigned blue)
{
    colour[0] = (uint8_t)red;
    colour[1] = (uint8_t)green;
    colour[2] = (uint8_t)blue;
}

/* Glyphs of 5 x 7 pixels: any 35 bits look like writing from a distance. */
static bool in_glyph(uint64_t seed, double u, double v)
{
    int64_t column = (int64_t)floor(u * 24);
    int64_t line = (int64_t)floor(v * 16);
    double x = (u * 24 - (double)column) * 6;
    double y = (v * 16 - (double)line) * 9;
    if (x >= 5 || y >= 7)
        return false;
    uint64_t bits = strl__mix64(seed + 0x9e3779b97f4a7c15u * (uint64_t)(line * 64 + column + 1));
    return bits >> ((unsigned)y * 5 + (unsigned)x) & 1;
}

/* The picture, in four quarters. u and v are 0 to 1 over the quarter. */
static void paint(uint64_t seed, double x, double y, uint8_t colour[3])
{
    double u = x * 2 - floor(x * 2);
    double v = y * 2 - floor(y * 2);
    double from_middle = sqrt((u - 0.5) * (u - 0.5) + (v - 0.5) * (v - 0.5));
    switch ((x >= 0.5) + 2 * (y >= 0.5)) {
    case 0: /* checkers of two sizes */
        if (((int)(u * 16) + (int)(v * 16)) & 1)
            set_colour(colour, 230, 225, 210);
        else
            set_colour(colour, (((int)(u * 64) + (int)(v * 64)) & 1) ? 170 : 30, 40, 60);
        break;
    case 1: /* rings that get narrower outwards */
        if (((int)(from_middle * from_middle * 120)) & 1)
            set_colour(colour, 20, 90, 160);
        else
            set_colour(colour, 250, 200, 60);
        break;
    case 2: /* writing */
        if (in_glyph(seed, u, v))
            set_colour(colour, 25, 25, 30);
        else
            set_colour(colour, 245, 243, 235);
        break;
    default: /* thin lines of several slopes on three grounds */
        if (fabs(sqrt(u * u + v * v) * 12 - rint(sqrt(u * u + v * v) * 12)) < 0.06 ||
            fabs((u + 2 * v) * 7 - rint((u + 2 * v) * 7)) < 0.05)
            set_colour(colour, 200, 30, 40);
        else
            set_colour(colour, 90, 150 + 40 * (unsigned)(u * 3) / 2, 110);
        break;
    }
}

/* Cells of the grid; each is two triangles. */
typedef struct plane_grid {
    uint64_t columns;
    uint64_t rows;
} plane_grid;

static void fill_row(const strl_scene_desc *desc, const plane_grid *grid, uint64_t row, bool painted, uint8_t *records)
{
    for (uint64_t column = 0; column <= grid->columns; column++, records += RECORD_BYTES) {
        uint64_t key =
            strl__mix64(desc->seed + 0xd1342543de82ef95u * (row + 1)) + 0x9e3779b97f4a7c15u * (2 * column + 1);
        bool inner_x = column > 0 && column < grid->columns;
        bool inner_y = row > 0 && row < grid->rows;
        double x = (double)column + (inner_x ? JITTER * (2 * uniform(key) - 1) : 0);
        double y = (double)row + (inner_y ? JITTER * (2 * uniform(key + 0x9e3779b97f4a7c15u) - 1) : 0);
        const float position[3] = {(float)(x / (double)grid->columns), (float)(y / (double)grid->rows), 0.0f};
        memcpy(records, position, sizeof position);
        if (painted)
            paint(desc->seed, position[0] < 1 ? position[0] : 0.9999999, position[1] < 1 ? position[1] : 0.9999999,
                  records + 12);
        else
            set_colour(records + 12, 180, 170, 150);
    }
}

static void fill_strip(uint64_t columns, uint64_t row, uint32_t *corners)
{
    for (uint64_t column = 0; column < columns; column++, corners += 6) {
        uint32_t a = (uint32_t)(row * (columns + 1) + column);
        uint32_t c = a + (uint32_t)(columns + 1);
        const uint32_t two[2][6] = {{a, a + 1, c + 1, a, c + 1, c}, {a, a + 1, c, a + 1, c + 1, c}};
        memcpy(corners, two[(row + column) & 1], sizeof two[0]);
    }
}

static strl_status write_plane(strl__scene_run *run, bool painted, strl_error *err)
{
    double cells = (double)run->desc->triangles * 0.5;
    plane_grid grid = {.columns = (uint64_t)lround(sqrt(cells))};
    grid.rows = (uint64_t)lround(cells / (double)grid.columns);
    uint8_t *records = strl__alloc(grid.columns + 1, RECORD_BYTES);
    uint32_t *corners = strl__alloc(grid.columns, 6 * sizeof *corners);
    strl_status status = STRL_OK;
    if (!records || !corners)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for one row of the plane");
    for (uint64_t row = 0; status == STRL_OK && row <= grid.rows; row++) {
        fill_row(run->desc, &grid, row, painted, records);
        status = strl__scene_mesh_vertices(run->writer, records, grid.columns + 1, err);
        if (status == STRL_OK && row < grid.rows) {
            fill_strip(grid.columns, row, corners);
            status = strl__scene_mesh_triangles(run->writer, corners, 2 * grid.columns, err);
        }
        if (status == STRL_OK)
            status = strl__scene_report(run, "painting", row, grid.rows, err);
    }
    strl__free(records);
    strl__free(corners);
    return status;
}

strl_status strl__scene_painted_plane(strl__scene_run *run, strl_error *err)
{
    return write_plane(run, true, err);
}

strl_status strl__scene_plain_plane(strl__scene_run *run, strl_error *err)
{
    return write_plane(run, false, err);
}
