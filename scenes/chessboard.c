/* Scene `chessboard`: the unit square in black and white fields of two triangles each, as Klein et al. 2005 (6) draw it: from afar
 * all of it is grey, and what is drawn shows whether samples are fair. Fields share no vertices, so that borders are sharp. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "scenes/generator.h"

enum { RECORD_BYTES = 15, CORNERS = 4, BATCH = 4096 };

typedef struct field_batch {
    uint8_t *records; /* [BATCH * CORNERS] */
    uint32_t *corners; /* [BATCH * 6] */
} field_batch;

static void put_field(const field_batch *batch, uint32_t at, uint64_t first_vertex, uint64_t row, uint64_t column, double rows,
                      double columns)
{
    const uint8_t shade = (row + column) & 1 ? 255 : 0;
    const uint32_t first = (uint32_t)(first_vertex + (uint64_t)at * CORNERS);
    uint32_t *corners = batch->corners + (size_t)at * 6;
    for (unsigned corner = 0; corner < CORNERS; corner++) {
        uint8_t *record = batch->records + ((size_t)at * CORNERS + corner) * RECORD_BYTES;
        const float position[3] = {(float)(((double)column + (corner & 1)) / columns), (float)(((double)row + (corner >> 1)) / rows), 0};
        memcpy(record, position, sizeof position);
        memset(record + sizeof position, shade, 3);
    }
    const uint32_t both[6] = {first, first + 1, first + 3, first, first + 3, first + 2};
    memcpy(corners, both, sizeof both);
}

static strl_status write_fields(strl__scene_run *run, const field_batch *batch, uint64_t columns, uint64_t rows, strl_error *err)
{
    const uint64_t fields = columns * rows;
    strl_status status = STRL_OK;
    for (uint64_t first = 0; first < fields && status == STRL_OK; first += BATCH) {
        const uint32_t count = fields - first < BATCH ? (uint32_t)(fields - first) : BATCH;
        for (uint32_t i = 0; i < count; i++)
            put_field(batch, i, first * CORNERS, (first + i) / columns, (first + i) % columns, (double)rows, (double)columns);
        status = strl__scene_mesh_vertices(run->writer, batch->records, (uint64_t)count * CORNERS, err);
        if (status == STRL_OK)
            status = strl__scene_mesh_triangles(run->writer, batch->corners, 2 * (uint64_t)count, err);
        if (status == STRL_OK)
            status = strl__scene_report(run, "painting", first + count, fields, err);
    }
    return status;
}

strl_status strl__scene_chessboard(strl__scene_run *run, strl_error *err)
{
    const uint64_t fields = run->desc->triangles / 2, columns = (uint64_t)lround(sqrt((double)fields));
    const field_batch batch = {strl__alloc(BATCH * CORNERS, RECORD_BYTES), strl__alloc(BATCH, 6 * sizeof *batch.corners)};
    strl_status status = batch.records && batch.corners
                             ? write_fields(run, &batch, columns, fields / columns, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory for some fields of the chessboard");
    strl__free(batch.records);
    strl__free(batch.corners);
    return status;
}
