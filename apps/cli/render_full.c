/* A container's finest level, whatever its size: the leaves stream through in batches drawn over one another. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "container/cut.h"
#include "container/treelet.h"
#include "frame/view.h"
#include "geometry/colour.h"
#include "interrupt.h"
#include "platform/thread.h"
#include "render_container.h"
#include "render_model.h"
#include "shared/placed.h"

#define BATCH_NODES 64u
#define BATCH_BYTES ((size_t)64 << 20) /* of decoded meshes and vertices, beyond which a batch is drawn */

typedef struct full_model {
    strl_render_model base;
    strl_container *container;
    strl_cull cull;
    strl_arena arena; /* of the batch under way */
    strl_draw_item items[BATCH_NODES];
    uint32_t item_count;
} full_model;

/* One image. */
typedef struct full_draw {
    full_model *model;
    strl_renderer *renderer;
    const strl_camera *camera;
    strl_view view;
    strl_draw_options options;
    strl_image_stats *stats;
    double near_distance, far_distance; /* of the whole image: batches share one depth buffer */
} full_draw;

static strl_status flush(full_draw *draw, strl_error *err)
{
    strl_draw_list list = {.items = draw->model->items,
                           .count = draw->model->item_count,
                           .cull = draw->model->cull,
                           .near_distance = draw->near_distance,
                           .far_distance = draw->far_distance};
    strl_render_stats drawn;
    strl_status status = strl_renderer_draw(draw->renderer, draw->camera, &list, &draw->options, &drawn, err);
    strl_render_add_stats(draw->stats, &drawn);
    draw->options.keep = true;
    draw->model->item_count = 0;
    strl_arena_rewind(&draw->model->arena, (strl_arena_mark){0});
    return status;
}

static strl_vertex *make_vertices(const strl_pm *mesh, strl_arena *arena)
{
    strl_vertex *vertices = strl_arena_alloc(arena, mesh->vertex_count, sizeof *vertices);
    uint32_t last[2] = {UINT32_MAX, UINT32_MAX}, product = UINT32_MAX; /* neighbours often have one colour */
    for (uint32_t v = 0; vertices && v < mesh->vertex_count; v++) {
        uint32_t colour = mesh->colour ? mesh->colour[v] : UINT32_MAX;
        uint32_t material = mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0].rgba;
        if (colour != last[0] || material != last[1])
            product = strl_rgba_multiply(colour, material);
        last[0] = colour, last[1] = material;
        memcpy(vertices[v].position, mesh->position[v], sizeof vertices[v].position);
        memcpy(vertices[v].normal, mesh->normal[v], sizeof vertices[v].normal);
        for (unsigned i = 0; i < 4; i++)
            vertices[v].rgba[i] = (uint8_t)(product >> 8 * i);
    }
    return vertices;
}

/* Decodes a leaf and puts it into the batch. */
static strl_status add_leaf(full_draw *draw, const strl_tree *tree, const strl_cut *cut, uint32_t id,
                            const strl_node *record, uint64_t placement, const double transform[12], strl_error *err)
{
    full_model *model = draw->model;
    strl_pm mesh;
    strl_status status = strl_container_mesh(model->container, cut->tree, record, &model->arena, &mesh, err);
    if (status != STRL_OK)
        return status;
    strl_draw_item *item = &model->items[model->item_count];
    *item = (strl_draw_item){.key = ((uint64_t)cut->tree << 32 | id) + 1,
                             .placement = (uint32_t)placement,
                             .node = id,
                             .level = record->level,
                             .group = record->group,
                             .visible = true,
                             .vertex_count = mesh.vertex_count,
                             .indices = mesh.triangle[0],
                             .index_count = 3 * mesh.triangle_count,
                             .draw_count = 3 * mesh.triangle_count,
                             .step = tree->step};
    item->vertices = make_vertices(&mesh, &model->arena);
    if (!item->vertices)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the vertices of node %" PRIu32, id);
    memcpy(item->anchor, record->anchor, sizeof item->anchor);
    memcpy(item->box_min, record->box_min, sizeof item->box_min);
    memcpy(item->box_max, record->box_max, sizeof item->box_max);
    memcpy(item->origin, tree->origin, sizeof item->origin);
    memcpy(item->transform, transform, sizeof item->transform);
    model->item_count++;
    if (model->item_count == BATCH_NODES || model->arena.total_bytes > BATCH_BYTES)
        return flush(draw, err);
    return STRL_OK;
}

static strl_status draw_placement(full_draw *draw, uint64_t index, strl_error *err)
{
    full_model *model = draw->model;
    strl_placement placement;
    strl_status status = strl_container_placement(model->container, index, &placement, err);
    if (status != STRL_OK)
        return status;
    const strl_tree *tree = strl_container_tree(model->container, placement.tree);
    strl_cut cut;
    strl_cut_init(&cut, model->container, placement.tree, 0);
    for (;;) {
        uint32_t id;
        strl_node record;
        status = strl_cut_next(&cut, &id, &record, err);
        if (status != STRL_OK || id == STRL_NONE)
            return status;
        status = strl_cli_check_interrupt(err);
        if (status != STRL_OK)
            return status;
        strl_box box;
        strl_placed_box(tree, placement.transform, record.box_min, record.box_max, box.min, box.max);
        if (!strl_view_sees(&draw->view, &box)) {
            draw->stats->nodes_culled++;
            continue;
        }
        status = add_leaf(draw, tree, &cut, id, &record, index, placement.transform, err);
        if (status != STRL_OK)
            return status;
    }
}

static strl_status full_draw_image(strl_render_model *base, strl_renderer *renderer, const strl_camera *camera,
                                   const strl_draw_options *options, strl_image_stats *stats, strl_error *err)
{
    full_model *model = (full_model *)base;
    full_draw draw = {.model = model, .renderer = renderer, .camera = camera, .options = *options, .stats = stats};
    uint64_t start = strl_clock_ns();
    if (!strl_view_init(&draw.view, camera))
        return strl__fail(err, STRL_ERR_ARGUMENT, "the camera is degenerate");
    strl_box all;
    memcpy(&all, base->bounds, sizeof all);
    double least, largest;
    strl_view_depth_range(&draw.view, &all, &least, &largest);
    strl_draw_list range;
    strl_render_set_range(&range, least, largest);
    draw.near_distance = range.near_distance, draw.far_distance = range.far_distance;
    uint64_t placements = strl_container_get_info(model->container)->placement_count;
    model->item_count = 0;
    strl_status status = STRL_OK;
    for (uint64_t p = 0; status == STRL_OK && p < placements; p++)
        status = draw_placement(&draw, p, err);
    if (status == STRL_OK && (model->item_count > 0 || !draw.options.keep))
        status = flush(&draw, err);
    strl_renderer_finish(renderer);
    strl_arena_rewind(&model->arena, (strl_arena_mark){0});
    stats->frame_ns = stats->draw_ns = strl_clock_ns() - start;
    return status;
}

static void full_close(strl_render_model *base)
{
    full_model *model = (full_model *)base;
    strl_container_close(model->container);
    strl_arena_deinit(&model->arena);
    strl__free(model);
}

static const strl_render_model_class full_class = {.draw = full_draw_image, .close = full_close};

strl_status strl_render_full_open(const strl_render_model_desc *desc, strl_render_model **model, strl_error *err)
{
    full_model *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a model");
    self->base.klass = &full_class;
    self->cull = desc->cull;
    strl_arena_init(&self->arena, 0);
    strl_status status = strl_location_open_container(&desc->location, &self->container, err);
    if (status != STRL_OK) {
        full_close(&self->base);
        return status;
    }
    strl_render_container_facts(self->container, &self->base);
    *model = &self->base;
    return STRL_OK;
}
