/* Scene `isosurface`: the zero level of mixing_field.h by marching cubes, tile by tile.
 *
 * Tiles are extracted in any order by all threads and numbered and written in the order x, y, z (z fastest) by one. Of
 * the tiles that are written only the starts of their shared blocks are kept, for the current layer in x and the one
 * before it: memory grows with a layer's tiles (200 KB for a billion triangles), not with the surface. */
#include "scenes/generator.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

#define SLOT_BYTES ((uint64_t)6 << 20) /* a tile full of surface, with normals */

typedef struct block_starts {
    uint64_t start[STRL__BLOCKS_OWN];
} block_starts;

typedef struct extraction_run {
    const strl__scene_run *scene;
    strl__isosurface surface;
    strl__tile_mesh *meshes; /* one per slot */
    block_starts *layers[2]; /* by y * tiles[2] + z; layer x in x & 1 */
    uint64_t tile_count;
    uint64_t reported;
} extraction_run;

static void tile_at(const strl__grid *grid, uint64_t index, uint64_t tile[3])
{
    tile[2] = index % grid->tiles[2];
    tile[1] = index / grid->tiles[2] % grid->tiles[1];
    tile[0] = index / grid->tiles[2] / grid->tiles[1];
}

static block_starts *starts_at(const extraction_run *run, const uint64_t tile[3])
{
    return &run->layers[tile[0] & 1][tile[1] * run->surface.grid.tiles[2] + tile[2]];
}

static strl_status extract_tile(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    extraction_run *run = context;
    uint64_t tile[3];
    tile_at(&run->surface.grid, index, tile);
    return strl__tile_extract(&run->surface.field, &run->surface.grid, tile, !run->scene->desc->no_normals,
                              &run->surface.table, &run->surface.scratch[worker], &run->meshes[slot], err);
}

/* The start of a block of the neighbour below along the axes in the mask; 0 where there is none (and no corner names
 * it). */
static uint64_t start_below(const extraction_run *run, const uint64_t tile[3], unsigned axes, unsigned block)
{
    uint64_t neighbour[3];
    for (unsigned axis = 0; axis < 3; axis++) {
        unsigned step = axes >> axis & 1;
        if (tile[axis] < step)
            return 0;
        neighbour[axis] = tile[axis] - step;
    }
    return starts_at(run, neighbour)->start[block];
}

static void gather_starts(const extraction_run *run, const uint64_t tile[3], uint64_t starts[STRL__BLOCKS])
{
    memcpy(starts, starts_at(run, tile)->start, STRL__BLOCKS_OWN * sizeof *starts);
    for (unsigned axis = 0; axis < 3; axis++) {
        unsigned first = 1u << strl__axis_first(axis);
        unsigned second = 1u << strl__axis_second(axis);
        const unsigned below[3] = {first | second, first, second};
        starts[STRL__BLOCK_BELOW_FACE + axis] = start_below(run, tile, 1u << axis, STRL__BLOCK_FACE + axis);
        for (unsigned i = 0; i < 3; i++)
            starts[STRL__BLOCK_BELOW_LINE + 3 * axis + i] = start_below(run, tile, below[i], STRL__BLOCK_LINE + axis);
    }
}

static strl_status write_tile(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    (void)worker;
    extraction_run *run = context;
    strl__tile_mesh *mesh = &run->meshes[slot];
    strl__scene_mesh *writer = run->scene->writer;
    uint64_t tile[3];
    tile_at(&run->surface.grid, index, tile);
    block_starts *own = starts_at(run, tile);
    for (unsigned block = 0; block < STRL__BLOCKS_OWN; block++) {
        own->start[block] = strl__scene_mesh_vertex_count(writer);
        strl_status status =
            strl__scene_mesh_vertices(writer, mesh->blocks[block].vertices, mesh->blocks[block].count, err);
        if (status != STRL_OK)
            return status;
    }
    uint64_t starts[STRL__BLOCKS];
    gather_starts(run, tile, starts);
    for (size_t i = 0; i < 3 * mesh->triangles; i++) {
        uint32_t corner = mesh->corners[i];
        mesh->corners[i] = (uint32_t)starts[corner >> STRL__BLOCK_SHIFT] + (corner & ((1u << STRL__BLOCK_SHIFT) - 1));
    }
    strl_status status = strl__scene_mesh_triangles(writer, mesh->corners, mesh->triangles, err);
    if (status != STRL_OK)
        return status;
    return strl__scene_report(run->scene, "extracting", index + 1, run->tile_count, err);
}

static strl_status extract_all(extraction_run *run, unsigned window, strl_error *err)
{
    const strl__grid *grid = &run->surface.grid;
    for (int i = 0; i < 2; i++) {
        run->layers[i] = strl__alloc_zero(grid->tiles[1] * grid->tiles[2], sizeof *run->layers[i]);
        if (!run->layers[i])
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for a layer of %" PRIu64 " tiles",
                              grid->tiles[1] * grid->tiles[2]);
    }
    run->tile_count = grid->tiles[0] * grid->tiles[1] * grid->tiles[2];
    return strl_pool_ordered(run->scene->desc->pool, run->tile_count, window, extract_tile, write_tile, run,
                             run->scene->desc->cancel, err);
}

strl_status strl__scene_isosurface(strl__scene_run *scene, strl_error *err)
{
    const strl_scene_desc *desc = scene->desc;
    unsigned workers = strl_pool_workers(desc->pool);
    unsigned window = strl_pool_window(desc->pool, 0);
    uint64_t fixed = workers * sizeof(strl__tile_scratch);
    if (fixed + 2 * SLOT_BYTES > desc->memory_bytes)
        return strl__fail(err, STRL_ERR_MEMORY,
                          "scene isosurface with %u threads needs a memory budget of %" PRIu64 " bytes, found %" PRIu64,
                          workers, fixed + 2 * SLOT_BYTES, desc->memory_bytes);
    uint64_t room = (desc->memory_bytes - fixed) / SLOT_BYTES;
    window = room < window ? (unsigned)room : window;

    extraction_run run = {.scene = scene, .surface = {.field = {.seed = desc->seed}}};
    strl__cube_table_init(&run.surface.table);
    run.surface.scratch = strl__alloc_zero(workers, sizeof *run.surface.scratch);
    run.meshes = strl__alloc_zero(window, sizeof *run.meshes);
    strl_status status = STRL_OK;
    if (!run.surface.scratch || !run.meshes)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u threads of scene isosurface", workers);
    if (status == STRL_OK)
        status = strl__isosurface_calibrate(scene, &run.surface, err);
    if (status == STRL_OK)
        status = extract_all(&run, window, err);
    for (unsigned slot = 0; run.meshes && slot < window; slot++)
        strl__tile_mesh_deinit(&run.meshes[slot]);
    strl__free(run.layers[0]);
    strl__free(run.layers[1]);
    strl__free(run.meshes);
    strl__free(run.surface.scratch);
    return status;
}
