#include "build/sample_tree.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "verify/verify.h"

#define MOST_TRIANGLES 8192u /* of a brick */

strl_build_result sample_tree_build(const char *input, const char *output, strl_build_desc desc)
{
    const char *inputs[1] = {built_path(input)};
    strl_build_result result;
    strl_error err = {0};
    desc.inputs = inputs;
    desc.input_count = 1;
    desc.output = built_path(output);
    desc.jobs = desc.jobs ? desc.jobs : 2;
    desc.memory_bytes = desc.memory_bytes ? desc.memory_bytes : 256u << 20;
    if (strl_build_samples(&desc, &result, &err) != STRL_OK)
        fail_msg("%s: %s", input, err.message);
    return result;
}

/* ---- structure */

static void check_record(const built_model *model, uint32_t id)
{
    const strl_node *node = &model->node[id];
    assert_int_equal(node->rung, STRL_RUNG_SAMPLED);
    assert_int_equal(node->step_count, 0);
    assert_int_equal(node->group_size, 1);
    assert_int_equal(node->decode_parent, STRL_NONE);
    assert_int_equal(node->base_triangle_count, node->triangle_count);
    assert_int_equal(node->base_vertex_count, node->vertex_count);
    assert_true(node->triangle_count <= MOST_TRIANGLES);
    assert_true(node->geometric_min == node->geometric_max && node->geometric_min == node->group_geometric);
    if (id == 0) {
        assert_int_equal(node->parent, STRL_NONE);
        return;
    }
    const strl_node *above = &model->node[node->parent];
    assert_true(node->geometric_max <= above->geometric_max);
    assert_true(above->level > node->level);
    for (int k = 0; k < 3; k++)
        assert_true(node->box_min[k] >= above->box_min[k] && node->box_max[k] <= above->box_max[k]);
}

static void check_levels(const test_brick *brick, const strl_node *node)
{
    assert_int_equal(brick->version, 3);
    assert_true(brick->level_count >= 1 && brick->level_count <= 22);
    for (uint32_t i = 0; i < brick->level_count; i++) {
        assert_true(isfinite(brick->level[i].size) && brick->level[i].size >= 0);
        assert_true(brick->level[i].size <= (i ? brick->level[i - 1].size : node->geometric_max));
        assert_true(brick->level[i].end <= 4096 && (i == 0 || brick->level[i].end >= brick->level[i - 1].end));
    }
}

static void check_splats(const test_brick *brick, const strl_node *node)
{
    for (uint32_t i = 0; i < brick->splat_count; i++) {
        assert_true(brick->splat[i].side <= 36);
        for (int k = 0; k < 3; k++) {
            int64_t at = node->anchor[k] + brick->splat[i].centre[k];
            if (at < node->box_min[k] || at > node->box_max[k])
                fail_msg("splat %u lies outside its node's box", i);
        }
    }
}

static void check_brick(const built_model *model, const uint8_t *file, size_t size, uint32_t id)
{
    const strl_node *node = &model->node[id];
    test_brick brick;
    uint64_t at = node->page.offset + node->payload_offset, sum = 0;
    assert_true(at + node->payload_bytes <= size);
    test_brick_read(&brick, file + at, node->payload_bytes);
    check_levels(&brick, node);
    check_splats(&brick, node);
    for (uint32_t i = 0; i < brick.run_count; i++) {
        assert_true(brick.run[i].level <= brick.level_count && brick.run[i].count >= 1);
        assert_true(i == 0 || brick.run[i].level != brick.run[i - 1].level);
        sum += brick.run[i].count;
    }
    assert_int_equal(sum, node->triangle_count);
    test_brick_free(&brick);
}

void sample_tree_check(const char *name)
{
    built_model model;
    size_t size;
    uint64_t triangles = 0, vertices = 0;
    uint8_t *file = built_read_file(built_path(name), &size);
    built_open(&model, built_path(name));
    assert_int_equal(model.tree.structure, STRL_STRUCTURE_SAMPLES);
    for (uint32_t i = 0; i < model.tree.node_count; i++) {
        check_record(&model, i);
        check_brick(&model, file, size, i);
        triangles += model.mesh[i].triangle_count;
        vertices += model.mesh[i].vertex_count;
    }
    assert_int_equal(triangles, model.tree.triangle_count);
    assert_int_equal(vertices, model.tree.vertex_count);
    assert_int_equal(model.tree.root_triangles, model.node[0].triangle_count);
    assert_true(model.tree.root_triangles <= STRL_ROOT_MAX_TRIANGLES);
    built_close(&model);
    free(file);
}

/* ---- the multiset */

static int compare(const void *a, const void *b)
{
    const int64_t *x = a, *y = b;
    for (int i = 0; i < 12; i++)
        if (x[i] != y[i])
            return x[i] < y[i] ? -1 : 1;
    return 0;
}

void sample_tree_sort(sample_tree_triangle *triangle, uint64_t count)
{
    for (uint64_t t = 0; t < count; t++) {
        sample_tree_triangle best, turned;
        memcpy(best, triangle[t], sizeof best);
        for (unsigned first = 1; first < 3; first++) {
            for (unsigned c = 0; c < 3; c++)
                memcpy(turned[c], triangle[t][(first + c) % 3], sizeof turned[c]);
            if (compare(turned, best) < 0)
                memcpy(best, turned, sizeof best);
        }
        memcpy(triangle[t], best, sizeof best);
    }
    qsort(triangle, count, sizeof *triangle, compare);
}

sample_tree_triangle *sample_tree_triangles(const char *name, uint64_t *count)
{
    built_model model;
    built_open(&model, built_path(name));
    sample_tree_triangle *triangle = malloc((model.tree.triangle_count + 1) * sizeof *triangle);
    assert_non_null(triangle);
    *count = 0;
    for (uint32_t i = 0; i < model.tree.node_count; i++) {
        const strl_pm *mesh = &model.mesh[i];
        assert_true(*count + mesh->triangle_count <= model.tree.triangle_count);
        for (uint32_t t = 0; t < mesh->triangle_count; t++, ++*count)
            for (int c = 0; c < 3; c++) {
                uint32_t vertex = mesh->triangle[t][c];
                built_position(&model, i, vertex, triangle[*count][c]);
                triangle[*count][c][3] = mesh->colour ? mesh->colour[vertex] : UINT32_MAX;
            }
    }
    built_close(&model);
    sample_tree_sort(triangle, *count);
    return triangle;
}

static sample_tree_triangle *expected_triangles(const mesh_file *mesh, const strl_tree *tree, uint64_t *count)
{
    sample_tree_triangle *triangle = malloc((mesh->face_count + 1u) * sizeof *triangle);
    assert_non_null(triangle);
    *count = 0;
    for (uint32_t f = 0; f < mesh->face_count; f++) {
        int64_t(*to)[4] = triangle[*count];
        bool kept = true;
        for (int c = 0; c < 3; c++) {
            uint32_t vertex = mesh->face[f][c];
            for (int k = 0; k < 3; k++)
                to[c][k] = (int64_t)nearbyint((mesh->position[vertex][k] - tree->origin[k]) / tree->step);
            const uint8_t *rgb = mesh->colour ? mesh->colour[vertex] : (const uint8_t[3]){255, 255, 255};
            to[c][3] = 0xff000000u | (uint32_t)rgb[2] << 16 | (uint32_t)rgb[1] << 8 | rgb[0];
        }
        for (int c = 0; c < 3; c++)
            kept &= memcmp(to[c], to[(c + 1) % 3], 3 * sizeof **to) != 0;
        *count += kept;
    }
    sample_tree_sort(triangle, *count);
    return triangle;
}

void sample_tree_compare(const char *name, const mesh_file *mesh)
{
    strl_container *container;
    strl_error err = {0};
    uint64_t expected, found;
    if (strl_container_open_path(built_path(name), &container, &err) != STRL_OK)
        fail_msg("%s", err.message);
    sample_tree_triangle *in = expected_triangles(mesh, strl_container_tree(container, 0), &expected);
    strl_container_close(container);
    sample_tree_triangle *out = sample_tree_triangles(name, &found);
    assert_int_equal(found, expected);
    for (uint64_t t = 0; t < found; t++)
        if (compare(in[t], out[t]) != 0)
            fail_msg("triangle %llu of the tree, in order, is not that of the input", (unsigned long long)t);
    free(in);
    free(out);
}

bool sample_trees_equal(const char *a, const char *b)
{
    uint64_t count, other_count;
    sample_tree_triangle *one = sample_tree_triangles(a, &count), *other = sample_tree_triangles(b, &other_count);
    bool equal = count == other_count && memcmp(one, other, count * sizeof *one) == 0;
    free(one);
    free(other);
    return equal;
}

void sample_tree_verify(const char *name, const char *input)
{
    strl_error err = {0};
    strl_verify_report report;
    const char *inputs[] = {built_path(input)};
    const strl_verify_desc desc = {.model = built_path(name),
                                   .inputs = inputs,
                                   .input_count = 1,
                                   .scratch_dir = built_path(""),
                                   .memory_bytes = 256u << 20,
                                   .jobs = 2,
                                   .cuts = 20};
    if (strl_verify_run(&desc, &report, &err) != STRL_OK)
        fail_msg("%s", err.message);
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        if (report.checks[kind].failures)
            fail_msg("%s: %s", strl_verify_name((strl_verify_kind)kind), report.checks[kind].first);
    assert_true(report.ok);
    assert_true(report.checks[STRL_VERIFY_PAYLOADS].count > 0 &&
                (report.triangles_leaf == 0 || report.checks[STRL_VERIFY_LEAVES].done));
    strl_verify_report_deinit(&report);
}

strl_build_result sample_tree_prove(const mesh_file *mesh)
{
    mesh_file_write_ply(mesh, built_path("proved.ply"));
    strl_build_result result = sample_tree_build("proved.ply", "proved.stroll", (strl_build_desc){0});
    assert_int_equal(result.triangles_in, mesh->face_count);
    assert_int_equal(result.triangles_in, result.triangles_leaf + result.dropped_degenerate);
    assert_true(result.root_triangles <= STRL_ROOT_MAX_TRIANGLES);
    sample_tree_check("proved.stroll");
    sample_tree_compare("proved.stroll", mesh);
    sample_tree_verify("proved.stroll", "proved.ply");
    return result;
}
