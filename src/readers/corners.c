#include "readers/corners.h"

#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

#define SLOT_BITS 24 /* of a sort key: the corner; the rest is the record */
#define CORNERS_MAX ((size_t)1 << SLOT_BITS)
#define RESIDENT_GOAL 4096u /* corners; stays in the processor's cache */
#define DIGIT_BITS 11
#define GAP_BYTES ((uint64_t)32 << 10) /* reading on is cheaper than a second read up to about here */

static size_t batch_corner_bytes(const strl__batch_desc *desc)
{
    return sizeof(strl__corner) + sizeof(strl__face) / 3 + 1 + (desc->indexed ? 8u : 0) +
           (desc->indexed_normals ? 8u : 0) + (desc->indexed_texcoords ? 8u : 0) + (desc->sorted ? 16u : 0);
}

strl_status strl__batch_init(strl__batch *batch, const strl__batch_desc *desc, strl_error *err)
{
    *batch = (strl__batch){0};
    size_t capacity = desc->sorted ? desc->bytes / batch_corner_bytes(desc) : 0;
    if (capacity < STRL__POLYGON_CORNERS_MAX + RESIDENT_GOAL)
        capacity = STRL__POLYGON_CORNERS_MAX + RESIDENT_GOAL;
    if (capacity > CORNERS_MAX)
        capacity = CORNERS_MAX;
    batch->corner_capacity = capacity;
    batch->corner_goal = capacity - STRL__POLYGON_CORNERS_MAX;
    batch->face_capacity = capacity / 3 + 1;
    batch->faces = strl__alloc(batch->face_capacity, sizeof *batch->faces);
    batch->corners = strl__alloc(capacity, sizeof *batch->corners);
    if (desc->indexed)
        batch->vertex = strl__alloc(capacity, sizeof *batch->vertex);
    if (desc->indexed_normals)
        batch->normal = strl__alloc(capacity, sizeof *batch->normal);
    if (desc->indexed_texcoords)
        batch->texcoord = strl__alloc(capacity, sizeof *batch->texcoord);
    for (unsigned i = 0; i < 2 && desc->sorted; i++)
        batch->keys[i] = strl__alloc(capacity, sizeof *batch->keys[i]);
    bool whole = batch->faces && batch->corners && (batch->vertex || !desc->indexed) &&
                 (batch->normal || !desc->indexed_normals) && (batch->texcoord || !desc->indexed_texcoords) &&
                 ((batch->keys[0] && batch->keys[1]) || !desc->sorted);
    if (whole)
        return STRL_OK;
    strl__batch_deinit(batch);
    return strl__fail(err, STRL_ERR_MEMORY, "no memory for a batch of %zu corners", capacity);
}

void strl__batch_deinit(strl__batch *batch)
{
    strl__free(batch->faces);
    strl__free(batch->corners);
    strl__free(batch->vertex);
    strl__free(batch->normal);
    strl__free(batch->texcoord);
    strl__free(batch->keys[0]);
    strl__free(batch->keys[1]);
    strl__polygon_deinit(&batch->polygon);
    *batch = (strl__batch){0};
}

void strl__batch_reset(strl__batch *batch)
{
    batch->face_count = batch->corner_count = 0;
    batch->next_face = batch->next_corner = 0;
    batch->next_triangle = 0;
}

/* Looks up all corners from a window that holds every record they name. */
static void decode_in_order(const strl__batch *batch, const strl__table *table, const uint64_t *indices)
{
    for (size_t i = 0; i < batch->corner_count; i++)
        if (indices[i] != STRL__NO_INDEX)
            strl__layout_decode(&table->layout, strl__table_record(table, indices[i]), &batch->corners[i]);
}

/* Sorts keys by their record numbers, all below 2^range_bits, digit by digit. Returns the sorted
 * array. */
static uint64_t *sort_keys(uint64_t *keys, uint64_t *scratch, size_t count, unsigned range_bits)
{
    for (unsigned shift = SLOT_BITS; shift < SLOT_BITS + range_bits; shift += DIGIT_BITS) {
        const uint64_t mask = ((uint64_t)1 << DIGIT_BITS) - 1;
        uint32_t starts[(1u << DIGIT_BITS) + 1] = {0};
        for (size_t i = 0; i < count; i++)
            starts[(keys[i] >> shift & mask) + 1]++;
        for (size_t digit = 0; digit < mask; digit++)
            starts[digit + 1] += starts[digit];
        for (size_t i = 0; i < count; i++)
            scratch[starts[keys[i] >> shift & mask]++] = keys[i];
        uint64_t *sorted = scratch;
        scratch = keys;
        keys = sorted;
    }
    return keys;
}

/* Reads the records that sorted keys name, run by run, and looks the corners up. */
static strl_status sweep(const strl__batch *batch, strl__table *table, const uint64_t *keys, size_t count,
                         uint64_t lowest, strl_error *err)
{
    const uint64_t slot_mask = ((uint64_t)1 << SLOT_BITS) - 1;
    const uint64_t fits = strl__table_window_records(table);
    const uint64_t gap = GAP_BYTES / table->layout.stride + 1;
    for (size_t begin = 0; begin < count;) {
        uint64_t first = lowest + (keys[begin] >> SLOT_BITS), last = first;
        size_t end = begin + 1;
        for (; end < count; end++) {
            uint64_t record = lowest + (keys[end] >> SLOT_BITS);
            if (record - last > gap || record - first >= fits)
                break;
            last = record;
        }
        strl_status status = strl__table_load(table, first, last, err);
        if (status)
            return status;
        for (; begin < end; begin++)
            strl__layout_decode(&table->layout, strl__table_record(table, lowest + (keys[begin] >> SLOT_BITS)),
                                &batch->corners[keys[begin] & slot_mask]);
    }
    return STRL_OK;
}

static strl_status resolve_sorted(strl__batch *batch, strl__table *table, const uint64_t *indices, uint64_t lowest,
                                  uint64_t highest, strl_error *err)
{
    unsigned range_bits = highest > lowest ? 64 - (unsigned)__builtin_clzll(highest - lowest) : 0;
    if (!batch->keys[0] || range_bits > 64 - SLOT_BITS)
        return strl__fail(err, STRL_ERR_LIMIT, "vertices %llu to %llu are too far apart to be resolved together",
                          (unsigned long long)lowest, (unsigned long long)highest);
    size_t count = 0;
    for (size_t i = 0; i < batch->corner_count; i++)
        if (indices[i] != STRL__NO_INDEX)
            batch->keys[0][count++] = (indices[i] - lowest) << SLOT_BITS | i;
    const uint64_t *sorted = sort_keys(batch->keys[0], batch->keys[1], count, range_bits);
    return sweep(batch, table, sorted, count, lowest, err);
}

static strl_status resolve(strl__batch *batch, strl__table *table, const uint64_t *indices, strl_error *err)
{
    uint64_t lowest = UINT64_MAX, highest = 0;
    for (size_t i = 0; i < batch->corner_count; i++)
        if (indices[i] != STRL__NO_INDEX) {
            lowest = indices[i] < lowest ? indices[i] : lowest;
            highest = indices[i] > highest ? indices[i] : highest;
        }
    if (lowest == UINT64_MAX)
        return STRL_OK;
    if (!strl__table_is_resident(table) && highest - lowest >= strl__table_window_records(table))
        return resolve_sorted(batch, table, indices, lowest, highest, err);
    strl_status status = strl__table_load(table, lowest, highest, err);
    if (!status)
        decode_in_order(batch, table, indices);
    return status;
}

strl_status strl__batch_resolve(strl__batch *batch, strl__table *vertices, strl__table *normals, strl_error *err)
{
    if (!vertices->layout.has_normal || !vertices->layout.has_colour)
        for (size_t i = 0; i < batch->corner_count; i++) {
            memset(batch->corners[i].normal, 0, sizeof batch->corners[i].normal);
            batch->corners[i].colour = 0xffffffffu;
        }
    strl_status status = resolve(batch, vertices, batch->vertex, err);
    if (!status && normals && batch->normal)
        status = resolve(batch, normals, batch->normal, err);
    return status;
}

strl_status strl__batch_resolve_texcoords(strl__batch *batch, strl__table *texcoords, strl_error *err)
{
    return resolve(batch, texcoords, batch->texcoord, err);
}

static bool is_finite_corner(const strl__corner *corner)
{
    return __builtin_isfinite(corner->position[0]) && __builtin_isfinite(corner->position[1]) &&
           __builtin_isfinite(corner->position[2]);
}

static bool has_normal(const strl__corner *corner)
{
    return corner->normal[0] != 0 || corner->normal[1] != 0 || corner->normal[2] != 0;
}

/* Finite, and not so far from the image that nothing of it could be told. */
static bool is_texcoord(const float texcoord[2])
{
    return texcoord[0] > -1e6f && texcoord[0] < 1e6f && texcoord[1] > -1e6f && texcoord[1] < 1e6f;
}

static void make_triangle(const strl__batch *batch, const strl__face *face, const strl__corner *const corners[3],
                          strl_triangle *triangle)
{
    for (unsigned i = 0; i < 3; i++) {
        memcpy(triangle->position[i], corners[i]->position, sizeof triangle->position[i]);
        memcpy(triangle->normal[i], corners[i]->normal, sizeof triangle->normal[i]);
        triangle->colour[i] = batch->has_corner_colour ? corners[i]->colour : face->colour;
    }
    bool has_texcoord = batch->has_texcoord;
    for (unsigned i = 0; i < 3 && has_texcoord; i++)
        has_texcoord = is_texcoord(corners[i]->texcoord);
    for (unsigned i = 0; i < 3; i++) {
        triangle->texcoord[i][0] = has_texcoord ? corners[i]->texcoord[0] : 0;
        triangle->texcoord[i][1] = has_texcoord ? corners[i]->texcoord[1] : 0;
    }
    triangle->part = face->part;
    triangle->material = face->material;
    triangle->flags = batch->has_corner_colour || batch->has_face_colour ? STRL_TRIANGLE_HAS_COLOUR : 0;
    if (has_texcoord)
        triangle->flags |= STRL_TRIANGLE_HAS_TEXCOORD;
    if (has_normal(corners[0]) && has_normal(corners[1]) && has_normal(corners[2]))
        triangle->flags |= STRL_TRIANGLE_HAS_NORMAL;
    else
        memset(triangle->normal, 0, sizeof triangle->normal);
}

/* Prepares the next face. Returns the number of its triangles, 0 where it is dropped. */
static uint32_t begin_face(strl__batch *batch, const strl__face *face, strl_reader_drops *drops, bool *no_memory)
{
    const strl__corner *corners = batch->corners + batch->next_corner;
    for (uint32_t i = 0; i < face->corner_count; i++)
        if (!is_finite_corner(&corners[i])) {
            drops->nonfinite += face->corner_count - 2; /* what cannot be triangulated is lost as a whole */
            return 0;
        }
    if (face->corner_count > 3 &&
        !strl__polygon_triangulate(&batch->polygon, corners->position, sizeof *corners, face->corner_count)) {
        *no_memory = true;
        return 0;
    }
    return face->corner_count - 2;
}

strl_status strl__batch_emit(strl__batch *batch, strl_triangle *triangles, size_t capacity, size_t *count,
                             strl_reader_drops *drops, strl_error *err)
{
    static const uint32_t single[3] = {0, 1, 2};
    *count = 0;
    while (batch->next_face < batch->face_count && *count < capacity) {
        const strl__face *face = &batch->faces[batch->next_face];
        bool no_memory = false;
        uint32_t total = batch->next_triangle ? face->corner_count - 2 : begin_face(batch, face, drops, &no_memory);
        if (no_memory)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory to triangulate a face of %u corners",
                              face->corner_count);
        const strl__corner *corners = batch->corners + batch->next_corner;
        while (batch->next_triangle < total && *count < capacity) {
            const uint32_t *index = total == 1 ? single : batch->polygon.triangles + 3 * (size_t)batch->next_triangle;
            const strl__corner *const chosen[3] = {&corners[index[0]], &corners[index[1]], &corners[index[2]]};
            make_triangle(batch, face, chosen, &triangles[(*count)++]);
            batch->next_triangle++;
        }
        if (batch->next_triangle == total) {
            batch->next_corner += face->corner_count;
            batch->next_face++;
            batch->next_triangle = 0;
        }
    }
    return STRL_OK;
}
