/* Scene `chessboard`: the unit square in black and white fields of two triangles each, as Klein et al. 2005 (6) draw
 * it: from afar all of it is grey, and what is drawn shows whether samples are fair. Fields share no vertices, so that
 * borders are sharp. As glTF it is copies of a square of fields; these have whole numbers as coordinates, which one
 * scale makes the unit square. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "scenes/generator.h"

enum { RECORD_BYTES = 15, CORNERS = 4, BATCH = 4096 };
enum { TILE = 64 /* even, so that all copies have the same colours */, SHADES = STRL__CHESSBOARD_MATERIALS };

const strl__material strl__chessboard_materials[STRL__CHESSBOARD_MATERIALS] = {
    {"BLACK", {0, 0, 0}, {0, 0, 0}, 1, 0, 1},
    {"WHITE", {255, 255, 255}, {1, 1, 1}, 1, 0, 1},
};

typedef struct field_batch {
    uint8_t *records;  /* [BATCH * CORNERS] */
    uint32_t *corners; /* [BATCH * 6] */
} field_batch;

static void put_field(const field_batch *batch, uint32_t at, uint64_t first_vertex, uint64_t row, uint64_t column,
                      double rows, double columns)
{
    const uint8_t shade = (row + column) & 1 ? 255 : 0;
    const uint32_t first = (uint32_t)(first_vertex + (uint64_t)at * CORNERS);
    uint32_t *corners = batch->corners + (size_t)at * 6;
    for (unsigned corner = 0; corner < CORNERS; corner++) {
        uint8_t *record = batch->records + ((size_t)at * CORNERS + corner) * RECORD_BYTES;
        const float position[3] = {(float)(((double)column + (corner & 1)) / columns),
                                   (float)(((double)row + (corner >> 1)) / rows), 0};
        memcpy(record, position, sizeof position);
        memset(record + sizeof position, shade, 3);
    }
    const uint32_t both[6] = {first, first + 1, first + 3, first, first + 3, first + 2};
    memcpy(corners, both, sizeof both);
}

static strl_status write_fields(strl__scene_run *run, const field_batch *batch, uint64_t columns, uint64_t rows,
                                strl_error *err)
{
    const uint64_t fields = columns * rows;
    strl_status status = STRL_OK;
    for (uint64_t first = 0; first < fields && status == STRL_OK; first += BATCH) {
        const uint32_t count = fields - first < BATCH ? (uint32_t)(fields - first) : BATCH;
        for (uint32_t i = 0; i < count; i++)
            put_field(batch, i, first * CORNERS, (first + i) / columns, (first + i) % columns, (double)rows,
                      (double)columns);
        status = strl__scene_mesh_vertices(run->writer, batch->records, (uint64_t)count * CORNERS, err);
        if (status == STRL_OK)
            status = strl__scene_mesh_triangles(run->writer, batch->corners, 2 * (uint64_t)count, err);
        if (status == STRL_OK)
            status = strl__scene_report(run, "painting", first + count, fields, err);
    }
    return status;
}

static uint64_t columns_of(uint64_t fields)
{
    return (uint64_t)lround(sqrt((double)fields));
}

strl_status strl__scene_chessboard(strl__scene_run *run, strl_error *err)
{
    const uint64_t fields = run->desc->triangles / 2, columns = columns_of(fields);
    const field_batch batch = {strl__alloc(BATCH * CORNERS, RECORD_BYTES),
                               strl__alloc(BATCH, 6 * sizeof *batch.corners)};
    strl_status status = batch.records && batch.corners
                             ? write_fields(run, &batch, columns, fields / columns, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory for some fields of the chessboard");
    strl__free(batch.records);
    strl__free(batch.corners);
    return status;
}

/* ---- as copies */

/* Of one size, wherever they lie: within the board, or at its upper edges. */
typedef struct board_tile {
    strl__part_mesh shade[SHADES];
} board_tile;

typedef struct board {
    strl__scene_run *run;
    uint64_t columns, rows;
    board_tile tiles[2][2]; /* [at the upper edge of rows][of columns] */
    strl__copy *copies;     /* [columns / TILE + 1] */
} board;

static uint64_t tile_fields(uint64_t all, bool at_edge)
{
    return at_edge ? all % TILE : all < TILE ? 0 : TILE;
}

static void put_tile_field(strl__part_mesh *mesh, double column, double row)
{
    const double up[3] = {0, 0, 1};
    uint32_t corner[CORNERS];
    for (unsigned i = 0; i < CORNERS; i++) {
        const double position[3] = {column + (i & 1), row + (i >> 1), 0};
        corner[i] = strl__part_mesh_vertex(mesh, position, up);
    }
    strl__part_mesh_quad(mesh, corner[0], corner[1], corner[3], corner[2]);
}

static strl_status make_tile(board *self, bool upper, bool right, strl_error *err)
{
    board_tile *tile = &self->tiles[upper][right];
    for (unsigned shade = 0; shade < SHADES; shade++)
        strl__part_mesh_clear(&tile->shade[shade]);
    for (uint64_t row = 0; row < tile_fields(self->rows, upper); row++)
        for (uint64_t column = 0; column < tile_fields(self->columns, right); column++)
            put_tile_field(&tile->shade[(row + column) & 1], (double)column, (double)row);
    return tile->shade[0].failed || tile->shade[1].failed
               ? strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for fields of the chessboard", self->run->desc->path)
               : STRL_OK;
}

/* From the given tile of its row on. */
static strl_status put_tiles(board *self, const board_tile *tile, uint64_t row, uint64_t first, uint32_t count,
                             strl_error *err)
{
    static const char *const names[SHADES] = {"BLACK-FIELDS", "WHITE-FIELDS"};
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < count; i++)
        self->copies[i] =
            strl__copy_upright((const double[3]){(double)((first + i) * TILE), (double)(row * TILE), 0}, 0, 1);
    for (unsigned shade = 0; shade < SHADES && status == STRL_OK; shade++) {
        const strl__part part = {names[shade], shade, strl__affine_identity(), &tile->shade[shade]};
        if (count && part.mesh->triangle_count)
            status = self->run->parts->put_copies(self->run->parts, &part, self->copies, count, err);
    }
    return status;
}

static strl_status put_board(board *self, strl_error *err)
{
    const uint64_t across = self->columns / TILE, tile_rows = (self->rows + TILE - 1) / TILE;
    strl_status status = STRL_OK;
    for (unsigned i = 0; i < 4 && status == STRL_OK; i++)
        status = make_tile(self, i / 2, i % 2, err);
    for (uint64_t row = 0; row < tile_rows && status == STRL_OK; row++) {
        const bool upper = row == self->rows / TILE;
        status = put_tiles(self, &self->tiles[upper][0], row, 0, (uint32_t)across, err);
        if (status == STRL_OK)
            status = put_tiles(self, &self->tiles[upper][1], row, across, 1, err);
        if (status == STRL_OK)
            status = strl__scene_report(self->run, "painting", row + 1, tile_rows, err);
    }
    return status;
}

strl_status strl__scene_chessboard_copies(strl__scene_run *run, strl_error *err)
{
    const uint64_t fields = run->desc->triangles / 2, columns = columns_of(fields), rows = fields / columns;
    const strl__affine upright = {.axis = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}}; /* glTF has y up */
    const strl__affine unit = {
        .axis = {{1 / (double)columns, 0, 0}, {0, 1 / (double)rows, 0}, {0, 0, 1 / (double)columns}}};
    strl__parts_writer *parts = run->parts;
    board self = {
        .run = run, .columns = columns, .rows = rows, .copies = strl__alloc(columns / TILE + 1, sizeof *self.copies)};
    strl_status status = self.copies ? parts->open_group(parts, "CHESSBOARD", &upright, err)
                                     : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for copies", run->desc->path);
    if (status == STRL_OK)
        status = parts->open_group(parts, "FIELDS", &unit, err);
    if (status == STRL_OK)
        status = put_board(&self, err);
    if (status == STRL_OK)
        status = parts->close_group(parts, err);
    if (status == STRL_OK)
        status = parts->close_group(parts, err);
    for (unsigned i = 0; i < 4 * SHADES; i++)
        strl__part_mesh_deinit(&self.tiles[i / 4][i / 2 % 2].shade[i % 2]);
    strl__free(self.copies);
    return status;
}
