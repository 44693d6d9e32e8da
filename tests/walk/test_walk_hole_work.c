/* Files that claim as many splats as the format allows, for cells as large as they like, seen by many placements of
 * which nothing else has arrived: a frame closes their holes with half a million points (docs/algorithms/samples.md,
 * "Bricks"), begins with what is nearest, and succeeds. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/planted_bricks.h"
#include "walk/walk_checks.h"

#define MOST_POINTS 524288u /* 2^19 */
#define SPLATS 4096u        /* of a brick, by docs/format-payload.md */
#define ALONG 16u           /* of them lie in a row: 16 x 16 x 16 */
#define GRID 20u            /* placements along x and along y */
#define COPIES (GRID * GRID)
#define MARKED 0xff0000ffu /* red */
#define OTHERS 0xffffffffu
#define GOOD "torus.stroll"
#define BAD "claims.stroll"

static built_model model; /* the good one */

static int create_model(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    mesh_file mesh = {0};
    mesh_file_torus(&mesh, 120, 120);
    mesh_file_write_ply(&mesh, built_path("torus.ply"));
    mesh_file_free(&mesh);
    sample_tree_build("torus.ply", GOOD, (strl_build_desc){0});
    built_open(&model, built_path(GOOD));
    assert_true(model.node[0].child_count > 0);
    return 0;
}

static int destroy_model(void **state)
{
    built_close(&model);
    return built_teardown(state);
}

/* ---- the lie */

typedef struct claim {
    uint8_t side;
    uint32_t marked; /* that many from the first on, red */
    uint32_t unseen; /* that many from the first on, of the smallest cells in a corner of the box */
} claim;

/* In the inner half of the box, from which a 32nd of a cell does not lead out. */
static int64_t place_of(const strl_node *record, int axis, uint32_t part)
{
    int64_t edge = record->box_max[axis] - record->box_min[axis];
    return record->box_min[axis] + edge / 4 + edge * part / (2 * (int64_t)ALONG);
}

/* The root's finest splats are as many as can be, all of cells that a pixel never covers; what is below it is wanted in
 * any case. */
static bool claim_splats(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    const claim *told = context;
    (void)mesh;
    if (id != 0)
        return false;
    for (uint32_t i = 0; i < SPLATS; i++) {
        test_brick_splat *splat = &brick->splat[i];
        *splat = (test_brick_splat){
            .side = told->side, .coverage = 255, .parallel = 255, .rgba = i < told->marked ? MARKED : OTHERS};
        splat->normal[0] = splat->normal[1] = 128;
        for (int k = 0; k < 3; k++)
            splat->centre[k] = (i < told->unseen ? record->box_min[k] : place_of(record, k, i >> 4 * (2 - k) & 15)) -
                               record->anchor[k];
        splat->side = i < told->unseen ? 0 : told->side;
    }
    for (uint32_t i = 0; i < brick->level_count; i++)
        brick->level[i] = (test_brick_level){brick->level[0].size, (uint16_t)(i + 1 < brick->level_count ? 0 : SPLATS)};
    brick->splat_count = SPLATS;
    return false;
}

/* ---- frames */

typedef struct counted {
    uint64_t points, marked;
    uint32_t of_placement[COPIES]; /* of those that have items of their own */
} counted;

static counted count_points(const strl_draw_list *list)
{
    counted found = {0};
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        if (!(item->point_px > 0))
            continue;
        assert_true(item->draw_count <= item->vertex_count);
        found.points += item->draw_count;
        if (item->placement != STRL_NONE)
            found.of_placement[item->placement] += item->draw_count;
        for (uint32_t v = 0; v < item->draw_count; v++)
            found.marked += item->vertices[v].rgba[1] == 0;
    }
    return found;
}

/* Of the first frames of a walk to which nothing comes but what opening reads. */
static counted see_first_frames(const strl_camera *camera)
{
    size_t size;
    uint8_t *bytes = built_read_file(built_path(BAD), &size);
    watched_source *source = watched_source_open(memory_source(bytes, size));
    strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = 1});
    counted found, again;
    source->walking = true;
    source->hold_percent = 100;
    strl_draw_list list = walk_frame(walk, camera);
    assert_true(strl_walk_get_stats(walk)->missing_nodes > 0);
    found = count_points(&list);
    assert_int_equal(found.points, strl_walk_get_stats(walk)->splats);
    list = walk_frame(walk, camera);
    again = count_points(&list);
    assert_memory_equal(&found, &again, sizeof found); /* each frame may do as much */
    source->hold_percent = 0;
    strl_walk_close(walk);
    free(bytes);
    return found;
}

static double width(int axis)
{
    return model.tree.step * (double)(model.tree.box_max[axis] - model.tree.box_min[axis]);
}

static double middle(int axis)
{
    return model.tree.origin[axis] +
           model.tree.step * (double)(model.tree.box_max[axis] + model.tree.box_min[axis]) / 2;
}

/* From above: `wide` world units fill the height of the image. */
static strl_camera above(double x, double y, double wide)
{
    const double fov = 10, height = wide / 2 / tan(fov / 2 * M_PI / 180);
    return (strl_camera){.eye = {x, y, middle(2) + height},
                         .target = {x, y, middle(2)},
                         .up = {0, 1, 0},
                         .fov_y_deg = fov,
                         .width = 900,
                         .height = 900};
}

/* ---- tests */

/* 400 copies in sight, each of 4,096 splats some pixels large: 1.6 million. */
static void many_copies_share_the_work_of_a_frame(void **state)
{
    (void)state;
    static strl_placement placement[COPIES];
    const double apart = 1.1 * fmax(width(0), width(1)), centre = (GRID - 1) / 2.0 * apart;
    claim told = {.side = 0};
    while (ldexp(model.tree.step, told.side + 1) < width(0) / ALONG)
        told.side++;
    for (uint32_t i = 0; i < COPIES; i++)
        placement[i] =
            (strl_placement){.transform = {1, 0, 0, i % GRID * apart, 0, 1, 0, i / GRID * apart, 0, 0, 1, 0}};
    plant_placed_bricks(GOOD, BAD, claim_splats, &told, placement, COPIES);
    strl_camera camera = above(middle(0) + centre, middle(1) + centre, 1.2 * GRID * apart);
    camera.eye[1] += GRID * apart; /* the last ones are the nearest */
    const counted found = see_first_frames(&camera);
    if (found.points > MOST_POINTS)
        fail_msg("%llu points close the holes of a frame", (unsigned long long)found.points);
    assert_true(found.points > MOST_POINTS / 2); /* the rest is what looking takes */
    for (uint32_t i = 0; i < MOST_POINTS / 2 / SPLATS; i++)
        assert_int_equal(found.of_placement[COPIES - 1 - i], SPLATS);
    assert_int_equal(found.of_placement[0], 0);
}

/* 4,096 cells in one brick, each so much larger than any point that it is covered by 1,024: four millions. */
static void cells_larger_than_any_point_share_it_too(void **state)
{
    (void)state;
    claim told = {.side = 0, .marked = 100};
    while (ldexp(model.tree.step, told.side) < width(0))
        told.side++;
    plant_bricks(GOOD, BAD, claim_splats, &told);
    const strl_camera camera = above(middle(0), middle(1), width(0) / 8);
    const counted found = see_first_frames(&camera);
    if (found.points > MOST_POINTS)
        fail_msg("%llu points close the holes of a frame", (unsigned long long)found.points);
    assert_true(found.points > MOST_POINTS / 2);
    assert_int_equal(found.marked, 100 * 1024); /* all of those that come first */
}

/* The work may end at any splat, and with any rest: what has been looked at takes some of it as well. */
static void the_work_ends_wherever_it_ends(void **state)
{
    (void)state;
    claim told = {.side = 0};
    while (ldexp(model.tree.step, told.side) < width(0))
        told.side++;
    const strl_camera camera = above(middle(0), middle(1), width(0) / 8);
    for (told.unseen = 0; told.unseen < 1000; told.unseen += 37) {
        plant_bricks(GOOD, BAD, claim_splats, &told);
        const counted found = see_first_frames(&camera);
        if (found.points > MOST_POINTS)
            fail_msg("%llu points close the holes of a frame, %u splats being out of sight",
                     (unsigned long long)found.points, told.unseen);
        assert_true(found.points > MOST_POINTS / 2);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(many_copies_share_the_work_of_a_frame),
        cmocka_unit_test(cells_larger_than_any_point_share_it_too),
        cmocka_unit_test(the_work_ends_wherever_it_ends),
    };
    return cmocka_run_group_tests(tests, create_model, destroy_model);
}
