/* Walks ten frames round a model, draws them with the null renderer, and says what was drawn.
 *
 *     cc first_walk.c $(pkg-config --cflags --libs stroll) -lm -o first_walk
 *     ./first_walk model.stroll */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "orbit.h"

#define WIDTH 1280u
#define HEIGHT 720u

/* begin: open */
static strl_status open_walk(const char *path, strl_walk **walk, strl_error *err)
{
    strl_source *source;
    *walk = NULL;
    strl_status status = strl_source_open_file(path, 2, &source, err); /* read by two threads of its own */
    if (status != STRL_OK)
        return status;
    const strl_walk_desc desc = {.memory_bytes = (uint64_t)256 << 20, .error_px = 1};
    return strl_walk_open(source, &desc, walk, err); /* owns the source from here on */
}
/* end: open */

/* begin: facts */
static void print_facts(strl_walk *walk)
{
    const strl_container *container = strl_walk_container(walk);
    const strl_container_info *info = strl_container_get_info(container);
    printf("%" PRIu64 " triangles, %" PRIu32 " parts, unit %s, %c is up\n", strl_container_triangle_count(container),
           info->part_count, info->unit[0] ? info->unit : "unknown", "xyz"[info->up_axis]);
}
/* end: facts */

/* begin: frames */
static strl_status walk_round(strl_walk *walk, strl_renderer *renderer, strl_error *err)
{
    for (int frame = 0; frame < 10; frame++) {
        strl_camera camera = orbit(walk, 0.1 * frame, WIDTH, HEIGHT);
        strl_draw_list list;
        strl_render_stats drawn;
        strl_status status = strl_walk_frame(walk, &camera, &list, err); /* never waits */
        if (status == STRL_OK)
            status = strl_renderer_draw(renderer, &camera, &list, NULL, &drawn, err);
        if (status != STRL_OK)
            return status;
        printf("frame %d: %" PRIu32 " nodes, %" PRIu64 " triangles, %" PRIu32 " nodes still coarser than wanted\n",
               frame, drawn.items, drawn.triangles, strl_walk_get_stats(walk)->missing_nodes);
        strl_walk_pump(walk, 4000000); /* 4 ms for decoding what has been read */
    }
    return STRL_OK;
}
/* end: frames */

/* begin: settle */
/* For a screenshot, not for a frame: goes on until nothing is missing for this camera. */
static strl_status settle(strl_walk *walk, const strl_camera *camera, strl_draw_list *list, strl_error *err)
{
    strl_status status;
    do {
        strl_walk_pump(walk, 4000000);
        status = strl_walk_frame(walk, camera, list, err);
    } while (status == STRL_OK && !strl_walk_settled(walk));
    return status;
}
/* end: settle */

/* begin: list */
static strl_status print_list(strl_walk *walk, const strl_draw_list *list, strl_error *err)
{
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        if (!item->visible || item->draw_count == 0 || item->point_px > 0 || i >= 5) /* splats have no parts */
            continue;
        char name[64] = "";
        strl_status status = STRL_OK;
        uint32_t *parts = malloc(item->vertex_count * sizeof *parts);
        if (parts)
            status = strl_container_vertex_parts(strl_walk_container(walk), item->placement, item->node,
                                                 item->vertex_count, parts, NULL, err);
        if (parts && status == STRL_OK)
            status = strl_container_part(strl_walk_container(walk), parts[item->indices[0]], name, sizeof name, err);
        free(parts);
        if (status != STRL_OK)
            return status;
        printf("node %" PRIu32 " of level %" PRIu32 ": %" PRIu32 " triangles, wrong by at most %.2f pixels, part %s\n",
               item->node, item->level, item->draw_count / 3, item->error_px, name);
    }
    return STRL_OK;
}
/* end: list */

/* begin: main */
int main(int argc, char **argv)
{
    strl_error err = {0};
    strl_walk *walk = NULL;
    strl_renderer *renderer = NULL;
    const strl_renderer_desc desc = {.backend = STRL_BACKEND_NULL, .width = WIDTH, .height = HEIGHT};
    if (argc != 2) {
        fprintf(stderr, "usage: first_walk MODEL.stroll\n");
        return 2;
    }
    strl_status status = open_walk(argv[1], &walk, &err);
    if (status == STRL_OK)
        status = strl_renderer_create(&desc, &renderer, &err);
    if (status == STRL_OK) {
        print_facts(walk);
        status = walk_round(walk, renderer, &err);
    }
    if (status == STRL_OK) {
        strl_camera camera = orbit(walk, 1, WIDTH, HEIGHT);
        strl_draw_list list;
        status = settle(walk, &camera, &list, &err);
        if (status == STRL_OK)
            status = print_list(walk, &list, &err);
    }
    if (status != STRL_OK)
        fprintf(stderr, "first_walk: %s\n", err.message);
    strl_renderer_destroy(renderer);
    strl_walk_close(walk);
    return status == STRL_OK ? 0 : 1;
}
/* end: main */
