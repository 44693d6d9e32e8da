/* Cones of normals: docs/format.md, "Cones". A triangle must lie in the cones of its node and of all nodes above. */
#include <math.h>

#include "base/fail.h"
#include "verify/mesh.h"

#define COSINE_ONE 65535.0
#define ROUNDING 1e-12 /* more than the arithmetic here loses, a ten-millionth of what a cosine's code tells apart */

/* a b - c d, of whole numbers below 2^34: both products as a sum of two doubles each. */
static double minor(double a, double b, double c, double d)
{
    double ab = a * b, cd = c * d;
    return (ab - cd) + (fma(a, b, -ab) - fma(c, d, -cd));
}

static void find_normal(const strl__vmesh *mesh, const uint16_t corner[3], double normal[3])
{
    double from[2][3];
    for (unsigned side = 0; side < 2; side++)
        for (unsigned k = 0; k < 3; k++)
            from[side][k] = (double)((int64_t)mesh->position[corner[side + 1]][k] - mesh->position[corner[0]][k]);
    normal[0] = minor(from[0][1], from[1][2], from[0][2], from[1][1]);
    normal[1] = minor(from[0][2], from[1][0], from[0][0], from[1][2]);
    normal[2] = minor(from[0][0], from[1][1], from[0][1], from[1][0]);
}

typedef struct normal {
    double of[3], length;
} normal;

/* Each is compared with the cones of many nodes. NULL without memory. */
static normal *find_normals(const strl__vmesh *mesh, strl_arena *scratch)
{
    normal *normals = strl_arena_alloc(scratch, mesh->triangle_count, sizeof *normals);
    for (uint32_t t = 0; normals && t < mesh->triangle_count; t++) {
        double *of = normals[t].of;
        find_normal(mesh, mesh->triangle[t], of);
        normals[t].length = sqrt(of[0] * of[0] + of[1] * of[1] + of[2] * of[2]);
    }
    return normals;
}

/* The triangle that lies outside; count = none. One without area lies in every cone. */
static uint32_t find_outside(const strl__vnode *n, const normal *normals, uint32_t count)
{
    double axis = 0;
    for (unsigned k = 0; k < 3; k++)
        axis += (double)n->cone_axis[k] * n->cone_axis[k];
    double least = (n->cone_cosine / COSINE_ONE - ROUNDING) * sqrt(axis);
    for (uint32_t t = 0; t < count; t++) {
        double along = 0;
        for (unsigned k = 0; k < 3; k++)
            along += normals[t].of[k] * n->cone_axis[k];
        if (normals[t].length > 0 && along < least * normals[t].length)
            return t;
    }
    return count;
}

strl_status strl__v_check_cones(strl__model *model, const strl__vtree *tree, uint32_t id, const strl__vmesh *mesh,
                                strl_arena *scratch, strl_error *err)
{
    const normal *normals = NULL;
    for (uint32_t above = id; above != STRL__NO_NODE; above = tree->nodes[above].parent) {
        const strl__vnode *n = &tree->nodes[above];
        if (n->cone_cosine == 0)
            continue;
        if (!normals && !(normals = find_normals(mesh, scratch)))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for the normals of %u triangles", mesh->triangle_count);
        strl__v_checked(model->checks, STRL_VERIFY_CONES, 1);
        uint32_t outside = find_outside(n, normals, mesh->triangle_count);
        if (outside < mesh->triangle_count)
            strl__v_flaw(
                model->checks, STRL_VERIFY_CONES, strl__key(tree, id),
                "tree %u node %u: its triangle %u does not lie in the cone of node %u (about %d %d %d, cosine %u)",
                tree->index, id, outside, above, n->cone_axis[0], n->cone_axis[1], n->cone_axis[2], n->cone_cosine);
    }
    return STRL_OK;
}
