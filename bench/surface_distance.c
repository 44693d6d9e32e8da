/* How far two surfaces are apart, in both directions: the one measure for Stroll and for others, of which it shares no
 * code.
 *
 *     surface_distance [--samples N] REFERENCE.ply OTHER.ply...
 *
 * Each surface is sampled evenly by area (N points, one in each N-th of the area) and at every vertex that a triangle
 * uses; the nearest point of the other surface is exact, by a tree of boxes. One JSON line for each OTHER, lengths in
 * model units: rms is over the even samples, max over these and the vertices; "forward" is from the reference to the
 * other surface, and rms and max are the larger of both directions. The maximum is one over samples: the true one is no
 * smaller. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "plain_mesh.h"

enum { LEAF_TRIANGLES = 4, MAX_DEPTH = 64, MAX_THREADS = 64 };

typedef struct box {
    double low[3], high[3];
} box;

/* An inner node's first child follows it. */
typedef struct tree_node {
    box bounds;
    uint32_t second_child; /* 0 = leaf */
    uint32_t first, count; /* leaf: triangles */
} tree_node;

typedef struct tree {
    tree_node *node;
    uint32_t node_count;
    double (*triangle)[3][3]; /* in the order of the leaves */
    uint32_t *order;          /* while building */
    double (*middle)[3];
    const plain_mesh *mesh;
} tree;

typedef struct sums {
    double squares, max_square;
    uint64_t samples;
} sums;

/* What one thread measures: the samples and vertices of triangles first to end. */
typedef struct task {
    const plain_mesh *from;
    const tree *to;
    const double *area_before; /* triangle_count + 1 */
    const uint32_t *owner;     /* of each vertex: the triangle that measures it */
    uint64_t sample_count;
    size_t first, end;
    uint32_t nearest; /* triangle of the last answer: the next is likely near */
    sums out;
} task;

/* ---- the tree ---- */

static box box_of(const tree *self, uint32_t first, uint32_t count)
{
    box all = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (size_t i = (size_t)3 * first; i < (size_t)3 * (first + count); i++) {
        const double *p = self->mesh->position + (size_t)3 * self->mesh->corner[(size_t)3 * self->order[i / 3] + i % 3];
        for (int axis = 0; axis < 3; axis++) {
            all.low[axis] = fmin(all.low[axis], p[axis]);
            all.high[axis] = fmax(all.high[axis], p[axis]);
        }
    }
    return all;
}

/* The order's middle one, by triangles' middles along the axis, comes to its place; smaller ones before it. */
static void select_half(const tree *self, uint32_t *order, uint32_t count, int axis)
{
    uint32_t low = 0, high = count - 1, half = count / 2;
    while (low < high) {
        double pivot = self->middle[order[low + (high - low) / 2]][axis];
        uint32_t i = low, j = high;
        while (i <= j) {
            while (self->middle[order[i]][axis] < pivot)
                i++;
            while (self->middle[order[j]][axis] > pivot)
                j--;
            if (i <= j) {
                uint32_t swapped = order[i];
                order[i++] = order[j];
                order[j] = swapped;
                if (j-- == 0)
                    break;
            }
        }
        if (half <= j && j != UINT32_MAX)
            high = j;
        else if (half >= i)
            low = i;
        else
            return;
    }
}

static int longest_axis(const box *bounds)
{
    int axis = 0;
    for (int i = 1; i < 3; i++)
        if (bounds->high[i] - bounds->low[i] > bounds->high[axis] - bounds->low[axis])
            axis = i;
    return axis;
}

static void build_node(tree *self, uint32_t first, uint32_t count)
{
    uint32_t index = self->node_count++;
    tree_node *node = &self->node[index];
    node->bounds = box_of(self, first, count);
    node->first = first;
    node->count = count;
    if (count <= LEAF_TRIANGLES)
        return;
    select_half(self, self->order + first, count, longest_axis(&node->bounds));
    build_node(self, first, count / 2);
    self->node[index].second_child = self->node_count;
    build_node(self, first + count / 2, count - count / 2);
}

static void build_tree(tree *self, const plain_mesh *mesh)
{
    uint32_t count = (uint32_t)mesh->triangle_count;
    *self = (tree){.mesh = mesh};
    self->node = plain_allocate((size_t)2 * count + 1, sizeof *self->node);
    self->order = plain_allocate(count, sizeof *self->order);
    self->middle = plain_allocate(count, sizeof *self->middle);
    for (uint32_t i = 0; i < count; i++) {
        self->order[i] = i;
        for (size_t k = 0; k < 9; k++)
            self->middle[i][k % 3] += mesh->position[(size_t)3 * mesh->corner[(size_t)3 * i + k / 3] + k % 3] / 3;
    }
    build_node(self, 0, count);
    free(self->middle);
    self->triangle = plain_allocate(count, sizeof *self->triangle);
    for (uint32_t i = 0; i < count; i++)
        for (size_t k = 0; k < 9; k++)
            self->triangle[i][k / 3][k % 3] =
                mesh->position[(size_t)3 * mesh->corner[(size_t)3 * self->order[i] + k / 3] + k % 3];
    free(self->order);
}

static void free_tree(tree *self)
{
    free(self->node);
    free(self->triangle);
}

/* ---- nearest point ---- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double clamped(double x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

static double square_to_segment(const double p[3], const double a[3], const double b[3])
{
    double ab[3], ap[3];
    for (int i = 0; i < 3; i++) {
        ab[i] = b[i] - a[i];
        ap[i] = p[i] - a[i];
    }
    double length = dot(ab, ab), t = length > 0 ? clamped(dot(ap, ab) / length) : 0;
    for (int i = 0; i < 3; i++)
        ap[i] -= t * ab[i];
    return dot(ap, ap);
}

/* Over the inside the distance to the plane, else that to the nearest of the three edges; right for degenerate ones
 * too. */
static double square_to_triangle(const double p[3], const double t[3][3])
{
    double u[3], v[3], w[3];
    for (int i = 0; i < 3; i++) {
        u[i] = t[1][i] - t[0][i];
        v[i] = t[2][i] - t[0][i];
        w[i] = p[i] - t[0][i];
    }
    double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v);
    double area = uu * vv - uv * uv, s = wu * vv - wv * uv, r = wv * uu - wu * uv;
    if (area > 0 && s >= 0 && r >= 0 && s + r <= area) {
        for (int i = 0; i < 3; i++)
            w[i] -= (s * u[i] + r * v[i]) / area;
        return dot(w, w);
    }
    return fmin(square_to_segment(p, t[0], t[1]),
                fmin(square_to_segment(p, t[1], t[2]), square_to_segment(p, t[2], t[0])));
}

static double square_to_box(const double p[3], const box *bounds)
{
    double sum = 0;
    for (int axis = 0; axis < 3; axis++) {
        double below = bounds->low[axis] - p[axis], above = p[axis] - bounds->high[axis];
        double out = below > above ? below : above;
        sum += out > 0 ? out * out : 0;
    }
    return sum;
}

/* `nearest`: a triangle to begin with; comes back as the nearest. */
static double square_to_surface(const tree *self, const double p[3], uint32_t *nearest)
{
    struct {
        uint32_t node;
        double square;
    } stack[MAX_DEPTH];
    int depth = 0;
    double best = square_to_triangle(p, (const double(*)[3])self->triangle[*nearest]);
    stack[depth].node = 0;
    stack[depth++].square = square_to_box(p, &self->node[0].bounds);
    while (depth > 0) {
        uint32_t index = stack[--depth].node;
        const tree_node *node = &self->node[index];
        if (stack[depth].square >= best)
            continue;
        if (node->second_child == 0) {
            for (uint32_t i = node->first; i < node->first + node->count; i++) {
                double square = square_to_triangle(p, (const double(*)[3])self->triangle[i]);
                if (square < best) {
                    best = square;
                    *nearest = i;
                }
            }
            continue;
        }
        uint32_t child[2] = {index + 1, node->second_child};
        double square[2] = {square_to_box(p, &self->node[child[0]].bounds),
                            square_to_box(p, &self->node[child[1]].bounds)};
        int nearer = square[1] < square[0];
        for (int i = 0; i < 2; i++) { /* the nearer one on top */
            int which = i == 0 ? !nearer : nearer;
            stack[depth].node = child[which];
            stack[depth++].square = square[which];
        }
    }
    return best;
}

/* ---- samples ---- */

/* Splitmix64: sample k's own random number, whatever thread asks. */
static double random_unit(uint64_t k)
{
    uint64_t z = (k + 1) * 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static void measure_point(task *self, const double p[3], bool is_sample)
{
    double square = square_to_surface(self->to, p, &self->nearest);
    self->out.max_square = fmax(self->out.max_square, square);
    if (is_sample) {
        self->out.squares += square;
        self->out.samples++;
    }
}

static void measure_triangle(task *self, size_t index)
{
    const uint32_t *corner = self->from->corner + 3 * index;
    const double *t[3];
    for (int i = 0; i < 3; i++) {
        t[i] = self->from->position + (size_t)3 * corner[i];
        if (self->owner[corner[i]] == index)
            measure_point(self, t[i], false);
    }
    double scale = (double)self->sample_count / self->area_before[self->from->triangle_count];
    uint64_t first = (uint64_t)(self->area_before[index] * scale),
             end = (uint64_t)(self->area_before[index + 1] * scale);
    for (uint64_t k = first; k < end; k++) {
        double a = sqrt(random_unit(2 * k)), b = random_unit(2 * k + 1), p[3];
        for (int i = 0; i < 3; i++)
            p[i] = (1 - a) * t[0][i] + a * (1 - b) * t[1][i] + a * b * t[2][i];
        measure_point(self, p, true);
    }
}

static void *run_task(void *context)
{
    task *self = context;
    for (size_t i = self->first; i < self->end; i++)
        measure_triangle(self, i);
    return NULL;
}

static double area_of(const plain_mesh *mesh, size_t index)
{
    double u[3], v[3], sum = 0;
    for (int i = 0; i < 3; i++) {
        const double *a = mesh->position + (size_t)3 * mesh->corner[3 * index];
        u[i] = mesh->position[(size_t)3 * mesh->corner[3 * index + 1] + (size_t)i] - a[i];
        v[i] = mesh->position[(size_t)3 * mesh->corner[3 * index + 2] + (size_t)i] - a[i];
    }
    for (int i = 0; i < 3; i++) {
        double part = u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
        sum += part * part;
    }
    return sqrt(sum) / 2;
}

static void prepare(const plain_mesh *mesh, double *area_before, uint32_t *owner)
{
    memset(owner, 0xff, mesh->vertex_count * sizeof *owner);
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        area_before[i + 1] = area_before[i] + area_of(mesh, i);
        for (int k = 0; k < 3; k++)
            if (owner[mesh->corner[3 * i + (size_t)k]] == UINT32_MAX)
                owner[mesh->corner[3 * i + (size_t)k]] = (uint32_t)i;
    }
}

/* From every sample and vertex of one surface to the other surface. */
static sums measure_direction(const plain_mesh *from, const tree *to, uint64_t sample_count)
{
    double *area_before = plain_allocate(from->triangle_count + 1, sizeof *area_before);
    uint32_t *owner = plain_allocate(from->vertex_count, sizeof *owner);
    prepare(from, area_before, owner);
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    size_t threads = processors < 1 ? 1 : processors > MAX_THREADS ? MAX_THREADS : (size_t)processors;
    task tasks[MAX_THREADS] = {0};
    pthread_t thread[MAX_THREADS];
    for (size_t i = 0; i < threads; i++) {
        tasks[i] = (task){.from = from,
                          .to = to,
                          .area_before = area_before,
                          .owner = owner,
                          .sample_count = sample_count,
                          .first = from->triangle_count * i / threads,
                          .end = from->triangle_count * (i + 1) / threads};
        if (pthread_create(&thread[i], NULL, run_task, &tasks[i]) != 0) {
            fprintf(stderr, "surface_distance: no thread can be started\n");
            exit(1);
        }
    }
    sums all = {0};
    for (size_t i = 0; i < threads; i++) {
        pthread_join(thread[i], NULL);
        all.squares += tasks[i].out.squares;
        all.samples += tasks[i].out.samples;
        all.max_square = fmax(all.max_square, tasks[i].out.max_square);
    }
    free(area_before);
    free(owner);
    return all;
}

static double rms_of(sums all)
{
    return all.samples ? sqrt(all.squares / (double)all.samples) : 0;
}

static bool measure_pair(const plain_mesh *reference, const tree *reference_tree, const char *path, uint64_t samples)
{
    plain_mesh other;
    tree other_tree;
    if (!plain_mesh_read(path, &other))
        return false;
    bool has_triangles = other.triangle_count > 0;
    if (has_triangles) {
        build_tree(&other_tree, &other);
        sums forward = measure_direction(reference, &other_tree, samples);
        sums backward = measure_direction(&other, reference_tree, samples);
        double rms[2] = {rms_of(forward), rms_of(backward)};
        double max[2] = {sqrt(forward.max_square), sqrt(backward.max_square)};
        printf("{\"file\":\"%s\",\"triangles\":%zu,\"diagonal\":%.9g,\"samples\":%llu,\"rms\":%.9g,\"max\":%.9g,"
               "\"rms_forward\":%.9g,\"rms_backward\":%.9g,\"max_forward\":%.9g,\"max_backward\":%.9g}\n",
               path, other.triangle_count, plain_mesh_diagonal(reference), (unsigned long long)samples,
               fmax(rms[0], rms[1]), fmax(max[0], max[1]), rms[0], rms[1], max[0], max[1]);
        fflush(stdout);
        free_tree(&other_tree);
    } else
        fprintf(stderr, "surface_distance: %s has no triangle\n", path);
    plain_mesh_free(&other);
    return has_triangles;
}

int main(int argc, char **argv)
{
    uint64_t samples = 1000000;
    int at = 1;
    if (argc > 3 && !strcmp(argv[1], "--samples")) {
        samples = strtoull(argv[2], NULL, 10);
        at = 3;
    }
    if (argc < at + 2 || samples == 0) {
        fprintf(stderr, "usage: surface_distance [--samples N] REFERENCE.ply OTHER.ply...\n");
        return 2;
    }
    plain_mesh reference;
    tree reference_tree;
    if (!plain_mesh_read(argv[at], &reference))
        return 1;
    bool good = reference.triangle_count > 0;
    if (good) {
        build_tree(&reference_tree, &reference);
        for (int i = at + 1; i < argc; i++)
            good = measure_pair(&reference, &reference_tree, argv[i], samples) && good;
        free_tree(&reference_tree);
    } else
        fprintf(stderr, "surface_distance: %s has no triangle\n", argv[at]);
    plain_mesh_free(&reference);
    return good ? 0 : 1;
}
