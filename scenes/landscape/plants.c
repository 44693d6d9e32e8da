/* Trees and houses: each kind is made once. */
#include <math.h>

#include "base/hash.h"
#include "scenes/landscape/landscape.h"

double strl__landscape_random(uint64_t key)
{
    return (double)(strl__mix64(key) >> 11) * 0x1p-53;
}

typedef struct tree_maker {
    uint64_t random;
    strl__part_mesh *wood, *leaves;
    double leaf;        /* its length */
    int leaves_of_twig; /* two triangles each */
    int depth;          /* of branching */
} tree_maker;

static double next(tree_maker *tree)
{
    tree->random += 0x9e3779b97f4a7c15u;
    return strl__landscape_random(tree->random);
}

/* A direction off another one. */
static void bend_away(tree_maker *tree, const double from[3], double most, double to[3])
{
    const double origin[3] = {0};
    const strl__affine frame = strl__affine_along(origin, from);
    double c, s, lean = most * (0.5 + 0.5 * next(tree));
    strl__circle(next(tree), &c, &s);
    for (int k = 0; k < 3; k++)
        to[k] = frame.axis[2][k] + lean * (c * frame.axis[0][k] + s * frame.axis[1][k]);
    strl__normalise(to);
}

/* Folded along its middle, so that light falls on it from two sides. */
static void put_leaf(tree_maker *tree, const double at[3])
{
    const double up[3] = {0, 0, 1};
    double ahead[3], side[3], corner[4][3], normal[3];
    bend_away(tree, up, 3, ahead);
    strl__cross(ahead, up, side);
    if (strl__normalise(side) == 0)
        return;
    strl__cross(side, ahead, normal);
    const double length = tree->leaf * (0.7 + 0.6 * next(tree)), width = 0.3 * length;
    for (int k = 0; k < 3; k++) {
        corner[0][k] = at[k];
        corner[1][k] = at[k] + 0.5 * length * ahead[k] + width * side[k];
        corner[2][k] = at[k] + length * ahead[k];
        corner[3][k] = at[k] + 0.5 * length * ahead[k] - width * side[k];
    }
    uint32_t first = 0;
    for (int i = 0; i < 4; i++) {
        const uint32_t made = strl__part_mesh_vertex(tree->leaves, corner[i], normal);
        first = i == 0 ? made : first;
    }
    strl__part_mesh_quad(tree->leaves, first, first + 1, first + 2, first + 3);
}

static void put_leaves(tree_maker *tree, const double from[3], const double to[3], double spread)
{
    for (int i = 0; i < tree->leaves_of_twig; i++) {
        const double t = next(tree);
        double at[3];
        for (int k = 0; k < 3; k++)
            at[k] = from[k] + t * (to[k] - from[k]) + spread * (next(tree) - 0.5);
        put_leaf(tree, at);
    }
}

static void grow(tree_maker *tree, const double from[3], const double direction[3], double length, double radius,
                 int depth)
{
    double to[3];
    for (int k = 0; k < 3; k++)
        to[k] = from[k] + length * direction[k];
    strl__part_bar(tree->wood, from, to, radius, depth == 0 ? 12 : depth < 3 ? 8 : 5);
    if (depth == tree->depth) {
        put_leaves(tree, from, to, length);
        return;
    }
    const int branches = 3 + (next(tree) < 0.5);
    for (int i = 0; i < branches; i++) {
        double way[3], begin[3], t = i == 0 ? 1 : 0.45 + 0.5 * next(tree);
        bend_away(tree, direction, i == 0 ? 0.25 : 0.9, way);
        for (int k = 0; k < 3; k++)
            begin[k] = from[k] + t * (to[k] - from[k]);
        grow(tree, begin, way, length * (0.6 + 0.2 * next(tree)), radius * (i == 0 ? 0.7 : 0.5), depth + 1);
    }
}

void strl__landscape_tree(uint64_t seed, int kind, strl__part_mesh *wood, strl__part_mesh *leaves)
{
    static const struct {
        double height, radius, leaf;
        int leaves, depth;
    } kinds[STRL__TREE_KINDS] = {{2.6, 0.16, 0.22, 45, 4},
                                 {3.4, 0.2, 0.26, 35, 4},
                                 {1.8, 0.09, 0.2, 60, 3},
                                 {4.2, 0.28, 0.3, 50, 4},
                                 {1.2, 0.07, 0.16, 90, 3}};
    const double origin[3] = {0}, up[3] = {0, 0, 1};
    tree_maker tree = {.random = strl__mix64(seed + 77u * (uint64_t)(kind + 1)),
                       .wood = wood,
                       .leaves = leaves,
                       .leaf = kinds[kind].leaf,
                       .leaves_of_twig = kinds[kind].leaves,
                       .depth = kinds[kind].depth};
    wood->place = leaves->place = strl__affine_identity();
    grow(&tree, origin, up, kinds[kind].height, kinds[kind].radius, 0);
}

/* ---- houses */

static void put_windows(strl__part_mesh *mesh, const double size[3], int columns, int storeys)
{
    for (int side = 0; side < 2; side++)
        for (int storey = 0; storey < storeys; storey++)
            for (int column = 0; column < columns; column++) {
                const double middle[3] = {(column + 0.5) / columns * size[0] - size[0] / 2, (side - 0.5) * size[1],
                                          1.5 + 2.8 * storey};
                strl__part_block(mesh, middle, 1.1, 0.12, 1.4);
                const double sill[3] = {middle[0], middle[1], middle[2] - 0.75};
                strl__part_block(mesh, sill, 1.3, 0.3, 0.08);
            }
}

static void put_roof(strl__part_mesh *mesh, const double size[3])
{
    const double eaves = size[2], over = 0.5;
    const strl__outline gable = {.count = 3,
                                 .points = {{-size[1] / 2 - over, 0}, {size[1] / 2 + over, 0}, {0, size[1] * 0.4}},
                                 .caps = {{0, 1, 2}}};
    /* The outline's y goes up, its way along the ridge. */
    mesh->place = (strl__affine){.axis = {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}, .origin = {-size[0] / 2 - over, 0, eaves}};
    strl__part_prism(mesh, &gable, size[0] + 2 * over);
    mesh->place = strl__affine_identity();
}

void strl__landscape_house(uint64_t seed, int kind, strl__part_mesh *mesh)
{
    static const double sizes[STRL__HOUSE_KINDS][3] = {{9, 7, 5.6}, {12, 8, 8.4}, {16, 9, 5.6}};
    const double *size = sizes[kind];
    const double low[3] = {-size[0] / 2, -size[1] / 2, -1}, high[3] = {size[0] / 2, size[1] / 2, size[2]};
    const double chimney[3] = {size[0] * (0.1 + 0.2 * strl__landscape_random(seed + (uint64_t)kind)), 0.8,
                               size[2] + size[1] * 0.4};
    mesh->place = strl__affine_identity();
    strl__part_box(mesh, low, high);
    strl__part_block(mesh, chimney, 0.8, 0.8, 2);
    put_windows(mesh, size, 4 + kind, (int)(size[2] / 2.8));
    put_roof(mesh, size);
}
