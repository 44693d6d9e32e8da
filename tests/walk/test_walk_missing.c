/* A walk through a sample tree of which little has arrived: what is not there yet leaves no hole. The model is a ball,
 * so that which pixels it covers is known without the library. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/hash.h"
#include "base/memory.h"
#include "build/sample_tree.h"
#include "walk/walk_checks.h"

#define RINGS 300u
#define SECTORS (2 * RINGS)
#define RADIUS 0.5
#define WIDTH 640
#define HEIGHT 480
#define FOV 60.0
#define PI 3.14159265358979323846
#define MOST_COARSER 1.5 /* two steps of the allowed error: it becomes finer where a tenth of the memory stays free */
#define MOST_UNCOVERED 0.0002 /* of the ball: planes in its cells meet at an angle */

/* The ball on its own lattice and on coarse ones, which need not fill the cube of the octree. */
#define LATTICES 3
static uint8_t *bytes[LATTICES];
static size_t size[LATTICES];
static bool covered[HEIGHT][WIDTH];

static int create_ball(void **state)
{
    if (built_setup(state) != 0)
        return -1;
    mesh_file mesh = {0};
    for (uint32_t ring = 0; ring <= RINGS; ring++)
        for (uint32_t sector = 0; sector < SECTORS; sector++) {
            double across = PI * ring / RINGS, around = 2 * PI * sector / SECTORS;
            mesh_file_add_vertex(&mesh, RADIUS * sin(across) * cos(around), RADIUS * sin(across) * sin(around),
                                 RADIUS * cos(across));
        }
    for (uint32_t ring = 0; ring < RINGS; ring++)
        for (uint32_t sector = 0; sector < SECTORS; sector++) {
            uint32_t a = ring * SECTORS + sector, b = ring * SECTORS + (sector + 1) % SECTORS;
            mesh_file_add_face(&mesh, a, a + SECTORS, b + SECTORS);
            mesh_file_add_face(&mesh, a, b + SECTORS, b);
        }
    mesh_file_write_ply(&mesh, built_path("ball.ply"));
    mesh_file_free(&mesh);
    const strl_build_desc lattices[LATTICES] = {{0}, {.compact = true}, {.grid = 1.0 / 1024}};
    for (int i = 0; i < LATTICES; i++) {
        sample_tree_build("ball.ply", "ball.stroll", lattices[i]);
        bytes[i] = built_read_file(built_path("ball.stroll"), &size[i]);
    }
    return 0;
}

static int destroy_ball(void **state)
{
    for (int i = 0; i < LATTICES; i++)
        free(bytes[i]);
    return built_teardown(state);
}

/* Along x, looking at the middle. */
static strl_camera camera_at(double distance)
{
    return (strl_camera){.eye = {distance, 0, 0}, .up = {0, 0, 1}, .fov_y_deg = FOV, .width = WIDTH, .height = HEIGHT};
}

/* ---- an image of what is covered: by points that are drawn as every second pixel at least, and by triangles */

typedef struct pixel_place {
    double x, y, depth;
} pixel_place;

static pixel_place project(const strl_draw_item *item, const strl_vertex *vertex, double distance)
{
    const strl_camera camera = camera_at(distance);
    double pixel[2], depth;
    project_vertex(&camera, item, vertex, pixel, &depth);
    return (pixel_place){pixel[0], pixel[1], depth};
}

/* Of the half that is seen: the other one covers the same pixels and would hide what is missing. */
static bool is_before(const pixel_place *p, double distance)
{
    return p->depth > 0 && p->depth < distance;
}

static int bounded(double value, int most)
{
    return value < 0 ? 0 : value > most ? most : (int)value;
}

static void cover_point(const strl_draw_item *item, const strl_vertex *vertex, double distance)
{
    pixel_place p = project(item, vertex, distance);
    double half = (double)item->point_px / 2;
    if (!is_before(&p, distance) || vertex->rgba[3] < 128)
        return;
    for (int y = bounded(ceil(p.y - half - 0.5), HEIGHT); y < bounded(p.y + half + 0.5, HEIGHT); y++)
        for (int x = bounded(ceil(p.x - half - 0.5), WIDTH); x < bounded(p.x + half + 0.5, WIDTH); x++)
            covered[y][x] = true;
}

static double edge(const pixel_place *a, const pixel_place *b, double x, double y)
{
    return (b->x - a->x) * (y - a->y) - (b->y - a->y) * (x - a->x);
}

static void cover_triangle(const strl_draw_item *item, const uint16_t *corner, double distance)
{
    pixel_place p[3];
    for (int c = 0; c < 3; c++) {
        p[c] = project(item, &item->vertices[corner[c]], distance);
        if (!is_before(&p[c], distance))
            return;
    }
    double least[2] = {fmin(p[0].x, fmin(p[1].x, p[2].x)), fmin(p[0].y, fmin(p[1].y, p[2].y))};
    double most[2] = {fmax(p[0].x, fmax(p[1].x, p[2].x)), fmax(p[0].y, fmax(p[1].y, p[2].y))};
    for (int y = bounded(least[1] - 0.5, HEIGHT); y < bounded(most[1] + 1, HEIGHT); y++)
        for (int x = bounded(least[0] - 0.5, WIDTH); x < bounded(most[0] + 1, WIDTH); x++) {
            double a = edge(&p[0], &p[1], x + 0.5, y + 0.5), b = edge(&p[1], &p[2], x + 0.5, y + 0.5),
                   c = edge(&p[2], &p[0], x + 0.5, y + 0.5);
            if ((a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0))
                covered[y][x] = true;
        }
}

/* Share of the pixels within the ball's outline, less two, that nothing covers. */
static double uncovered_share(const strl_draw_list *list, double distance)
{
    uint32_t pixels = 0, open = 0;
    double focal = HEIGHT / 2.0 / tan(FOV / 2 * PI / 180),
           outline = focal * RADIUS / sqrt(distance * distance - RADIUS * RADIUS) - 2;
    memset(covered, 0, sizeof covered);
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        for (uint32_t k = 0; k < item->draw_count && item->visible; k += item->point_px > 0 ? 1 : 3)
            if (item->point_px > 0)
                cover_point(item, &item->vertices[item->indices[k]], distance);
            else
                cover_triangle(item, &item->indices[item->draw_first + k], distance);
    }
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            if (hypot(x + 0.5 - WIDTH / 2.0, y + 0.5 - HEIGHT / 2.0) < outline) {
                pixels++;
                open += !covered[y][x];
            }
    assert_true(pixels > 3000);
    return (double)open / pixels;
}

/* ---- tests */

/* Nothing but what opening reads. */
static void check_first_image(int lattice)
{
    for (double distance = 1.2; distance < 4; distance += 0.4) {
        watched_source *source = watched_source_open(memory_source(bytes[lattice], size[lattice]));
        strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = 1});
        source->walking = true;
        source->hold_percent = 100;
        const strl_camera camera = camera_at(distance);
        strl_draw_list list = walk_frame(walk, &camera);
        assert_true(strl_walk_get_stats(walk)->missing_nodes > 0);
        double share = uncovered_share(&list, distance);
        if (share > MOST_UNCOVERED)
            fail_msg("lattice %d, at %g %g of the ball are open", lattice, distance, share);
        source->hold_percent = 0;
        strl_walk_close(walk);
    }
}

static void the_first_image_has_no_hole(void **state)
{
    (void)state;
    for (int lattice = 0; lattice < LATTICES; lattice++)
        check_first_image(lattice);
}

/* From the first image to the last, also where cells are larger than any point can be. */
static void nor_has_any_that_comes_behind_it(void **state)
{
    (void)state;
    for (double distance = 0.53; distance < 1.6; distance *= 1.2) {
        watched_source *source = watched_source_open(memory_source(bytes[0], size[0]));
        strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = 1});
        const strl_camera camera = camera_at(distance);
        source->walking = true;
        source->hold_percent = 90;
        unsigned late = 0;
        for (unsigned frame = 0; frame < 2000 && (frame == 0 || !strl_walk_settled(walk)); frame++) {
            strl_draw_list list = walk_frame(walk, &camera);
            double share = uncovered_share(&list, distance);
            if (share > MOST_UNCOVERED)
                fail_msg("at %g %g of the ball are open in frame %u", distance, share, frame);
            late += strl_walk_get_stats(walk)->missing_nodes > 0;
            strl_walk_pump(walk, UINT64_MAX);
        }
        assert_true(strl_walk_settled(walk) && late > 2);
        strl_walk_close(walk);
    }
}

/* Nearer and nearer: what is held of a brick no longer does, and more of it is on its way. */
static void nor_has_any_on_the_way_there(void **state)
{
    (void)state;
    watched_source *source = watched_source_open(memory_source(bytes[0], size[0]));
    strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = 1});
    unsigned late = 0, frames = 0;
    source->walking = true;
    for (double distance = 4; distance > 0.55; distance *= 0.96, frames++) {
        const strl_camera camera = camera_at(distance);
        source->hold_percent = frames < 3 ? 0 : 95;
        strl_draw_list list = walk_frame(walk, &camera);
        double share = uncovered_share(&list, distance);
        if (share > MOST_UNCOVERED)
            fail_msg("at %g %g of the ball are open", distance, share);
        late += strl_walk_get_stats(walk)->missing_nodes > 0;
        strl_walk_pump(walk, UINT64_MAX);
    }
    assert_true(late > 0 && late < frames);
    strl_walk_close(walk);
}

/* Positions and colours of the corners of all that is drawn, in whatever order. */
static uint64_t hash_of_list(const strl_draw_list *list)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        for (uint32_t k = 0; k < item->draw_count; k++) {
            const strl_vertex *vertex = &item->vertices[item->indices[k]];
            uint64_t one = k % 3;
            for (int axis = 0; axis < 3; axis++)
                one = strl__mix64(one ^ (uint64_t)(item->anchor[axis] + vertex->position[axis]));
            sum += strl__mix64(one ^ (uint64_t)vertex->normal[0] << 48 ^ (uint64_t)vertex->normal[1] << 32 ^
                               (uint64_t)(vertex->rgba[0] | vertex->rgba[1] << 8 | vertex->rgba[2] << 16) << 8 ^
                               vertex->rgba[3]);
        }
    }
    return sum;
}

static strl_walk *settled_walk(double distance, uint64_t *triangles, uint64_t *hash)
{
    strl_walk *walk = open_walk(memory_source(bytes[0], size[0]), &(strl_walk_desc){.error_px = 1});
    const strl_camera camera = camera_at(distance);
    strl_draw_list list = settle(walk, &camera, 2000);
    *triangles = strl_walk_get_stats(walk)->triangles;
    *hash = hash_of_list(&list);
    return walk;
}

/* Of a brick that is seen from afar only what it shows is held, and nothing else differs: nearer, more of it comes;
 * back again, it is there. */
static void of_what_is_far_little_is_held(void **state)
{
    (void)state;
    const double distances[] = {40, 16, 10, 6, 4, 2.5, 1.6, 1.2, 0.8, 5, 40};
    strl_walk *walk = open_walk(memory_source(bytes[0], size[0]), &(strl_walk_desc){.error_px = 1});
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    uint64_t most = 0;
    for (size_t i = 0; i < sizeof distances / sizeof *distances; i++) {
        const strl_camera camera = camera_at(distances[i]);
        strl_draw_list list = settle(walk, &camera, 2000);
        uint64_t triangles, hash, before = most;
        strl_walk *fresh = settled_walk(distances[i], &triangles, &hash);
        uint64_t fresh_bytes = strl_walk_get_stats(fresh)->resident_bytes;
        assert_int_equal(stats->triangles, triangles);
        assert_true(hash_of_list(&list) == hash);
        assert_int_equal(stats->missing_nodes, 0);
        most = stats->resident_bytes > most ? stats->resident_bytes : most;
        if (i + 1 == sizeof distances / sizeof *distances)
            assert_true(fresh_bytes < before / 2 &&
                        stats->resident_bytes > fresh_bytes); /* it stays while there is room */
        strl_walk_close(fresh);
    }
    strl_walk_close(walk);
}

/* How much of a brick will be held is estimated: whatever comes of that, it settles within its budget. */
static void it_settles_with_little_memory(void **state)
{
    (void)state;
    const double distances[] = {40, 20, 6, 30, 1.2, 40};
    for (uint64_t megabytes = 2; megabytes <= 16; megabytes *= 2) {
        strl_walk *walk = open_walk(memory_source(bytes[0], size[0]),
                                    &(strl_walk_desc){.error_px = 0.5, .memory_bytes = megabytes << 20});
        for (size_t i = 0; i < sizeof distances / sizeof *distances; i++) {
            const strl_camera camera = camera_at(distances[i]);
            settle(walk, &camera, 2000);
            assert_true(strl_walk_get_stats(walk)->resident_bytes <= megabytes << 20);
            assert_int_equal(strl_walk_get_stats(walk)->missing_nodes, 0);
        }
        strl_walk_close(walk);
    }
}

/* Who comes from near holds whole bricks of which little shows from afar: what is too much of them goes where room is
 * wanted, and the image is as fine as that of who never was near. What more memory allows is used. */
static void from_near_it_is_as_fine_as_from_afar(void **state)
{
    (void)state;
    const double distances[] = {1.2, 1.6, 2.5, 4, 6, 10};
    double before[sizeof distances / sizeof *distances];
    unsigned tight = 0;
    for (uint64_t kilobytes = 1024; kilobytes <= 16384; kilobytes *= 2) {
        const strl_walk_desc desc = {.error_px = 0.5, .memory_bytes = kilobytes << 10};
        strl_walk *walk = open_walk(memory_source(bytes[0], size[0]), &desc);
        for (size_t i = 0; i < sizeof distances / sizeof *distances; i++) {
            strl_walk *fresh = open_walk(memory_source(bytes[0], size[0]), &desc);
            const strl_camera camera = camera_at(distances[i]);
            strl_draw_list list = settle(walk, &camera, 2000), fresh_list = settle(fresh, &camera, 2000);
            double px = strl_walk_get_stats(walk)->allowed_error_px,
                   fresh_px = strl_walk_get_stats(fresh)->allowed_error_px;
            if (px > MOST_COARSER * fresh_px)
                fail_msg("with %u KiB, at %g, %g pixels are allowed, %g on a walk that begins there",
                         (unsigned)kilobytes, distances[i], px, fresh_px);
            if (px == fresh_px)
                assert_true(hash_of_list(&list) == hash_of_list(&fresh_list));
            assert_true(kilobytes == 1024 || fresh_px <= before[i]);
            before[i] = fresh_px;
            tight += fresh_px > 0.5;
            strl_walk_close(fresh);
        }
        strl_walk_close(walk);
    }
    assert_true(tight > 3);
}

/* What has settled stays as it is while the camera stands, but for little: of bricks more may come that is only likely
 * to be wanted. */
static void what_has_settled_stays(void **state)
{
    (void)state;
    unsigned changed = 0, all = 0;
    for (double distance = 0.6; distance < 6; distance *= 1.25)
        for (uint64_t kilobytes = 1024; kilobytes <= 8192; kilobytes *= 2, all++) {
            strl_walk *walk = open_walk(memory_source(bytes[0], size[0]),
                                        &(strl_walk_desc){.error_px = 0.5, .memory_bytes = kilobytes << 10});
            const strl_camera camera = camera_at(distance);
            settle(walk, &camera, 2000);
            double settled_px = strl_walk_get_stats(walk)->allowed_error_px;
            for (unsigned frame = 0; frame < 100; frame++) {
                walk_frame(walk, &camera);
                strl_walk_pump(walk, UINT64_MAX);
            }
            double px = strl_walk_get_stats(walk)->allowed_error_px;
            changed += px != settled_px;
            strl_walk_close(walk);
        }
    if (20 * changed > all) /* what is prefetched changes estimates: now and then a step more fits by them */
        fail_msg("%u of %u that had settled changed", changed, all);
}

/* ---- what goes wrong on the way to more or less of a brick */

/* Near enough that of all bricks more is wanted than from afar, and back. */
static const double trip[] = {6, 1.6, 6, 4, 1.2, 6};

/* Once nothing is missing (settled does not tell that: it waits for nothing that failed three times) it shows what a
 * walk shows that never had to do with any of that. */
static void check_settles_right(strl_walk *walk, double distance)
{
    const strl_camera camera = camera_at(distance);
    uint64_t triangles, hash;
    strl_draw_list list = settle(walk, &camera, 5000);
    for (unsigned frame = 0; frame < 5000 && strl_walk_get_stats(walk)->missing_nodes > 0; frame++) {
        strl_walk_pump(walk, UINT64_MAX);
        list = walk_frame(walk, &camera);
    }
    strl_walk_close(settled_walk(distance, &triangles, &hash));
    assert_int_equal(strl_walk_get_stats(walk)->missing_nodes, 0);
    assert_int_equal(strl_walk_get_stats(walk)->triangles, triangles);
    assert_true(hash_of_list(&list) == hash);
}

/* At each n-th allocation, whichever that is: asking, decoding, replacing, dropping. */
static void without_memory_it_keeps_what_it_has(void **state)
{
    (void)state;
    const uint64_t budgets[] = {0, (uint64_t)3 << 20};
    unsigned failed = 0;
    for (unsigned i = 0; i < 2; i++)
        for (uint64_t n = 1; n < 80; n += 1 + n) {
            strl_walk *walk = open_walk(memory_source(bytes[0], size[0]),
                                        &(strl_walk_desc){.error_px = 1, .memory_bytes = budgets[i]});
            for (size_t at = 0; at < sizeof trip / sizeof *trip; at++) {
                const strl_camera camera = camera_at(trip[at]);
                for (unsigned frame = 0; frame < 6; frame++) {
                    strl_draw_list list;
                    bool fails = walk_frame_without_memory(walk, &camera, n, &list) != STRL_OK;
                    failed += fails || strl_walk_get_stats(walk)->faults > 0;
                    /* splats of tens of pixels are as transparent as what they stand for is open */
                    if (!fails && budgets[i] == 0)
                        assert_true(uncovered_share(&list, trip[at]) <= MOST_UNCOVERED);
                }
            }
            if (budgets[i] == 0)
                check_settles_right(walk, trip[5]);
            strl_walk_close(walk);
        }
    assert_true(failed > 10);
}

/* Each third read fails. */
static void where_reads_fail_it_keeps_what_it_has(void **state)
{
    (void)state;
    strl_source *failing;
    assert_int_equal(strl_source_open_delayed(memory_source(bytes[0], size[0]), 0, 3, &failing, NULL), STRL_OK);
    strl_walk *walk = open_walk(failing, &(strl_walk_desc){.error_px = 1, .memory_bytes = (uint64_t)7 << 20});
    uint64_t faults = 0;
    for (size_t at = 0; at < sizeof trip / sizeof *trip; at++) {
        const strl_camera camera = camera_at(trip[at]);
        for (unsigned frame = 0; frame < 200; frame++) {
            strl_draw_list list = walk_frame(walk, &camera);
            if (frame % 40 == 0 && strl_walk_get_stats(walk)->allowed_error_px <= 2)
                assert_true(uncovered_share(&list, trip[at]) <= MOST_UNCOVERED);
            strl_walk_pump(walk, UINT64_MAX);
        }
        faults = strl_walk_get_stats(walk)->faults;
    }
    assert_true(faults > 0);
    check_settles_right(walk, trip[5]);
    strl_walk_close(walk);
}

/* More was asked for, and who asked has gone away again before it came: the read is cancelled, the brick as it was. */
static void what_nobody_wants_any_more_is_not_waited_for(void **state)
{
    (void)state;
    watched_source *source = watched_source_open(memory_source(bytes[0], size[0]));
    strl_walk *walk = open_walk(&source->base, &(strl_walk_desc){.error_px = 1});
    const strl_camera far = camera_at(30), near = camera_at(1.2);
    settle(walk, &far, 2000);
    source->walking = true;
    source->hold_percent = 100;
    for (unsigned frame = 0; frame < 80; frame++) /* until no page is kept from which it could come */
        walk_frame(walk, &near);
    assert_true(strl_walk_get_stats(walk)->missing_nodes > 0 && !strl_walk_settled(walk));
    uint32_t pending = strl_walk_get_stats(walk)->requests_pending;
    for (unsigned frame = 0; frame < 40; frame++)
        walk_frame(walk, &far);
    assert_true(strl_walk_settled(walk));
    source->hold_percent = 0;
    for (unsigned frame = 0; frame < 40; frame++) {
        walk_frame(walk, &far);
        strl_walk_pump(walk, UINT64_MAX);
    }
    assert_true(pending > 0);
    assert_int_equal(strl_walk_get_stats(walk)->requests_pending, 0);
    source->walking = false;
    check_settles_right(walk, 30);
    check_settles_right(walk, 1.2);
    strl_walk_close(walk);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_image_has_no_hole),
        cmocka_unit_test(nor_has_any_that_comes_behind_it),
        cmocka_unit_test(nor_has_any_on_the_way_there),
        cmocka_unit_test(of_what_is_far_little_is_held),
        cmocka_unit_test(it_settles_with_little_memory),
        cmocka_unit_test(from_near_it_is_as_fine_as_from_afar),
        cmocka_unit_test(what_has_settled_stays),
        cmocka_unit_test(without_memory_it_keeps_what_it_has),
        cmocka_unit_test(where_reads_fail_it_keeps_what_it_has),
        cmocka_unit_test(what_nobody_wants_any_more_is_not_waited_for),
    };
    return cmocka_run_group_tests(tests, create_ball, destroy_ball);
}
