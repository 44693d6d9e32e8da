/* Level 0: from the cells of a cluster to its node. */
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "build/clusters/hierarchy.h"
#include "build/ingest/normals.h"

/* One shared position of a cluster, in the words of its bucket. */
typedef struct shared_ref {
    uint32_t cluster;
    uint32_t at; /* index of its x */
} shared_ref;

typedef struct leaf_stage {
    strl_hierarchy *hierarchy;
    strl_level *level;
    uint32_t *words;  /* the bucket of shares at hand */
    shared_ref *refs; /* sorted by (cluster, at) */
    size_t ref_count;
    uint32_t first_cluster; /* of the item 0 of the pipeline at hand */
    uint32_t *last_reader;  /* [cell_count] as in strl_leaf_shares; NO_READER = dropped */
    strl_made_node *slots;
    strl_arena *arenas; /* per worker */
} leaf_stage;

#define SAMPLE_LEAVES 16u
#define NO_READER UINT32_MAX

static int compare_refs(const void *a, const void *b)
{
    const shared_ref *x = a, *y = b;
    if (x->cluster != y->cluster)
        return x->cluster < y->cluster ? -1 : 1;
    return x->at < y->at ? -1 : x->at > y->at;
}

static int compare_words(const void *a, const void *b)
{
    uint32_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return x < y ? -1 : x > y;
}

static const shared_ref *refs_of(const leaf_stage *stage, uint32_t cluster, size_t *count)
{
    size_t low = 0, high = stage->ref_count;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (stage->refs[middle].cluster < cluster)
            low = middle + 1;
        else
            high = middle;
    }
    for (*count = 0; low + *count < stage->ref_count && stage->refs[low + *count].cluster == cluster;)
        (*count)++;
    return *count ? stage->refs + low : NULL;
}

/* The cells that a position of the cluster has outside of it. */
static const uint32_t *cells_of_ref(const leaf_stage *stage, const shared_ref *ref, uint32_t *count)
{
    const uint32_t *words = stage->words + ref->at + 3;
    const uint32_t *list = words + 1 + words[0];
    *count = list[0];
    return list + 1;
}

/* The cluster's own cells and those of others that have one of its positions, ascending, each once: faces round a
 * position then come in one order wherever the position is looked at. Positions in very many cells list none: their
 * normals are then of the cluster's own faces. */
static uint32_t *cells_with_halo(const leaf_stage *stage, const uint32_t *own, uint32_t own_count,
                                 const shared_ref *refs, size_t ref_count, strl_arena *arena, uint32_t *count)
{
    size_t total = own_count, unique = 0;
    uint32_t some;
    for (size_t i = 0; i < ref_count; i++) {
        cells_of_ref(stage, &refs[i], &some);
        total += some;
    }
    uint32_t *cells = strl_arena_alloc(arena, total, sizeof *cells);
    if (!cells)
        return NULL;
    memcpy(cells, own, own_count * sizeof *cells);
    size_t at = own_count;
    for (size_t i = 0; i < ref_count; i++) {
        const uint32_t *list = cells_of_ref(stage, &refs[i], &some);
        memcpy(cells + at, list, some * sizeof *cells);
        at += some;
    }
    qsort(cells, total, sizeof *cells, compare_words);
    for (size_t i = 0; i < total; i++)
        if (i == 0 || cells[i] != cells[unique - 1])
            cells[unique++] = cells[i];
    *count = (uint32_t)unique;
    return cells;
}

static uint64_t triangles_in(const strl_ingest *ingest, const uint32_t *cells, uint32_t count)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += ingest->cells[cells[i]].count;
    return sum;
}

static strl_status read_cells(const strl_ingest *ingest, const uint32_t *cells, uint32_t count, void *scratch,
                              strl_soup_triangle *triangles, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0, run; i < count && !status; i += run) { /* neighbours on the curve are read at once */
        const strl_cell *first = &ingest->cells[cells[i]];
        uint32_t size = first->count;
        for (run = 1; i + run < count && cells[i + run] == cells[i] + run; run++)
            size += ingest->cells[cells[i + run]].count;
        status = strl_ingest_read(ingest, first->first, size, scratch, triangles, err);
        triangles += size;
    }
    return status;
}

static bool lacks_normals(const strl_soup_triangle *triangles, uint32_t count)
{
    for (uint32_t t = 0; t < count; t++)
        for (int c = 0; c < 3; c++)
            if (triangles[t].corner[c].normal[0] == STRL_NORMAL_MISSING)
                return true;
    return false;
}

/* Which triangles of the cells are the cluster's. */
static bool *mark_own(const leaf_stage *stage, uint32_t cluster, const uint32_t *cells, uint32_t cell_count,
                      uint64_t all, strl_arena *arena)
{
    bool *is_own = strl_arena_alloc(arena, all, sizeof *is_own);
    uint64_t at = 0;
    for (uint32_t i = 0; i < cell_count && is_own; i++)
        for (uint32_t k = 0; k < stage->hierarchy->ingest->cells[cells[i]].count; k++)
            is_own[at++] = stage->hierarchy->partition->cluster[cells[i]] == cluster;
    return is_own;
}

static strl_status read_cluster(const leaf_stage *stage, uint32_t cluster, const shared_ref *refs, size_t ref_count,
                                strl_arena *arena, strl_soup_triangle **triangles, uint32_t *own, strl_error *err)
{
    const strl_ingest *ingest = stage->hierarchy->ingest;
    const strl_partition *partition = stage->hierarchy->partition;
    const uint32_t *own_cells = partition->cell + partition->cluster_first[cluster];
    uint32_t own_count = partition->cluster_first[cluster + 1] - partition->cluster_first[cluster], count = 0;
    uint32_t *cells = cells_with_halo(stage, own_cells, own_count, refs, ref_count, arena, &count);
    *own = (uint32_t)triangles_in(ingest, own_cells, own_count);
    uint64_t all = cells ? triangles_in(ingest, cells, count) : 0;
    void *scratch = strl_arena_alloc(arena, all, strl_soup_bytes(ingest));
    *triangles = strl_arena_alloc(arena, all, sizeof **triangles);
    if (!cells || !scratch || !*triangles)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a cluster of %u triangles", *own);
    strl_status status = read_cells(ingest, own_cells, own_count, scratch, *triangles, err);
    if (status || !lacks_normals(*triangles, *own))
        return status;
    bool *is_own = mark_own(stage, cluster, cells, count, all, arena);
    status = read_cells(ingest, cells, count, scratch, *triangles, err);
    if (!status && (!is_own || !strl__fill_normals(*triangles, is_own, (uint32_t)all, arena)))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the normals of %u triangles", *own);
    for (uint64_t t = 0, to = 0; t < all && !status; t++)
        if (is_own[t])
            (*triangles)[to++] = (*triangles)[t];
    return status;
}

/* Triangles of one corner each are merged by the welding of node_mesh.c: a soup becomes points and wedges. */
static strl_status weld(const strl_hierarchy *hierarchy, const strl_soup_triangle *triangles, uint32_t count,
                        strl_arena *arena, strl_node_mesh *node, strl_error *err)
{
    strl_node_mesh soup = {0}, *list[1] = {&soup};
    uint32_t *owner, *point_of;
    if (!strl_mesh_create(&soup.mesh, 3 * count, 3 * count, count, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a cluster of %u triangles", count);
    soup.mesh.start_error = hierarchy->ingest->leaf_error;
    for (int k = 0; k < 3; k++)
        soup.anchor[k] = triangles[0].corner[0].position[k];
    for (uint32_t t = 0; t < count; t++) {
        for (uint32_t c = 0; c < 3; c++) {
            const strl_soup_corner *corner = &triangles[t].corner[c];
            uint32_t at = 3 * t + c;
            for (int k = 0; k < 3; k++)
                soup.mesh.position[at][k] = (int32_t)((int64_t)corner->position[k] - soup.anchor[k]);
            soup.mesh.wedge[at] = (strl_wedge){.point = at,
                                               .normal = {corner->normal[0], corner->normal[1]},
                                               .colour = corner->colour,
                                               .texcoord = corner->texcoord,
                                               .palette = triangles[t].palette};
            soup.mesh.triangle[t][c] = at;
        }
        soup.mesh.drift[t] = (strl_drift){0};
        soup.mesh.deviation[t] = soup.mesh.shift[t] = 0;
    }
    return strl_node_mesh_merge((const strl_node_mesh *const *)list, 1, arena, node, &owner, &point_of, err);
}

/* Positions relative to the anchor, in a small table, to find the points that are shared. */
static uint32_t find_point(const uint32_t *table, uint32_t mask, const strl_mesh *mesh, const int32_t position[3],
                           uint32_t *slot)
{
    uint64_t hash = strl__mix64(((uint64_t)(uint32_t)position[0] << 32 | (uint32_t)position[1]) ^
                                strl__mix64((uint32_t)position[2]));
    uint32_t at = (uint32_t)hash & mask;
    while (table[at] && memcmp(mesh->position[table[at] - 1], position, sizeof *mesh->position))
        at = (at + 1) & mask;
    *slot = at;
    return table[at];
}

static strl_status mark_shared(const leaf_stage *stage, const shared_ref *refs, size_t ref_count, strl_arena *arena,
                               strl_node_mesh *node, strl_error *err)
{
    strl_mesh *mesh = &node->mesh;
    uint32_t size = 16, slot, shares = 0;
    while (size < 2 * mesh->point_count)
        size *= 2;
    for (size_t i = 0; i < ref_count; i++)
        shares += stage->words[refs[i].at + 3];
    uint32_t *table = strl_arena_alloc_zero(arena, size, sizeof *table);
    uint32_t *ref_of = strl_arena_alloc_zero(arena, mesh->point_count, sizeof *ref_of); /* index of words + 1 */
    node->share_first = strl_arena_alloc(arena, (size_t)mesh->point_count + 1, sizeof *node->share_first);
    node->share = strl_arena_alloc(arena, shares, sizeof *node->share);
    if (!table || !ref_of || !node->share_first || !node->share)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u shared positions", shares);
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        find_point(table, size - 1, mesh, mesh->position[p], &slot);
        table[slot] = p + 1;
    }
    for (size_t i = 0; i < ref_count; i++) {
        int32_t position[3];
        for (int k = 0; k < 3; k++)
            position[k] = (int32_t)((int64_t)stage->words[refs[i].at + (uint32_t)k] - node->anchor[k]);
        uint32_t found = find_point(table, size - 1, mesh, position, &slot);
        if (!found)
            return strl__fail(err, STRL_ERR_INTERNAL, "a shared position is missing from its cluster");
        ref_of[found - 1] = refs[i].at + 1;
    }
    uint32_t at = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        node->share_first[p] = at;
        if (!ref_of[p])
            continue;
        const uint32_t *list = stage->words + ref_of[p] - 1 + 3;
        mesh->flags[p] |= STRL_POINT_KEPT | STRL_POINT_OUTSIDE;
        memcpy(node->share + at, list + 1, list[0] * sizeof *list);
        at += list[0];
    }
    node->share_first[mesh->point_count] = at;
    return STRL_OK;
}

static strl_status make_one(leaf_stage *stage, uint32_t index, unsigned worker, strl_made_node *made, strl_error *err)
{
    strl_arena *arena = &stage->arenas[worker];
    strl_arena_mark mark = strl_arena_get_mark(arena);
    uint32_t cluster = stage->first_cluster + index, own = 0;
    size_t ref_count;
    const shared_ref *refs = refs_of(stage, cluster, &ref_count);
    strl_soup_triangle *triangles;
    strl_node_mesh node;
    *made = (strl_made_node){0};
    strl_status status = read_cluster(stage, cluster, refs, ref_count, arena, &triangles, &own, err);
    if (!status && own == 0)
        status = strl__fail(err, STRL_ERR_INTERNAL, "cluster %u is empty", cluster);
    if (!status)
        status = weld(stage->hierarchy, triangles, own, arena, &node, err);
    if (!status)
        status = mark_shared(stage, refs, ref_count, arena, &node, err);
    if (!status)
        status = strl_make_node(stage->hierarchy, &node, NULL, cluster, (own + 1) / 2, arena, made, err);
    if (!status) {
        for (int k = 0; k < 3; k++) {
            made->state.record.group_box_min[k] = made->state.record.box_min[k];
            made->state.record.group_box_max[k] = made->state.record.box_max[k];
        }
        made->state.record.group_geometric = made->state.record.geometric_min;
        made->state.record.group_appearance = made->state.record.appearance_min;
        made->state.record.group_size = 1;
        made->state.claims.group = made->state.claims.least;
        made->state.group = cluster;
    }
    strl_arena_rewind(arena, mark);
    return status;
}

static strl_status make_leaf(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    leaf_stage *stage = context;
    return make_one(stage, (uint32_t)index, worker, &stage->slots[slot], err);
}

static void drop_cells(leaf_stage *stage, uint32_t cluster, const uint32_t *cells, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (stage->last_reader[cells[i]] == cluster) {
            strl_ingest_drop_cell(stage->hierarchy->ingest, cells[i]);
            stage->last_reader[cells[i]] = NO_READER;
        }
}

/* Gives back the disk of cells that no later cluster needs: the cluster's own, and those of others
 * that waited for it. */
static void drop_what_was_read(leaf_stage *stage, uint32_t cluster)
{
    const strl_partition *partition = stage->hierarchy->partition;
    size_t ref_count;
    const shared_ref *refs = refs_of(stage, cluster, &ref_count);
    uint32_t first = partition->cluster_first[cluster], count = partition->cluster_first[cluster + 1] - first;
    drop_cells(stage, cluster, partition->cell + first, count);
    for (size_t i = 0; i < ref_count; i++) {
        const uint32_t *cells = cells_of_ref(stage, &refs[i], &count);
        drop_cells(stage, cluster, cells, count);
    }
}

static strl_status take_leaf(void *context, uint64_t index, unsigned slot, unsigned worker, strl_error *err)
{
    leaf_stage *stage = context;
    uint32_t cluster = stage->first_cluster + (uint32_t)index;
    (void)worker;
    drop_what_was_read(stage, cluster);
    strl_status status = strl_take_node(stage->hierarchy, stage->level, cluster, &stage->slots[slot], err);
    strl_made_node_deinit(&stage->slots[slot]);
    if (!status)
        status = strl_clusters_note(stage->hierarchy, 0, cluster + 1, err);
    return status ? status : strl__build_report(stage->hierarchy->context, cluster + 1, stage->level->count, err);
}

typedef struct leaf_sample {
    leaf_stage *stage;
    uint32_t count, stride;
    float errors[SAMPLE_LEAVES];
} leaf_sample;

static strl_status sample_leaf(void *context, uint64_t index, unsigned worker, strl_error *err)
{
    leaf_sample *sample = context;
    strl_made_node made;
    strl_status status = make_one(sample->stage, (uint32_t)index * sample->stride, worker, &made, err);
    sample->errors[index] = strl_node_error(&made.state.record);
    strl_made_node_deinit(&made);
    return status;
}

/* What error half the triangles cost, from some clusters of the bucket at hand. */
static strl_status sample_error(leaf_stage *stage, uint32_t clusters, strl_error *err)
{
    leaf_sample sample = {.stage = stage, .count = clusters < SAMPLE_LEAVES ? clusters : SAMPLE_LEAVES};
    if (clusters < 2 * SAMPLE_LEAVES)
        return STRL_OK;
    sample.stride = clusters / sample.count;
    stage->hierarchy->soft_triangles = 0; /* whatever half of them costs: the leaves will end there alike */
    strl_status status = strl_pool_for(stage->hierarchy->context->pool, sample.count, sample_leaf, &sample, NULL, err);
    stage->hierarchy->soft_triangles = STRL_SOFT_TRIANGLES;
    if (!status)
        stage->hierarchy->even_error = strl_median(sample.errors, sample.count);
    return status;
}

/* Reads one bucket of shares and sorts its records by cluster. */
static strl_status load_bucket(leaf_stage *stage, strl_spill *spill, strl_error *err)
{
    size_t count = (size_t)(strl_spill_bytes(spill) / 4), capacity = 0;
    stage->words = strl__alloc(count, sizeof *stage->words);
    stage->refs = NULL;
    stage->ref_count = 0;
    strl_status status = stage->words ? strl_spill_read(spill, 0, stage->words, count * 4, err)
                                      : strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu shared positions", count);
    for (size_t at = 0; at < count && !status;) {
        if (!strl__grow(&stage->refs, &capacity, stage->ref_count + 1, sizeof *stage->refs))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu shared positions", count);
        stage->refs[stage->ref_count++] = (shared_ref){stage->words[at], (uint32_t)at + 1};
        at += 5 + stage->words[at + 4];
        at += 1 + stage->words[at];
    }
    if (!status && stage->ref_count)
        qsort(stage->refs, stage->ref_count, sizeof *stage->refs, compare_refs);
    return status;
}

/* The clusters of a bucket from `first` on. */
static strl_status make_bucket(leaf_stage *stage, const strl_leaf_shares *shares, uint32_t bucket, uint32_t first,
                               strl_error *err)
{
    uint32_t begin = shares->bucket_first[bucket], end = shares->bucket_first[bucket + 1];
    if (first >= end)
        return STRL_OK;
    strl_status status = load_bucket(stage, shares->spill[bucket], err);
    stage->first_cluster = begin > first ? begin : first;
    if (!status && stage->first_cluster == 0)
        status = sample_error(stage, end - begin, err);
    if (!status)
        status = strl_pool_ordered(stage->hierarchy->context->pool, end - stage->first_cluster, 0, make_leaf, take_leaf,
                                   stage, NULL, err);
    strl__free(stage->words);
    strl__free(stage->refs);
    return status;
}

strl_status strl_make_leaves(strl_hierarchy *hierarchy, uint32_t first, strl_error *err)
{
    strl_pool *pool = hierarchy->context->pool;
    leaf_stage stage = {.hierarchy = hierarchy, .level = &hierarchy->levels[0]};
    strl_leaf_shares shares;
    stage.level->group_count = stage.level->count; /* every leaf is a group of its own */
    unsigned workers = strl_pool_workers(pool);
    strl_status status = strl_leaf_shares_create(hierarchy, &shares, err);
    stage.last_reader = shares.last_reader;
    stage.slots = strl__alloc_zero(strl_pool_window(pool, 0), sizeof *stage.slots);
    stage.arenas = strl__alloc_zero(workers, sizeof *stage.arenas);
    if (!status && (!stage.slots || !stage.arenas))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u workers", workers);
    for (uint32_t b = 0; b < shares.bucket_count && !status; b++)
        status = make_bucket(&stage, &shares, b, first, err);
    for (unsigned i = 0; stage.slots && i < strl_pool_window(pool, 0); i++)
        strl_made_node_deinit(&stage.slots[i]);
    for (unsigned i = 0; stage.arenas && i < workers; i++)
        strl_arena_deinit(&stage.arenas[i]);
    strl__free(stage.slots);
    strl__free(stage.arenas);
    strl_leaf_shares_deinit(&shares);
    if (!status)
        status = strl_ingest_drop(&hierarchy->ingest->shared, err);
    return status ? status : strl_ingest_drop(&hierarchy->ingest->soup, err);
}
