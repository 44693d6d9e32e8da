/* What the triangles of a container of samples would take in plain order: along a Morton curve, in pieces of as many
 * triangles as its bricks have in the mean, by the same payload codec, without splats, records or a tree. One JSON line
 * a file. Holds all triangles in memory.
 *
 *     bench_morton FILE.stroll... */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/hash.h"
#include "container/treelet.h"

typedef struct corner {
    int64_t position[3];
    uint32_t colour, texcoord, palette; /* index into the model's palette */
    uint16_t normal[2];
} corner;

typedef struct face {
    corner corner[3];
    uint64_t key;
} face;

typedef struct model {
    strl_container *container;
    const strl_tree *tree;
    face *face;
    size_t count, capacity;
    strl_palette_entry *palette;
    size_t palette_count, palette_capacity;
    bool has_colours, has_texcoords;
} model;

static bool palette_index(model *m, const strl_palette_entry *entry, uint32_t *index)
{
    for (*index = (uint32_t)m->palette_count; (*index)-- > 0;)
        if (memcmp(&m->palette[*index], entry, sizeof *entry) == 0)
            return true;
    if (!strl__grow(&m->palette, &m->palette_capacity, m->palette_count + 1, sizeof *m->palette))
        return false;
    *index = (uint32_t)m->palette_count;
    m->palette[m->palette_count++] = *entry;
    return true;
}

static uint64_t key_of(const model *m, const face *f)
{
    int64_t extent = 1;
    unsigned shift = 0;
    uint64_t key = 0;
    for (int k = 0; k < 3; k++) {
        int64_t side = m->tree->box_max[k] - m->tree->box_min[k];
        extent = side > extent ? side : extent;
    }
    while (extent >> shift >= 1 << 21)
        shift++;
    for (int k = 0; k < 3; k++) {
        int64_t sum = f->corner[0].position[k] + f->corner[1].position[k] + f->corner[2].position[k];
        uint64_t at = (uint64_t)(sum / 3 - m->tree->box_min[k]) >> shift;
        for (unsigned bit = 0; bit < 21; bit++)
            key |= (at >> bit & 1) << (3 * bit + k);
    }
    return key;
}

static bool take_mesh(model *m, const strl_node *node, const strl_pm *mesh)
{
    if (!strl__grow(&m->face, &m->capacity, m->count + mesh->triangle_count, sizeof *m->face))
        return false;
    m->has_colours |= mesh->colour != NULL;
    m->has_texcoords |= mesh->texcoord != NULL;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        face *f = &m->face[m->count++];
        for (int c = 0; c < 3; c++) {
            uint16_t v = mesh->triangle[t][c];
            corner *to = &f->corner[c];
            memset(to, 0, sizeof *to);
            for (int k = 0; k < 3; k++)
                to->position[k] = node->anchor[k] + mesh->position[v][k];
            memcpy(to->normal, mesh->normal[v], sizeof to->normal);
            to->colour = mesh->colour ? mesh->colour[v] : UINT32_MAX;
            to->texcoord = mesh->texcoord ? mesh->texcoord[v] : 0;
            if (!palette_index(m, &mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0], &to->palette))
                return false;
        }
        f->key = key_of(m, f);
    }
    return true;
}

static int by_key(const void *a, const void *b)
{
    const face *x = a, *y = b;
    return x->key < y->key ? -1 : x->key > y->key;
}

/* ---- pieces */

typedef struct piece {
    const face *face;
    uint32_t count, vertices, entries;
    const corner **vertex; /* [3 count] */
    uint32_t *slot, mask;
    uint16_t (*triangle)[3];
    uint32_t *known; /* palette entries of the piece */
} piece;

static uint16_t weld(piece *p, const corner *c)
{
    uint32_t at = (uint32_t)strl__checksum(c, sizeof *c) & p->mask;
    while (p->slot[at] && memcmp(p->vertex[p->slot[at] - 1], c, sizeof *c))
        at = (at + 1) & p->mask;
    if (!p->slot[at]) {
        p->vertex[p->vertices] = c;
        p->slot[at] = ++p->vertices;
    }
    return (uint16_t)(p->slot[at] - 1);
}

static bool make_piece(piece *p, strl_arena *arena)
{
    for (p->mask = 63; p->mask < 5 * p->count; p->mask = 2 * p->mask + 1)
        ;
    p->slot = strl_arena_alloc_zero(arena, (size_t)p->mask + 1, sizeof *p->slot);
    p->vertex = strl_arena_alloc(arena, 3 * (size_t)p->count, sizeof *p->vertex);
    p->triangle = strl_arena_alloc(arena, p->count, sizeof *p->triangle);
    p->known = strl_arena_alloc(arena, 3 * (size_t)p->count, sizeof *p->known);
    if (!p->slot || !p->vertex || !p->triangle || !p->known)
        return false;
    for (uint32_t t = 0; t < p->count; t++)
        for (int c = 0; c < 3; c++)
            p->triangle[t][c] = weld(p, &p->face[t].corner[c]);
    return true;
}

static uint16_t entry_of(piece *p, uint32_t palette)
{
    uint32_t i = 0;
    while (i < p->entries && p->known[i] != palette)
        i++;
    if (i == p->entries)
        p->known[p->entries++] = palette;
    return (uint16_t)i;
}

static bool make_mesh(const model *m, piece *p, strl_arena *arena, strl_pm *pm)
{
    uint16_t *entry = strl_arena_alloc(arena, p->vertices, sizeof *entry);
    if (!entry)
        return false;
    for (uint32_t v = 0; v < p->vertices; v++)
        entry[v] = entry_of(p, p->vertex[v]->palette);
    *pm = (strl_pm){.vertex_count = p->vertices, .triangle_count = p->count, .palette_count = p->entries};
    if (!strl_pm_create(pm, m->has_colours, p->entries > 1, m->has_texcoords, arena))
        return false;
    for (uint32_t i = 0; i < p->entries; i++)
        pm->palette[i] = m->palette[p->known[i]];
    for (uint32_t v = 0; v < p->vertices; v++) {
        for (int k = 0; k < 3; k++)
            pm->position[v][k] = (int32_t)(p->vertex[v]->position[k] - p->vertex[0]->position[k]);
        memcpy(pm->normal[v], p->vertex[v]->normal, sizeof pm->normal[v]);
        pm->parent[v] = 0;
        if (pm->colour)
            pm->colour[v] = p->vertex[v]->colour;
        if (pm->texcoord)
            pm->texcoord[v] = p->vertex[v]->texcoord;
        if (pm->palette_index)
            pm->palette_index[v] = entry[v];
    }
    memcpy(pm->triangle, p->triangle, p->count * sizeof *pm->triangle);
    pm->vertex_end[0] = p->vertices;
    pm->triangle_end[0] = p->count;
    pm->geometric_error[0] = pm->appearance_error[0] = 0;
    return true;
}

static strl_status encode_pieces(const model *m, uint32_t each, uint64_t *bytes, strl_error *err)
{
    strl_arena arena = {0};
    strl_status status = STRL_OK;
    *bytes = 0;
    for (size_t at = 0; at < m->count && !status; at += each) {
        piece p = {.face = m->face + at, .count = (uint32_t)(m->count - at < each ? m->count - at : each)};
        strl_arena_mark mark = strl_arena_get_mark(&arena);
        strl_writer payload = {0};
        strl_pm pm;
        status = make_piece(&p, &arena) && make_mesh(m, &p, &arena, &pm) ? STRL_OK : STRL_ERR_MEMORY;
        if (!status)
            status = strl_payload_encode(&pm, NULL, &arena, &payload, NULL, err);
        *bytes += payload.size;
        strl__free(payload.data);
        strl_arena_rewind(&arena, mark);
    }
    strl_arena_deinit(&arena);
    return status;
}

static strl_status load(model *m, strl_error *err)
{
    strl_arena arena = {0};
    strl_status status = STRL_OK;
    m->tree = strl_container_tree(m->container, 0);
    for (uint32_t id = 0; id < m->tree->node_count && !status; id++) {
        strl_node node;
        strl_pm mesh;
        strl_arena_mark mark = strl_arena_get_mark(&arena);
        status = strl_container_node(m->container, 0, id, &node, err);
        if (!status)
            status = strl_container_mesh(m->container, 0, &node, &arena, &mesh, err);
        if (!status && !take_mesh(m, &node, &mesh))
            status = STRL_ERR_MEMORY;
        strl_arena_rewind(&arena, mark);
    }
    strl_arena_deinit(&arena);
    if (!status)
        qsort(m->face, m->count, sizeof *m->face, by_key);
    return status;
}

static int compare(const char *path)
{
    model m = {0};
    strl_error err = {0};
    uint64_t bytes = 0;
    strl_status status = strl_container_open_path(path, &m.container, &err);
    if (!status)
        status = load(&m, &err);
    uint32_t each = m.count ? (uint32_t)(m.count / m.tree->node_count) + 1 : 1;
    if (!status)
        status = encode_pieces(&m, each, &bytes, &err);
    if (status)
        fprintf(stderr, "bench_morton: %s: %s\n", path, err.message);
    else
        printf("{\"file\":\"%s\",\"triangles\":%zu,\"triangles_a_piece\":%u,\"plain_bytes\":%" PRIu64
               ",\"container_bytes\":%" PRIu64 ",\"over\":%.4f}\n",
               path, m.count, each, bytes, strl_container_get_info(m.container)->file_bytes,
               bytes ? (double)strl_container_get_info(m.container)->file_bytes / (double)bytes : 0);
    strl_container_close(m.container);
    strl__free(m.face);
    strl__free(m.palette);
    return status ? 1 : 0;
}

int main(int count, char **words)
{
    int failed = 0;
    for (int i = 1; i < count; i++)
        failed |= compare(words[i]);
    return failed;
}
