/* Images of the GL backends: alike, free of cracks, and independent of how the vertices got there. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <epoxy/gl.h>

#include "render/glcommon/context.h"
#include "render/patches.h"
#include "stroll/render.h"

#define WIDTH 160u
#define HEIGHT 120u
#define PIXELS (WIDTH * HEIGHT)

typedef struct picture {
    uint8_t rgba[PIXELS][4];
    float depth[PIXELS];
    strl_render_stats stats;
} picture;

static strl_renderer *make(strl_renderer_desc desc)
{
    strl_renderer *renderer = NULL;
    strl_error err;
    desc.width = desc.width ? desc.width : WIDTH;
    desc.height = desc.height ? desc.height : HEIGHT;
    if (strl_renderer_create(&desc, &renderer, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return renderer;
}

static void shoot(strl_renderer *renderer, const strl_camera *camera, const strl_draw_list *list,
                  const strl_draw_options *options, picture *out)
{
    strl_error err = {0};
    if (strl_renderer_draw(renderer, camera, list, options, &out->stats, &err) != STRL_OK ||
        strl_renderer_read_colour(renderer, out->rgba[0], &err) != STRL_OK ||
        strl_renderer_read_depth(renderer, out->depth, &err) != STRL_OK)
        fail_msg("%s", err.message);
}

static void shoot_once(strl_renderer_desc desc, const strl_camera *camera, const strl_draw_list *list,
                       const strl_draw_options *options, picture *out)
{
    strl_renderer *renderer = make(desc);
    shoot(renderer, camera, list, options, out);
    strl_renderer_destroy(renderer);
}

/* Pixels whose colour differs by more than `steps` in some channel, or whose depth by more than a hundred-thousandth
 * (linear depth, of orthographic cameras: a ten-millionth of the range). */
static int count_different(const picture *a, const picture *b, int steps)
{
    int different = 0;
    for (size_t p = 0; p < PIXELS; p++) {
        bool differs = isinf(a->depth[p]) != isinf(b->depth[p]) ||
                       (!isinf(a->depth[p]) && fabsf(a->depth[p] - b->depth[p]) > 1e-5f * a->depth[p] + 1e-4f);
        for (int c = 0; c < 4; c++)
            differs = differs || abs(a->rgba[p][c] - b->rgba[p][c]) > steps;
        different += differs;
    }
    return different;
}

static int count_covered(const picture *a)
{
    int covered = 0;
    for (size_t p = 0; p < PIXELS; p++)
        covered += !isinf(a->depth[p]);
    return covered;
}

static void every_backend_gives_the_same_picture(void **state)
{
    (void)state;
    static const strl_renderer_desc others[] = {{.backend = STRL_BACKEND_GL3},
                                                {.backend = STRL_BACKEND_GL3, .core_only = true},
                                                {.backend = STRL_BACKEND_GL3, .gles = true},
                                                {.backend = STRL_BACKEND_GL3, .gles = true, .core_only = true}};
    static picture first, other;
    patches all;
    patches_init(&all, (patches_desc){.side = 4});
    for (int mode = 0; mode < 5; mode++) {
        strl_draw_options options = {
            .flat = mode == 1, .debug = mode == 3 ? STRL_DEBUG_CLUSTER : STRL_DEBUG_NONE, .background = {30, 60, 90}};
        strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, mode == 4 ? 0.9 : 0.25);
        if (mode == 2)
            camera.fov_y_deg = 0, camera.ortho_height = 60, camera.eye[2] += 40;
        shoot_once((strl_renderer_desc){.backend = STRL_BACKEND_GL45}, &camera, &all.list, &options, &first);
        assert_in_range(count_covered(&first), PIXELS / 4, PIXELS);
        for (size_t o = 0; o < sizeof others / sizeof *others; o++) {
            shoot_once(others[o], &camera, &all.list, &options, &other);
            assert_in_range(count_different(&first, &other, 2), 0, PIXELS / 1000);
        }
    }
    patches_deinit(&all);
}

static void wireframes_leave_holes_on_every_backend(void **state)
{
    (void)state;
    static const strl_renderer_desc descs[] = {
        {.backend = STRL_BACKEND_GL45}, {.backend = STRL_BACKEND_GL3}, {.backend = STRL_BACKEND_GL3, .gles = true}};
    static picture lines, filled;
    patches all;
    patches_init(&all, (patches_desc){.side = 2});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.1);
    const strl_draw_options options = {.wireframe = true};
    for (int d = 0; d < 3; d++) {
        strl_renderer *renderer = make(descs[d]);
        shoot(renderer, &camera, &all.list, &options, &lines);
        shoot(renderer, &camera, &all.list, NULL, &filled);
        strl_renderer_destroy(renderer);
        assert_in_range(count_covered(&lines), PIXELS / 20, count_covered(&filled) * 9 / 10);
    }
    patches_deinit(&all);
}

/* From above and from below; as it is, mirrored, turned over by mirroring twice; lit, thinned out, as a wireframe; with
 * splats, which have no back. */
static void backs_are_not_drawn_where_the_list_says_so(void **state)
{
    (void)state;
    static const strl_renderer_desc descs[] = {{.backend = STRL_BACKEND_GL45},
                                               {.backend = STRL_BACKEND_GL3},
                                               {.backend = STRL_BACKEND_GL3, .core_only = true},
                                               {.backend = STRL_BACKEND_GL3, .gles = true}};
    static const double scales[3][3] = {{1, 1, 1}, {-1, 1, 1}, {-1, 1, -1}};
    static picture culled, both;
    for (size_t d = 0; d < sizeof descs / sizeof *descs; d++)
        for (int mode = 0; mode < 24; mode++) {
            bool below = mode & 1, orthographic = mode & 2, translucent = mode & 4;
            const double *scale = scales[mode / 8];
            patches all;
            patches_init(&all, (patches_desc){.side = 2, .flat = true, .alpha = translucent ? 128 : 255});
            strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.6);
            camera.up[0] = 0, camera.up[1] = 1, camera.up[2] = 0;
            if (orthographic)
                camera.fov_y_deg = 0, camera.ortho_height = 60;
            for (int k = 0; k < 3; k++) {
                camera.eye[k] *= scale[k], camera.target[k] *= scale[k];
                for (uint32_t i = 0; i < all.count; i++)
                    all.items[i].transform[5 * k] = scale[k];
            }
            camera.eye[2] = below != (scale[2] < 0) ? -fabs(camera.eye[2]) : fabs(camera.eye[2]);
            strl_renderer *renderer = make(descs[d]);
            shoot(renderer, &camera, &all.list, NULL, &both);
            all.list.cull = STRL_CULL_BACK;
            shoot(renderer, &camera, &all.list, NULL, &culled);
            assert_true(count_covered(&both) > (int)PIXELS / 10);
            assert_int_equal(count_covered(&culled), below ? 0 : count_covered(&both));
            for (uint32_t i = 0; i < all.count; i++)
                all.items[i].point_px = 9;
            all.list.frame++;
            shoot(renderer, &camera, &all.list, NULL, &culled);
            assert_true(count_covered(&culled) > (int)PIXELS / 20);
            for (uint32_t i = 0; i < all.count; i++) /* what was set is not left behind */
                all.items[i].point_px = 0;
            all.list.cull = STRL_CULL_NONE;
            shoot(renderer, &camera, &all.list, NULL, &culled);
            assert_int_equal(count_different(&culled, &both, 0), 0);
            strl_renderer_destroy(renderer);
            patches_deinit(&all);
        }
}

/* The two stand side by side and share a batch. */
static void mirrored_and_plain_placements_cull_in_one_list(void **state)
{
    (void)state;
    static picture culled, both;
    patches all;
    patches_init(&all, (patches_desc){.side = 2, .flat = true});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.6);
    camera.up[0] = 0, camera.up[1] = 1, camera.up[2] = 0;
    for (uint32_t i = 0; i < all.count; i += 2) { /* mirrored in the plane that the patch itself lies in */
        all.items[i].placement = 1;
        all.items[i].transform[10] = -1;
    }
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        all.list.cull = STRL_CULL_NONE;
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &all.list, NULL, &both);
        all.list.cull = STRL_CULL_BACK;
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &all.list, NULL, &culled);
        /* the mirrored ones look down */
        assert_in_range(count_covered(&culled), count_covered(&both) / 3, count_covered(&both) * 2 / 3);
    }
    patches_deinit(&all);
}

/* The flat square fills the image and every patch has its own anchor: one background pixel would be a crack. */
static void assert_no_crack(patches_desc desc, strl_backend backend)
{
    static picture shot;
    patches all;
    desc.flat = true;
    desc.side = 6;
    patches_init(&all, desc);
    strl_renderer *renderer = make((strl_renderer_desc){.backend = backend});
    for (int view = 0; view < 6; view++) {
        double extent = 6 * PATCH_SIDE * 1000 * 0x1p-10;
        double height = extent * 0.1 * pow(0.2, view);
        strl_camera camera = {.eye = {extent * (0.5 + 0.01 * view), extent * 0.47, height},
                              .up = {0.3 * view, 1, 0},
                              .fov_y_deg = 60,
                              .width = WIDTH,
                              .height = HEIGHT};
        camera.target[0] = camera.eye[0] + 0.2 * height, camera.target[1] = camera.eye[1] - 0.3 * height;
        all.list.near_distance = camera.eye[2] * 0.01;
        shoot(renderer, &camera, &all.list, NULL, &shot);
        assert_int_equal(count_covered(&shot), PIXELS);
    }
    strl_renderer_destroy(renderer);
    patches_deinit(&all);
}

static void nodes_with_different_anchors_meet_without_a_crack(void **state)
{
    (void)state;
    assert_no_crack((patches_desc){0}, STRL_BACKEND_GL45);
    assert_no_crack((patches_desc){0}, STRL_BACKEND_GL3);
}

static void cells_far_beyond_32_bits_draw_like_cells_near_zero(void **state)
{
    (void)state;
    static picture near, far;
    patches at_zero, far_out;
    patches_init(&at_zero, (patches_desc){.side = 4});
    patches_init(&far_out, (patches_desc){.side = 4, .shift = (int64_t)1 << 38});
    strl_camera camera = patches_camera(&at_zero, WIDTH, HEIGHT, 0.25);
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &at_zero.list, NULL, &near);
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &far_out.list, NULL, &far);
        assert_int_equal(count_different(&near, &far, 0), 0);
        /* A wide lattice seen as a whole: the eye's cell is more than 32 bits away from the vertices. */
        strl_camera distant = camera;
        distant.eye[2] += 6e6;
        distant.fov_y_deg = 0.001;
        strl_draw_list list = at_zero.list;
        list.far_distance = 1e8;
        shoot_once((strl_renderer_desc){.backend = backend}, &distant, &list, NULL, &near);
        assert_in_range(count_covered(&near), PIXELS / 4, PIXELS);
    }
    patches_deinit(&at_zero);
    patches_deinit(&far_out);
}

static void a_dirty_range_uploads_as_good_as_everything(void **state)
{
    (void)state;
    static picture partial, whole;
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        patches all;
        patches_init(&all, (patches_desc){.side = 2});
        strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.25);
        strl_renderer *renderer = make((strl_renderer_desc){.backend = backend});
        shoot(renderer, &camera, &all.list, NULL, &partial);
        assert_int_equal(partial.stats.uploaded_vertices, all.count * PATCH_VERTICES);
        /* Turns the diagonals of some quads of patch 1, and takes the last row of patch 2 away. */
        for (int q = 50; q < 90; q++) {
            uint16_t *corner = all.indices + PATCH_INDICES + 6 * q, a = corner[0], b = corner[2];
            memcpy(corner, (uint16_t[6]){a, (uint16_t)(a + 1), (uint16_t)(b + 1), a, (uint16_t)(b + 1), b}, 12);
        }
        all.items[1].state++, all.items[1].dirty_first = 300, all.items[1].dirty_count = 240;
        all.items[2].state++, all.items[2].index_count -= PATCH_SIDE * 6, all.items[2].draw_count -= PATCH_SIDE * 6;
        all.list.frame = 2;
        shoot(renderer, &camera, &all.list, NULL, &partial);
        assert_int_equal(partial.stats.uploaded_vertices, 0);
        assert_int_equal(partial.stats.uploaded_indices, 240);
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &all.list, NULL, &whole);
        assert_int_equal(count_different(&partial, &whole, 0), 0);
        /* A list was skipped: the range says nothing about what the GPU holds. */
        all.items[1].state++, all.items[1].dirty_count = 0;
        all.list.frame = 4;
        shoot(renderer, &camera, &all.list, NULL, &partial);
        assert_int_equal(partial.stats.uploaded_indices, PATCH_INDICES);
        assert_int_equal(count_different(&partial, &whole, 0), 0);
        strl_renderer_destroy(renderer);
        patches_deinit(&all);
    }
}

static void a_node_that_refines_beyond_its_room_is_drawn_whole(void **state)
{
    (void)state;
    static picture grown, fresh;
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        patches all;
        patches_init(&all, (patches_desc){.side = 2});
        strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.25);
        strl_renderer *renderer = make((strl_renderer_desc){.backend = backend});
        all.items[3].index_count = all.items[3].draw_count = 60;
        shoot(renderer, &camera, &all.list, NULL, &grown);
        all.items[3].index_count = all.items[3].draw_count = PATCH_INDICES, all.items[3].state++;
        all.items[3].dirty_first = 60, all.items[3].dirty_count = PATCH_INDICES - 60;
        all.list.frame = 2;
        shoot(renderer, &camera, &all.list, NULL, &grown);
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &all.list, NULL, &fresh);
        assert_int_equal(count_different(&grown, &fresh, 0), 0);
        strl_renderer_destroy(renderer);
        patches_deinit(&all);
    }
}

static void a_list_larger_than_the_budget_is_drawn_whole_within_it(void **state)
{
    (void)state;
    static picture tight, roomy;
    patches all;
    patches_init(&all, (patches_desc){.side = 20});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.7);
    const strl_renderer_desc least = {.backend = STRL_BACKEND_GL45, .gpu_memory_bytes = STRL_RENDERER_LEAST_GPU_BYTES};
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        strl_renderer_desc desc = least;
        desc.backend = backend;
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &all.list, NULL, &roomy);
        assert_int_equal(roomy.stats.evictions, 0);
        strl_renderer *renderer = make(desc);
        for (int frame = 1; frame < 4; frame++) {
            all.list.frame = (uint64_t)frame;
            shoot(renderer, &camera, &all.list, NULL, &tight);
            assert_in_range(tight.stats.gpu_bytes, 1, STRL_RENDERER_LEAST_GPU_BYTES);
            assert_true(tight.stats.evictions > 100);
            assert_int_equal(tight.stats.triangles, roomy.stats.triangles);
            assert_int_equal(count_different(&tight, &roomy, 0), 0);
        }
        strl_renderer_destroy(renderer);
    }
    patches_deinit(&all);
}

/* Alpha is the share of pixels, and which ones depends on the pixel grid alone. */
static void alpha_is_a_pattern_fixed_to_the_pixel_grid(void **state)
{
    (void)state;
    static picture first, moved;
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        patches all;
        patches_init(&all, (patches_desc){.side = 2, .flat = true, .alpha = 64});
        strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.1);
        memcpy(camera.eye, (double[3]){camera.target[0], camera.target[1], 4}, sizeof camera.eye);
        strl_renderer *renderer = make((strl_renderer_desc){.backend = backend});
        shoot(renderer, &camera, &all.list, NULL, &first);
        camera.eye[0] += 1.7, camera.target[0] += 0.3;
        shoot(renderer, &camera, &all.list, NULL, &moved);
        assert_int_equal(count_covered(&first), PIXELS / 4);
        for (size_t p = 0; p < PIXELS; p++) {
            assert_true(isinf(first.depth[p]) == isinf(moved.depth[p]));
            assert_int_equal(first.rgba[p][3], isinf(first.depth[p]) ? 0 : 255);
        }
        strl_renderer_destroy(renderer);
        patches_deinit(&all);
    }
}

/* A plane across the view: the depth of each pixel is the distance of the plane along the view direction. */
static void depth_is_the_distance_along_the_view(void **state)
{
    (void)state;
    static picture shot;
    patches all;
    patches_init(&all, (patches_desc){.side = 6, .flat = true});
    double extent = 6 * PATCH_SIDE * 1000 * 0x1p-10;
    strl_camera camera = {.eye = {extent / 2, extent / 2, 33.25},
                          .target = {extent / 2, extent / 2, 0},
                          .up = {0, 1, 0},
                          .fov_y_deg = 60,
                          .width = WIDTH,
                          .height = HEIGHT};
    static const strl_renderer_desc descs[] = {{.backend = STRL_BACKEND_GL45},
                                               {.backend = STRL_BACKEND_GL3, .core_only = true},
                                               {.backend = STRL_BACKEND_GL3, .gles = true},
                                               {.backend = STRL_BACKEND_GL45, .supersample = 3}};
    for (int d = 0; d < 8; d++) {
        camera.fov_y_deg = d < 4 ? 60 : 0;
        camera.ortho_height = 40;
        shoot_once(descs[d % 4], &camera, &all.list, NULL, &shot);
        for (size_t p = 0; p < PIXELS; p++)
            assert_true(fabsf(shot.depth[p] - 33.25f) < 33.25f * (d < 4 ? 2e-6f : 1e-4f));
    }
    patches_deinit(&all);
}

/* Every backend cuts along the same plane, and only on the side of its normal. */
static void a_section_cuts_what_lies_before_it(void **state)
{
    (void)state;
    static picture whole, cut, other;
    static const strl_renderer_desc others[] = {{.backend = STRL_BACKEND_GL3},
                                                {.backend = STRL_BACKEND_GL3, .core_only = true},
                                                {.backend = STRL_BACKEND_GL3, .gles = true}};
    patches all;
    patches_init(&all, (patches_desc){.side = 6, .flat = true});
    double extent = 6 * PATCH_SIDE * 1000 * 0x1p-10;
    strl_camera camera = {.eye = {extent / 2, extent / 2, 33},
                          .target = {extent / 2, extent / 2, 0},
                          .up = {0, 1, 0},
                          .fov_y_deg = 60,
                          .width = WIDTH,
                          .height = HEIGHT};
    strl_draw_options options = {.section = {1, 0, 0, extent / 2}};
    for (int orthographic = 0; orthographic < 2; orthographic++) {
        camera.fov_y_deg = orthographic ? 0 : 60, camera.ortho_height = 40;
        shoot_once((strl_renderer_desc){.backend = STRL_BACKEND_GL45}, &camera, &all.list, NULL, &whole);
        shoot_once((strl_renderer_desc){.backend = STRL_BACKEND_GL45}, &camera, &all.list, &options, &cut);
        assert_int_equal(count_covered(&whole), PIXELS);
        for (size_t p = 0; p < PIXELS; p++)
            assert_true(isinf(cut.depth[p]) == (p % WIDTH >= WIDTH / 2));
        for (size_t o = 0; o < sizeof others / sizeof *others; o++) {
            shoot_once(others[o], &camera, &all.list, &options, &other);
            assert_true(count_different(&cut, &other, 3) <= (int)(PIXELS / 500));
        }
    }
    /* The state is gone with the draw: the next one is whole, and a plane that is no number cuts nothing. */
    strl_renderer *renderer = make((strl_renderer_desc){.backend = STRL_BACKEND_GL45});
    shoot(renderer, &camera, &all.list, &options, &cut);
    shoot(renderer, &camera, &all.list, NULL, &other);
    assert_int_equal(count_covered(&other), PIXELS);
    options.section[3] = NAN;
    shoot(renderer, &camera, &all.list, &options, &other);
    assert_int_equal(count_covered(&other), PIXELS);
    strl_renderer_destroy(renderer);
    patches_deinit(&all);
}

/* Patches are parts: 0 hidden, 1 marked, others plain; the part of a patch is its number modulo 3. */
static void hidden_and_marked_parts_are_drawn_so_and_back(void **state)
{
    (void)state;
    static picture plain, styled, again;
    static strl_vertex_label labels[3][PATCH_VERTICES];
    static const strl_renderer_desc descs[] = {
        {.backend = STRL_BACKEND_GL45}, {.backend = STRL_BACKEND_GL3}, {.backend = STRL_BACKEND_GL3, .gles = true}};
    const uint8_t styles[] = {STRL_PART_HIDDEN, STRL_PART_MARKED};
    patches all;
    patches_init(&all, (patches_desc){.side = 3, .flat = true});
    for (uint32_t part = 0; part < 3; part++)
        for (int v = 0; v < PATCH_VERTICES; v++)
            labels[part][v].part = part;
    labels[2][PATCH_VERTICES - 1].part = 0; /* one corner of a plain patch is hidden */
    for (uint32_t i = 0; i < all.count; i++)
        all.items[i].labels = labels[i % 3];
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.6);
    strl_draw_options options = {.part_styles = styles, .part_count = 2};
    for (size_t d = 0; d < sizeof descs / sizeof *descs; d++) {
        options.styles_version = 5 * d; /* 0 is a version like others */
        strl_renderer *renderer = make(descs[d]);
        shoot(renderer, &camera, &all.list, NULL, &plain);
        uint64_t all_vertices = plain.stats.uploaded_vertices;
        shoot(renderer, &camera, &all.list, &options, &styled);
        assert_int_equal(styled.stats.uploaded_vertices, all_vertices); /* every patch has a part that is not plain */
        assert_int_equal(styled.stats.items, 6);
        int gone = 0, tinted = 0;
        for (size_t p = 0; p < PIXELS; p++) {
            gone += !isinf(plain.depth[p]) && isinf(styled.depth[p]);
            tinted += !isinf(styled.depth[p]) && styled.rgba[p][0] > styled.rgba[p][2] + 40;
        }
        assert_true(gone > count_covered(&plain) / 5 && gone < count_covered(&plain) / 2);
        assert_true(tinted > count_covered(&plain) / 5 && tinted < count_covered(&plain) / 2);
        shoot(renderer, &camera, &all.list, &options, &again);
        assert_int_equal(again.stats.uploaded_vertices, 0);
        assert_memory_equal(styled.rgba, again.rgba, sizeof again.rgba);
        shoot(renderer, &camera, &all.list, NULL, &again);
        assert_memory_equal(plain.rgba, again.rgba, sizeof again.rgba);
        strl_renderer_destroy(renderer);
    }
    patches_deinit(&all);
}

/* A placement that is a part as a whole looks as if all of its vertices were of it, and costs no upload. */
static void placements_are_parts_as_a_whole(void **state)
{
    (void)state;
    static picture by_label, by_placement;
    static strl_vertex_label labels[3][PATCH_VERTICES];
    static const strl_renderer_desc descs[] = {
        {.backend = STRL_BACKEND_GL45}, {.backend = STRL_BACKEND_GL3}, {.backend = STRL_BACKEND_GL3, .gles = true}};
    const uint8_t styles[] = {STRL_PART_HIDDEN, STRL_PART_MARKED};
    const strl_draw_options options = {.part_styles = styles, .part_count = 2};
    patches all;
    patches_init(&all, (patches_desc){.side = 3, .flat = true});
    for (uint32_t part = 0; part < 3; part++)
        for (int v = 0; v < PATCH_VERTICES; v++)
            labels[part][v].part = part;
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.6);
    for (size_t d = 0; d < sizeof descs / sizeof *descs; d++) {
        for (uint32_t i = 0; i < all.count; i++)
            all.items[i].labels = labels[i % 3], all.items[i].own_part = 0;
        shoot_once(descs[d], &camera, &all.list, &options, &by_label);
        for (uint32_t i = 0; i < all.count; i++)
            all.items[i].labels = NULL, all.items[i].own_part = i % 3 + 1;
        strl_renderer *renderer = make(descs[d]);
        shoot(renderer, &camera, &all.list, NULL, &by_placement);
        shoot(renderer, &camera, &all.list, &options, &by_placement);
        assert_int_equal(by_placement.stats.uploaded_vertices, 0);
        assert_int_equal(by_placement.stats.items, 6);
        assert_int_equal(count_different(&by_label, &by_placement, 2), 0); /* mixed in bytes there, in floats here */
        strl_renderer_destroy(renderer);
    }
    patches_deinit(&all);
}

static double linear_of(double encoded)
{
    encoded /= 255;
    return encoded <= 0.04045 ? encoded / 12.92 : pow((encoded + 0.055) / 1.055, 2.4);
}

static void supersampling_is_the_mean_of_the_larger_image_in_linear_light(void **state)
{
    (void)state;
    enum { K = 3 };
    static picture small;
    static uint8_t large[PIXELS * K * K][4];
    patches all;
    patches_init(&all, (patches_desc){.side = 2});
    const strl_draw_options options = {.background = {250, 20, 10}};
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.9);
        shoot_once((strl_renderer_desc){.backend = backend, .supersample = K}, &camera, &all.list, &options, &small);
        camera.width *= K, camera.height *= K;
        strl_renderer *renderer =
            make((strl_renderer_desc){.backend = backend, .width = WIDTH * K, .height = HEIGHT * K});
        assert_int_equal(strl_renderer_draw(renderer, &camera, &all.list, &options, NULL, NULL), STRL_OK);
        assert_int_equal(strl_renderer_read_colour(renderer, large[0], NULL), STRL_OK);
        strl_renderer_destroy(renderer);
        for (size_t p = 0; p < PIXELS; p++)
            for (int c = 0; c < 3; c++) {
                double mean = 0;
                for (size_t s = 0; s < K * K; s++)
                    mean += linear_of(large[(p / WIDTH * K + s / K) * WIDTH * K + p % WIDTH * K + s % K][c]) / (K * K);
                assert_true(mean >= linear_of(small.rgba[p][c] - 1.5) && mean <= linear_of(small.rgba[p][c] + 1.5));
            }
    }
    patches_deinit(&all);
}

/* Positions as floats from an origin, drawn beside the same positions on a lattice. */
static void float_positions_draw_like_lattice_positions(void **state)
{
    (void)state;
    static picture lattice, floats;
    patches all;
    patches_init(&all, (patches_desc){.side = 4});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.25);
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        patches raw;
        patches_init(&raw, (patches_desc){.side = 4});
        for (uint32_t p = 0; p < raw.count; p++) {
            raw.items[p].positions = STRL_POSITIONS_FLOAT;
            for (uint32_t v = 0; v < PATCH_VERTICES; v++)
                for (int i = 0; i < 3; i++) {
                    int32_t *bits = &raw.vertices[p * PATCH_VERTICES + v].position[i];
                    float value = (float)((double)(*bits + raw.items[p].anchor[i]) * raw.items[p].step);
                    memcpy(bits, &value, sizeof value);
                }
        }
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &all.list, NULL, &lattice);
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &raw.list, NULL, &floats);
        assert_in_range(count_different(&lattice, &floats, 2), 0, PIXELS / 500);
        patches_deinit(&raw);
    }
    patches_deinit(&all);
}

/* A model that is turned and scaled by its placement, seen by a camera that is turned and scaled with it, looks the
 * same. */
static void a_placement_moves_the_model_and_not_its_look(void **state)
{
    (void)state;
    static picture plain, placed;
    patches all;
    patches_init(&all, (patches_desc){.side = 4});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.25);
    strl_draw_options options = {.sky_up = {0, 0, 1}};
    for (strl_backend backend = STRL_BACKEND_GL45; backend <= STRL_BACKEND_GL3; backend++) {
        shoot_once((strl_renderer_desc){.backend = backend}, &camera, &all.list, &options, &plain);
        patches moved;
        patches_init(&moved, (patches_desc){.side = 4});
        /* x -> y, y -> z, z -> x, times 3, then shifted. */
        const double transform[12] = {0, 0, 3, 1000, 3, 0, 0, -500, 0, 3, 0, 70};
        for (uint32_t p = 0; p < moved.count; p++)
            memcpy(moved.items[p].transform, transform, sizeof transform);
        strl_camera turned = camera;
        double *points[] = {turned.eye, turned.target}, *from[] = {camera.eye, camera.target};
        for (int k = 0; k < 2; k++)
            for (int i = 0; i < 3; i++)
                points[k][i] = 3 * from[k][(i + 2) % 3] + transform[i * 4 + 3];
        memcpy(turned.up, (double[3]){0, 0, 1}, sizeof turned.up);
        strl_draw_options sky = {.sky_up = {1, 0, 0}};
        moved.list.near_distance *= 3, moved.list.far_distance *= 3;
        shoot_once((strl_renderer_desc){.backend = backend}, &turned, &moved.list, &sky, &placed);
        for (size_t p = 0; p < PIXELS; p++)
            placed.depth[p] /= 3;
        assert_in_range(count_different(&plain, &placed, 2), 0, PIXELS / 500);
        patches_deinit(&moved);
    }
    patches_deinit(&all);
}

static void an_image_drawn_in_parts_is_the_whole_image(void **state)
{
    (void)state;
    static picture whole, parts;
    patches all;
    patches_init(&all, (patches_desc){.side = 4});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.25);
    shoot_once((strl_renderer_desc){.backend = STRL_BACKEND_GL45}, &camera, &all.list, NULL, &whole);
    strl_renderer *renderer = make((strl_renderer_desc){.backend = STRL_BACKEND_GL45});
    for (uint32_t first = 0; first < all.count; first += 5) {
        strl_draw_list list = all.list;
        list.items += first;
        list.count = all.count - first < 5 ? all.count - first : 5;
        shoot(renderer, &camera, &list, &(strl_draw_options){.keep = first > 0}, &parts);
    }
    assert_int_equal(count_different(&whole, &parts, 0), 0);
    strl_renderer_destroy(renderer);
    patches_deinit(&all);
}

static void a_renderer_draws_with_the_context_its_caller_made_and_resizes(void **state)
{
    (void)state;
    static picture own, borrowed;
    patches all;
    patches_init(&all, (patches_desc){.side = 3});
    strl_camera camera = patches_camera(&all, WIDTH, HEIGHT, 0.25), small = patches_camera(&all, 40, 30, 0.25);
    const strl_gl_context_desc wanted[] = {
        {.major = 4, .minor = 5}, {.major = 3, .minor = 3}, {.gles = true, .major = 3}};
    const strl_backend backends[] = {STRL_BACKEND_GL45, STRL_BACKEND_GL3, STRL_BACKEND_GL3};
    shoot_once((strl_renderer_desc){.backend = STRL_BACKEND_GL45}, &camera, &all.list, NULL, &own);
    for (int c = 0; c < 3; c++) {
        strl_gl_context *context = NULL;
        assert_int_equal(strl__gl_context_create(&wanted[c], &context, NULL), STRL_OK);
        strl_renderer *renderer = make((strl_renderer_desc){.backend = backends[c], .current_context = true});
        assert_int_equal(strl_renderer_resize(renderer, 40, 30, NULL), STRL_OK);
        assert_int_equal(strl_renderer_draw(renderer, &small, &all.list, NULL, NULL, NULL), STRL_OK);
        assert_int_equal(strl_renderer_resize(renderer, WIDTH, HEIGHT, NULL), STRL_OK);
        assert_int_equal(strl_renderer_read_colour(renderer, borrowed.rgba[0], NULL), STRL_ERR_ARGUMENT);
        shoot(renderer, &camera, &all.list, NULL, &borrowed);
        assert_int_equal(count_different(&own, &borrowed, 2), 0);
        GLint front;
        all.list.cull = STRL_CULL_BACK;
        all.items[all.count - 1].transform[0] = -1;
        shoot(renderer, &camera, &all.list, NULL, &borrowed);
        all.list.cull = STRL_CULL_NONE;
        all.items[all.count - 1].transform[0] = 1;
        glGetIntegerv(GL_FRONT_FACE, &front);
        assert_true(front == GL_CCW && !glIsEnabled(GL_CULL_FACE)); /* as others expect to find it */
        strl_renderer_destroy(renderer);
        strl__gl_context_destroy(context);
    }
    patches_deinit(&all);
}

static void a_wrong_call_is_refused_with_a_sentence(void **state)
{
    (void)state;
    strl_error err = {0};
    strl_renderer *renderer = NULL;
    const strl_renderer_desc huge = {.backend = STRL_BACKEND_GL3, .width = 16000, .height = 16000, .supersample = 8};
    assert_int_equal(strl_renderer_create(&huge, &renderer, &err), STRL_ERR_LIMIT);
    assert_null(renderer);
    renderer = make((strl_renderer_desc){.backend = STRL_BACKEND_GL45});
    patches all;
    patches_init(&all, (patches_desc){.side = 1});
    strl_camera camera = patches_camera(&all, WIDTH + 1, HEIGHT, 0.25);
    float depth;
    assert_int_equal(strl_renderer_read_depth(renderer, &depth, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(strl_renderer_draw(renderer, &camera, &all.list, NULL, NULL, &err), STRL_ERR_ARGUMENT);
    assert_non_null(strstr(err.message, "161x120"));
    camera.width = WIDTH;
    all.items[0].dirty_first = PATCH_INDICES, all.items[0].dirty_count = 1;
    assert_int_equal(strl_renderer_draw(renderer, &camera, &all.list, NULL, NULL, &err), STRL_ERR_ARGUMENT);
    strl_renderer_destroy(renderer);
    patches_deinit(&all);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_backend_gives_the_same_picture),
        cmocka_unit_test(wireframes_leave_holes_on_every_backend),
        cmocka_unit_test(backs_are_not_drawn_where_the_list_says_so),
        cmocka_unit_test(mirrored_and_plain_placements_cull_in_one_list),
        cmocka_unit_test(nodes_with_different_anchors_meet_without_a_crack),
        cmocka_unit_test(cells_far_beyond_32_bits_draw_like_cells_near_zero),
        cmocka_unit_test(a_dirty_range_uploads_as_good_as_everything),
        cmocka_unit_test(a_node_that_refines_beyond_its_room_is_drawn_whole),
        cmocka_unit_test(a_list_larger_than_the_budget_is_drawn_whole_within_it),
        cmocka_unit_test(alpha_is_a_pattern_fixed_to_the_pixel_grid),
        cmocka_unit_test(depth_is_the_distance_along_the_view),
        cmocka_unit_test(a_section_cuts_what_lies_before_it),
        cmocka_unit_test(hidden_and_marked_parts_are_drawn_so_and_back),
        cmocka_unit_test(placements_are_parts_as_a_whole),
        cmocka_unit_test(supersampling_is_the_mean_of_the_larger_image_in_linear_light),
        cmocka_unit_test(float_positions_draw_like_lattice_positions),
        cmocka_unit_test(a_placement_moves_the_model_and_not_its_look),
        cmocka_unit_test(an_image_drawn_in_parts_is_the_whole_image),
        cmocka_unit_test(a_renderer_draws_with_the_context_its_caller_made_and_resizes),
        cmocka_unit_test(a_wrong_call_is_refused_with_a_sentence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
