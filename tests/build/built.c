#include "build/built.h"

#include <dirent.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "scenes/scene.h"

#define PI 3.14159265358979323846

static char folder[64];

/* ---- meshes ---- */
static void grow(void *items_pointer, size_t *capacity, size_t need, size_t item_size)
{
    assert_true(strl__grow(items_pointer, capacity, need, item_size));
}

uint32_t mesh_file_add_vertex(mesh_file *mesh, double x, double y, double z)
{
    grow(&mesh->position, &mesh->vertex_capacity, mesh->vertex_count + 1u, sizeof *mesh->position);
    double *p = mesh->position[mesh->vertex_count];
    p[0] = x, p[1] = y, p[2] = z;
    return mesh->vertex_count++;
}

void mesh_file_add_face(mesh_file *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    grow(&mesh->face, &mesh->face_capacity, mesh->face_count + 1u, sizeof *mesh->face);
    uint32_t *face = mesh->face[mesh->face_count++];
    face[0] = a, face[1] = b, face[2] = c;
}

void mesh_file_free(mesh_file *mesh)
{
    strl__free(mesh->position);
    strl__free(mesh->normal);
    strl__free(mesh->colour);
    strl__free(mesh->face);
    *mesh = (mesh_file){0};
}

void mesh_file_write_ply(const mesh_file *mesh, const char *path)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\nelement vertex %u\nproperty double x\nproperty double y\n"
            "property double z\n",
            mesh->vertex_count);
    if (mesh->normal)
        fprintf(file, "property float nx\nproperty float ny\nproperty float nz\n");
    if (mesh->colour)
        fprintf(file, "property uchar red\nproperty uchar green\nproperty uchar blue\n");
    fprintf(file, "element face %u\nproperty list uchar uint vertex_indices\nend_header\n", mesh->face_count);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        fwrite(mesh->position[v], sizeof(double), 3, file);
        if (mesh->normal)
            fwrite(mesh->normal[v], sizeof(float), 3, file);
        if (mesh->colour)
            fwrite(mesh->colour[v], 1, 3, file);
    }
    for (uint32_t f = 0; f < mesh->face_count; f++) {
        fputc(3, file);
        fwrite(mesh->face[f], sizeof(uint32_t), 3, file);
    }
    assert_false(ferror(file));
    assert_int_equal(fclose(file), 0);
}

void mesh_file_torus(mesh_file *mesh, uint32_t rings, uint32_t sectors)
{
    for (uint32_t r = 0; r < rings; r++)
        for (uint32_t s = 0; s < sectors; s++) {
            double a = 2 * PI * r / rings, b = 2 * PI * s / sectors;
            double tube = 0.4 + 0.02 * sin(9 * a) * cos(7 * b), out = 1 + tube * cos(b);
            mesh_file_add_vertex(mesh, out * cos(a), out * sin(a), tube * sin(b));
        }
    for (uint32_t r = 0; r < rings; r++)
        for (uint32_t s = 0; s < sectors; s++) {
            uint32_t a = r * sectors + s, b = (r + 1) % rings * sectors + s;
            uint32_t c = (r + 1) % rings * sectors + (s + 1) % sectors, d = r * sectors + (s + 1) % sectors;
            mesh_file_add_face(mesh, a, b, c);
            mesh_file_add_face(mesh, a, c, d);
        }
}

void mesh_file_sphere(mesh_file *mesh, uint32_t rings, uint32_t sectors)
{
    uint32_t south = mesh_file_add_vertex(mesh, 0, 0, -1), north = mesh_file_add_vertex(mesh, 0, 0, 1);
    for (uint32_t r = 1; r < rings; r++)
        for (uint32_t s = 0; s < sectors; s++) {
            double polar = PI * r / rings, round = 2 * PI * s / sectors;
            mesh_file_add_vertex(mesh, sin(polar) * cos(round), sin(polar) * sin(round), -cos(polar));
        }
    for (uint32_t s = 0; s < sectors; s++) {
        uint32_t next = (s + 1) % sectors, last = 2 + (rings - 2) * sectors;
        mesh_file_add_face(mesh, south, 2 + next, 2 + s);
        mesh_file_add_face(mesh, north, last + s, last + next);
        for (uint32_t r = 0; r + 2 < rings; r++) {
            uint32_t a = 2 + r * sectors + s, b = 2 + r * sectors + next;
            mesh_file_add_face(mesh, a, b, b + sectors);
            mesh_file_add_face(mesh, a, b + sectors, a + sectors);
        }
    }
}

void mesh_file_grid(mesh_file *mesh, uint32_t side, const double at[3], double size, double waves)
{
    uint32_t first = mesh->vertex_count;
    for (uint32_t y = 0; y <= side; y++)
        for (uint32_t x = 0; x <= side; x++) {
            double u = (double)x / side, v = (double)y / side;
            mesh_file_add_vertex(mesh, at[0] + size * u, at[1] + size * v,
                                 at[2] + size * waves * sin(40 * u) * cos(33 * v));
        }
    for (uint32_t y = 0; y < side; y++)
        for (uint32_t x = 0; x < side; x++) {
            uint32_t a = first + y * (side + 1) + x, c = a + side + 1;
            mesh_file_add_face(mesh, a, a + 1, c + 1);
            mesh_file_add_face(mesh, a, c + 1, c);
        }
}

void mesh_file_cube(mesh_file *mesh)
{
    static const uint8_t corner[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                          {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    uint32_t first = mesh->vertex_count;
    for (unsigned c = 0; c < 8; c++)
        mesh_file_add_vertex(mesh, c & 1, c >> 1 & 1, c >> 2);
    for (unsigned f = 0; f < 12; f++)
        mesh_file_add_face(mesh, first + corner[f][0], first + corner[f][1], first + corner[f][2]);
}

/* ---- the folder ---- */
int built_setup(void **state)
{
    (void)state;
    snprintf(folder, sizeof folder, "build-test-XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static unsigned for_each_file(bool remove_them)
{
    unsigned count = 0;
    DIR *listing = opendir(folder);
    assert_non_null(listing);
    for (struct dirent *entry; (entry = readdir(listing)) != NULL;) {
        if (!strcmp(entry->d_name, ".") || !strcmp(entry->d_name, ".."))
            continue;
        count++;
        if (remove_them)
            remove(built_path(entry->d_name));
    }
    closedir(listing);
    return count;
}

unsigned built_files_left(void)
{
    return for_each_file(false);
}

int built_teardown(void **state)
{
    (void)state;
    for_each_file(true);
    return rmdir(folder);
}

const char *built_path(const char *name)
{
    static char paths[4][512];
    static unsigned next;
    char *path = paths[next++ & 3];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

void built_write_text(const char *name, const char *text)
{
    FILE *file = fopen(built_path(name), "wb");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

uint8_t *built_read_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    fseek(file, 0, SEEK_END);
    *size = (size_t)ftell(file);
    rewind(file);
    uint8_t *bytes = malloc(*size + 1);
    assert_non_null(bytes);
    assert_int_equal(fread(bytes, 1, *size, file), *size);
    fclose(file);
    return bytes;
}

void built_scene(const char *scene, const char *name, uint64_t triangles, bool normals)
{
    strl_error err = {0};
    strl_scene_desc desc = {
        .name = scene, .path = built_path(name), .triangles = triangles, .seed = 1, .no_normals = !normals};
    if (strl_scene_write(&desc, NULL, NULL, &err) != STRL_OK)
        fail_msg("%s", err.message);
}

/* ---- building and looking ---- */
strl_build_result built_build(const char *const *inputs, uint32_t count, const char *output, unsigned jobs)
{
    strl_build_desc desc = {
        .inputs = inputs, .input_count = count, .output = output, .memory_bytes = 256u << 20, .jobs = jobs ? jobs : 2};
    strl_build_result result;
    strl_error err = {0};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK)
        fail_msg("%s: %s", inputs[0], err.message);
    return result;
}

strl_build_result built_build_one(const char *input, const char *output)
{
    return built_build(&input, 1, output, 0);
}

static void must(strl_status status, const strl_error *err)
{
    if (status != STRL_OK)
        fail_msg("%s", err->message);
}

void built_open(built_model *model, const char *path)
{
    strl_error err = {0};
    *model = (built_model){0};
    strl_arena_init(&model->arena, 0);
    must(strl_container_open_path(path, &model->container, &err), &err);
    model->info = *strl_container_get_info(model->container);
    assert_int_equal(model->info.tree_count, 1);
    model->tree = *strl_container_tree(model->container, 0);
    model->node = strl_arena_alloc(&model->arena, model->tree.node_count, sizeof *model->node);
    model->mesh = strl_arena_alloc(&model->arena, model->tree.node_count, sizeof *model->mesh);
    assert_non_null(model->node);
    assert_non_null(model->mesh);
    for (uint32_t i = 0; i < model->tree.node_count; i++) {
        must(strl_container_node(model->container, 0, i, &model->node[i], &err), &err);
        must(strl_container_mesh(model->container, 0, &model->node[i], &model->arena, &model->mesh[i], &err), &err);
    }
}

void built_close(built_model *model)
{
    strl_container_close(model->container);
    strl_arena_deinit(&model->arena);
}

void built_position(const built_model *model, uint32_t node, uint32_t vertex, int64_t out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = model->node[node].anchor[k] + model->mesh[node].position[vertex][k];
}

uint32_t built_resolve(const strl_pm *mesh, uint32_t vertex, uint32_t state)
{
    while (vertex >= mesh->vertex_end[state])
        vertex = mesh->parent[vertex];
    return vertex;
}

uint32_t built_triangles(const built_model *model, uint32_t node, uint32_t state, int64_t (*triangle)[3][3])
{
    const strl_pm *mesh = &model->mesh[node];
    for (uint32_t t = 0; t < mesh->triangle_end[state]; t++)
        for (int c = 0; c < 3; c++)
            built_position(model, node, built_resolve(mesh, mesh->triangle[t][c], state), triangle[t][c]);
    return mesh->triangle_end[state];
}

int64_t (*built_leaves(const built_model *model, uint64_t *count))[3][3]
{
    int64_t(*triangle)[3][3] = malloc((model->tree.triangle_count + 1) * sizeof *triangle);
    assert_non_null(triangle);
    *count = 0;
    for (uint32_t i = 0; i < model->tree.node_count; i++)
        if (model->node[i].child_count == 0) {
            assert_true(*count + model->mesh[i].triangle_count <= model->tree.triangle_count);
            *count += built_triangles(model, i, model->mesh[i].step_count, triangle + *count);
        }
    assert_int_equal(*count, model->tree.triangle_count);
    return triangle;
}
