/* Every state of every node and every cut is a mesh within its claim, and no cut has a crack. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "build/cuts.h"
#include "build/meshes.h"
#include "build/open_edges.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SMALLER 5u
#define RANDOM_CUTS 12u
#else
#define SMALLER 1u
#define RANDOM_CUTS 100u
#endif

/* ---- states of nodes ---- */
static bool same_place(const int64_t a[3], const int64_t b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static bool is_degenerate(int64_t (*triangle)[3])
{
    return same_place(triangle[0], triangle[1]) || same_place(triangle[1], triangle[2]) ||
           same_place(triangle[2], triangle[0]);
}

/* State s - 1 is state s with one point moved onto another: what has the point becomes its neighbour or a line. */
static void assert_one_collapse_apart(const built_model *model, uint32_t node, uint32_t s, int64_t (*fine)[3][3],
                                      int64_t (*coarse)[3][3])
{
    const strl_pm *mesh = &model->mesh[node];
    uint32_t first = mesh->vertex_end[s - 1], moved = 0;
    int64_t from[3], to[3];
    built_position(model, node, first, from);
    built_position(model, node, mesh->parent[first], to);
    for (uint32_t v = 0; v < first; v++)
        moved += !memcmp(mesh->position[v], mesh->position[first], sizeof *mesh->position);
    assert_int_equal(moved, 0); /* the point is new with this state */
    uint32_t fine_count = built_triangles(model, node, s, fine),
             coarse_count = built_triangles(model, node, s - 1, coarse);
    assert_true(coarse_count <= fine_count);
    for (uint32_t t = 0; t < fine_count; t++) {
        for (int c = 0; c < 3; c++)
            if (same_place(fine[t][c], from))
                memcpy(fine[t][c], to, sizeof to);
        if (t < coarse_count)
            assert_memory_equal(fine[t], coarse[t], sizeof fine[t]);
        else
            assert_true(is_degenerate(fine[t]));
    }
}

static void check_state(const built_model *model, const cut_input *in, uint32_t node, uint32_t s,
                        int64_t (*triangle)[3][3], uint64_t *random)
{
    const strl_pm *mesh = &model->mesh[node];
    uint32_t count = built_triangles(model, node, s, triangle);
    double claim = (double)mesh->geometric_error[s];
    for (uint32_t t = 0; t < count; t++)
        assert_false(is_degenerate(triangle[t]));
    for (int i = 0; i < 40 && count; i++) {
        double corner[3][3], p[3];
        uint32_t t = mesh_below(random, count);
        for (int k = 0; k < 9; k++)
            ((double *)corner)[k] = (double)((const int64_t *)triangle[t])[k];
        cut_random_point((const double(*)[3])corner, random, p);
        double distance = surface_distance(&in->surface, i & 1 ? p : corner[i / 2 % 3]);
        if (distance > claim)
            fail_msg("node %u of level %u, state %u of %u: the claim is %g, a point lies %g from the input", node,
                     model->node[node].level, s, mesh->step_count, claim, distance);
    }
}

static void a_hundred_states_of_fifty_nodes_are_meshes_within_their_claims(void **state)
{
    (void)state;
    built_model model;
    cut_input in;
    uint64_t random = 1;
    strl_error err = {0};
    built_scene("isosurface", "states.ply", 100000 / SMALLER, true);
    built_build_one(built_path("states.ply"), built_path("states.stroll"));
    built_open(&model, built_path("states.stroll"));
    cut_input_load(&model, &in);
    assert_true(model.tree.node_count > 50 / SMALLER);
    uint32_t nodes = model.tree.node_count < 50 ? model.tree.node_count : 50;
    for (uint32_t i = 0; i < nodes; i++) {
        uint32_t node = (uint32_t)((uint64_t)i * model.tree.node_count / nodes);
        const strl_pm *mesh = &model.mesh[node];
        if (strl_pm_check(mesh, &err) != STRL_OK)
            fail_msg("node %u: %s", node, err.message);
        assert_true(mesh->step_count >= 100);
        int64_t(*fine)[3][3] = malloc(mesh->triangle_count * sizeof *fine),
        (*coarse)[3][3] = malloc(mesh->triangle_count * sizeof *coarse);
        assert_non_null(fine);
        assert_non_null(coarse);
        for (uint32_t j = 0; j < 100; j++) {
            uint32_t s = (uint32_t)((uint64_t)j * (mesh->step_count + 1) / 100);
            check_state(&model, &in, node, s, fine, &random);
            if (s && j % 10 == 0)
                assert_one_collapse_apart(&model, node, s, fine, coarse);
        }
        check_state(&model, &in, node, mesh->step_count, fine, &random);
        free(fine);
        free(coarse);
    }
    cut_input_free(&in);
    built_close(&model);
}

/* ---- errors of the hierarchy ---- */
static void errors_and_boxes_grow_to_the_root(void **state)
{
    (void)state;
    built_model model;
    built_open(&model, built_path("states.stroll"));
    for (uint32_t i = 0; i < model.tree.node_count; i++) {
        const strl_node *node = &model.node[i];
        const strl_pm *mesh = &model.mesh[i];
        assert_true(node->geometric_min <= node->geometric_max && node->appearance_min <= node->appearance_max);
        assert_true(node->group_geometric >= node->geometric_min && node->group_appearance >= node->appearance_min);
        /* claims of states lie within the record's range */
        assert_true(mesh->geometric_error[0] <= node->geometric_max);
        for (uint32_t v = 0; v < mesh->vertex_count; v++) {
            int64_t cell[3];
            built_position(&model, i, v, cell);
            for (int k = 0; k < 3; k++)
                assert_true(cell[k] >= node->box_min[k] && cell[k] <= node->box_max[k]);
        }
        if (node->parent == STRL_NONE)
            continue;
        const strl_node *parent = &model.node[node->parent];
        assert_true(parent->geometric_min >= node->geometric_max && parent->appearance_min >= node->appearance_max);
        assert_true(parent->group_geometric >= node->group_geometric &&
                    parent->group_appearance >= node->group_appearance);
        for (int k = 0; k < 3; k++) {
            assert_true(parent->box_min[k] <= node->box_min[k] && parent->box_max[k] >= node->box_max[k]);
            assert_true(parent->group_box_min[k] <= node->group_box_min[k] &&
                        parent->group_box_max[k] >= node->group_box_max[k]);
        }
    }
    built_close(&model);
}

/* ---- random cuts ---- */
/* Groups by id, to split at random: a group splits only after the groups of all its members' parents. */
typedef struct groups {
    uint32_t count, *first, *member;
    bool *split;
} groups;

static void list_groups(const built_model *model, groups *list)
{
    uint32_t nodes = model->tree.node_count, count = model->tree.group_count;
    *list = (groups){.count = count};
    list->first = calloc(count + 2u, sizeof *list->first);
    list->member = malloc(nodes * sizeof *list->member);
    list->split = calloc(count, sizeof *list->split);
    assert_true(list->first && list->member && list->split);
    for (uint32_t i = 0; i < nodes; i++) {
        assert_true(model->node[i].group < count);
        list->first[model->node[i].group + 2]++;
    }
    for (uint32_t g = 0; g < count; g++)
        list->first[g + 2] += list->first[g + 1];
    for (uint32_t i = 0; i < nodes; i++)
        list->member[list->first[model->node[i].group + 1]++] = i;
    for (uint32_t i = 0; i < nodes; i++)
        assert_int_equal(model->node[i].group_size,
                         list->first[model->node[i].group + 1] - list->first[model->node[i].group]);
}

static void free_groups(groups *list)
{
    free(list->first);
    free(list->member);
    free(list->split);
}

static void split_group(const built_model *model, groups *list, uint32_t group)
{
    if (list->split[group])
        return;
    for (uint32_t i = list->first[group]; i < list->first[group + 1]; i++) {
        const strl_node *node = &model->node[list->member[i]];
        if (node->child_count == 0)
            return; /* leaves do not split */
        if (node->parent != STRL_NONE)
            split_group(model, list, model->node[node->parent].group);
    }
    list->split[group] = true;
}

static void random_cut(const built_model *model, groups *list, uint64_t *random, cut_mesh *cut)
{
    memset(list->split, 0, list->count * sizeof *list->split);
    uint32_t splits = mesh_below(random, 1 + list->count / 4);
    for (uint32_t i = 0; i < splits; i++)
        split_group(model, list, mesh_below(random, list->count));
    cut->count = cut->worst_rung = cut->dependent = 0;
    for (uint32_t i = 0; i < model->tree.node_count; i++) {
        const strl_node *node = &model->node[i];
        bool reached = node->parent == STRL_NONE || list->split[model->node[node->parent].group];
        if (reached && !list->split[node->group]) /* any state goes beside any other */
            cut_mesh_add(model, i, mesh_below(random, model->mesh[i].step_count + 1), cut);
    }
}

/* ---- cracks ---- */
static uint64_t hash_place(const int64_t p[3])
{
    return strl__mix64((uint64_t)p[0] + 0x9e37 + strl__mix64((uint64_t)p[1] + strl__mix64((uint64_t)p[2])));
}

/* 0 where every edge is used an even number of times. */
static uint64_t odd_edges_hash(size_t count, const int64_t (*triangle)[3][3])
{
    uint64_t sum = 0;
    for (size_t t = 0; t < count; t++) {
        uint64_t h[3];
        for (int c = 0; c < 3; c++)
            h[c] = hash_place(triangle[t][c]);
        for (int c = 0; c < 3; c++)
            sum ^= strl__mix64((h[c] + h[(c + 1) % 3]) ^ (h[c] ^ h[(c + 1) % 3]) * 3);
    }
    return sum;
}

static void assert_closed(const cut_mesh *cut, const char *what, uint32_t number)
{
    if (odd_edges_hash(cut->count, (const int64_t(*)[3][3])cut->triangle) == 0)
        return;
    size_t odd;
    free(list_open_edges(cut->count, (const int64_t(*)[3][3])cut->triangle, &odd));
    fail_msg("%s cut %u of %zu triangles has %zu open edges", what, number, cut->count, odd);
}

static void a_closed_mesh_has_no_crack_in_any_cut(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    built_model model;
    groups list;
    cut_mesh cut = {0};
    uint64_t random = 11;
    uint32_t dependent_cuts = 0, boundary_steps = 0;
    mesh_file_torus(&mesh, 500 / SMALLER, 200);
    mesh_file_write_ply(&mesh, built_path("closed.ply"));
    mesh_file_free(&mesh);
    built_build_one(built_path("closed.ply"), built_path("closed.stroll"));
    built_open(&model, built_path("closed.stroll"));
    list_groups(&model, &list);
    for (uint32_t i = 0; i < model.tree.node_count; i++)
        boundary_steps += model.node[i].boundary_steps;
    double coarsest = (double)model.node[0].geometric_max * model.tree.step;
    for (uint32_t i = 0; i < 8; i++) {
        cut_uniform(&model, coarsest * pow(0.25, i), &cut);
        assert_closed(&cut, "uniform", i);
    }
    cut_uniform(&model, 0, &cut);
    assert_int_equal(cut.count, model.tree.triangle_count);
    assert_closed(&cut, "finest", 0);
    for (uint32_t i = 0; i < RANDOM_CUTS; i++) {
        random_cut(&model, &list, &random, &cut);
        dependent_cuts += cut.dependent > 0;
        assert_closed(&cut, "random", i);
    }
    if (SMALLER == 1) { /* dependencies were there to be tested */
        assert_true(boundary_steps > 0);
        assert_true(dependent_cuts > RANDOM_CUTS / 4);
    }
    strl__free(cut.triangle);
    free_groups(&list);
    built_close(&model);
}

static void open_edges_end_at_boundary_points_of_the_input(void **state)
{
    (void)state;
    built_model model;
    cut_input in;
    groups list;
    cut_mesh cut = {0};
    uint64_t random = 5;
    uint32_t checked = 0;
    size_t rim_count;
    built_open(&model, built_path("states.stroll"));
    cut_input_load(&model, &in);
    list_groups(&model, &list);
    int64_t(*rim)[3] = list_rim_points(in.count, (const int64_t(*)[3][3])in.triangle, &rim_count);
    assert_true(rim_count > 0);
    for (uint32_t i = 0; i < RANDOM_CUTS / 2; i++) {
        random_cut(&model, &list, &random, &cut);
        if (cut.worst_rung >= STRL_RUNG_CLUSTERING)
            continue;
        checked++;
        assert_open_at_the_rim_only(cut.count, (const int64_t(*)[3][3])cut.triangle, (const int64_t(*)[3])rim,
                                    rim_count, i);
    }
    assert_true(checked > RANDOM_CUTS / 8);
    free(rim);
    strl__free(cut.triangle);
    free_groups(&list);
    cut_input_free(&in);
    built_close(&model);
}

static void uniform_cuts_are_within_their_length(void **state)
{
    (void)state;
    const char *const models[2] = {"states.stroll", "closed.stroll"};
    for (int m = 0; m < 2; m++) {
        built_model model;
        built_open(&model, built_path(models[m]));
        assert_uniform_cuts_hold(&model, models[m], 8, 30000 / SMALLER);
        built_close(&model);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_hundred_states_of_fifty_nodes_are_meshes_within_their_claims),
        cmocka_unit_test(errors_and_boxes_grow_to_the_root),
        cmocka_unit_test(a_closed_mesh_has_no_crack_in_any_cut),
        cmocka_unit_test(open_edges_end_at_boundary_points_of_the_input),
        cmocka_unit_test(uniform_cuts_are_within_their_length),
    };
    return cmocka_run_group_tests(tests, built_setup, built_teardown);
}
