#include "verify/input.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"

#define READ_BATCH 4096u
#define CHUNK_TRIANGLES 4096u
/* Memory of one triangle while its slice is cut into chunks: corners, box, order, and what building a chunk takes. */
#define SLICE_TRIANGLE_BYTES 160u
#define LATTICE_LIMIT 0x1p62

/* ---- reading ---- */

typedef struct reading {
    strl__model *model;
    const strl__vtree *tree;
    strl__vinput *input;
    strl__regions *regions;
    strl_triangle *batch;
} reading;

/* docs/format.md: the cell nearest to the point, ties to the even one. False where two corners share a cell. */
static bool quantise(const strl__vtree *tree, const strl_triangle *triangle, double corners[9], strl__hash128 points[3],
                     bool *inside)
{
    int64_t cell[3][3];
    *inside = true;
    for (unsigned c = 0; c < 3; c++) {
        for (unsigned k = 0; k < 3; k++) {
            double x = (triangle->position[c][k] - tree->origin[k]) / tree->step;
            *inside = *inside && fabs(x) < LATTICE_LIMIT;
            corners[3 * c + k] = x;
            cell[c][k] = *inside ? (int64_t)nearbyint(x) : 0;
        }
        points[c] = strl__hash_point(cell[c][0], cell[c][1], cell[c][2]);
    }
    return memcmp(cell[0], cell[1], sizeof cell[0]) && memcmp(cell[1], cell[2], sizeof cell[0]) &&
           memcmp(cell[2], cell[0], sizeof cell[0]);
}

static strl_status take(reading *self, const strl_triangle *triangle, strl_error *err)
{
    double corners[9];
    strl__hash128 points[3];
    bool inside;
    self->input->triangles++;
    /* Of a tree without a triangle the lattice is not known on which they lost their area. The header has to count
     * them. */
    bool none_kept = self->tree->triangle_count == 0 && self->model->tree_count > 1;
    if (none_kept || !quantise(self->tree, triangle, corners, points, &inside)) {
        self->input->degenerate++;
        return STRL_OK;
    }
    if (!inside)
        strl__v_flaw(self->model->checks, STRL_VERIFY_LEAVES, 0,
                     "input triangle %" PRIu64 " is not on the lattice of tree %u", self->input->triangles - 1,
                     self->tree->index);
    strl__hash_add(&self->input->sum, strl__hash_triangle(points[0], points[1], points[2]));
    self->input->kept++;
    return strl__v_regions_add(self->regions, corners, err);
}

static strl_status read_all(reading *self, strl_reader *reader, strl_error *err)
{
    strl_reader_info info;
    strl_reader_info_get(reader, &info);
    size_t count = 1;
    strl_status status = STRL_OK;
    while (status == STRL_OK && count) {
        status = strl_reader_next(reader, self->batch, READ_BATCH, &count, err);
        for (size_t i = 0; status == STRL_OK && i < count; i++)
            status = take(self, &self->batch[i], err);
        if (status == STRL_OK)
            status = strl__v_report(self->model, "read input", strl_reader_bytes_done(reader), info.file_bytes, err);
    }
    return status;
}

static strl_status read_input(reading *self, uint32_t index, uint32_t piece, strl_error *err)
{
    strl_reader *reader = NULL;
    strl_status status = strl__v_open_input(self->model, index, &reader, err);
    if (status == STRL_OK && piece)
        status = strl_reader_select(reader, piece, err);
    if (status == STRL_OK)
        status = read_all(self, reader, err);
    if (status == STRL_OK) {
        strl_reader_drops drops;
        strl_reader_drops_get(reader, &drops);
        self->input->nonfinite += drops.nonfinite;
        self->input->degenerate += drops.degenerate_faces;
        self->input->triangles += drops.nonfinite + drops.degenerate_faces;
        self->input->lines += drops.lines;
        self->input->points += drops.points;
    }
    strl_reader_close(reader);
    return status;
}

static strl_status read_inputs(strl__model *model, const strl__vtree *tree, const strl__vpiece *piece,
                               strl__vinput *input, strl__regions *regions, strl_error *err)
{
    reading self = {.model = model,
                    .tree = tree,
                    .input = input,
                    .regions = regions,
                    .batch = strl__alloc(READ_BATCH, sizeof *self.batch)};
    strl_status status = self.batch ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory to read the input");
    for (uint32_t i = 0; status == STRL_OK && i < model->desc->input_count; i++)
        if (piece->input == STRL__EVERY_INPUT || piece->input == i)
            status = read_input(&self, i, piece->piece, err);
    if (status == STRL_OK)
        status = strl__v_regions_flush(regions, err);
    strl__free(self.batch);
    return status;
}

/* ---- chunks ---- */

typedef struct chunk_entry {
    double box[2][3];
    uint64_t offset, bytes;
} chunk_entry;

/* Some blocks of one region; its chunks are numbered by slice, so that their order does not depend on the threads. */
typedef struct slice {
    uint32_t region;
    size_t first_block, block_count;
    chunk_entry *chunks; /* owned */
    size_t chunk_count, chunk_capacity;
} input_slice;

typedef struct chunking {
    strl__model *model;
    strl__vinput *input;
    strl__regions *regions;
    input_slice *slices;
    size_t slice_count, slice_capacity;
    strl__worker *workers;
    strl_mutex mutex; /* guards the end of the file */
    uint64_t end;
} chunking;

/* Triangles of a slice while it is divided. */
typedef struct pile {
    const double (*corner)[9];
    float (*boxes)[6]; /* relative to base, only for dividing */
    uint32_t *order;
    double base[3];
} triangle_pile;

static bool pile_init(triangle_pile *self, const double (*corner)[9], uint32_t count, strl_arena *arena)
{
    *self = (triangle_pile){.corner = corner};
    self->boxes = strl_arena_alloc(arena, count, sizeof *self->boxes);
    self->order = strl_arena_alloc(arena, count, sizeof *self->order);
    if (!self->boxes || !self->order)
        return false;
    memcpy(self->base, corner[0], sizeof self->base);
    for (uint32_t t = 0; t < count; t++) {
        self->order[t] = t;
        for (unsigned k = 0; k < 3; k++) {
            const double *c = corner[t];
            self->boxes[t][k] = (float)(fmin(fmin(c[k], c[3 + k]), c[6 + k]) - self->base[k]);
            self->boxes[t][3 + k] = (float)(fmax(fmax(c[k], c[3 + k]), c[6 + k]) - self->base[k]);
        }
    }
    return true;
}

/* Equal positions become one vertex, so that it is measured once. */
static uint32_t find_vertex(double (*vertex)[3], uint32_t *count, uint32_t *table, uint32_t mask, const double p[3])
{
    uint64_t bits[3];
    memcpy(bits, p, sizeof bits);
    uint32_t at = (uint32_t)strl__mix64(strl__mix64(strl__mix64(bits[0]) + bits[1]) + bits[2]) & mask;
    while (table[at]) {
        if (memcmp(vertex[table[at] - 1], p, sizeof *vertex) == 0)
            return table[at] - 1;
        at = (at + 1) & mask;
    }
    memcpy(vertex[*count], p, sizeof *vertex);
    table[at] = ++*count;
    return *count - 1;
}

static strl__chunk *make_chunk(const triangle_pile *pile, const uint32_t *order, uint32_t count, strl_arena *scratch,
                               double box[2][3])
{
    uint32_t vertex_count = 0, slots = 4 * CHUNK_TRIANGLES * 2;
    double(*vertex)[3] = strl_arena_alloc(scratch, 3 * (size_t)count, sizeof *vertex);
    uint32_t(*triangle)[3] = strl_arena_alloc(scratch, count, sizeof *triangle);
    uint32_t *table = strl_arena_alloc_zero(scratch, slots, sizeof *table);
    if (!vertex || !triangle || !table)
        return NULL;
    double base[3];
    memcpy(base, pile->corner[order[0]], sizeof base);
    memcpy(box[0], base, sizeof base);
    memcpy(box[1], base, sizeof base);
    for (uint32_t t = 0; t < count; t++)
        for (unsigned c = 0; c < 3; c++) {
            double p[3];
            for (unsigned k = 0; k < 3; k++) {
                double at = pile->corner[order[t]][3 * c + k];
                box[0][k] = fmin(box[0][k], at);
                box[1][k] = fmax(box[1][k], at);
                p[k] = at - base[k] + 0.0; /* no negative zero: positions are compared as bits */
            }
            triangle[t][c] = find_vertex(vertex, &vertex_count, table, slots - 1, p);
        }
    return strl__v_chunk_build(base, (const double(*)[3])vertex, vertex_count, (const uint32_t(*)[3])triangle, count,
                               scratch);
}

static strl_status write_chunk(chunking *self, input_slice *slice, const triangle_pile *pile, const uint32_t *order,
                               uint32_t count, strl_arena *scratch, strl_error *err)
{
    strl_arena_mark mark = strl_arena_get_mark(scratch);
    chunk_entry entry;
    strl__chunk *chunk = make_chunk(pile, order, count, scratch, entry.box);
    strl_status status = STRL_OK;
    if (!chunk || !strl__grow(&slice->chunks, &slice->chunk_capacity, slice->chunk_count + 1, sizeof *slice->chunks))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a piece of %u triangles", count);
    if (status == STRL_OK) {
        strl_mutex_lock(&self->mutex);
        entry.offset = self->end;
        entry.bytes = chunk->bytes;
        self->end += chunk->bytes;
        strl_mutex_unlock(&self->mutex);
        slice->chunks[slice->chunk_count++] = entry;
        status = strl_file_write(self->input->file, entry.offset, chunk, (size_t)chunk->bytes, err);
    }
    strl__free(chunk);
    strl_arena_rewind(scratch, mark);
    return status;
}

/* Halves until a piece is small enough. */
static strl_status divide(chunking *self, input_slice *slice, const triangle_pile *pile, uint32_t *order,
                          uint32_t count, strl_arena *scratch, strl_error *err)
{
    if (count <= CHUNK_TRIANGLES)
        return write_chunk(self, slice, pile, order, count, scratch, err);
    uint32_t half = count / 2;
    unsigned axis = strl__v_bvh_axis((const float(*)[6])pile->boxes, order, count);
    strl__v_bvh_select((const float(*)[6])pile->boxes, order, count, half, axis);
    strl_status status = divide(self, slice, pile, order, half, scratch, err);
    return status == STRL_OK ? divide(self, slice, pile, order + half, count - half, scratch, err) : status;
}

static strl_status chunk_slice(void *context, uint64_t index, unsigned worker_index, strl_error *err)
{
    chunking *self = context;
    strl__worker *worker = &self->workers[worker_index];
    input_slice *slice = &self->slices[index];
    const strl__region *region = &self->regions->items[slice->region];
    uint32_t per_block = self->regions->block_triangles, count = 0;
    strl_arena_rewind(&worker->arena, (strl_arena_mark){0});
    strl_arena_rewind(&worker->scratch, (strl_arena_mark){0});
    double(*corner)[9] = strl_arena_alloc(&worker->arena, slice->block_count * per_block, sizeof *corner);
    if (!corner)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a slice of the input");
    for (size_t i = slice->first_block; i < slice->first_block + slice->block_count; i++) {
        uint32_t triangles = i + 1 == region->block_count ? region->last : per_block;
        strl_status status =
            strl_file_read(self->regions->file, (uint64_t)region->blocks[i] * per_block * STRL__SOUP_BYTES,
                           corner[count], triangles * STRL__SOUP_BYTES, err);
        if (status != STRL_OK)
            return status;
        count += triangles;
    }
    triangle_pile pile;
    if (!pile_init(&pile, (const double(*)[9])corner, count, &worker->arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a slice of %u triangles", count);
    return divide(self, slice, &pile, pile.order, count, &worker->scratch, err);
}

static strl_status list_slices(chunking *self, uint64_t slice_triangles, strl_error *err)
{
    size_t blocks = (size_t)(slice_triangles / self->regions->block_triangles);
    blocks = blocks ? blocks : 1;
    for (uint32_t r = 0; r < self->regions->count; r++)
        for (size_t first = 0; first < self->regions->items[r].block_count; first += blocks) {
            size_t left = self->regions->items[r].block_count - first;
            if (!strl__grow(&self->slices, &self->slice_capacity, self->slice_count + 1, sizeof *self->slices))
                return strl__fail(err, STRL_ERR_MEMORY, "no memory for the slices of the input");
            self->slices[self->slice_count++] =
                (input_slice){.region = r, .first_block = first, .block_count = left < blocks ? left : blocks};
        }
    return STRL_OK;
}

static strl_status load_chunk(void *context, uint32_t index, unsigned worker, strl__chunk **chunk, strl_error *err)
{
    const strl__vinput *input = context;
    (void)worker;
    *chunk = strl__alloc((size_t)input->bytes[index], 1);
    if (!*chunk)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a piece of the input");
    strl_status status = strl_file_read(input->file, input->offset[index], *chunk, (size_t)input->bytes[index], err);
    if (status == STRL_OK)
        strl__v_chunk_point(*chunk);
    return status;
}

static strl_status list_chunks(chunking *self, strl_error *err)
{
    strl__vinput *input = self->input;
    size_t count = 0, at = 0;
    for (size_t s = 0; s < self->slice_count; s++)
        count += self->slices[s].chunk_count;
    double(*box)[2][3] = strl__alloc(count, sizeof *box);
    input->offset = strl__alloc(count, sizeof *input->offset);
    input->bytes = strl__alloc(count, sizeof *input->bytes);
    if (!box || !input->offset || !input->bytes || count > UINT32_MAX) {
        strl__free(box);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the %zu pieces of the input", count);
    }
    for (size_t s = 0; s < self->slice_count; s++)
        for (size_t c = 0; c < self->slices[s].chunk_count; c++, at++) {
            memcpy(box[at], self->slices[s].chunks[c].box, sizeof *box);
            input->offset[at] = self->slices[s].chunks[c].offset;
            input->bytes[at] = self->slices[s].chunks[c].bytes;
        }
    input->surface.load = load_chunk;
    input->surface.context = input;
    return strl__v_surface_init(&input->surface, (uint32_t)count, box, err);
}

static strl_status make_chunks(strl__model *model, strl__vinput *input, strl__regions *regions,
                               uint64_t slice_triangles, strl_error *err)
{
    chunking self = {.model = model, .input = input, .regions = regions, .workers = strl__v_workers_create(model)};
    strl_mutex_init(&self.mutex);
    strl_status status = self.workers ? list_slices(&self, slice_triangles, err)
                                      : strl__fail(err, STRL_ERR_MEMORY, "no memory for the workers");
    if (status == STRL_OK)
        status = strl_pool_for(model->pool, self.slice_count, chunk_slice, &self, NULL, err);
    if (status == STRL_OK)
        status = list_chunks(&self, err);
    for (size_t s = 0; s < self.slice_count; s++)
        strl__free(self.slices[s].chunks);
    strl__free(self.slices);
    strl_mutex_deinit(&self.mutex);
    strl__v_workers_destroy(model, self.workers);
    return status;
}

/* What a double cannot tell apart where the model lies, with some room for the arithmetic of a distance. */
static double rounding_of(const strl__vtree *tree)
{
    double largest = 0;
    for (unsigned k = 0; k < 3; k++)
        largest = fmax(largest, fabs(tree->origin[k]) / tree->step +
                                    fmax(fabs((double)tree->box[0][k]), fabs((double)tree->box[1][k])));
    return 16 * DBL_EPSILON * largest;
}

strl_status strl__v_input_read(strl__model *model, const strl__vtree *tree, const strl__vpiece *piece,
                               strl__vinput *input, strl_error *err)
{
    uint64_t slice_triangles = model->memory_bytes / 8 / strl_pool_workers(model->pool) / SLICE_TRIANGLE_BYTES;
    uint64_t wanted = tree->triangle_count / (slice_triangles / 2) + 1;
    strl__regions regions = {0};
    *input = (strl__vinput){.rounding = rounding_of(tree)};
    strl_status status = strl_file_create_nameless(model->desc->scratch_dir, &input->file, err);
    if (status == STRL_OK)
        status = strl__v_regions_create(model, tree, wanted > 512 ? 512 : (uint32_t)wanted, &regions, err);
    if (status == STRL_OK)
        status = read_inputs(model, tree, piece, input, &regions, err);
    if (status == STRL_OK)
        status = make_chunks(model, input, &regions, slice_triangles, err);
    strl__v_regions_destroy(&regions);
    return status;
}

void strl__v_input_deinit(strl__vinput *input)
{
    strl__v_surface_deinit(&input->surface);
    strl__free(input->offset);
    strl__free(input->bytes);
    strl_file_close(input->file, NULL);
    *input = (strl__vinput){0};
}

void strl__v_check_drops(strl__model *model, const strl__vinput *input)
{
    if (input->triangles != model->triangles_in || input->nonfinite != model->dropped_nonfinite ||
        input->degenerate != model->dropped_degenerate || input->lines != model->dropped_lines ||
        input->points != model->dropped_points)
        strl__v_flaw(model->checks, STRL_VERIFY_LEAVES, 1,
                     "the input has %" PRIu64 " triangles, of which %" PRIu64 " are not finite and %" PRIu64
                     " degenerate, %" PRIu64 " lines and %" PRIu64 " points; the header says %" PRIu64 ", %" PRIu64
                     ", %" PRIu64 ", %" PRIu64 " and %" PRIu64,
                     input->triangles, input->nonfinite, input->degenerate, input->lines, input->points,
                     model->triangles_in, model->dropped_nonfinite, model->dropped_degenerate, model->dropped_lines,
                     model->dropped_points);
}

void strl__v_check_leaves(strl__model *model, const strl__vtree *tree, const strl__vinput *input)
{
    strl__hash128 sum = {0, 0};
    for (uint32_t id = 0; id < tree->node_count; id++)
        if (strl__holds_input(tree, id))
            strl__hash_add(&sum, tree->nodes[id].finest);
    strl__v_checked(model->checks, STRL_VERIFY_LEAVES, input->kept);
    if (input->kept != tree->triangle_count)
        strl__v_flaw(model->checks, STRL_VERIFY_LEAVES, strl__key(tree, 2),
                     "the input has %" PRIu64 " triangles on the lattice, the leaves %" PRIu64, input->kept,
                     tree->triangle_count);
    else if (!strl__hash_same(sum, input->sum))
        strl__v_flaw(model->checks, STRL_VERIFY_LEAVES, strl__key(tree, 3),
                     "the %" PRIu64 " triangles of the leaves are not those of the input on the lattice", input->kept);
}
