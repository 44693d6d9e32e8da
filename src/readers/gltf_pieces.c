/* Meshes that the drawn nodes use again and again: each is a piece of its own, and its uses are placements. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"

/* A tree of its own costs a page and a draw for each placement: small meshes, and those that are few triangles even
 * with all their copies, stay with the rest. */
#define LEAST_TRIANGLES 256u
#define LEAST_COPIED_TRIANGLES 4096u

uint64_t strl__gltf_instance_count(const strl__gltf_node *node)
{
    return node->instances ? node->instances->count : 1;
}

/* ---- choosing */

typedef struct candidate {
    uint64_t saved; /* triangles that are not copied */
    uint32_t mesh;
} candidate;

static uint64_t product(uint64_t a, uint64_t b)
{
    uint64_t result;
    return __builtin_mul_overflow(a, b, &result) ? UINT64_MAX : result;
}

static bool is_candidate(const strl__gltf_mesh *mesh)
{
    return mesh->uses >= 2 && mesh->triangles >= LEAST_TRIANGLES &&
           product(mesh->triangles, mesh->uses) >= LEAST_COPIED_TRIANGLES;
}

static int by_savings(const void *left, const void *right)
{
    const candidate *a = left, *b = right;
    if (a->saved != b->saved)
        return a->saved > b->saved ? -1 : 1;
    return a->mesh < b->mesh ? -1 : a->mesh > b->mesh;
}

static int by_mesh(const void *left, const void *right)
{
    const candidate *a = left, *b = right;
    return a->mesh < b->mesh ? -1 : a->mesh > b->mesh;
}

/* Into a list of at most `most`, the largest savings first. */
static void insert(candidate *list, size_t *count, size_t most, candidate added)
{
    if (*count == most && by_savings(&list[most - 1], &added) < 0)
        return;
    size_t at = *count < most ? (*count)++ : most - 1;
    for (; at > 0 && by_savings(&added, &list[at - 1]) < 0; at--)
        list[at] = list[at - 1];
    list[at] = added;
}

/* The largest savings, in the order of the file. */
static strl_status choose(strl__gltf *gltf, size_t count, strl_error *err)
{
    strl_reader *reader = gltf->reader;
    const size_t kept = count < reader->most_pieces ? count : reader->most_pieces;
    size_t found = 0;
    candidate *candidates = strl__alloc(kept, sizeof *candidates);
    gltf->pieces = strl__alloc(kept, sizeof *gltf->pieces);
    if (!candidates || !gltf->pieces) {
        strl__free(candidates);
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for %zu pieces", reader->path, kept);
    }
    for (size_t i = 0; i < gltf->mesh_count; i++)
        if (is_candidate(&gltf->meshes[i]))
            insert(candidates, &found, kept,
                   (candidate){product(gltf->meshes[i].triangles, gltf->meshes[i].uses - 1), (uint32_t)i});
    qsort(candidates, kept, sizeof *candidates, by_mesh);
    for (size_t i = 0; i < kept; i++) {
        gltf->pieces[i] = candidates[i].mesh;
        gltf->meshes[candidates[i].mesh].piece = (uint32_t)i + 1;
    }
    gltf->table_bytes += kept * sizeof *gltf->pieces;
    reader->piece_count = (uint32_t)kept;
    strl__free(candidates);
    return STRL_OK;
}

/* Whether a pass over piece 0 would find anything, lines and points included. */
static bool is_rest_empty(const strl__gltf *gltf)
{
    for (size_t i = 0; i < gltf->mesh_count; i++) {
        const strl__gltf_mesh *mesh = &gltf->meshes[i];
        for (uint32_t p = 0; mesh->uses && mesh->piece == 0 && p < mesh->primitive_count; p++)
            if (gltf->primitives[mesh->first_primitive + p].position != STRL__NO_ITEM)
                return false;
    }
    return true;
}

static bool is_placed(const strl__gltf *gltf, const strl__gltf_node *node)
{
    return node->mesh != STRL__NO_ITEM && gltf->meshes[node->mesh].piece;
}

/* Known at once, because trees of the pieces before need the tables of names to be whole. Of a placement it is the
 * node's, as if it were a copy. */
static strl_status list_names(strl__gltf *gltf, strl_error *err)
{
    strl_status status = STRL_OK;
    uint32_t named;
    while (!status && strl__gltf_next_node(gltf))
        if (is_placed(gltf, &gltf->nodes[gltf->pass.node]))
            status = strl__gltf_name_part(gltf, gltf->pass.node, &named, err);
    strl__gltf_rewind(gltf);
    for (uint32_t i = 0; i < gltf->reader->piece_count && !status; i++) {
        const strl__gltf_mesh *mesh = &gltf->meshes[gltf->pieces[i]];
        uint32_t part, material;
        status = strl__gltf_name_piece(gltf, gltf->pieces[i], &part, err);
        for (uint32_t p = 0; p < mesh->primitive_count && !status; p++) {
            const strl__gltf_primitive *primitive = &gltf->primitives[mesh->first_primitive + p];
            if (primitive->mode >= 4 && primitive->position != STRL__NO_ITEM)
                status = strl__gltf_list_material(gltf, primitive->material, &material, err);
        }
    }
    return status;
}

strl_status strl__gltf_find_pieces(strl__gltf *gltf, strl_error *err)
{
    size_t count = 0;
    gltf->rest_triangles = gltf->triangles;
    for (size_t i = 0; i < gltf->mesh_count && gltf->reader->most_pieces; i++)
        count += is_candidate(&gltf->meshes[i]);
    strl_status status = count ? choose(gltf, count, err) : STRL_OK;
    if (status || !count)
        return status;
    gltf->rest_triangles = 0;
    gltf->triangles = 0;
    for (size_t i = 0; i < gltf->mesh_count; i++) {
        const strl__gltf_mesh *mesh = &gltf->meshes[i];
        uint64_t triangles = mesh->piece ? mesh->triangles : product(mesh->triangles, mesh->uses);
        if (__builtin_add_overflow(gltf->triangles, triangles, &gltf->triangles))
            gltf->triangles = UINT64_MAX;
        if (!mesh->piece && __builtin_add_overflow(gltf->rest_triangles, triangles, &gltf->rest_triangles))
            gltf->rest_triangles = UINT64_MAX;
    }
    gltf->rest_is_empty = is_rest_empty(gltf);
    return list_names(gltf, err);
}

void strl__gltf_piece_get(const strl_reader *reader, uint32_t piece, strl_reader_piece *facts)
{
    const strl__gltf *gltf = strl__gltf_of(reader);
    if (piece == 0) {
        *facts = (strl_reader_piece){gltf->rest_triangles, 1, gltf->rest_is_empty};
        return;
    }
    const strl__gltf_mesh *mesh = &gltf->meshes[gltf->pieces[piece - 1]];
    *facts = (strl_reader_piece){mesh->triangles, mesh->uses, false};
}

/* ---- placing */

static strl_status read_window(strl__gltf *gltf, const strl__gltf_instances *of, uint64_t first, strl_error *err)
{
    strl__gltf_window *window = &gltf->instances;
    const uint64_t left = of->count - first;
    const size_t count = left < STRL__GLTF_INSTANCES ? (size_t)left : STRL__GLTF_INSTANCES;
    strl_status status = STRL_OK;
    window->of = NULL;
    for (size_t i = 0; i < count; i++) {
        memcpy(window->translation[i], (double[3]){0, 0, 0}, sizeof *window->translation);
        memcpy(window->rotation[i], (double[4]){0, 0, 0, 1}, sizeof *window->rotation);
        memcpy(window->scale[i], (double[3]){1, 1, 1}, sizeof *window->scale);
    }
    if (of->translation != STRL__NO_ITEM)
        status = strl__gltf_read_numbers(gltf, of->translation, false, first, count, window->translation[0], err);
    if (!status && of->rotation != STRL__NO_ITEM)
        status = strl__gltf_read_numbers(gltf, of->rotation, true, first, count, window->rotation[0], err);
    if (!status && of->scale != STRL__NO_ITEM)
        status = strl__gltf_read_numbers(gltf, of->scale, false, first, count, window->scale[0], err);
    if (status)
        return status;
    window->of = of;
    window->first = first;
    window->count = count;
    return STRL_OK;
}

strl_status strl__gltf_place_node(strl__gltf *gltf, strl__gltf_matrix *placement, strl_error *err)
{
    const strl__gltf_instances *instances = gltf->nodes[gltf->pass.node].instances;
    const strl__gltf_window *window = &gltf->instances;
    const uint64_t instance = gltf->pass.instance;
    *placement = *strl__gltf_world(gltf);
    if (!instances)
        return STRL_OK;
    if (window->of != instances || instance < window->first || instance - window->first >= window->count) {
        strl_status status = read_window(gltf, instances, instance / STRL__GLTF_INSTANCES * STRL__GLTF_INSTANCES, err);
        if (status)
            return status;
    }
    const uint64_t at = instance - window->first;
    const strl__gltf_matrix own = strl__gltf_compose(window->translation[at], window->rotation[at], window->scale[at]);
    *placement = strl__gltf_multiply(placement, &own);
    return STRL_OK;
}

/* The pass goes from node to node, as that over triangles, but reads none. */
strl_status strl__gltf_start_placements(strl_reader *reader, strl_error *err)
{
    (void)err;
    strl__gltf_rewind(strl__gltf_of(reader));
    reader->started = true; /* there are no triangles until the next rewind */
    reader->ended = true;
    return STRL_OK;
}

static bool is_finite(const strl__gltf_matrix *matrix)
{
    bool finite = true;
    for (unsigned i = 0; i < 12; i++)
        finite = finite && isfinite(matrix->m[i]);
    return finite;
}

strl_status strl__gltf_next_placement(strl_reader *reader, strl_reader_placement *placement, bool *found,
                                      strl_error *err)
{
    strl__gltf *gltf = strl__gltf_of(reader);
    strl__gltf_pass *pass = &gltf->pass;
    for (;;) {
        const strl__gltf_node *node = pass->has_node ? &gltf->nodes[pass->node] : NULL;
        const strl__gltf_mesh *mesh = node && node->mesh != STRL__NO_ITEM ? &gltf->meshes[node->mesh] : NULL;
        for (; mesh && mesh->piece && pass->instance < strl__gltf_instance_count(node); pass->instance++) {
            strl__gltf_matrix matrix;
            strl_status status = strl__gltf_place_node(gltf, &matrix, err);
            if (status)
                return status;
            if (!is_finite(&matrix)) {
                reader->drops.nonfinite += mesh->triangles;
                continue;
            }
            pass->instance++;
            placement->piece = mesh->piece;
            placement->part = node->part;
            memcpy(placement->transform, matrix.m, sizeof placement->transform);
            *found = true;
            return STRL_OK;
        }
        pass->instance = 0;
        if (!strl__gltf_next_node(gltf))
            return STRL_OK;
    }
}
