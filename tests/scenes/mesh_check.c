/* See mesh_check.h. */
#include "mesh_check.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static void *take(size_t count, size_t size)
{
    void *block = calloc(count ? count : 1, size);
    assert_non_null(block);
    return block;
}

static void read_file(mesh_check *mesh, const char *path)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    long size = ftell(file);
    assert_true(size > 0);
    rewind(file);
    mesh->size = (size_t)size;
    mesh->bytes = take(mesh->size, 1);
    assert_int_equal(fread(mesh->bytes, 1, mesh->size, file), mesh->size);
    fclose(file);
}

void mesh_check_load(mesh_check *mesh, const char *path)
{
    *mesh = (mesh_check){0};
    read_file(mesh, path);
    char header[1024] = {0};
    memcpy(header, mesh->bytes, mesh->size < sizeof header - 1 ? mesh->size : sizeof header - 1);
    char *end = strstr(header, "end_header\n");
    assert_non_null(end);
    assert_memory_equal(header, "ply\nformat binary_little_endian 1.0\n", 36);
    assert_int_equal(sscanf(strstr(header, "element vertex"), "element vertex %u", &mesh->vertex_count), 1);
    assert_int_equal(sscanf(strstr(header, "element face"), "element face %u", &mesh->triangle_count), 1);
    mesh->record_bytes = strstr(header, "float nx") ? 24 : strstr(header, "uchar red") ? 15 : 12;
    size_t header_bytes = (size_t)(end - header) + strlen("end_header\n");
    size_t vertex_bytes = mesh->vertex_count * mesh->record_bytes;
    assert_int_equal(mesh->size, header_bytes + vertex_bytes + (size_t)mesh->triangle_count * 13);
    mesh->records = mesh->bytes + header_bytes;
    mesh->corners = take(mesh->triangle_count, 3 * sizeof *mesh->corners);
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        const uint8_t *face = mesh->records + vertex_bytes + 13 * i;
        assert_int_equal(face[0], 3);
        memcpy(mesh->corners + 3 * i, face + 1, 12);
        for (int k = 0; k < 3; k++)
            assert_true(mesh->corners[3 * i + k] < mesh->vertex_count);
    }
}

void mesh_check_free(mesh_check *mesh)
{
    free(mesh->bytes);
    free(mesh->corners);
}

void mesh_check_position(const mesh_check *mesh, uint32_t vertex, float position[3])
{
    memcpy(position, mesh->records + vertex * mesh->record_bytes, 12);
}

void mesh_check_normal(const mesh_check *mesh, uint32_t vertex, float normal[3])
{
    assert_int_equal(mesh->record_bytes, 24);
    memcpy(normal, mesh->records + (size_t)vertex * 24 + 12, 12);
}

void mesh_check_face(const mesh_check *mesh, uint32_t triangle, double normal[3])
{
    float p[3][3];
    double u[3];
    double v[3];
    for (int k = 0; k < 3; k++)
        mesh_check_position(mesh, mesh->corners[3 * (size_t)triangle + k], p[k]);
    for (int k = 0; k < 3; k++) {
        u[k] = (double)p[1][k] - p[0][k];
        v[k] = (double)p[2][k] - p[0][k];
    }
    for (int k = 0; k < 3; k++)
        normal[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
}

static uint32_t find_root(uint32_t *parent, uint32_t item)
{
    while (parent[item] != item)
        item = parent[item] = parent[parent[item]];
    return item;
}

static uint32_t *fresh_sets(uint32_t count)
{
    uint32_t *parent = take(count, sizeof *parent);
    for (uint32_t i = 0; i < count; i++)
        parent[i] = i;
    return parent;
}

static int compare_keys(const void *a, const void *b)
{
    uint64_t left = *(const uint64_t *)a;
    uint64_t right = *(const uint64_t *)b;
    return (left > right) - (left < right);
}

static bool on_one_wall(const mesh_check *mesh, uint32_t a, uint32_t b, const float walls[2][2])
{
    float p[3];
    float q[3];
    mesh_check_position(mesh, a, p);
    mesh_check_position(mesh, b, q);
    for (int axis = 0; axis < 2; axis++)
        for (int side = 0; side < 2; side++)
            if (p[axis] == walls[side][axis] && q[axis] == walls[side][axis])
                return true;
    return false;
}

static void find_walls(const mesh_check *mesh, float walls[2][2])
{
    for (uint32_t vertex = 0; vertex < mesh->vertex_count; vertex++) {
        float p[3];
        mesh_check_position(mesh, vertex, p);
        for (int axis = 0; axis < 2; axis++) {
            walls[0][axis] = vertex == 0 || p[axis] < walls[0][axis] ? p[axis] : walls[0][axis];
            walls[1][axis] = vertex == 0 || p[axis] > walls[1][axis] ? p[axis] : walls[1][axis];
        }
    }
}

/* Undirected edges, sorted; the direction is the lowest bit: from the smaller index to the larger one, or back. */
static uint64_t *sorted_edges(const mesh_check *mesh)
{
    size_t count = 3 * (size_t)mesh->triangle_count;
    uint64_t *keys = take(count, sizeof *keys);
    for (size_t i = 0; i < count; i++) {
        uint64_t a = mesh->corners[i];
        uint64_t b = mesh->corners[i % 3 == 2 ? i - 2 : i + 1];
        keys[i] = a < b ? a << 33 | b << 1 : b << 33 | a << 1 | 1;
    }
    qsort(keys, count, sizeof *keys, compare_keys);
    return keys;
}

/* Joins the corners at each vertex across the edges that two triangles share: what stays apart is another fan. */
static uint64_t count_fans_apart(const mesh_check *mesh)
{
    size_t corner_count = 3 * (size_t)mesh->triangle_count;
    uint32_t *sets = fresh_sets((uint32_t)corner_count);
    uint64_t *by_edge = take(corner_count, 2 * sizeof *by_edge);
    for (size_t i = 0; i < corner_count; i++) {
        uint64_t a = mesh->corners[i];
        uint64_t b = mesh->corners[i % 3 == 2 ? i - 2 : i + 1];
        by_edge[2 * i] = a < b ? a << 32 | b : b << 32 | a;
        by_edge[2 * i + 1] = i;
    }
    qsort(by_edge, corner_count, 2 * sizeof *by_edge, compare_keys);
    for (size_t i = 0; i + 1 < corner_count; i++) {
        if (by_edge[2 * i] != by_edge[2 * i + 2])
            continue;
        size_t one = (size_t)by_edge[2 * i + 1];
        size_t two = (size_t)by_edge[2 * i + 3];
        size_t one_end = one % 3 == 2 ? one - 2 : one + 1;
        size_t two_end = two % 3 == 2 ? two - 2 : two + 1;
        sets[find_root(sets, (uint32_t)one)] = find_root(sets, (uint32_t)two_end);
        sets[find_root(sets, (uint32_t)one_end)] = find_root(sets, (uint32_t)two);
    }
    uint64_t fans = 0;
    for (size_t i = 0; i < corner_count; i++)
        fans += sets[i] == i;
    uint8_t *used = take(mesh->vertex_count, 1);
    uint64_t used_count = 0;
    for (size_t i = 0; i < corner_count; i++) {
        used_count += !used[mesh->corners[i]];
        used[mesh->corners[i]] = 1;
    }
    free(used);
    free(by_edge);
    free(sets);
    return fans - used_count;
}

void mesh_check_topology(const mesh_check *mesh, mesh_topology *topology)
{
    *topology = (mesh_topology){0};
    float walls[2][2] = {{0}};
    find_walls(mesh, walls);
    size_t count = 3 * (size_t)mesh->triangle_count;
    uint64_t *keys = sorted_edges(mesh);
    uint32_t *parts = fresh_sets(mesh->vertex_count);
    uint32_t *rims = fresh_sets(mesh->vertex_count);
    uint8_t *marks = take(mesh->vertex_count, 1); /* 1 used, 2 on the rim */
    for (size_t i = 0; i < count;) {
        size_t next = i;
        while (next < count && keys[next] >> 1 == keys[i] >> 1)
            next++;
        uint32_t a = (uint32_t)(keys[i] >> 33);
        uint32_t b = (uint32_t)(keys[i] >> 1);
        topology->edges++;
        parts[find_root(parts, a)] = find_root(parts, b);
        marks[a] |= 1;
        marks[b] |= 1;
        if (next - i == 1) {
            topology->open_edges++;
            topology->open_inside += !on_one_wall(mesh, a, b, walls);
            rims[find_root(rims, a)] = find_root(rims, b);
            marks[a] |= 2;
            marks[b] |= 2;
        } else if (next - i > 2 || keys[i] == keys[i + 1]) {
            topology->crowded_edges++;
        }
        i = next;
    }
    for (uint32_t vertex = 0; vertex < mesh->vertex_count; vertex++) {
        topology->unused_vertices += !marks[vertex];
        topology->components += marks[vertex] && parts[vertex] == vertex;
        topology->rims += (marks[vertex] & 2) && rims[vertex] == vertex;
    }
    topology->fans_apart = count_fans_apart(mesh);
    int64_t euler = (int64_t)(mesh->vertex_count - topology->unused_vertices) - (int64_t)topology->edges +
                    (int64_t)mesh->triangle_count;
    topology->genus = (2 * (int64_t)topology->components - (int64_t)topology->rims - euler) / 2;
    free(marks);
    free(rims);
    free(parts);
    free(keys);
}

static int compare_positions(const void *a, const void *b)
{
    return memcmp(a, b, 12);
}

uint64_t mesh_check_duplicate_positions(const mesh_check *mesh)
{
    uint8_t *positions = take(mesh->vertex_count, 12);
    for (uint32_t vertex = 0; vertex < mesh->vertex_count; vertex++) {
        float p[3];
        mesh_check_position(mesh, vertex, p);
        for (int k = 0; k < 3; k++)
            p[k] += 0.0f; /* -0 and 0 are one place */
        memcpy(positions + 12 * (size_t)vertex, p, 12);
    }
    qsort(positions, mesh->vertex_count, 12, compare_positions);
    uint64_t duplicates = 0;
    for (size_t i = 1; i < mesh->vertex_count; i++)
        duplicates += compare_positions(positions + 12 * (i - 1), positions + 12 * i) == 0;
    free(positions);
    return duplicates;
}
