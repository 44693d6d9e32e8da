/* What Stroll is measured against: a cluster hierarchy as Nanite has it (Karis, "Nanite: A Deep Dive", 2021), made by
 * libmeshoptimizer, whole in memory.
 *
 *     peer_dag INPUT.ply PREFIX ERROR...
 *
 * Clusters of at most 128 triangles are put into groups of about 16 along their shared edges (METIS); vertices that
 * several groups have are locked, each group is simplified to half its triangles and split into clusters again, until
 * no group gets below 85 %. A group's error is the largest of its clusters' and of its own step, so that it grows
 * upward. These are the settings of the library's own example (demo/clusterlod.h, 2025), less what speaks of normals
 * and texture coordinates: only the shape counts here. For each ERROR (model units) PREFIX_I.ply is the cut of the
 * clusters whose own error is at most ERROR and whose group's error is above it. One JSON line for the hierarchy, one
 * for each cut.
 *
 * Library versions before 1.0 cannot lock single vertices nor report an error of the whole model's scale. A vertex that
 * shares its place with two others is left alone by all of them, so locked vertices are given two unused twins; errors
 * are scaled by the extent that the library reports. They have no sloppy simplification with locks either: a group that
 * gets stuck stays as it is, and buildMeshlets stands for buildMeshletsFlex. */
#include <float.h>
#include <meshoptimizer.h>
#include <metis.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "plain_mesh.h"

enum { CLUSTER_TRIANGLES = 128, CLUSTER_VERTICES = 128, GROUP_CLUSTERS = 16 };
#define SIMPLIFY_RATIO 0.5
#define SIMPLIFY_THRESHOLD 0.85 /* of a group's corners: what stays above is stuck */
#if MESHOPTIMIZER_VERSION >= 1000
enum { LEAST_CLUSTER_TRIANGLES = CLUSTER_TRIANGLES / 3, LOCK_TWINS = 0 };
#define SPLIT_FACTOR 2.0f
#define SLOPPY_ERROR 2.0f /* for what a sloppy step does to the look */
#else
enum { LOCK_TWINS = 2 };
#endif

typedef struct cluster {
    size_t first_corner;
    uint32_t corner_count;
    float own_error, parent_error; /* of the group it came from and of the group it is in; FLT_MAX = of no group */
} cluster;

typedef struct dag {
    float *position; /* three a vertex, no two alike */
    size_t vertex_count;
    uint32_t *corner;
    size_t corner_count, corner_room;
    cluster *cluster;
    size_t cluster_count, cluster_room;
    uint32_t *pending, *next; /* clusters of the level at hand, and of the one above */
    size_t pending_count, next_count, pending_room, next_room;
    uint32_t *group;   /* of each pending cluster; while a level is made */
    uint32_t *seen_by; /* vertex: the first group of the level that has it */
    uint8_t *locked;   /* vertex: several groups have it */
    uint32_t *local;   /* vertex: its number in the group at hand, or UINT32_MAX */
    size_t group_count, stuck_count;
    int level_count;
} dag;

/* A group's triangles with vertices numbered from 0. */
typedef struct group_mesh {
    uint32_t *corner, *global;
    float *position;
    uint8_t *lock;
    size_t corner_count, vertex_count, place_count; /* places: vertices and twins */
} group_mesh;

/* Two clusters on one edge. */
typedef struct edge {
    uint64_t key;
    uint32_t owner;
} edge;

static void *grown(void *memory, size_t *room, size_t needed, size_t size)
{
    if (needed <= *room)
        return memory;
    *room = needed + needed / 2;
    memory = realloc(memory, *room * size);
    if (!memory) {
        fprintf(stderr, "peer_dag: no memory for %zu items of %zu bytes\n", *room, size);
        exit(1);
    }
    return memory;
}

/* ---- clusters ---- */

static void add_cluster(dag *self, const uint32_t *corner, uint32_t corner_count, float own_error)
{
    self->corner = grown(self->corner, &self->corner_room, self->corner_count + corner_count, sizeof *self->corner);
    self->cluster = grown(self->cluster, &self->cluster_room, self->cluster_count + 1, sizeof *self->cluster);
    self->next = grown(self->next, &self->next_room, self->next_count + 1, sizeof *self->next);
    self->cluster[self->cluster_count] = (cluster){self->corner_count, corner_count, own_error, FLT_MAX};
    self->next[self->next_count++] = (uint32_t)self->cluster_count++;
    memcpy(self->corner + self->corner_count, corner, corner_count * sizeof *corner);
    self->corner_count += corner_count;
}

static size_t meshlets_of(const group_mesh *mesh, struct meshopt_Meshlet *meshlet, unsigned *vertex,
                          unsigned char *triangle)
{
#if MESHOPTIMIZER_VERSION >= 1000
    return meshopt_buildMeshletsFlex(meshlet, vertex, triangle, mesh->corner, mesh->corner_count, mesh->position,
                                     mesh->place_count, 3 * sizeof *mesh->position, CLUSTER_VERTICES,
                                     LEAST_CLUSTER_TRIANGLES, CLUSTER_TRIANGLES, 0, SPLIT_FACTOR);
#else
    return meshopt_buildMeshlets(meshlet, vertex, triangle, mesh->corner, mesh->corner_count, mesh->position,
                                 mesh->place_count, 3 * sizeof *mesh->position, CLUSTER_VERTICES, CLUSTER_TRIANGLES, 0);
#endif
}

static size_t meshlet_bound(size_t corner_count)
{
#if MESHOPTIMIZER_VERSION >= 1000
    return meshopt_buildMeshletsBound(corner_count, CLUSTER_VERTICES, LEAST_CLUSTER_TRIANGLES);
#else
    return meshopt_buildMeshletsBound(corner_count, CLUSTER_VERTICES, CLUSTER_TRIANGLES);
#endif
}

static void split_into_clusters(dag *self, const group_mesh *mesh, float own_error)
{
    size_t bound = meshlet_bound(mesh->corner_count);
    struct meshopt_Meshlet *meshlet = plain_allocate(bound, sizeof *meshlet);
    unsigned *vertex = plain_allocate(bound * CLUSTER_VERTICES, sizeof *vertex);
    unsigned char *triangle = plain_allocate(bound, (size_t)3 * CLUSTER_TRIANGLES);
    size_t count = meshlets_of(mesh, meshlet, vertex, triangle);
    for (size_t i = 0; i < count; i++) {
        uint32_t corner[3 * CLUSTER_TRIANGLES], corner_count = 3 * meshlet[i].triangle_count;
        for (uint32_t k = 0; k < corner_count; k++)
            corner[k] = mesh->global[vertex[meshlet[i].vertex_offset + triangle[meshlet[i].triangle_offset + k]]];
        add_cluster(self, corner, corner_count, own_error);
    }
    free(meshlet);
    free(vertex);
    free(triangle);
}

/* ---- groups ---- */

static int compare_edges(const void *a, const void *b)
{
    const edge *p = a, *q = b;
    if (p->key != q->key)
        return p->key < q->key ? -1 : 1;
    return p->owner < q->owner ? -1 : p->owner > q->owner;
}

static int compare_pairs(const void *a, const void *b)
{
    uint64_t p = *(const uint64_t *)a, q = *(const uint64_t *)b;
    return p < q ? -1 : p > q;
}

/* All edges of the pending clusters, equal ones together. Owners are numbered as pending[] is. */
static edge *sorted_edges(const dag *self, size_t *edge_count)
{
    size_t count = 0;
    for (size_t i = 0; i < self->pending_count; i++)
        count += self->cluster[self->pending[i]].corner_count;
    edge *edges = plain_allocate(count, sizeof *edges);
    *edge_count = count;
    count = 0;
    for (size_t i = 0; i < self->pending_count; i++) {
        const cluster *from = &self->cluster[self->pending[i]];
        for (uint32_t k = 0; k < from->corner_count; k++) {
            const uint32_t *triangle = self->corner + from->first_corner + k / 3 * 3;
            uint64_t a = triangle[k % 3], b = triangle[(k + 1) % 3];
            edges[count++] = (edge){a < b ? a << 32 | b : b << 32 | a, (uint32_t)i};
        }
    }
    qsort(edges, count, sizeof *edges, compare_edges);
    return edges;
}

/* Both ways, (owner, neighbour) as one number, once for each edge that they share; sorted. */
static uint64_t *neighbour_pairs(const dag *self, size_t *pair_count)
{
    size_t edge_count, count = 0;
    edge *edges = sorted_edges(self, &edge_count);
    uint64_t *pairs = plain_allocate(2 * edge_count, sizeof *pairs);
    for (size_t i = 1; i < edge_count; i++)
        if (edges[i].key == edges[i - 1].key && edges[i].owner != edges[i - 1].owner) {
            pairs[count++] = (uint64_t)edges[i].owner << 32 | edges[i - 1].owner;
            pairs[count++] = (uint64_t)edges[i - 1].owner << 32 | edges[i].owner;
        }
    free(edges);
    qsort(pairs, count, sizeof *pairs, compare_pairs);
    *pair_count = count;
    return pairs;
}

static void run_metis(idx_t count, idx_t *first, idx_t *neighbour, idx_t *weight, idx_t parts, idx_t *part)
{
    idx_t options[METIS_NOPTIONS], constraints = 1, cut = 0;
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_SEED] = 1;
    int result = METIS_PartGraphRecursive(&count, &constraints, first, neighbour, NULL, NULL, weight, &parts, NULL,
                                          NULL, options, &cut, part);
    if (result != METIS_OK) {
        fprintf(stderr, "peer_dag: METIS made no groups (%d)\n", result);
        exit(1);
    }
}

/* Fills group[]; returns how many groups there are. */
static size_t group_clusters(dag *self)
{
    size_t parts = (self->pending_count + GROUP_CLUSTERS - 1) / GROUP_CLUSTERS, pair_count, used = 0;
    memset(self->group, 0, self->pending_count * sizeof *self->group);
    if (parts <= 1)
        return 1;
    uint64_t *pairs = neighbour_pairs(self, &pair_count);
    idx_t *first = plain_allocate(self->pending_count + 1, sizeof *first);
    idx_t *neighbour = plain_allocate(pair_count, sizeof *neighbour),
          *weight = plain_allocate(pair_count, sizeof *weight);
    idx_t *part = plain_allocate(self->pending_count, sizeof *part);
    for (size_t i = 0; i < pair_count; i++) {
        if (i == 0 || pairs[i] != pairs[i - 1]) {
            neighbour[used++] = (idx_t)(uint32_t)pairs[i];
            first[(pairs[i] >> 32) + 1]++;
        }
        weight[used - 1]++;
    }
    for (size_t i = 0; i < self->pending_count; i++)
        first[i + 1] += first[i];
    run_metis((idx_t)self->pending_count, first, neighbour, weight, (idx_t)parts, part);
    for (size_t i = 0; i < self->pending_count; i++)
        self->group[i] = (uint32_t)part[i];
    free(pairs);
    free(first);
    free(neighbour);
    free(weight);
    free(part);
    return parts;
}

static void lock_shared_vertices(dag *self)
{
    memset(self->seen_by, 0xff, self->vertex_count * sizeof *self->seen_by);
    memset(self->locked, 0, self->vertex_count);
    for (size_t i = 0; i < self->pending_count; i++) {
        const cluster *from = &self->cluster[self->pending[i]];
        for (uint32_t k = 0; k < from->corner_count; k++) {
            uint32_t vertex = self->corner[from->first_corner + k];
            if (self->seen_by[vertex] == UINT32_MAX)
                self->seen_by[vertex] = self->group[i];
            self->locked[vertex] |= self->seen_by[vertex] != self->group[i];
        }
    }
}

/* ---- one group ---- */

/* members: numbers of pending clusters. */
static void gather(dag *self, const uint32_t *members, size_t member_count, group_mesh *mesh)
{
    size_t count = 0;
    for (size_t i = 0; i < member_count; i++)
        count += self->cluster[self->pending[members[i]]].corner_count;
    *mesh = (group_mesh){.corner = plain_allocate(count, sizeof *mesh->corner),
                         .global = plain_allocate(count, sizeof *mesh->global),
                         .position = plain_allocate(count, 3 * (1 + LOCK_TWINS) * sizeof *mesh->position),
                         .lock = plain_allocate(count, 1)};
    for (size_t i = 0; i < member_count; i++) {
        const cluster *from = &self->cluster[self->pending[members[i]]];
        for (uint32_t k = 0; k < from->corner_count; k++) {
            uint32_t vertex = self->corner[from->first_corner + k];
            if (self->local[vertex] == UINT32_MAX) {
                self->local[vertex] = (uint32_t)mesh->vertex_count;
                mesh->lock[mesh->vertex_count] = self->locked[vertex];
                memcpy(mesh->position + 3 * mesh->vertex_count, self->position + (size_t)3 * vertex, 3 * sizeof(float));
                mesh->global[mesh->vertex_count++] = vertex;
            }
            mesh->corner[mesh->corner_count++] = self->local[vertex];
        }
    }
    mesh->place_count = mesh->vertex_count;
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        self->local[mesh->global[i]] = UINT32_MAX;
        for (int twin = 0; mesh->lock[i] && twin < LOCK_TWINS; twin++)
            memcpy(mesh->position + 3 * mesh->place_count++, mesh->position + 3 * i, 3 * sizeof(float));
    }
}

static void free_group(group_mesh *mesh)
{
    free(mesh->corner);
    free(mesh->global);
    free(mesh->position);
    free(mesh->lock);
}

/* Replaces the group's corners; returns the error of this step alone, in model units. */
static float simplify(group_mesh *mesh)
{
    size_t target = (size_t)((double)(mesh->corner_count / 3) * SIMPLIFY_RATIO) * 3,
           stride = 3 * sizeof *mesh->position;
    uint32_t *coarse = plain_allocate(mesh->corner_count, sizeof *coarse);
    float error = 0, scale = meshopt_simplifyScale(mesh->position, mesh->place_count, stride);
#if MESHOPTIMIZER_VERSION >= 1000
    size_t count = meshopt_simplifyWithAttributes(coarse, mesh->corner, mesh->corner_count, mesh->position,
                                                  mesh->place_count, stride, NULL, 0, NULL, 0, mesh->lock, target,
                                                  FLT_MAX, meshopt_SimplifyPermissive, &error);
    if (count > target) {
        count = meshopt_simplifySloppy(coarse, mesh->corner, mesh->corner_count, mesh->position, mesh->place_count,
                                       stride, mesh->lock, target, FLT_MAX, &error);
        error *= SLOPPY_ERROR;
    }
#else
    size_t count = meshopt_simplify(coarse, mesh->corner, mesh->corner_count, mesh->position, mesh->place_count, stride,
                                    target, FLT_MAX, 0, &error);
#endif
    free(mesh->corner);
    mesh->corner = coarse;
    mesh->corner_count = count;
    return error * scale;
}

static void climb(dag *self, const uint32_t *members, size_t member_count)
{
    group_mesh mesh;
    gather(self, members, member_count, &mesh);
    size_t before = mesh.corner_count;
    float error = simplify(&mesh);
    self->group_count++;
    if ((double)mesh.corner_count > (double)before * SIMPLIFY_THRESHOLD)
        self->stuck_count++; /* its clusters keep FLT_MAX: nothing stands above them */
    else {
        for (size_t i = 0; i < member_count; i++) {
            float own = self->cluster[self->pending[members[i]]].own_error;
            error = own > error ? own : error;
        }
        for (size_t i = 0; i < member_count; i++)
            self->cluster[self->pending[members[i]]].parent_error = error;
        if (mesh.corner_count > 0)
            split_into_clusters(self, &mesh, error);
    }
    free_group(&mesh);
}

/* ---- the hierarchy ---- */

static void take_next_level(dag *self)
{
    uint32_t *spare = self->pending;
    size_t spare_room = self->pending_room;
    self->pending = self->next;
    self->pending_count = self->next_count;
    self->pending_room = self->next_room;
    self->next = spare;
    self->next_room = spare_room;
    self->next_count = 0;
    self->level_count++;
}

static void climb_level(dag *self)
{
    self->group = plain_allocate(self->pending_count, sizeof *self->group);
    size_t group_count = group_clusters(self);
    lock_shared_vertices(self);
    size_t *first = plain_allocate(group_count + 2, sizeof *first);
    uint32_t *members = plain_allocate(self->pending_count, sizeof *members);
    for (size_t i = 0; i < self->pending_count; i++)
        first[self->group[i] + 2]++;
    for (size_t i = 2; i < group_count + 2; i++)
        first[i] += first[i - 1];
    for (size_t i = 0; i < self->pending_count; i++)
        members[first[self->group[i] + 1]++] = (uint32_t)i;
    for (size_t i = 0; i < group_count; i++)
        if (first[i + 1] > first[i])
            climb(self, members + first[i], first[i + 1] - first[i]);
    free(first);
    free(members);
    free(self->group);
    self->group = NULL;
}

/* Equal places become one vertex; triangles that this makes flat are left out. */
static void weld(dag *self, const plain_mesh *input, group_mesh *mesh)
{
    size_t corner_count = 3 * input->triangle_count;
    float *position = plain_allocate(input->vertex_count, 3 * sizeof *position);
    for (size_t i = 0; i < 3 * input->vertex_count; i++)
        position[i] = (float)input->position[i];
    uint32_t *remap = plain_allocate(input->vertex_count, sizeof *remap);
    self->vertex_count = meshopt_generateVertexRemap(remap, input->corner, corner_count, position, input->vertex_count,
                                                     3 * sizeof *position);
    self->position = plain_allocate(self->vertex_count, 3 * sizeof *position);
    meshopt_remapVertexBuffer(self->position, position, input->vertex_count, 3 * sizeof *position, remap);
    *mesh = (group_mesh){.corner = plain_allocate(corner_count, sizeof *mesh->corner), .position = self->position};
    for (size_t i = 0; i < corner_count; i += 3) {
        uint32_t a = remap[input->corner[i]], b = remap[input->corner[i + 1]], c = remap[input->corner[i + 2]];
        if (a == b || b == c || c == a)
            continue;
        memcpy(mesh->corner + mesh->corner_count, (uint32_t[]){a, b, c}, 3 * sizeof a);
        mesh->corner_count += 3;
    }
    free(position);
    free(remap);
    mesh->vertex_count = mesh->place_count = self->vertex_count;
    mesh->global = plain_allocate(self->vertex_count, sizeof *mesh->global);
    for (size_t i = 0; i < self->vertex_count; i++)
        mesh->global[i] = (uint32_t)i;
}

static void build(dag *self, const plain_mesh *input)
{
    group_mesh mesh;
    weld(self, input, &mesh);
    split_into_clusters(self, &mesh, 0);
    mesh.position = NULL;
    free_group(&mesh);
    self->seen_by = plain_allocate(self->vertex_count, sizeof *self->seen_by);
    self->locked = plain_allocate(self->vertex_count, 1);
    self->local = plain_allocate(self->vertex_count, sizeof *self->local);
    memset(self->local, 0xff, self->vertex_count * sizeof *self->local);
    for (take_next_level(self); self->pending_count > 1; take_next_level(self))
        climb_level(self);
}

static void free_dag(dag *self)
{
    void *owned[] = {self->position, self->corner,  self->cluster, self->pending, self->next,
                     self->group,    self->seen_by, self->locked,  self->local};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

/* ---- cuts ---- */

static bool write_cut(const dag *self, const char *prefix, int number, double error)
{
    char path[4096];
    snprintf(path, sizeof path, "%s_%d.ply", prefix, number);
    uint32_t *corner = plain_allocate(self->corner_count, sizeof *corner);
    size_t corner_count = 0, drawn = 0;
    float claimed = 0;
    for (size_t i = 0; i < self->cluster_count; i++) {
        const cluster *at = &self->cluster[i];
        if ((double)at->own_error > error || (double)at->parent_error <= error)
            continue;
        memcpy(corner + corner_count, self->corner + at->first_corner, at->corner_count * sizeof *corner);
        corner_count += at->corner_count;
        claimed = at->own_error > claimed ? at->own_error : claimed;
        drawn++;
    }
    bool good = plain_mesh_write(path, self->position, self->vertex_count, corner, corner_count / 3);
    free(corner);
    printf("{\"error\":%.9g,\"claimed\":%.9g,\"clusters\":%zu,\"triangles\":%zu,\"file\":\"%s\"}\n", error,
           (double)claimed, drawn, corner_count / 3, path);
    return good;
}

int main(int argc, char **argv)
{
    plain_mesh input;
    dag self = {0};
    if (argc < 4) {
        fprintf(stderr, "usage: peer_dag INPUT.ply PREFIX ERROR...\n");
        return 2;
    }
    if (!plain_mesh_read(argv[1], &input))
        return 1;
    clock_t start = clock();
    build(&self, &input);
    printf("{\"library\":%d,\"triangles_in\":%zu,\"clusters\":%zu,\"groups\":%zu,\"stuck_groups\":%zu,\"levels\":%d,"
           "\"triangles\":%zu,\"cpu_seconds\":%.2f}\n",
           MESHOPTIMIZER_VERSION, input.triangle_count, self.cluster_count, self.group_count, self.stuck_count,
           self.level_count, self.corner_count / 3, (double)(clock() - start) / CLOCKS_PER_SEC);
    plain_mesh_free(&input);
    bool good = true;
    for (int i = 3; i < argc && good; i++)
        good = write_cut(&self, argv[2], i - 3, strtod(argv[i], NULL));
    free_dag(&self);
    return good ? 0 : 1;
}
