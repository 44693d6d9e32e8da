/* See tile.h. */
#include "scenes/tile.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

/* Vertices keep this share of a cell from the grid's corners: neighbours on different edges never meet, and no triangle
 * degenerates. It moves a vertex by at most as much, and only there. */
#define CLEARANCE 0.0625f

enum { LOW, MIDDLE, HIGH };

typedef struct extraction {
    const strl__grid *grid;
    const strl__cube_table *table;
    strl__tile_scratch *scratch;
    strl__tile_mesh *mesh;
    uint32_t next[STRL__BLOCKS]; /* per block: how many have been met */
    int64_t first[3];            /* the tile's first cell */
    unsigned cells[3];
    bool below[3]; /* whether there is a tile on the lower side */
    bool normals;
} extraction;

void strl__tile_mesh_deinit(strl__tile_mesh *mesh)
{
    for (int block = 0; block < STRL__BLOCKS_OWN; block++)
        strl__free(mesh->blocks[block].vertices);
    strl__free(mesh->corners);
    *mesh = (strl__tile_mesh){0};
}

/* Sign masks of one slice of samples; the box has a margin of one sample. */
static void take_signs(const strl__field_scratch *field, const unsigned cells[3], unsigned margin, unsigned z,
                       uint64_t *inside)
{
    for (unsigned y = 0; y <= cells[1]; y++) {
        const float *row = strl__field_at(field, margin, y + margin, z + margin);
        uint64_t mask = 0;
        unsigned x = 0;
        for (; x + 8 <= cells[0] + 1; x += 8) {
            uint64_t pair[4];
            memcpy(pair, row + x, sizeof pair);
            uint64_t bits = 0;
            for (int i = 0; i < 4; i++)
                bits |= ((pair[i] >> 31 & 1) | (pair[i] >> 62 & 2)) << (2 * i);
            mask |= bits << x;
        }
        for (; x <= cells[0]; x++)
            mask |= (uint64_t)(signbit(row[x]) != 0) << x;
        inside[y] = mask;
    }
}

/* The cells of one row that the surface crosses, as a mask. */
static uint64_t active_cells(const uint64_t *low, const uint64_t *high, unsigned y, unsigned cells)
{
    uint64_t any = low[y] | low[y + 1] | high[y] | high[y + 1];
    uint64_t all = low[y] & low[y + 1] & high[y] & high[y + 1];
    return (any | any >> 1) & ~(all & all >> 1) & (((uint64_t)1 << cells) - 1);
}

static unsigned cube_mask(const uint64_t *low, const uint64_t *high, unsigned y, unsigned x)
{
    return (unsigned)((low[y] >> x & 3) | (low[y + 1] >> x & 3) << 2 | (high[y] >> x & 3) << 4 |
                      (high[y + 1] >> x & 3) << 6);
}

uint64_t strl__tile_count(const strl__field *field, double step, const int64_t first[3], const unsigned cells[3],
                          const strl__cube_table *table, strl__tile_scratch *scratch)
{
    strl__field_box box = {
        .first = {first[0], first[1], first[2]}, .count = {cells[0] + 1, cells[1] + 1, cells[2] + 1}, .step = step};
    if (!strl__field_sample(field, &box, &scratch->field))
        return 0;
    uint64_t triangles = 0;
    take_signs(&scratch->field, cells, 0, 0, scratch->inside[0]);
    for (unsigned z = 0; z < cells[2]; z++) {
        const uint64_t *low = scratch->inside[z & 1];
        uint64_t *high = scratch->inside[~z & 1];
        take_signs(&scratch->field, cells, 0, z + 1, high);
        for (unsigned y = 0; y < cells[1]; y++) {
            uint64_t active = active_cells(low, high, y, cells[0]);
            for (; active; active &= active - 1)
                triangles += table->triangles[cube_mask(low, high, y, (unsigned)__builtin_ctzll(active))];
        }
    }
    return triangles;
}

/* Which block an edge along `axis` belongs to, by the tile's faces it lies on (first and second of the other axes). */
static unsigned block_of(unsigned axis, unsigned first, unsigned second)
{
    if (first == MIDDLE && second == MIDDLE)
        return STRL__BLOCK_INSIDE;
    if (first == MIDDLE)
        return (second == HIGH ? STRL__BLOCK_FACE : STRL__BLOCK_BELOW_FACE) + strl__axis_second(axis);
    if (second == MIDDLE)
        return (first == HIGH ? STRL__BLOCK_FACE : STRL__BLOCK_BELOW_FACE) + strl__axis_first(axis);
    if (first == HIGH && second == HIGH)
        return STRL__BLOCK_LINE + axis;
    unsigned neighbour = first == LOW && second == LOW ? 0 : first == LOW ? 1 : 2;
    return STRL__BLOCK_BELOW_LINE + 3 * axis + neighbour;
}

static unsigned place_of(const extraction *work, unsigned axis, unsigned at)
{
    if (at == 0 && work->below[axis])
        return LOW;
    return at == work->cells[axis] ? HIGH : MIDDLE;
}

static void gradient_at(const float *sample, float gradient[3])
{
    const ptrdiff_t row = STRL__FIELD_STRIDE;
    const ptrdiff_t slice = (ptrdiff_t)STRL__FIELD_SIDE * STRL__FIELD_STRIDE;
    gradient[0] = sample[1] - sample[-1];
    gradient[1] = sample[row] - sample[-row];
    gradient[2] = sample[slice] - sample[-slice];
}

/* The vertex on the edge along `axis` from grid corner `at`. */
static void place_vertex(const extraction *work, unsigned axis, const unsigned at[3], float *vertex)
{
    static const ptrdiff_t steps[3] = {1, STRL__FIELD_STRIDE, (ptrdiff_t)STRL__FIELD_SIDE * STRL__FIELD_STRIDE};
    const float *low = strl__field_at(&work->scratch->field, at[0] + 1, at[1] + 1, at[2] + 1);
    const float *high = low + steps[axis];
    float share = *low / (*low - *high);
    float clear = share > CLEARANCE ? share : CLEARANCE;
    clear = clear < 1.0f - CLEARANCE ? clear : 1.0f - CLEARANCE;
    for (unsigned i = 0; i < 3; i++) {
        double place = (double)(work->first[i] + at[i]);
        vertex[i] = (float)((i == axis ? place + (double)clear : place) * work->grid->step);
    }
    if (!work->normals)
        return;
    float a[3];
    float b[3];
    gradient_at(low, a);
    gradient_at(high, b);
    float square = 0;
    for (int i = 0; i < 3; i++) {
        a[i] += share * (b[i] - a[i]);
        square += a[i] * a[i];
    }
    float scale = square > 0 ? 1.0f / sqrtf(square) : 0.0f;
    for (int i = 0; i < 3; i++)
        vertex[3 + i] = square > 0 ? a[i] * scale : (float)(i == 2);
}

/* Gives the crossed edges of one row their corners, in scan order. */
static bool number_row(extraction *work, unsigned axis, uint64_t crossed, unsigned y, unsigned z, uint32_t *corners)
{
    const size_t floats = work->normals ? 6 : 3;
    unsigned block_low;
    unsigned block_middle;
    unsigned block_high;
    if (axis == 0) {
        block_low = block_middle = block_high = block_of(0, place_of(work, 1, y), place_of(work, 2, z));
    } else {
        unsigned other = axis == 1 ? place_of(work, 2, z) : place_of(work, 1, y);
        block_low = block_of(axis, place_of(work, 0, 0), other);
        block_middle = block_of(axis, MIDDLE, other);
        block_high = block_of(axis, HIGH, other);
    }
    for (; crossed; crossed &= crossed - 1) {
        unsigned x = (unsigned)__builtin_ctzll(crossed);
        unsigned block = x == 0 ? block_low : x == work->cells[0] ? block_high : block_middle;
        uint32_t index = work->next[block]++;
        corners[64 * y + x] = (uint32_t)block << STRL__BLOCK_SHIFT | index;
        if (block >= STRL__BLOCKS_OWN)
            continue;
        strl__tile_block *own = &work->mesh->blocks[block];
        if ((index + 1) * floats > own->capacity &&
            !strl__grow(&own->vertices, &own->capacity, (index + 1) * floats, sizeof(float)))
            return false;
        const unsigned at[3] = {x, y, z};
        place_vertex(work, axis, at, own->vertices + index * floats);
        own->count = index + 1;
    }
    return true;
}

/* Edges along x and y in slice z. */
static bool number_slice(extraction *work, unsigned z)
{
    const uint64_t *inside = work->scratch->inside[z & 1];
    uint32_t *along_x = work->scratch->corners[2 * (z & 1)];
    uint32_t *along_y = work->scratch->corners[2 * (z & 1) + 1];
    uint64_t cells = ((uint64_t)1 << work->cells[0]) - 1;
    uint64_t points = cells << 1 | 1;
    for (unsigned y = 0; y <= work->cells[1]; y++) {
        if (!number_row(work, 0, (inside[y] ^ inside[y] >> 1) & cells, y, z, along_x))
            return false;
        if (y < work->cells[1] && !number_row(work, 1, (inside[y] ^ inside[y + 1]) & points, y, z, along_y))
            return false;
    }
    return true;
}

/* Edges along z from slice z to the next. */
static bool number_layer(extraction *work, unsigned z)
{
    const uint64_t *low = work->scratch->inside[z & 1];
    const uint64_t *high = work->scratch->inside[~z & 1];
    uint64_t points = (((uint64_t)1 << work->cells[0]) - 1) << 1 | 1;
    for (unsigned y = 0; y <= work->cells[1]; y++) {
        if (!number_row(work, 2, (low[y] ^ high[y]) & points, y, z, work->scratch->corners[4]))
            return false;
    }
    return true;
}

static bool emit_layer(extraction *work, unsigned z)
{
    const uint64_t *low = work->scratch->inside[z & 1];
    const uint64_t *high = work->scratch->inside[~z & 1];
    strl__tile_mesh *mesh = work->mesh;
    const uint32_t *edges[12];
    for (unsigned i = 0; i < 4; i++) {
        unsigned slice = (z + (i >> 1)) & 1;
        edges[i] = work->scratch->corners[2 * slice] + 64 * (i & 1);
        edges[4 + i] = work->scratch->corners[2 * slice + 1] + (i & 1);
        edges[8 + i] = work->scratch->corners[4] + (i & 1) + 64 * (i >> 1);
    }
    for (unsigned y = 0; y < work->cells[1]; y++) {
        uint64_t active = active_cells(low, high, y, work->cells[0]);
        size_t most = 3 * (mesh->triangles + STRL__CUBE_TRIANGLES_MAX * (size_t)__builtin_popcountll(active));
        if (most > mesh->corner_capacity && !strl__grow(&mesh->corners, &mesh->corner_capacity, most, sizeof(uint32_t)))
            return false;
        for (; active; active &= active - 1) {
            unsigned x = (unsigned)__builtin_ctzll(active);
            unsigned mask = cube_mask(low, high, y, x);
            uint32_t *to = mesh->corners + 3 * mesh->triangles;
            for (unsigned i = 0; i < 3u * work->table->triangles[mask]; i++)
                to[i] = edges[work->table->edges[mask][i]][64 * y + x];
            mesh->triangles += work->table->triangles[mask];
        }
    }
    return true;
}

static bool extract_layers(extraction *work)
{
    take_signs(&work->scratch->field, work->cells, 1, 0, work->scratch->inside[0]);
    if (!number_slice(work, 0))
        return false;
    for (unsigned z = 0; z < work->cells[2]; z++) {
        take_signs(&work->scratch->field, work->cells, 1, z + 1, work->scratch->inside[~z & 1]);
        if (!number_layer(work, z) || !number_slice(work, z + 1) || !emit_layer(work, z))
            return false;
    }
    return true;
}

strl_status strl__tile_extract(const strl__field *field, const strl__grid *grid, const uint64_t tile[3], bool normals,
                               const strl__cube_table *table, strl__tile_scratch *scratch, strl__tile_mesh *mesh,
                               strl_error *err)
{
    extraction work = {.grid = grid, .table = table, .scratch = scratch, .mesh = mesh, .normals = normals};
    strl__field_box box = {.step = grid->step};
    for (int axis = 0; axis < 3; axis++) {
        uint64_t first = tile[axis] * STRL__TILE_CELLS;
        uint64_t left = grid->cells[axis] - first;
        work.first[axis] = (int64_t)first;
        work.cells[axis] = left < STRL__TILE_CELLS ? (unsigned)left : STRL__TILE_CELLS;
        work.below[axis] = tile[axis] > 0;
        box.first[axis] = work.first[axis] - 1;
        box.count[axis] = work.cells[axis] + 3;
    }
    for (int block = 0; block < STRL__BLOCKS_OWN; block++)
        mesh->blocks[block].count = 0;
    mesh->triangles = 0;
    if (!strl__field_sample(field, &box, &scratch->field))
        return STRL_OK;
    if (!extract_layers(&work))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the surface in one tile of the scene");
    return STRL_OK;
}
