/* Building little models in a folder of the test's own, and looking into the containers with the blocking reader. */
#ifndef STRL_TESTS_BUILD_BUILT_H
#define STRL_TESTS_BUILD_BUILT_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/build.h"
#include "container/container.h"

/* A mesh to be written as a file. Zero-initialise; arrays grow by mesh_file_add_... */
typedef struct mesh_file {
    double (*position)[3];
    float (*normal)[3];   /* NULL = without */
    uint8_t (*colour)[3]; /* NULL = without */
    uint32_t (*face)[3];
    uint32_t vertex_count, face_count;
    size_t vertex_capacity, face_capacity;
} mesh_file;

uint32_t mesh_file_add_vertex(mesh_file *mesh, double x, double y, double z);
void mesh_file_add_face(mesh_file *mesh, uint32_t a, uint32_t b, uint32_t c);
void mesh_file_free(mesh_file *mesh);
/* Binary PLY with doubles. */
void mesh_file_write_ply(const mesh_file *mesh, const char *path);

/* Shapes. A torus is closed; the grid lies in the plane z = 0, moved by `at` and scaled. */
void mesh_file_torus(mesh_file *mesh, uint32_t rings, uint32_t sectors);
void mesh_file_sphere(mesh_file *mesh, uint32_t rings, uint32_t sectors);
void mesh_file_grid(mesh_file *mesh, uint32_t side, const double at[3], double size, double waves);
void mesh_file_cube(mesh_file *mesh);

/* The test's folder, made by setup, emptied and removed by teardown (cmocka group fixtures). */
int built_setup(void **state);
int built_teardown(void **state);
/* Path of a name in the folder: static storage, four at a time. */
const char *built_path(const char *name);
void built_write_text(const char *name, const char *text);
uint8_t *built_read_file(const char *path, size_t *size); /* malloc */
/* Names in the folder, without . and .. */
unsigned built_files_left(void);

/* Scene into the folder. */
void built_scene(const char *scene, const char *name, uint64_t triangles, bool normals);

/* Builds; fails the test where that fails. memory 0 = 256 MiB, jobs 0 = 2. */
strl_build_result built_build(const char *const *inputs, uint32_t count, const char *output, unsigned jobs);
strl_build_result built_build_one(const char *input, const char *output);

/* A whole container in memory. */
typedef struct built_model {
    strl_container *container;
    strl_tree tree;
    strl_container_info info;
    strl_arena arena;
    strl_node *node; /* [tree.node_count] */
    strl_pm *mesh;   /* [tree.node_count] */
} built_model;

void built_open(built_model *model, const char *path);
void built_close(built_model *model);
/* Lattice position of a vertex. */
void built_position(const built_model *model, uint32_t node, uint32_t vertex, int64_t out[3]);
/* The vertex that stands for `vertex` in a state. */
uint32_t built_resolve(const strl_pm *mesh, uint32_t vertex, uint32_t state);
/* Triangles of a state as lattice positions; triangle: room for triangle_end[state]. Returns their count. */
uint32_t built_triangles(const built_model *model, uint32_t node, uint32_t state, int64_t (*triangle)[3][3]);
/* All leaves in their finest state: malloc. */
int64_t (*built_leaves(const built_model *model, uint64_t *count))[3][3];

#endif
