/* A program outside of Stroll's tree: walks ten frames through MODEL with the null renderer, reads the draw
 * list, and prints the error sentence of BROKEN. tests/install/test_install.py builds and runs it. */
#include <inttypes.h>
#include <stdio.h>

#include <stroll/stroll.h>

static strl_status open_model(const char *path, strl_walk **walk, strl_error *err)
{
    strl_source *source;
    *walk = NULL;
    strl_status status = strl_source_open_file(path, 1, &source, err);
    return status == STRL_OK ? strl_walk_open(source, NULL, walk, err) : status;
}

static strl_camera look(const strl_walk *walk, int frame)
{
    strl_camera camera = {.fov_y_deg = 60, .width = 320, .height = 200, .up = {0, 0, 1}};
    double bounds[6];
    strl_walk_bounds(walk, bounds);
    for (int i = 0; i < 3; i++) {
        double size = bounds[i + 3] - bounds[i];
        camera.target[i] = bounds[i] + size / 2;
        camera.eye[i] = bounds[i + 3] + size * (1 - 0.05 * frame);
    }
    camera.eye[0] += 1e-3 * (bounds[3] - bounds[0]); /* never straight from above */
    return camera;
}

/* A corner of the list's visible triangles that does not lie within its vertices would be our loss. */
static uint64_t count_good_corners(const strl_draw_list *list)
{
    uint64_t good = 0;
    for (uint32_t i = 0; i < list->count; i++)
        for (uint32_t k = 0; list->items[i].visible && k < list->items[i].draw_count; k++)
            good += list->items[i].indices[list->items[i].draw_first + k] < list->items[i].vertex_count;
    return good;
}

static strl_status walk_ten_frames(strl_walk *walk, strl_renderer *renderer, strl_error *err)
{
    for (int frame = 0; frame < 10; frame++) {
        const strl_camera camera = look(walk, frame);
        strl_draw_list list;
        strl_render_stats drawn;
        strl_status status = strl_walk_frame(walk, &camera, &list, err);
        if (status == STRL_OK)
            status = strl_renderer_draw(renderer, &camera, &list, NULL, &drawn, err);
        if (status != STRL_OK)
            return status;
        printf("frame %d: %" PRIu32 " items, %" PRIu64 " triangles, %s\n", frame, drawn.items, drawn.triangles,
               count_good_corners(&list) == 3 * drawn.triangles ? "corners good" : "corners bad");
        strl_walk_pump(walk, 10000000);
    }
    return STRL_OK;
}

int main(int argc, char **argv)
{
    strl_error err = {0};
    strl_walk *walk, *broken;
    strl_renderer *renderer = NULL;
    const strl_renderer_desc desc = {.backend = STRL_BACKEND_NULL, .width = 320, .height = 200};
    if (argc != 3)
        return 2;
    printf("version %s\n", strl_version());
    strl_status status = open_model(argv[1], &walk, &err);
    if (status == STRL_OK)
        status = strl_renderer_create(&desc, &renderer, &err);
    if (status == STRL_OK)
        status = walk_ten_frames(walk, renderer, &err);
    if (status != STRL_OK)
        fprintf(stderr, "consumer: %s\n", err.message);
    strl_renderer_destroy(renderer);
    strl_walk_close(walk);
    strl_status refused = open_model(argv[2], &broken, &err);
    printf("broken: %s: %s\n", strl_status_name(refused), refused == STRL_OK ? "opened" : err.message);
    strl_walk_close(broken);
    return status == STRL_OK ? 0 : 1;
}
