/* Models for the checker's tests: a bumpy torus (closed) or sheet (open) as PLY, built into a container, and
 * copies of such a container with a fault planted. A copy is written anew by the container's writer, so all
 * checksums are right. */
#ifndef STRL_TESTS_VERIFY_PLANTED_H
#define STRL_TESTS_VERIFY_PLANTED_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "stroll/build.h"
#include "container/container.h"
#include "container/writer.h"
#include "geometry/payload.h"
#include "platform/file.h"
#include "verify/verify.h"

typedef struct model {
    char folder[64];
    char input[96], good[96], bad[96];
    uint32_t copies; /* in the planted one, each turned, mirrored or sheared; 0 = it is placed once, as it is */
} model;

/* A grid of rows x columns; closed: wrapped both ways round a torus. */
static inline void model_write_ply(const char *path, unsigned rows, unsigned columns, bool closed)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    unsigned cells = closed ? rows * columns : (rows - 1) * (columns - 1);
    fprintf(file,
            "ply\nformat ascii 1.0\nelement vertex %u\nproperty double x\nproperty double y\nproperty double z\n"
            "element face %u\nproperty list uchar int vertex_indices\nend_header\n",
            rows * columns, 2 * cells);
    for (unsigned i = 0; i < rows; i++)
        for (unsigned j = 0; j < columns; j++) {
            double u = 6.283185307179586 * i / rows, v = 6.283185307179586 * j / columns;
            double bump = 0.04 * sin(9 * u) * cos(7 * v) + 0.01 * sin(31 * u + 5 * v), r = 1 + bump;
            if (closed)
                fprintf(file, "%.9g %.9g %.9g\n", (3 + r * cos(v)) * cos(u), (3 + r * cos(v)) * sin(u), r * sin(v));
            else
                fprintf(file, "%.9g %.9g %.9g\n", 10. * i / rows, 10. * j / columns, 5 * bump);
        }
    for (unsigned i = 0; i + !closed < rows; i++)
        for (unsigned j = 0; j + !closed < columns; j++) {
            unsigned k = (i + 1) % rows, l = (j + 1) % columns;
            fprintf(file, "3 %u %u %u\n3 %u %u %u\n", i * columns + j, k * columns + j, k * columns + l,
                    i * columns + j, k * columns + l, i * columns + l);
        }
    assert_int_equal(fclose(file), 0);
}

static inline void model_setup(model *self, unsigned rows, unsigned columns, bool closed)
{
    strcpy(self->folder, "/tmp/strl-verify-XXXXXX");
    self->copies = 0;
    assert_non_null(mkdtemp(self->folder));
    snprintf(self->input, sizeof self->input, "%s/input.ply", self->folder);
    snprintf(self->good, sizeof self->good, "%s/good.stroll", self->folder);
    snprintf(self->bad, sizeof self->bad, "%s/bad.stroll", self->folder);
    model_write_ply(self->input, rows, columns, closed);
    const char *inputs[] = {self->input};
    const strl_build_desc desc = {.inputs = inputs, .input_count = 1, .output = self->good, .jobs = 1};
    strl_build_result result;
    strl_error err = {0};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
}

static inline void model_teardown(model *self)
{
    assert_int_equal(strl_path_remove_directory(self->folder, NULL), STRL_OK);
}

/* What a planted fault sees of each node; it may change record and mesh. */
typedef void (*model_fault)(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena);

static inline void model__check(strl_status status, const strl_error *err)
{
    if (status != STRL_OK)
        fail_msg("%s", err->message);
}

static inline void model__copy_node(strl_container *from, strl_container_writer *to, uint32_t id, model_fault fault,
                                    void *context)
{
    strl_error err = {0};
    strl_arena arena;
    strl_node record;
    strl_pm mesh;
    strl_writer payload = {0};
    strl_arena_init(&arena, 0);
    model__check(strl_container_node(from, 0, id, &record, &err), &err);
    model__check(strl_container_mesh(from, 0, &record, &arena, &mesh, &err), &err);
    fault(context, id, &record, &mesh, &arena);
    record.decode_parent = STRL_NONE;
    record.vertex_count = mesh.vertex_count;
    record.triangle_count = mesh.triangle_count;
    record.step_count = mesh.step_count;
    record.base_vertex_count = mesh.vertex_end[0];
    record.base_triangle_count = mesh.triangle_end[0];
    record.shared_vertices = record.shared_vertices < mesh.vertex_end[0] ? record.shared_vertices : mesh.vertex_end[0];
    model__check(strl_payload_encode(&mesh, NULL, &arena, &payload, NULL, &err), &err);
    model__check(strl_container_writer_add_node(to, &record, payload.data, (uint32_t)payload.size, &err), &err);
    strl__free(payload.data);
    strl_arena_deinit(&arena);
}

static inline void model__place(const model *self, strl_container_writer *to)
{
    strl_error err = {0};
    for (uint32_t i = 0; i < self->copies; i++) {
        double turn = 0.1 * i, c = cos(turn), s = sin(turn), flip = i % 3 ? 1 : -2;
        const strl_placement copy = {
            .transform = {c, -s, 0.01 * i, 20. * (i % 32), s, c, 0, 20. * (i / 32), 0, i % 5 * 0.3, flip, 0}};
        model__check(strl_container_writer_add_placement(to, &copy, &err), &err);
    }
}

/* Writes self->bad. */
static inline void model_plant(const model *self, model_fault fault, void *context)
{
    strl_error err = {0};
    strl_container *from;
    strl_container_writer *to;
    uint64_t bytes;
    model__check(strl_container_open_path(self->good, &from, &err), &err);
    const strl_container_writer_desc desc = {
        .path = self->bad, .scratch_dir = self->folder, .info = *strl_container_get_info(from)};
    model__check(strl_container_writer_create(&desc, &to, &err), &err);
    const strl_tree *tree = strl_container_tree(from, 0);
    model__check(strl_container_writer_begin_tree(to, tree, &err), &err);
    for (uint32_t id = 0; id < tree->node_count; id++)
        model__copy_node(from, to, id, fault, context);
    model__check(strl_container_writer_end_tree(to, &err), &err);
    model__place(self, to);
    model__check(strl_container_writer_finish(to, &bytes, &err), &err);
    strl_container_writer_destroy(to);
    strl_container_close(from);
}

/* The first node of a level, and how many nodes there are. */
static inline uint32_t model_node_of_level(const model *self, uint32_t level)
{
    strl_container *container;
    strl_error err = {0};
    strl_node record;
    uint32_t found = UINT32_MAX;
    model__check(strl_container_open_path(self->good, &container, &err), &err);
    for (uint32_t id = 0; found == UINT32_MAX && id < strl_container_tree(container, 0)->node_count; id++) {
        model__check(strl_container_node(container, 0, id, &record, &err), &err);
        found = record.level == level ? id : found;
    }
    strl_container_close(container);
    return found;
}

#endif
