#include "build/samples/octree.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "geometry/colour.h"

double strl_octree_side(const strl_ingest *ingest, uint32_t depth)
{
    return ldexp(1, (int)(ingest->curve_shift + STRL_OCTREE_DEPTH - depth));
}

/* Every third bit, from the lowest on, moved together. */
static uint64_t every_third(uint64_t bits)
{
    bits &= 0x1249249249249249u;
    bits = (bits ^ bits >> 2) & 0x10c30c30c30c30c3u;
    bits = (bits ^ bits >> 4) & 0x100f00f00f00f00fu;
    bits = (bits ^ bits >> 8) & 0x001f0000ff0000ffu;
    bits = (bits ^ bits >> 16) & 0x001f00000000ffffu;
    return (bits ^ bits >> 32) & 0x00000000001fffffu;
}

void strl_octree_corner(const strl_ingest *ingest, uint64_t prefix, uint32_t depth, double corner[3])
{
    double side = strl_octree_side(ingest, depth);
    for (unsigned k = 0; k < 3; k++)
        corner[k] = (double)every_third(prefix >> k) * side;
}

/* Whether the ball of one side's radius round the cell's centre holds the triangle. */
static bool fits(const strl_soup_triangle *triangle, const double centre[3], double side)
{
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) {
            double way = triangle->corner[c].position[k] - centre[k];
            sum += way * way;
        }
        if (sum > side * side)
            return false;
    }
    return true;
}

float strl_octree_extent(const strl_soup_triangle *triangle)
{
    double most = 0;
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) {
            double way = (double)triangle->corner[c].position[k] - triangle->corner[(c + 1) % 3].position[k];
            sum += way * way;
        }
        most = sum > most ? sum : most;
    }
    return (float)(sqrt(most) * (1 + 1e-6));
}

/* A triangle no longer than this share of a cell's side lies in its ball wherever in the cell its centroid is: one side
 * less half a diagonal. Its corners are at most two thirds of its longest edge from the centroid. */
#define SURE_SHARE 0.2

uint8_t strl_octree_limit(const strl_ingest *ingest, const strl_soup_triangle *triangle, uint64_t key)
{
    double extent = strl_octree_extent(triangle);
    int exponent;
    frexp(extent / SURE_SHARE, &exponent); /* the side 2^exponent is above */
    int depth = (int)(ingest->curve_shift + STRL_OCTREE_DEPTH) - exponent;
    uint32_t limit = depth < 0 ? 0 : depth > (int)STRL_OCTREE_DEPTH ? STRL_OCTREE_DEPTH : (uint32_t)depth;
    const uint64_t cell[3] = {every_third(key), every_third(key >> 1), every_third(key >> 2)};
    double side = strl_octree_side(ingest, limit);
    for (; limit < STRL_OCTREE_DEPTH; limit++) {
        double centre[3];
        side /= 2;
        for (int k = 0; k < 3; k++)
            centre[k] = ((double)(cell[k] >> (STRL_OCTREE_DEPTH - limit - 1)) + 0.5) * side;
        if (!fits(triangle, centre, side))
            break;
    }
    return (uint8_t)limit;
}

strl_status strl_octree_create(strl_octree *octree, const strl_ingest *ingest, uint32_t triangle_count, strl_error *err)
{
    octree->ingest = ingest;
    octree->triangle_count = triangle_count;
    octree->triangle = strl__alloc(triangle_count, sizeof *octree->triangle);
    octree->key = strl__alloc(triangle_count, sizeof *octree->key);
    octree->limit = strl__alloc(triangle_count, sizeof *octree->limit);
    octree->owner = strl__alloc(triangle_count, sizeof *octree->owner);
    octree->hits = strl__alloc_zero(triangle_count, sizeof *octree->hits);
    if (octree->triangle && octree->key && octree->limit && octree->owner && octree->hits)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_MEMORY, "no memory to sample %u triangles", triangle_count);
}

void strl_octree_deinit(strl_octree *octree)
{
    strl__free(octree->triangle);
    strl__free(octree->key);
    strl__free(octree->limit);
    strl__free(octree->owner);
    strl__free(octree->hits);
    strl__free(octree->sums);
    strl__free(octree->octant);
    strl__free(octree->item);
    *octree = (strl_octree){0};
}

strl_status strl_octree_add(strl_octree *octree, const strl_octant *octant, uint32_t *index, strl_error *err)
{
    if (!strl__grow(&octree->octant, &octree->octant_capacity, octree->octant_count + 1, sizeof *octree->octant))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu cells", octree->octant_count);
    *index = (uint32_t)octree->octant_count;
    octree->octant[octree->octant_count++] = *octant;
    return STRL_OK;
}

strl_status strl_octree_add_item(strl_octree *octree, uint32_t triangle, float weight, strl_error *err)
{
    if (!strl__grow(&octree->item, &octree->item_capacity, octree->item_count + 1, sizeof *octree->item))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu samples", octree->item_count);
    octree->item[octree->item_count++] = (strl_sample_item){triangle, weight};
    return STRL_OK;
}

/* ---- leaves */

static double linear_of(uint32_t rgba, int channel)
{
    return (double)strl_srgb_decode(rgba >> 8 * channel & 255);
}

static void add_colour(const strl_octree *octree, const strl_soup_triangle *triangle, double area,
                       strl_splat_sums *sums)
{
    uint32_t material = octree->ingest->palette[triangle->palette].rgba;
    if (!octree->ingest->has_colours && material == UINT32_MAX) {
        for (int k = 0; k < 4; k++)
            sums->linear[k] += area;
        return;
    }
    for (int c = 0; c < 3; c++) {
        uint32_t rgba = strl_rgba_multiply(triangle->corner[c].colour, material);
        for (int k = 0; k < 3; k++)
            sums->linear[k] += area / 3 * linear_of(rgba, k);
        sums->linear[3] += area / 3 * (rgba >> 24) / 255;
    }
}

static double area_vector(const strl_soup_triangle *triangle, double vector[3])
{
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)triangle->corner[1].position[k] - triangle->corner[0].position[k];
        b[k] = (double)triangle->corner[2].position[k] - triangle->corner[0].position[k];
    }
    for (int k = 0; k < 3; k++)
        vector[k] = (a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]) / 2;
    return sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
}

/* Triangles are seen from both sides: only the line of a normal counts. */
static void add_vector(double to[3], const double vector[3])
{
    double sign = to[0] * vector[0] + to[1] * vector[1] + to[2] * vector[2] < 0 ? -1 : 1;
    for (int k = 0; k < 3; k++)
        to[k] += sign * vector[k];
}

static void add_triangle(const strl_octree *octree, const strl_soup_triangle *triangle, strl_splat_sums *sums,
                         float *area_out)
{
    double vector[3], area = area_vector(triangle, vector);
    sums->area += area;
    add_vector(sums->normal, vector);
    add_colour(octree, triangle, area, sums);
    for (int k = 0; k < 3; k++)
        sums->centre[k] += area *
                           ((double)triangle->corner[0].position[k] + triangle->corner[1].position[k] +
                            triangle->corner[2].position[k]) /
                           3;
    *area_out = (float)area;
}

static void add_sums(strl_splat_sums *to, const strl_splat_sums *from)
{
    to->area += from->area;
    for (int k = 0; k < 4; k++)
        to->linear[k] += from->linear[k];
    for (int k = 0; k < 3; k++)
        to->centre[k] += from->centre[k];
    add_vector(to->normal, from->normal);
}

strl_status strl_octree_add_leaf(strl_octree *octree, const uint32_t *order, uint32_t count, strl_octant *leaf,
                                 uint32_t *index, strl_error *err)
{
    strl_status status = STRL_OK;
    leaf->is_leaf = true;
    leaf->chunk = STRL_NO_CHUNK;
    leaf->first_item = (uint32_t)octree->item_count;
    leaf->item_count = leaf->total = count;
    for (uint32_t i = 0; i < count && !status; i++) {
        float area;
        add_triangle(octree, &octree->triangle[order[i]], &leaf->sums, &area);
        octree->owner[order[i]] = (uint32_t)octree->octant_count;
        if (octree->limit[order[i]] < leaf->depth)
            leaf->extent = fmaxf(leaf->extent, strl_octree_extent(&octree->triangle[order[i]]));
        status = strl_octree_add_item(octree, order[i], area, err);
    }
    return status ? status : strl_octree_add(octree, leaf, index, err);
}

/* ---- cells */

/* Depth of the smallest cell that has both keys. */
static uint32_t common_depth(uint64_t a, uint64_t b)
{
    uint32_t depth = STRL_OCTREE_DEPTH;
    for (uint64_t differ = a ^ b; differ; differ >>= 3)
        depth--;
    return depth;
}

/* Moves those of order[0 .. count) to its front that no smaller cell holds; all keep their order. Returns how many they
 * are. */
static uint32_t part_large(const strl_octree *octree, uint32_t *order, uint32_t count, uint32_t depth, uint32_t *spare)
{
    uint32_t large = 0, rest = 0;
    for (uint32_t i = 0; i < count; i++)
        if (octree->limit[order[i]] <= depth)
            order[large++] = order[i];
        else
            spare[rest++] = order[i];
    memcpy(order + large, spare, rest * sizeof *order);
    return large;
}

static uint32_t end_of_child(const strl_octree *octree, const uint32_t *order, uint32_t at, uint32_t count,
                             uint32_t depth)
{
    unsigned shift = 3 * (STRL_OCTREE_DEPTH - depth - 1);
    uint64_t prefix = octree->key[order[at]] >> shift;
    while (at < count && octree->key[order[at]] >> shift == prefix)
        at++;
    return at;
}

static strl_status build(strl_octree *octree, uint32_t *order, uint32_t count, uint32_t depth, uint32_t *spare,
                         uint32_t *index, strl_error *err);

static strl_status build_children(strl_octree *octree, uint32_t *order, uint32_t count, strl_octant *octant,
                                  uint32_t *spare, strl_error *err)
{
    uint32_t large = part_large(octree, order, count, octant->depth, spare);
    strl_status status = STRL_OK;
    for (uint32_t at = large, end; at < count && !status; at = end) {
        end = end_of_child(octree, order, at, count, octant->depth);
        status =
            build(octree, order + at, end - at, octant->depth + 1, spare, &octant->child[octant->child_count++], err);
    }
    if (!status && large) {
        strl_octant leaf = {.prefix = octant->prefix, .depth = octant->depth, .is_large = true};
        status = strl_octree_add_leaf(octree, order, large, &leaf, &octant->child[octant->child_count++], err);
    }
    return status;
}

/* order[0 .. count) lie in one cell of `depth`, or of less where they are too large for it. */
static strl_status build(strl_octree *octree, uint32_t *order, uint32_t count, uint32_t depth, uint32_t *spare,
                         uint32_t *index, strl_error *err)
{
    uint32_t own = common_depth(octree->key[order[0]], octree->key[order[count - 1]]);
    for (uint32_t i = 0; i < count; i++)
        own = octree->limit[order[i]] < own ? octree->limit[order[i]] : own;
    own = own < depth ? depth : own;
    strl_octant octant = {
        .prefix = octree->key[order[0]] >> 3 * (STRL_OCTREE_DEPTH - own), .depth = own, .chunk = STRL_NO_CHUNK};
    if (count <= octree->leaf_triangles || own == STRL_OCTREE_DEPTH)
        return strl_octree_add_leaf(octree, order, count, &octant, index, err);
    strl_status status = build_children(octree, order, count, &octant, spare, err);
    if (!status)
        status = strl_octree_add(octree, &octant, index, err);
    return status ? status : strl_octree_sample(octree, *index, err);
}

strl_status strl_octree_build(strl_octree *octree, uint32_t *order, uint32_t count, uint32_t depth, uint32_t *root,
                              strl_error *err)
{
    *root = STRL_NO_OCTANT;
    if (!count)
        return STRL_OK;
    uint32_t *spare = strl__alloc(count, sizeof *spare);
    strl_status status = spare ? build(octree, order, count, depth, spare, root, err)
                               : strl__fail(err, STRL_ERR_MEMORY, "no memory to sample %u triangles", count);
    strl__free(spare);
    return status;
}

void strl_octree_sum_children(strl_octree *octree, strl_octant *octant)
{
    octant->sums = (strl_splat_sums){0};
    octant->total = 0;
    for (uint32_t i = 0; i < octant->child_count; i++) {
        const strl_octant *child = &octree->octant[octant->child[i]];
        add_sums(&octant->sums, &child->sums);
        octant->extent = fmaxf(octant->extent, child->extent);
        octant->total += child->total;
    }
}
