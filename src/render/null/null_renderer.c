/* Draws nothing: checks each item, keeps a shadow of what a GPU would hold within the same budget, and counts. The
 * shadow has the indices themselves, uploaded by the same plan as on a GPU: a wrong dirty range is found at once. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "render/cache.h"
#include "render/check.h"
#include "render/renderer.h"
#include "render/style.h"

/* What a GPU would hold of one node. Found through the cache entry's key. */
typedef struct shadow {
    uint16_t *indices; /* owned */
    uint64_t vertices_checksum;
} shadow;

typedef struct null_renderer {
    strl_renderer base;
    strl_cache cache;
    shadow *shadows; /* place.names.array of an entry is the index of its shadow */
    size_t shadow_count, shadow_capacity;
    uint32_t *free_shadows;
    size_t free_count, free_capacity;
    uint64_t gpu_bytes;
    uint8_t background[3];
} null_renderer;

static null_renderer *self_of(strl_renderer *renderer)
{
    return (null_renderer *)renderer;
}

static void release(null_renderer *self, strl_cache_entry *entry)
{
    uint32_t at = entry->place.names.array;
    strl__free(self->shadows[at].indices);
    self->shadows[at].indices = NULL;
    self->free_shadows[self->free_count++] = at;
    self->gpu_bytes -= entry->bytes;
    strl__cache_remove(&self->cache, entry);
}

static strl_status make_room(null_renderer *self, uint64_t bytes, strl_render_stats *stats, strl_error *err)
{
    uint64_t budget = self->base.desc.gpu_memory_bytes;
    while (self->cache.oldest && self->gpu_bytes + bytes > budget) {
        release(self, self->cache.oldest);
        stats->evictions++;
    }
    if (self->gpu_bytes + bytes > budget)
        return strl__fail(err, STRL_ERR_LIMIT, "a node needs %" PRIu64 " bytes of GPU memory, the budget is %" PRIu64,
                          bytes, budget);
    return STRL_OK;
}

static strl_cache_entry *add(null_renderer *self, uint64_t key)
{
    if (self->free_count == 0) {
        if (!strl__grow(&self->shadows, &self->shadow_capacity, self->shadow_count + 1, sizeof *self->shadows) ||
            !strl__grow(&self->free_shadows, &self->free_capacity, self->shadow_count + 1, sizeof *self->free_shadows))
            return NULL;
        self->shadows[self->shadow_count] = (shadow){0};
        self->free_shadows[self->free_count++] = (uint32_t)self->shadow_count++;
    }
    strl_cache_entry *entry = strl__cache_add(&self->cache, key);
    if (entry)
        entry->place.names.array = self->free_shadows[--self->free_count];
    return entry;
}

static uint64_t checksum_vertices(const strl_draw_item *item)
{
    return strl__checksum(item->vertices, item->vertex_count * sizeof *item->vertices);
}

/* Copies what the plan says and compares the whole with the item. */
static strl_status update(null_renderer *self, strl_cache_entry *entry, const strl_draw_item *item,
                          strl_cache_upload upload, strl_error *err)
{
    shadow *held = &self->shadows[entry->place.names.array];
    if (item->index_count > entry->index_capacity) {
        uint16_t *indices = strl__realloc(held->indices, item->index_count, sizeof *indices);
        if (!indices)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for the shadow of node %" PRIu32, item->node);
        held->indices = indices;
        entry->index_capacity = item->index_count;
    }
    if (upload.vertices)
        held->vertices_checksum = checksum_vertices(item);
    else if (held->vertices_checksum != checksum_vertices(item))
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "node %" PRIu32 " (placement %" PRIu32 ") has other vertices under the same key", item->node,
                          item->placement);
    if (upload.index_count > 0)
        memcpy(held->indices + upload.first_index, item->indices + upload.first_index,
               upload.index_count * sizeof(uint16_t));
    if (item->index_count > 0 && memcmp(held->indices, item->indices, item->index_count * sizeof(uint16_t)) != 0)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "node %" PRIu32 " (placement %" PRIu32 ") differs from the list before outside its "
                          "dirty range [%" PRIu32 ", +%" PRIu32 ")",
                          item->node, item->placement, item->dirty_first, item->dirty_count);
    return STRL_OK;
}

static strl_status draw_item(null_renderer *self, const strl_draw_item *item, uint64_t frame, strl_render_stats *stats,
                             strl_error *err)
{
    strl_cache_entry *entry = strl__cache_find(&self->cache, item->key);
    uint64_t bytes = item->vertex_count * sizeof(strl_vertex) + item->index_count * sizeof(uint16_t);
    if (entry && bytes > entry->bytes) {
        release(self, entry);
        entry = NULL;
    }
    strl_cache_upload upload = strl__cache_plan(entry, item, frame);
    if (!entry) {
        strl_status status = make_room(self, bytes, stats, err);
        if (status != STRL_OK)
            return status;
        entry = add(self, item->key);
        if (!entry)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for the shadow of node %" PRIu32, item->node);
        entry->bytes = bytes;
        self->gpu_bytes += bytes;
    }
    strl_status status = update(self, entry, item, upload, err);
    if (status != STRL_OK) {
        release(self, entry); /* what it holds is neither the old nor the new node */
        return status;
    }
    strl__cache_touch(&self->cache, entry);
    strl__cache_commit(entry, item, frame);
    stats->uploaded_vertices += upload.vertices ? item->vertex_count : 0;
    stats->uploaded_indices += upload.index_count;
    return STRL_OK;
}

/* Items of one key share one place on the GPU: they must be one node in one state, each placed elsewhere. */
static strl_status check_keys(null_renderer *self, const strl_draw_item *item, uint64_t serial, strl_error *err)
{
    const strl_cache_entry *entry = strl__cache_find(&self->cache, item->key);
    if (!entry || entry->batch != serial)
        return STRL_OK;
    if (entry->placement == item->placement)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "node %" PRIu32 " (placement %" PRIu32 ") has a key that is in the list already", item->node,
                          item->placement);
    if (entry->state != item->state || entry->index_count != item->index_count)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "node %" PRIu32 " (placement %" PRIu32 ") is in state %" PRIu32 ", but placement %" PRIu32
                          " of the same key in state %" PRIu32,
                          item->node, item->placement, item->state, entry->placement, entry->state);
    return STRL_OK;
}

static strl_status null_draw(strl_renderer *renderer, const strl_draw_setup *setup, const strl_draw_list *list,
                             strl_render_stats *stats, strl_error *err)
{
    null_renderer *self = self_of(renderer);
    static const uint64_t in_this_list = UINT64_MAX;
    memcpy(self->background, setup->options.background, sizeof self->background);
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        status = strl__check_item_counts(item, err);
        if (status == STRL_OK)
            status = strl__check_item_contents(item, err);
        if (status != STRL_OK || !item->visible || item->draw_count == 0 ||
            strl__item_style(item, &setup->options) == STRL_PART_HIDDEN)
            continue;
        status = check_keys(self, item, in_this_list, err);
        if (status == STRL_OK)
            status = draw_item(self, item, list->frame, stats, err);
        if (status != STRL_OK)
            continue;
        self->cache.newest->batch = in_this_list;
        self->cache.newest->placement = item->placement;
        stats->triangles += item->point_px > 0 ? 0 : item->draw_count / 3;
        stats->items++;
        stats->draws++;
    }
    for (strl_cache_entry *entry = self->cache.newest; entry && entry->batch == in_this_list; entry = entry->older)
        entry->batch = 0;
    stats->uploaded_bytes = stats->uploaded_vertices * sizeof(strl_vertex) + stats->uploaded_indices * sizeof(uint16_t);
    stats->gpu_bytes = self->gpu_bytes;
    return status;
}

static void null_finish(strl_renderer *renderer)
{
    (void)renderer;
}

static strl_status null_resize(strl_renderer *renderer, strl_error *err)
{
    (void)renderer, (void)err;
    return STRL_OK;
}

static strl_status null_read_colour(strl_renderer *renderer, uint8_t *rgba, strl_error *err)
{
    (void)err;
    size_t pixels = (size_t)renderer->desc.width * renderer->desc.height;
    const uint8_t *background = self_of(renderer)->background;
    for (size_t p = 0; p < pixels; p++)
        memcpy(rgba + 4 * p, (const uint8_t[4]){background[0], background[1], background[2], 0}, 4);
    return STRL_OK;
}

static strl_status null_read_depth(strl_renderer *renderer, float *depth, strl_error *err)
{
    (void)err;
    size_t pixels = (size_t)renderer->desc.width * renderer->desc.height;
    for (size_t p = 0; p < pixels; p++)
        depth[p] = INFINITY;
    return STRL_OK;
}

static strl_status null_present(strl_renderer *renderer, uint32_t width, uint32_t height, strl_error *err)
{
    (void)renderer, (void)width, (void)height, (void)err;
    return STRL_OK;
}

static void null_destroy(strl_renderer *renderer)
{
    null_renderer *self = self_of(renderer);
    for (size_t s = 0; s < self->shadow_count; s++)
        strl__free(self->shadows[s].indices);
    strl__free(self->shadows);
    strl__free(self->free_shadows);
    strl__cache_deinit(&self->cache);
    strl__free(self);
}

static const strl_renderer_class null_class = {
    .backend = STRL_BACKEND_NULL,
    .draw = null_draw,
    .finish = null_finish,
    .resize = null_resize,
    .read_colour = null_read_colour,
    .read_depth = null_read_depth,
    .present = null_present,
    .destroy = null_destroy,
};

strl_status strl__null_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err)
{
    null_renderer *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a renderer");
    self->base = (strl_renderer){.klass = &null_class, .desc = *desc, .device = "null"};
    strl_status status = strl__cache_init(&self->cache, err);
    if (status != STRL_OK) {
        strl__free(self);
        return status;
    }
    *renderer = &self->base;
    return STRL_OK;
}
