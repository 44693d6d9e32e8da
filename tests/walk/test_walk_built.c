/* The front over a container of the real builder: which groups split, and that the front has neither hole nor crack. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/memory.h"
#include "build/built.h"
#include "build/open_edges.h"
#include "frame/view.h"
#include "walk/walk_checks.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TRIANGLES 100000u
#define PATH_STEPS 80u
#define LEAST_CHAINS 0u
#else
#define TRIANGLES 300000u
#define PATH_STEPS 160u
#define LEAST_CHAINS 1u /* see count_chains; a small model has too few levels */
#endif
#define CAMERAS 64u
#define MOST_ALLOWED_PX 65536.0 /* times the error: from there on memory decides where the front ends */
#define PI 3.14159265358979323846

typedef struct shared_model {
    built_model model;
    uint8_t *bytes; /* of the file */
    size_t size;
    double centre[3], diagonal; /* world */
} shared_model;

static shared_model shared;

/* A state of the tree: which groups split, which nodes are the front, what lies below it. */
typedef struct cut {
    bool *split; /* [group_count] */
    bool *asks;  /* [group_count] a member asks for itself; by find_wanted */
    bool *front; /* [node_count] */
} cut;

/* ---- the model ---- */
static void check_model(const built_model *model)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    strl_placement placement;
    uint32_t shared_groups = 0;
    assert_int_equal(model->info.placement_count, 1);
    assert_int_equal(strl_container_placement(model->container, 0, &placement, NULL), STRL_OK);
    assert_memory_equal(placement.transform, identity, sizeof identity); /* boxes here are the model's */
    assert_true(model->tree.level_count >= 4);
    for (uint32_t i = 0; i < model->tree.node_count; i++) {
        assert_true((model->node[i].level == 0) == (model->node[i].child_count == 0));
        assert_true(model->node[i].rung < STRL_RUNG_CLUSTERING); /* such nodes may open what was closed */
        shared_groups += model->node[i].level > 0 && model->node[i].group_size > 1;
    }
    assert_true(shared_groups > 0);
}

static int create_model(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    built_scene("isosurface", "walked.ply", TRIANGLES, true);
    built_build_one(built_path("walked.ply"), built_path("walked.stroll"));
    built_open(&shared.model, built_path("walked.stroll"));
    shared.bytes = built_read_file(built_path("walked.stroll"), &shared.size);
    check_model(&shared.model);
    for (int k = 0; k < 3; k++) {
        double size = shared.model.info.bounds[k + 3] - shared.model.info.bounds[k];
        shared.centre[k] = shared.model.info.bounds[k] + size / 2;
        shared.diagonal += size * size;
    }
    shared.diagonal = sqrt(shared.diagonal);
    return 0;
}

static int destroy_model(void **state)
{
    free(shared.bytes);
    built_close(&shared.model);
    return built_teardown(state);
}

static strl_walk *open_shared(const strl_walk_desc *desc, watched_source **source)
{
    *source = watched_source_open(memory_source(shared.bytes, shared.size));
    strl_walk *walk = open_walk(&(*source)->base, desc);
    (*source)->walking = true;
    return walk;
}

/* ---- cameras ---- */
/* Eye and target in diagonals from the centre. */
static strl_camera camera_from(const double eye[3], const double target[3])
{
    strl_camera camera = {.up = {0.02, 0.03, 1}, .fov_y_deg = 60, .width = 1280, .height = 720};
    for (int k = 0; k < 3; k++) {
        camera.eye[k] = shared.centre[k] + shared.diagonal * eye[k];
        camera.target[k] = shared.centre[k] + shared.diagonal * target[k];
    }
    return camera;
}

/* By number: far, round about, near, inside; looking away, from inside and outside; half of them through a long
 * lens at some spot. */
static strl_camera camera_number(uint32_t number)
{
    uint64_t random = number;
    double turn = 2 * PI * next_random(&random), rise = next_random(&random) - 0.5;
    double way[3] = {cos(turn), sin(turn), rise}, eye[3], target[3] = {0, 0, 0};
    static const double distance[4] = {4, 0.8, 0.25, 0.05};
    for (int k = 0; k < 3; k++) {
        eye[k] = distance[number % 4] * (number % 8 < 4 ? 1 : 1.7) * way[k];
        target[k] = 0.1 * (next_random(&random) - 0.5);
        if (number % 8 == 7) /* away from the middle, from just beside it or from without */
            eye[k] *= number % 16 == 7 ? 1 : 8, target[k] = 2 * eye[k];
    }
    bool long_lens = number % 32 >= 16 && number % 8 != 7;
    for (int k = 0; k < 2 && long_lens; k++)
        target[k] = 0.5 * (next_random(&random) - 0.5);
    strl_camera camera = camera_from(eye, target);
    camera.fov_y_deg = long_lens ? 2 : 60;
    return camera;
}

/* Towards the model, low over it and away; at in 0 .. 1. */
static strl_camera path_camera(double at)
{
    double along = 6 * pow(2 * at - 1, 3);
    const double eye[3] = {along, 0.12 * sin(5 * at), 0.18 + 0.3 * fabs(along)};
    const double target[3] = {0.5 * along + 0.15, 0.02, 0};
    return camera_from(eye, target);
}

/* ---- the rule, from the records alone ---- */
static strl_box box_of(const int64_t min[3], const int64_t max[3])
{
    const strl_tree *tree = &shared.model.tree;
    strl_box box;
    for (int k = 0; k < 3; k++) {
        box.min[k] = tree->origin[k] + tree->step * (double)min[k];
        box.max[k] = tree->origin[k] + tree->step * (double)max[k];
    }
    return box;
}

/* The least error that a node can be drawn with, over its box. */
static double node_px(const strl_view *view, const strl_node *node)
{
    strl_box box = box_of(node->box_min, node->box_max);
    return strl_view_error_px(view, &box,
                              (double)fmaxf(node->geometric_min, node->appearance_min) * shared.model.tree.step);
}

/* What the record of any member says of all at and below its group. */
static double bound_px(const strl_view *view, const strl_node *node)
{
    strl_box box = box_of(node->group_box_min, node->group_box_max);
    return strl_view_error_px(view, &box,
                              (double)fmaxf(node->group_geometric, node->group_appearance) * shared.model.tree.step);
}

static void cut_create(cut *c)
{
    c->split = calloc(shared.model.tree.group_count, sizeof *c->split);
    c->asks = calloc(shared.model.tree.group_count, sizeof *c->asks);
    c->front = calloc(shared.model.tree.node_count, sizeof *c->front);
    assert_true(c->split && c->asks && c->front);
}

static void cut_destroy(cut *c)
{
    free(c->split);
    free(c->asks);
    free(c->front);
}

static bool is_reached(const cut *c, const strl_node *node)
{
    return node->parent == STRL_NONE || c->split[shared.model.node[node->parent].group];
}

/* A group splits where a member asks for itself, or where a group of its members' children splits. */
static void find_wanted(const strl_camera *camera, double allowed_px, cut *c)
{
    const built_model *model = &shared.model;
    strl_view view;
    assert_true(strl_view_init(&view, camera));
    memset(c->split, 0, model->tree.group_count * sizeof *c->split);
    memset(c->asks, 0, model->tree.group_count * sizeof *c->asks);
    for (uint32_t level = 1; level < model->tree.level_count; level++)
        for (uint32_t i = 0; i < model->tree.node_count; i++) {
            const strl_node *node = &model->node[i];
            if (node->level != level)
                continue;
            bool asks = node_px(&view, node) > allowed_px, needed = asks;
            for (uint32_t k = 0; k < node->child_count; k++) /* groups of a level below are decided */
                needed = needed || c->split[model->node[node->first_child + k].group];
            c->asks[node->group] = c->asks[node->group] || asks;
            c->split[node->group] = c->split[node->group] || needed;
        }
    for (uint32_t i = 0; i < model->tree.node_count; i++)
        c->front[i] = is_reached(c, &model->node[i]) && !c->split[model->node[i].group];
}

/* Groups that split only for groups that split only for others: what needs several passes, or one in the right
 * order. */
static uint32_t count_chains(const cut *wanted)
{
    const built_model *model = &shared.model;
    uint32_t chains = 0;
    bool *direct = calloc(model->tree.group_count, sizeof *direct); /* asks, or a group just below does */
    assert_non_null(direct);
    for (uint32_t i = 0; i < model->tree.node_count; i++) {
        const strl_node *node = &model->node[i];
        direct[node->group] = direct[node->group] || wanted->asks[node->group];
        if (node->parent != STRL_NONE && wanted->asks[node->group])
            direct[model->node[node->parent].group] = true;
    }
    for (uint32_t g = 0; g < model->tree.group_count; g++)
        chains += wanted->split[g] && !direct[g];
    free(direct);
    return chains;
}

/* ---- what the walk shows ---- */
/* Reads a draw list as a cut. Fails the test where it is none, or where a group is torn. */
static void read_front(const strl_draw_list *list, const strl_walk_stats *stats, cut *c)
{
    const built_model *model = &shared.model;
    uint32_t nodes = model->tree.node_count, covering = 0;
    bool *covered = calloc(nodes, sizeof *covered);
    uint8_t *seen = calloc(model->tree.group_count, sizeof *seen); /* 1 a member split, 2 one did not */
    assert_true(covered && seen);
    memset(c->front, 0, nodes * sizeof *c->front);
    assert_int_equal(stats->nodes + stats->nodes_culled, list->count);
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        assert_true(item->placement == 0 && item->node < nodes && !c->front[item->node]);
        assert_int_equal(item->group, model->node[item->node].group);
        assert_int_equal(item->level, model->node[item->node].level);
        c->front[item->node] = true;
    }
    for (uint32_t i = 0; i < nodes; i++) { /* parents come before their children */
        const strl_node *node = &model->node[i];
        covered[i] = node->parent != STRL_NONE && (covered[node->parent] || c->front[node->parent]);
        assert_false(covered[i] && c->front[i]);                         /* nothing is there twice */
        assert_true(covered[i] || c->front[i] || node->child_count > 0); /* and nothing is missing */
        seen[node->group] |= covered[i] || c->front[i] ? 2 : 1;
        covering += c->front[i];
    }
    for (uint32_t g = 0; g < model->tree.group_count; g++) {
        assert_int_not_equal(seen[g], 3);
        c->split[g] = seen[g] == 1;
    }
    assert_int_equal(covering, list->count);
    free(covered);
    free(seen);
}

static void assert_same_cut(const cut *wanted, const cut *found, uint32_t number)
{
    const built_model *model = &shared.model;
    for (uint32_t i = 0; i < model->tree.node_count; i++)
        if (wanted->front[i] != found->front[i])
            fail_msg("camera %u: node %u of level %u is %s in the front", number, i, model->node[i].level,
                     found->front[i] ? "by mistake" : "not");
    assert_memory_equal(wanted->split, found->split, model->tree.group_count * sizeof *found->split);
}

/* No node of a settled front is coarser than allowed, unless it is the finest that there is. */
static uint32_t check_states(const strl_draw_list *list, const strl_camera *camera, double allowed_px)
{
    uint32_t coarser = 0;
    strl_view view;
    assert_true(strl_view_init(&view, camera));
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        const strl_node *node = &shared.model.node[item->node];
        const strl_pm *mesh = &shared.model.mesh[item->node];
        strl_box box = box_of(node->box_min, node->box_max);
        assert_true(item->state <= mesh->step_count);
        float error = fmaxf(mesh->geometric_error[item->state], mesh->appearance_error[item->state]);
        bool suffices = strl_view_error_px(&view, &box, (double)error * shared.model.tree.step) <= allowed_px;
        assert_true(suffices || (item->level == 0 && item->state == mesh->step_count));
        coarser += suffices && item->state < mesh->step_count;
    }
    return coarser;
}

/* ---- tests ---- */
static void a_settled_front_is_the_closure_of_what_single_nodes_ask_for(void **state)
{
    (void)state;
    static const double errors_px[5] = {2, 10, 0.5, 40, 160};
    cut wanted, found;
    uint32_t least = UINT32_MAX, most = 0, coarser = 0, chains = 0;
    cut_create(&wanted);
    cut_create(&found);
    for (uint32_t i = 0; i < 5; i++) {
        watched_source *source;
        strl_walk *walk = open_shared(&(strl_walk_desc){.error_px = errors_px[i]}, &source);
        for (uint32_t number = 0; number < CAMERAS; number++) {
            strl_camera camera = camera_number(number);
            strl_draw_list list = settle(walk, &camera, 400);
            const strl_walk_stats *stats = strl_walk_get_stats(walk);
            assert_true(stats->missing_nodes == 0 && stats->faults == 0);
            assert_true(stats->allowed_error_px == errors_px[i]);
            read_front(&list, stats, &found);
            find_wanted(&camera, errors_px[i], &wanted);
            assert_same_cut(&wanted, &found, number);
            chains += count_chains(&wanted);
            coarser += check_states(&list, &camera, errors_px[i]);
            least = list.count < least ? list.count : least;
            most = list.count > most ? list.count : most;
        }
        strl_walk_close(walk);
    }
    assert_int_equal(least, 1); /* the root, from afar */
    assert_true(most > shared.model.tree.node_count / 3);
    assert_true(coarser > CAMERAS);
    assert_in_range(chains, LEAST_CHAINS, UINT32_MAX);
    cut_destroy(&wanted);
    cut_destroy(&found);
}

/* Groups whose bound is above the allowed error, whose parents have split, and which nobody has to split. */
static uint32_t count_spared(const strl_camera *camera, double allowed_px, const cut *c)
{
    uint32_t spared = 0;
    strl_view view;
    assert_true(strl_view_init(&view, camera));
    for (uint32_t i = 0; i < shared.model.tree.node_count; i++) {
        const strl_node *node = &shared.model.node[i];
        spared += node->level > 0 && c->front[i] && bound_px(&view, node) > allowed_px;
    }
    return spared;
}

static void groups_split_and_collapse_for_one_member_and_not_for_a_bound(void **state)
{
    (void)state;
    watched_source *source;
    strl_walk *walk = open_shared(&(strl_walk_desc){.error_px = 2}, &source);
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    cut wanted, found;
    uint64_t splits = 0, collapses = 0, dependent_splits = 0, dependent_collapses = 0;
    uint32_t spared = 0, most = 0, last = 0;
    cut_create(&wanted);
    cut_create(&found);
    for (uint32_t step = 0; step <= PATH_STEPS; step++) {
        strl_camera camera = path_camera((double)step / PATH_STEPS);
        strl_draw_list list;
        uint32_t frames = 0;
        do {
            strl_walk_pump(walk, UINT64_MAX);
            list = walk_frame(walk, &camera);
            splits += stats->splits, collapses += stats->collapses;
            dependent_splits += stats->dependent_splits, dependent_collapses += stats->dependent_collapses;
            assert_true(stats->dependent_splits <= stats->splits && stats->dependent_collapses <= stats->collapses);
            assert_true(++frames < 400);
        } while (!strl_walk_settled(walk));
        read_front(&list, stats, &found);
        find_wanted(&camera, 2, &wanted);
        assert_same_cut(&wanted, &found, step);
        spared += count_spared(&camera, 2, &found);
        most = list.count > most ? list.count : most;
        last = list.count;
    }
    assert_true(most > 20 && last < most / 2);
    assert_true(dependent_splits > 0 && dependent_collapses > 0);
    assert_true(splits > dependent_splits && collapses > dependent_collapses);
    assert_true(spared > 0);
    cut_destroy(&wanted);
    cut_destroy(&found);
    strl_walk_close(walk);
}

/* What the items show, as lattice positions: strl__free. */
static int64_t (*drawn_triangles(const strl_draw_list *list, size_t *count))[3][3]
{
    *count = 0;
    for (uint32_t i = 0; i < list->count; i++)
        *count += list->items[i].draw_count / 3;
    int64_t(*triangle)[3][3] = strl__alloc(*count + 1, sizeof *triangle);
    assert_non_null(triangle);
    size_t corner = 0;
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        const uint16_t *indices = item->indices + item->draw_first;
        for (uint32_t k = 0; k < item->draw_count; k++, corner++) {
            assert_true(indices[k] < item->vertex_count);
            for (int axis = 0; axis < 3; axis++)
                triangle[corner / 3][corner % 3][axis] = item->anchor[axis] + item->vertices[indices[k]].position[axis];
        }
    }
    return triangle;
}

static void check_no_crack(const strl_draw_list *list, const int64_t (*rim)[3], size_t rim_count, uint32_t number)
{
    size_t count;
    int64_t(*triangle)[3][3] = drawn_triangles(list, &count);
    assert_open_at_the_rim_only(count, (const int64_t(*)[3][3])triangle, rim, rim_count, number);
    strl__free(triangle);
}

/* What a walk holds with all that it wants at the path's middle. */
static uint64_t ample_bytes(double error_px)
{
    watched_source *source;
    strl_walk *walk = open_shared(&(strl_walk_desc){.error_px = error_px}, &source);
    strl_camera camera = path_camera(0.5);
    settle(walk, &camera, 400);
    uint64_t bytes = strl_walk_get_stats(walk)->resident_bytes;
    strl_walk_close(walk);
    return bytes;
}

static void fronts_stay_whole_with_little_memory_and_a_late_source(void **state)
{
    (void)state;
    uint64_t leaves, random = 3;
    size_t rim_count;
    int64_t(*leaf)[3][3] = built_leaves(&shared.model, &leaves);
    int64_t(*rim)[3] = list_rim_points(leaves, (const int64_t(*)[3][3])leaf, &rim_count);
    assert_true(rim_count > 0 && rim_count < leaves / 4); /* most of the surface is closed */
    free(leaf);
    uint64_t memory = ample_bytes(1) / 3 * 2;
    watched_source *source;
    strl_walk *walk =
        open_shared(&(strl_walk_desc){.memory_bytes = memory, .error_px = 1, .requests_in_flight = 3}, &source);
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    source->hold_percent = 90;
    cut wanted, found;
    uint32_t tight = 0, late = 0, mixed = 0;
    cut_create(&wanted);
    cut_create(&found);
    for (uint32_t step = 0; step <= PATH_STEPS; step++) {
        strl_camera camera = path_camera((double)step / PATH_STEPS);
        strl_draw_list list = walk_frame(walk, &camera);
        read_front(&list, stats, &found);
        find_wanted(&camera, stats->allowed_error_px, &wanted);
        assert_true(stats->resident_bytes <= memory);
        tight += stats->allowed_error_px > 1;
        late += stats->missing_nodes > 0;
        bool levels[64] = {false};
        uint32_t level_count = 0;
        for (uint32_t i = 0; i < list.count; i++) {
            level_count += !levels[list.items[i].level & 63];
            levels[list.items[i].level & 63] = true;
        }
        mixed += level_count > 1;
        if (strl_walk_settled(walk) && stats->allowed_error_px < MOST_ALLOWED_PX)
            assert_same_cut(&wanted, &found, step);
        if (step % 3 == 0)
            check_no_crack(&list, (const int64_t(*)[3])rim, rim_count, step);
        if (next_random(&random) < 0.5)
            strl_walk_pump(walk, UINT64_MAX);
    }
    assert_true(tight > PATH_STEPS / 8 && late > PATH_STEPS / 8 && mixed > PATH_STEPS / 8);
    /* It comes to rest at the closure for the error that fits. */
    strl_camera camera = path_camera(0.5);
    strl_draw_list list = settle(walk, &camera, 4000);
    assert_true(stats->allowed_error_px > 1);
    read_front(&list, stats, &found);
    find_wanted(&camera, stats->allowed_error_px, &wanted);
    assert_same_cut(&wanted, &found, PATH_STEPS);
    check_states(&list, &camera, stats->allowed_error_px);
    check_no_crack(&list, (const int64_t(*)[3])rim, rim_count, PATH_STEPS);
    cut_destroy(&wanted);
    cut_destroy(&found);
    free(rim);
    strl_walk_close(walk);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_settled_front_is_the_closure_of_what_single_nodes_ask_for),
        cmocka_unit_test(groups_split_and_collapse_for_one_member_and_not_for_a_bound),
        cmocka_unit_test(fronts_stay_whole_with_little_memory_and_a_late_source),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
