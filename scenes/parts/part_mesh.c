/* See part_mesh.h: arrays, boxes and prisms. */
#include "scenes/parts/part_mesh.h"

#include "base/memory.h"

void strl__part_mesh_clear(strl__part_mesh *mesh)
{
    mesh->vertex_count = 0;
    mesh->triangle_count = 0;
    mesh->place = strl__affine_identity();
}

void strl__part_mesh_deinit(strl__part_mesh *mesh)
{
    strl__free(mesh->vertices);
    strl__free(mesh->corners);
    *mesh = (strl__part_mesh){0};
}

uint32_t strl__part_mesh_vertex(strl__part_mesh *mesh, const double position[3], const double normal[3])
{
    double placed[2][3];
    size_t at = (size_t)mesh->vertex_count * STRL__PART_VERTEX_FLOATS, need = at + STRL__PART_VERTEX_FLOATS;
    if (mesh->failed ||
        (need > mesh->float_capacity && !strl__grow(&mesh->vertices, &mesh->float_capacity, need, sizeof(float)))) {
        mesh->failed = true;
        return 0;
    }
    strl__affine_point(&mesh->place, position, placed[0]);
    strl__affine_vector(&mesh->place, normal, placed[1]);
    for (int i = 0; i < STRL__PART_VERTEX_FLOATS; i++)
        mesh->vertices[at + (size_t)i] = (float)placed[i / 3][i % 3] + 0.0f; /* -0 and 0 are one place */
    return mesh->vertex_count++;
}

void strl__part_mesh_triangle(strl__part_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    size_t at = (size_t)mesh->triangle_count * 3;
    if (mesh->failed || (at + 3 > mesh->corner_capacity &&
                         !strl__grow(&mesh->corners, &mesh->corner_capacity, at + 3, sizeof(uint32_t)))) {
        mesh->failed = true;
        return;
    }
    mesh->corners[at] = a;
    mesh->corners[at + 1] = b;
    mesh->corners[at + 2] = c;
    mesh->triangle_count++;
}

void strl__part_mesh_quad(strl__part_mesh *mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    strl__part_mesh_triangle(mesh, a, b, c);
    strl__part_mesh_triangle(mesh, a, c, d);
}

void strl__part_box(strl__part_mesh *mesh, const double low[3], const double high[3])
{
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            int u = (axis + 1 + !side) % 3, v = (axis + 1 + side) % 3; /* u x v points out of the box */
            double normal[3] = {0}, at[3];
            uint32_t corner[4];
            normal[axis] = side ? 1 : -1;
            at[axis] = side ? high[axis] : low[axis];
            for (int i = 0; i < 4; i++) {
                at[u] = i == 1 || i == 2 ? high[u] : low[u];
                at[v] = i >= 2 ? high[v] : low[v];
                corner[i] = strl__part_mesh_vertex(mesh, at, normal);
            }
            strl__part_mesh_quad(mesh, corner[0], corner[1], corner[2], corner[3]);
        }
}

void strl__part_block(strl__part_mesh *mesh, const double middle[3], double x, double y, double z)
{
    const double low[3] = {middle[0] - x / 2, middle[1] - y / 2, middle[2] - z / 2};
    const double high[3] = {middle[0] + x / 2, middle[1] + y / 2, middle[2] + z / 2};
    strl__part_box(mesh, low, high);
}

/* ---- outlines ---- */

strl__outline strl__outline_i(double width, double depth, double flange, double web)
{
    double b = width / 2, h = depth / 2, w = web / 2, t = flange;
    return (strl__outline){12,
                           {{-b, -h},
                            {b, -h},
                            {b, -h + t},
                            {w, -h + t},
                            {w, h - t},
                            {b, h - t},
                            {b, h},
                            {-b, h},
                            {-b, h - t},
                            {-w, h - t},
                            {-w, -h + t},
                            {-b, -h + t}},
                           {{0, 1, 2},
                            {0, 2, 3},
                            {0, 3, 10},
                            {0, 10, 11},
                            {10, 3, 4},
                            {10, 4, 9},
                            {6, 7, 8},
                            {6, 8, 9},
                            {6, 9, 4},
                            {6, 4, 5}}};
}

strl__outline strl__outline_channel(double width, double depth, double thick)
{
    double b = width / 2, t = thick;
    return (strl__outline){
        8,
        {{-b, 0}, {b, 0}, {b, depth}, {b - t, depth}, {b - t, t}, {-b + t, t}, {-b + t, depth}, {-b, depth}},
        {{1, 2, 3}, {1, 3, 4}, {0, 1, 4}, {0, 4, 5}, {0, 5, 6}, {0, 6, 7}}};
}

strl__outline strl__outline_angle(double side, double thick)
{
    double s = side, t = thick;
    return (strl__outline){
        6, {{0, 0}, {s, 0}, {s, t}, {t, t}, {t, s}, {0, s}}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}};
}

strl__outline strl__outline_round(int count, double radius)
{
    strl__outline made = {.count = count};
    for (int i = 0; i < count; i++) {
        double c, s;
        strl__circle_step(i, count, &c, &s);
        made.points[i][0] = radius * c;
        made.points[i][1] = radius * s;
    }
    for (int i = 0; i + 2 < count; i++) {
        made.caps[i][1] = (uint8_t)(i + 1);
        made.caps[i][2] = (uint8_t)(i + 2);
    }
    return made;
}

static void put_cap(strl__part_mesh *mesh, const strl__outline *outline, double z, bool top)
{
    const double normal[3] = {0, 0, top ? 1 : -1};
    uint32_t first = mesh->vertex_count;
    for (int i = 0; i < outline->count; i++) {
        const double at[3] = {outline->points[i][0], outline->points[i][1], z};
        strl__part_mesh_vertex(mesh, at, normal);
    }
    for (int i = 0; i + 2 < outline->count; i++) {
        const uint8_t *cap = outline->caps[i];
        strl__part_mesh_triangle(mesh, first + cap[0], first + cap[top ? 1 : 2], first + cap[top ? 2 : 1]);
    }
}

void strl__part_prism(strl__part_mesh *mesh, const strl__outline *outline, double length)
{
    for (int i = 0; i < outline->count; i++) {
        const double *a = outline->points[i], *b = outline->points[(i + 1) % outline->count];
        double normal[3] = {b[1] - a[1], a[0] - b[0], 0};
        strl__normalise(normal);
        const double corners[4][3] = {{a[0], a[1], 0}, {b[0], b[1], 0}, {b[0], b[1], length}, {a[0], a[1], length}};
        uint32_t at[4];
        for (int k = 0; k < 4; k++)
            at[k] = strl__part_mesh_vertex(mesh, corners[k], normal);
        strl__part_mesh_quad(mesh, at[0], at[1], at[2], at[3]);
    }
    put_cap(mesh, outline, 0, false);
    put_cap(mesh, outline, length, true);
}

void strl__part_vertex_in_world(const strl__part_mesh *mesh, uint32_t vertex, const strl__affine *world,
                                double position[3], double normal[3])
{
    const float *from = mesh->vertices + (size_t)vertex * STRL__PART_VERTEX_FLOATS;
    for (int k = 0; k < 3; k++)
        position[k] = (double)from[k], normal[k] = (double)from[3 + k];
    strl__affine_point(world, position, position);
    strl__affine_vector(world, normal, normal);
    strl__normalise(normal);
}
