/* Where backs are not drawn the walk leaves out what shows nothing else, and nothing that does: the test of cones
 * against all placements and cameras, and walks through a closed sample tree whose pictures with and without cones are
 * the same. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/sample_tree.h"
#include "container/writer.h"
#include "stroll/render.h"
#include "walk/facing.h"
#include "walk/walk_checks.h"

typedef long double wide;

/* ---- numbers of the test's own, in more digits than the walk's */

static double between(uint64_t *state, double low, double high)
{
    return low + (high - low) * next_random(state);
}

static wide product(const wide a[3], const wide b[3], const wide c[3])
{
    wide sum = 0;
    for (int k = 0; k < 3; k++)
        sum += a[k] * (b[(k + 1) % 3] * c[(k + 2) % 3] - b[(k + 2) % 3] * c[(k + 1) % 3]);
    return sum;
}

static wide length_of(const wide a[3])
{
    return sqrtl(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

static bool is_mirror(const double m[12])
{
    wide row[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            row[i][j] = m[4 * i + j];
    return product(row[0], row[1], row[2]) < 0;
}

static void place(const strl_tree *tree, const double m[12], const wide cell[3], wide world[3])
{
    for (int i = 0; i < 3; i++) {
        world[i] = m[4 * i + 3];
        for (int j = 0; j < 3; j++)
            world[i] += m[4 * i + j] * (tree->origin[j] + tree->step * cell[j]);
    }
}

/* The sine of the angle by which the eye is before the face, at least in sign: above 0 it sees the front. */
static wide before(const strl_camera *camera, const double m[12], wide corner[3][3])
{
    wide from[3][3], side[2][3];
    bool orthographic = camera->fov_y_deg == 0;
    for (int k = 0; k < 3; k++) {
        from[0][k] = orthographic ? camera->target[k] - (wide)camera->eye[k] : corner[0][k] - camera->eye[k];
        side[0][k] = corner[1][k] - corner[0][k];
        side[1][k] = corner[2][k] - corner[0][k];
    }
    wide volume = product(from[0], side[0], side[1]),
         size = length_of(from[0]) * length_of(side[0]) * length_of(side[1]);
    return size == 0 ? 0 : (is_mirror(m) ? volume : -volume) / size;
}

/* ---- the test of a cone */

typedef struct situation {
    strl_tree tree;
    strl_node record;
    double transform[12];
    strl_camera camera;
} situation;

static void any_transform(uint64_t *random, double m[12])
{
    double scale = pow(10, between(random, -3, 3)), kind = next_random(random);
    for (int k = 0; k < 12; k++)
        m[k] = k % 4 == 3 ? between(random, -1000, 1000) : kind < 0.2 ? 0 : scale * between(random, -1, 1);
    for (int k = 0; k < 3 && kind < 0.2; k++)
        m[5 * k] = scale * (next_random(random) < 0.5 ? -1 : 1) * (kind < 0.1 ? 1 : between(random, 0.01, 10));
    for (int k = 0; k < 3 && kind > 0.9; k++) /* nearly flat */
        m[8 + k] = m[k] + m[4 + k] + scale * between(random, -1e-4, 1e-4);
}

static void any_cone(uint64_t *random, strl_cone *cone)
{
    for (int k = 0; k < 3; k++)
        cone->axis[k] = (int16_t)between(random, -32767, 32768);
    cone->axis[0] |= 1;
    cone->cosine = (uint16_t)(65535 - (65534 * pow(next_random(random), 3)));
    if (next_random(random) < 0.1)
        cone->cosine = 65535;
}

static situation any_situation(uint64_t *random)
{
    situation s = {.tree = {.step = ldexp(1, (int)between(random, -24, 4))}};
    wide middle[3], world[3];
    double reach = pow(10, between(random, -1, 2)), size = 0;
    any_transform(random, s.transform);
    any_cone(random, &s.record.cone);
    for (int k = 0; k < 3; k++) {
        s.tree.origin[k] = between(random, -1000, 1000);
        s.record.box_min[k] = (int64_t)between(random, -0x1p21, 0x1p21);
        s.record.box_max[k] =
            s.record.box_min[k] + (int64_t)(next_random(random) < 0.1 ? 0 : pow(2, between(random, 0, 18)));
        size = fmax(size, (double)(s.record.box_max[k] - s.record.box_min[k]));
    }
    for (int k = 0; k < 3; k++)
        middle[k] = (double)s.record.box_min[k] + size * reach * between(random, -1, 1);
    place(&s.tree, s.transform, middle, world);
    s.camera = (strl_camera){.up = {0.3, 0.2, 1}, .width = 100, .height = 80};
    s.camera.fov_y_deg = next_random(random) < 0.7 ? 60 : 0;
    s.camera.ortho_height = s.camera.fov_y_deg == 0 ? 10 : 0;
    for (int k = 0; k < 3; k++) {
        s.camera.eye[k] = (double)world[k];
        s.camera.target[k] = s.camera.eye[k] + between(random, -1, 1);
    }
    return s;
}

/* A direction of the cone, often one of its rim. */
static void any_normal(uint64_t *random, const strl_cone *cone, wide out[3])
{
    wide axis[3] = {cone->axis[0], cone->axis[1], cone->axis[2]}, across[3], size = length_of(axis), along = 0;
    wide cosine = cone->cosine / 65535.0L, sine = sqrtl(1 - cosine * cosine);
    for (int k = 0; k < 3; k++) {
        axis[k] /= size;
        across[k] = between(random, -1, 1);
        along += across[k] * axis[k];
    }
    for (int k = 0; k < 3; k++)
        across[k] -= along * axis[k];
    size = length_of(across);
    wide share = next_random(random) < 0.5 ? 1 : next_random(random);
    for (int k = 0; k < 3; k++)
        out[k] = axis[k] * sqrtl(1 - sine * sine * share * share) + across[k] / size * sine * share;
}

/* A face with that normal in the box, and how it stands to the eye. */
static wide look_at_any_face(uint64_t *random, const situation *s)
{
    wide normal[3], at[3], side[3], across[3], world[3][3], corner[3][3], size;
    any_normal(random, &s->record.cone, normal);
    for (int k = 0; k < 3; k++) {
        double share = next_random(random);
        at[k] = (wide)s->record.box_min[k] + (share < 0.3   ? 0
                                              : share > 0.7 ? 1
                                                            : (wide)(share - 0.3) / 0.4L) *
                                                 (wide)(s->record.box_max[k] - s->record.box_min[k]);
        side[k] = between(random, -1, 1);
    }
    for (int k = 0; k < 3; k++)
        across[k] = normal[(k + 1) % 3] * side[(k + 2) % 3] - normal[(k + 2) % 3] * side[(k + 1) % 3];
    size = length_of(across);
    for (int k = 0; k < 3; k++)
        side[k] = across[k] / size;
    for (int k = 0; k < 3; k++) /* side x across is along the normal */
        across[k] = normal[(k + 1) % 3] * side[(k + 2) % 3] - normal[(k + 2) % 3] * side[(k + 1) % 3];
    for (int k = 0; k < 3; k++) {
        corner[0][k] = at[k];
        corner[1][k] = at[k] + side[k];
        corner[2][k] = at[k] + across[k];
    }
    for (int c = 0; c < 3; c++)
        place(&s->tree, s->transform, corner[c], world[c]);
    return before(&s->camera, s->transform, world);
}

static void nothing_that_faces_the_eye_is_left_out(void **state)
{
    (void)state;
    uint64_t random = 1;
    unsigned away = 0, unsure = 0;
    for (unsigned round = 0; round < 40000; round++) {
        const situation s = any_situation(&random);
        strl_view view;
        if (!strl_view_init(&view, &s.camera))
            continue;
        const strl__facing facing = strl__facing_find(&view, &s.tree, s.transform);
        bool is_away = strl__faces_away(&facing, &s.record);
        wide most = -1;
        for (unsigned i = 0; i < (is_away ? 200 : 100); i++)
            most = fmaxl(most, look_at_any_face(&random, &s));
        if (is_away && most > 1e-11L)
            fail_msg("round %u: left out, and a face is seen from before by %Lg", round, most);
        away += is_away;
        unsure += !is_away && most < -1e-3L;
    }
    assert_true(away > 4000);
    assert_true(unsure < away / 4); /* what is kept is seen, but where a hundred faces are too few to find that */
}

static void without_a_cone_or_an_inverse_nothing_faces_away(void **state)
{
    (void)state;
    situation s = {
        .tree = {.step = 1},
        .transform = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0},
        .camera = {
            .eye = {0.5, 0.5, -9}, .target = {0.5, 0.5, 0}, .up = {0, 1, 0}, .fov_y_deg = 60, .width = 9, .height = 9}};
    strl_view view;
    for (int k = 0; k < 3; k++)
        s.record.box_max[k] = 1;
    s.record.cone = (strl_cone){{0, 0, 1}, 65535};
    assert_true(strl_view_init(&view, &s.camera));
    strl__facing facing = strl__facing_find(&view, &s.tree, s.transform), nothing = {0};
    assert_true(strl__faces_away(&facing, &s.record));
    assert_false(strl__faces_away(&nothing, &s.record));
    s.record.cone.axis[2] = -1;
    assert_false(strl__faces_away(&facing, &s.record));
    s.record.cone = (strl_cone){{0}, 0};
    assert_false(strl__faces_away(&facing, &s.record));
    s.record.cone = (strl_cone){{0, 0, 1}, 65535};
    s.transform[10] = -1; /* mirrored, it does not turn round: the eye is behind, as it was before */
    facing = strl__facing_find(&view, &s.tree, s.transform);
    assert_false(strl__faces_away(&facing, &s.record));
    s.transform[10] = 0;
    facing = strl__facing_find(&view, &s.tree, s.transform);
    assert_false(facing.known || strl__faces_away(&facing, &s.record));
    s.transform[10] = INFINITY;
    facing = strl__facing_find(&view, &s.tree, s.transform);
    assert_false(facing.known || strl__faces_away(&facing, &s.record));
}

/* ---- a closed model: a sphere of radius 1, in three places of which one mirrors and one is neither round nor upright
 */

#define RINGS 240u
#define CAMERAS 16u
#define WIDTH 320u
#define HEIGHT 240u

static const double places[][12] = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0},
                                    {-1.2, 0.3, 0, 2.8, 0.1, 0.9, 0, 0.4, 0, 0.2, 0.7, 0.1},
                                    {0, 0.5, 0.4, -0.6, 1.5, 0, 0.2, 2.9, 0, 0.1, -0.8, 0.5}};
#define PLACES (sizeof places / sizeof *places)

static built_model model;
static uint8_t *with_cones, *without_cones;
static size_t size_with, size_without;

/* The same bricks, placed; with_cone: and with their cones. */
static void write_placed(const char *name, bool with_cone)
{
    strl_error err = {0};
    strl_container_writer *to;
    size_t size;
    uint64_t bytes;
    uint8_t *file = built_read_file(built_path("round.stroll"), &size);
    const strl_container_writer_desc desc = {
        .path = built_path(name), .scratch_dir = built_path(""), .info = model.info};
    strl_status status = strl_container_writer_create(&desc, &to, &err);
    if (status == STRL_OK)
        status = strl_container_writer_begin_tree(to, &model.tree, &err);
    for (uint32_t id = 0; status == STRL_OK && id < model.tree.node_count; id++) {
        strl_node record = model.node[id];
        if (!with_cone)
            record.cone = (strl_cone){0};
        status = strl_container_writer_add_node(to, &record, file + record.page.offset + record.payload_offset,
                                                record.payload_bytes, &err);
    }
    if (status == STRL_OK)
        status = strl_container_writer_end_tree(to, &err);
    for (size_t p = 0; status == STRL_OK && p < PLACES; p++) {
        strl_placement placement = {0};
        memcpy(placement.transform, places[p], sizeof places[p]);
        status = strl_container_writer_add_placement(to, &placement, &err);
    }
    if (status == STRL_OK)
        status = strl_container_writer_finish(to, &bytes, &err);
    if (status != STRL_OK)
        fail_msg("%s", err.message);
    strl_container_writer_destroy(to);
    free(file);
}

static int create_model(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    mesh_file mesh = {0};
    mesh_file_sphere(&mesh, RINGS, 2 * RINGS);
    mesh_file_write_ply(&mesh, built_path("round.ply"));
    mesh_file_free(&mesh);
    sample_tree_build("round.ply", "round.stroll", (strl_build_desc){0});
    sample_tree_verify("round.stroll", "round.ply");
    built_open(&model, built_path("round.stroll"));
    write_placed("with.stroll", true);
    write_placed("without.stroll", false);
    with_cones = built_read_file(built_path("with.stroll"), &size_with);
    without_cones = built_read_file(built_path("without.stroll"), &size_without);
    return 0;
}

static int destroy_model(void **state)
{
    built_close(&model);
    free(with_cones);
    free(without_cones);
    return built_teardown(state);
}

static strl_walk *open_model(bool cones, double error_px, strl_cull cull)
{
    strl_source *source = cones ? memory_source(with_cones, size_with) : memory_source(without_cones, size_without);
    return open_walk(source, &(strl_walk_desc){.error_px = error_px, .cull = cull});
}

/* Round the three, now and then in one of them. */
static strl_camera any_camera(uint64_t *random)
{
    strl_camera camera = {.up = {0.1, 0.2, 1}, .fov_y_deg = 60, .width = WIDTH, .height = HEIGHT};
    double reach = next_random(random) < 0.2 ? 0.8 : 5;
    for (int k = 0; k < 3; k++) {
        camera.target[k] = between(random, -0.5, 1.5);
        camera.eye[k] = reach * between(random, -1, 1);
    }
    if (next_random(random) < 0.3)
        camera.fov_y_deg = 0, camera.ortho_height = 6;
    return camera;
}

/* Whether any triangle of the brick shows its front. */
static bool shows_a_front(uint32_t id, const double transform[12], const strl_camera *camera)
{
    const strl_pm *mesh = &model.mesh[id];
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        wide corner[3][3];
        for (int c = 0; c < 3; c++) {
            int64_t cell[3];
            built_position(&model, id, mesh->triangle[t][c], cell);
            place(&model.tree, transform, (const wide[3]){cell[0], cell[1], cell[2]}, corner[c]);
        }
        if (before(camera, transform, corner) > 1e-12L)
            return true;
    }
    return false;
}

/* [PLACES * node_count], of triangles alone; malloc. */
static bool *listed_bricks(const strl_draw_list *list)
{
    bool *listed = calloc(PLACES * model.tree.node_count, sizeof *listed);
    assert_non_null(listed);
    for (uint32_t i = 0; i < list->count; i++)
        if (!(list->items[i].point_px > 0)) {
            assert_true(list->items[i].placement < PLACES && list->items[i].node < model.tree.node_count);
            bool *brick = &listed[list->items[i].placement * model.tree.node_count + list->items[i].node];
            assert_false(*brick);
            *brick = true;
        }
    for (size_t p = 0; p < PLACES; p++) /* bricks add up: none is drawn without what is above it */
        for (uint32_t id = 1; id < model.tree.node_count; id++)
            assert_true(!listed[p * model.tree.node_count + id] ||
                        listed[p * model.tree.node_count + model.node[id].parent]);
    return listed;
}

static void bricks_that_are_left_out_show_no_front(void **state)
{
    (void)state;
    uint64_t random = 3, left_out = 0, drawn = 0, counted = 0;
    const double errors[] = {1e-9, 0.5, 4};
    for (size_t e = 0; e < sizeof errors / sizeof *errors; e++) {
        strl_walk *walk = open_model(true, errors[e], STRL_CULL_BACK),
                  *plain = open_model(false, errors[e], STRL_CULL_NONE);
        for (unsigned i = 0; i < CAMERAS; i++) {
            strl_camera camera = any_camera(&random);
            strl_draw_list list = settle(walk, &camera, 2000), all = settle(plain, &camera, 2000);
            assert_true(list.cull == STRL_CULL_BACK && all.cull == STRL_CULL_NONE);
            bool *here = listed_bricks(&list), *there = listed_bricks(&all);
            for (size_t p = 0; p < PLACES; p++)
                for (uint32_t id = 0; id < model.tree.node_count; id++) {
                    size_t at = p * model.tree.node_count + id;
                    assert_true(!here[at] || there[at]);
                    if (there[at] && !here[at]) {
                        left_out++;
                        assert_false(shows_a_front(id, places[p], &camera));
                    }
                    drawn += here[at];
                }
            counted += strl_walk_get_stats(walk)->nodes_backfacing;
            assert_int_equal(strl_walk_get_stats(plain)->nodes_backfacing, 0);
            assert_true(strl_walk_get_stats(walk)->triangles <= strl_walk_get_stats(plain)->triangles);
            free(here);
            free(there);
        }
        strl_walk_close(walk);
        strl_walk_close(plain);
    }
    assert_true(left_out > drawn / 5);
    assert_true(counted > left_out / 20 && counted <= left_out);
}

static void without_the_word_cones_do_nothing(void **state)
{
    (void)state;
    uint64_t random = 4;
    strl_walk *walk = open_model(true, 1, STRL_CULL_NONE), *plain = open_model(false, 1, STRL_CULL_NONE),
              *no_cones = open_model(false, 1, STRL_CULL_BACK);
    for (unsigned i = 0; i < CAMERAS; i++) {
        strl_camera camera = any_camera(&random);
        strl_draw_list list = settle(walk, &camera, 2000), all = settle(plain, &camera, 2000),
                       same = settle(no_cones, &camera, 2000);
        const strl_draw_list *lists[] = {&list, &same};
        for (int l = 0; l < 2; l++) {
            assert_int_equal(lists[l]->count, all.count);
            for (uint32_t k = 0; k < all.count; k++)
                assert_true(lists[l]->items[k].node == all.items[k].node &&
                            lists[l]->items[k].draw_count == all.items[k].draw_count);
        }
        assert_int_equal(strl_walk_get_stats(walk)->nodes_backfacing + strl_walk_get_stats(no_cones)->nodes_backfacing,
                         0);
    }
    strl_walk_close(walk);
    strl_walk_close(plain);
    strl_walk_close(no_cones);
}

static void settled_lists_are_the_same_from_wherever_one_comes(void **state)
{
    (void)state;
    uint64_t random = 5;
    strl_walk *walk = open_model(true, 0.5, STRL_CULL_BACK);
    for (unsigned i = 0; i < CAMERAS; i++) {
        strl_camera camera = any_camera(&random);
        for (unsigned frame = 0; frame < 2; frame++) { /* on the way */
            walk_frame(walk, &(strl_camera){
                                 .eye = {4, 3, i}, .up = {0, 1, 0}, .fov_y_deg = 60, .width = WIDTH, .height = HEIGHT});
            strl_walk_pump(walk, 1);
        }
        strl_draw_list list = settle(walk, &camera, 2000);
        strl_walk *fresh = open_model(true, 0.5, STRL_CULL_BACK);
        strl_draw_list expected = settle(fresh, &camera, 2000);
        assert_int_equal(list.count, expected.count);
        for (uint32_t k = 0; k < list.count; k++)
            assert_true(list.items[k].node == expected.items[k].node &&
                        list.items[k].placement == expected.items[k].placement &&
                        list.items[k].draw_count == expected.items[k].draw_count);
        assert_int_equal(strl_walk_get_stats(walk)->nodes_backfacing, strl_walk_get_stats(fresh)->nodes_backfacing);
        strl_walk_close(fresh);
    }
    strl_walk_close(walk);
}

/* What is left out is not waited for, and takes no memory that something else needs: a quarter of the bricks, so that
 * nine tenths of the memory do for one side, with room for one to be decoded, and not for both. */
static void one_side_takes_less_memory(void **state)
{
    (void)state;
    strl_camera camera = {.eye = {0, -60, 0}, .up = {0, 0, 1}, .fov_y_deg = 8, .width = 4000, .height = 4000};
    size_t size;
    uint8_t *bytes = built_read_file(built_path("round.stroll"), &size);
    strl_walk *plain = open_walk(memory_source(bytes, size), &(strl_walk_desc){.error_px = 0.5});
    settle(plain, &camera, 2000);
    uint64_t needed = strl_walk_get_stats(plain)->resident_bytes;
    uint32_t all = strl_walk_get_stats(plain)->nodes;
    strl_walk_close(plain);
    for (int cull = STRL_CULL_NONE; cull <= STRL_CULL_BACK; cull++) {
        strl_walk *walk =
            open_walk(memory_source(bytes, size),
                      &(strl_walk_desc){.error_px = 0.5, .memory_bytes = needed * 92 / 100, .cull = (strl_cull)cull});
        settle(walk, &camera, 4000);
        const strl_walk_stats *stats = strl_walk_get_stats(walk);
        assert_true((stats->allowed_error_px == 0.5) == (cull == STRL_CULL_BACK));
        assert_true(stats->resident_bytes <= needed * 92 / 100);
        assert_true(cull == STRL_CULL_NONE || stats->nodes < all);
        strl_walk_close(walk);
    }
    free(bytes);
}

static void late_or_without_memory_the_walk_goes_on(void **state)
{
    (void)state;
    uint64_t random = 7;
    watched_source *source = watched_source_open(memory_source(with_cones, size_with));
    strl_walk *walk =
        open_walk(&source->base, &(strl_walk_desc){.error_px = 0.5, .requests_in_flight = 2, .cull = STRL_CULL_BACK});
    unsigned late = 0;
    source->walking = true;
    source->hold_percent = 80;
    for (unsigned i = 0; i < CAMERAS; i++) {
        strl_camera camera = any_camera(&random);
        for (unsigned frame = 0; frame < 8; frame++) {
            strl_draw_list list = walk_frame(walk, &camera);
            free(listed_bricks(&list));
            late += strl_walk_get_stats(walk)->missing_nodes > 0;
            strl_walk_pump(walk, 1);
        }
    }
    assert_true(late > CAMERAS / 2);
    source->hold_percent = 0;
    for (uint64_t n = 1; n < 200; n += 1 + n / 8) {
        strl_draw_list list;
        strl_camera camera = any_camera(&random);
        walk_frame_without_memory(walk, &camera, n, &list);
        free(listed_bricks(&list));
    }
    strl_camera camera = any_camera(&random);
    settle(walk, &camera, 2000);
    strl_walk_close(walk);
}

/* ---- pictures */

typedef struct picture {
    uint8_t rgba[WIDTH * HEIGHT][4];
    float depth[WIDTH * HEIGHT];
    strl_render_stats stats;
} picture;

static void shoot(strl_renderer *renderer, const strl_camera *camera, const strl_draw_list *list, picture *out)
{
    strl_error err = {0};
    if (strl_renderer_draw(renderer, camera, list, NULL, &out->stats, &err) != STRL_OK ||
        strl_renderer_read_colour(renderer, out->rgba[0], &err) != STRL_OK ||
        strl_renderer_read_depth(renderer, out->depth, &err) != STRL_OK)
        fail_msg("%s", err.message);
}

static unsigned count_different(const picture *a, const picture *b)
{
    unsigned different = 0;
    for (size_t p = 0; p < WIDTH * HEIGHT; p++)
        different += memcmp(a->rgba[p], b->rgba[p], 4) != 0 || memcmp(&a->depth[p], &b->depth[p], sizeof(float)) != 0;
    return different;
}

static void pictures_with_cones_are_those_without(void **state)
{
    (void)state;
    static picture culled, plain, both_sides;
    const strl_renderer_desc descs[] = {
        {.backend = STRL_BACKEND_GL45}, {.backend = STRL_BACKEND_GL3}, {.backend = STRL_BACKEND_GL3, .gles = true}};
    uint64_t triangles = 0, all_triangles = 0;
    unsigned outside = 0;
    for (size_t d = 0; d < sizeof descs / sizeof *descs; d++) {
        strl_renderer_desc desc = descs[d];
        strl_renderer *renderer[3];
        strl_error err = {0};
        desc.width = WIDTH, desc.height = HEIGHT;
        for (int r = 0; r < 3; r++) /* keys of several walks would meet in one */
            if (strl_renderer_create(&desc, &renderer[r], &err) != STRL_OK)
                fail_msg("%s", err.message);
        strl_walk *walk = open_model(true, 1e-9, STRL_CULL_BACK), *without = open_model(false, 1e-9, STRL_CULL_BACK),
                  *closed = open_model(true, 1e-9, STRL_CULL_NONE);
        uint64_t random = 6;
        for (unsigned i = 0; i < CAMERAS; i++) {
            strl_camera camera = any_camera(&random);
            strl_draw_list list = settle(walk, &camera, 2000), all = settle(without, &camera, 2000),
                           sides = settle(closed, &camera, 2000);
            list.near_distance = all.near_distance; /* the depth's scale */
            list.far_distance = all.far_distance;
            shoot(renderer[0], &camera, &list, &culled);
            shoot(renderer[1], &camera, &all, &plain);
            shoot(renderer[2], &camera, &sides, &both_sides);
            assert_int_equal(count_different(&culled, &plain), 0);
            triangles += culled.stats.triangles;
            all_triangles += plain.stats.triangles;
            /* outside of all: but for slivers of the rim */
            if (hypot(hypot(camera.eye[0], camera.eye[1]), camera.eye[2]) > 5.5) {
                assert_in_range(count_different(&culled, &both_sides), 0, WIDTH * HEIGHT / 200);
                outside++;
            }
        }
        for (int r = 0; r < 3; r++)
            strl_renderer_destroy(renderer[r]);
        strl_walk_close(walk);
        strl_walk_close(without);
        strl_walk_close(closed);
    }
    assert_true(triangles < all_triangles * 4 / 5 && outside > CAMERAS / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_that_faces_the_eye_is_left_out),
        cmocka_unit_test(without_a_cone_or_an_inverse_nothing_faces_away),
        cmocka_unit_test(bricks_that_are_left_out_show_no_front),
        cmocka_unit_test(without_the_word_cones_do_nothing),
        cmocka_unit_test(settled_lists_are_the_same_from_wherever_one_comes),
        cmocka_unit_test(one_side_takes_less_memory),
        cmocka_unit_test(late_or_without_memory_the_walk_goes_on),
        cmocka_unit_test(pictures_with_cones_are_those_without),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
