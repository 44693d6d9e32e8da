/* OpenGL 4.5 core. Items of a list are collected into a batch; a flush writes their records and indirect draws through
 * the ring and issues one multi-draw for each slab. When the budget is full of nodes that the batch uses, the batch is
 * flushed and they may go: GL runs copies and draws in order, so a place can be written again at once. */
#include <epoxy/gl.h>
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "render/check.h"
#include "render/gl45/store.h"
#include "render/glcommon/gl.h"
#include "render/style.h"

/* As glMultiDrawElementsIndirect reads it. */
typedef struct gl45_command {
    uint32_t count, instance_count, first_index;
    int32_t base_vertex;
    uint32_t base_instance; /* which item record the vertices get: the item's place in the batch */
} gl45_command;

typedef struct gl45_queued {
    gl45_command command;
    uint32_t slab;
    bool translucent, points, mirrors;
} gl45_queued;

/* What one multi-draw has in common, besides the slab. */
typedef struct gl45_kind {
    bool translucent, points, mirrors;
} gl45_kind;

typedef struct gl45_renderer {
    strl_gl gl;
    strl_gl_ring ring;
    strl_gl_store store;
    uint32_t batch_most; /* items of one batch */
    uint32_t batch_count;
    uint64_t batch;        /* number of the batch being collected; nodes of it cannot be evicted */
    gl45_queued *queued;   /* [batch_most] */
    strl_gl_item *records; /* [batch_most] */
    strl_vertex *styled;   /* scratch */
    size_t styled_capacity;
} gl45_renderer;

typedef struct gl45_draw {
    gl45_renderer *self;
    uint64_t frame;
    const strl_draw_options *options;
    strl_render_stats *stats;
    bool mirrors; /* something queued does, and it matters */
} gl45_draw;

/* Where a batch lies in the ring: one piece, so that one fence guards all of it. */
typedef struct gl45_piece {
    uint8_t *mapped;
    size_t offset, used; /* offset in the ring's buffer */
} gl45_piece;

/* The queued commands of one slab and kind, contiguous, as one call. */
static void draw_slab(gl45_draw *draw, gl45_piece *piece, uint32_t slab, gl45_kind kind)
{
    gl45_renderer *self = draw->self;
    size_t first = piece->used;
    uint32_t count = 0;
    for (uint32_t q = 0; q < self->batch_count; q++) {
        const gl45_queued *queued = &self->queued[q];
        if (queued->slab != slab || queued->translucent != kind.translucent || queued->points != kind.points ||
            queued->mirrors != kind.mirrors)
            continue;
        memcpy(piece->mapped + piece->used, &queued->command, sizeof queued->command);
        piece->used += sizeof queued->command;
        count++;
    }
    if (count == 0)
        return;
    GLuint array = self->store.slabs[slab].array;
    glVertexArrayVertexBuffer(array, 1, self->ring.buffer, (GLintptr)piece->offset, sizeof(strl_gl_item));
    glBindVertexArray(array);
    glMultiDrawElementsIndirect(kind.points ? GL_POINTS : GL_TRIANGLES, GL_UNSIGNED_SHORT,
                                (const void *)(piece->offset + first), (GLsizei)count, 0);
    draw->stats->draws += count;
}

static void flush(gl45_draw *draw)
{
    gl45_renderer *self = draw->self;
    if (self->batch_count == 0)
        return;
    size_t record_bytes = self->batch_count * sizeof *self->records;
    gl45_piece piece = {.used = record_bytes};
    piece.mapped =
        strl__gl_ring_take(&self->ring, record_bytes + self->batch_count * sizeof(gl45_command), &piece.offset);
    memcpy(piece.mapped, self->records, record_bytes);
    glBindBuffer(GL_DRAW_INDIRECT_BUFFER, self->ring.buffer);
    for (int kind = 0; kind < (draw->mirrors ? 8 : 4); kind++) {
        glUseProgram(self->gl.programs[kind & 1 ? STRL_GL_NODE_ALPHA : STRL_GL_NODE].name);
        strl__gl_set_fronts(kind & 4);
        for (uint32_t slab = 0; slab < self->store.slab_count; slab++)
            draw_slab(draw, &piece, slab, (gl45_kind){kind & 1, kind & 2, kind & 4});
    }
    self->batch_count = 0;
    self->batch++;
    draw->mirrors = false;
}

static void release(gl45_renderer *self, strl_cache_entry *entry)
{
    strl__gl_store_release(&self->store, entry);
    strl__cache_remove(&self->gl.cache, entry);
}

/* Throws out the node whose use is longest ago; flushes where the batch still needs it. False where there is none. */
static bool evict_one(gl45_draw *draw)
{
    strl_cache_entry *oldest = draw->self->gl.cache.oldest;
    if (!oldest)
        return false;
    if (oldest->batch == draw->self->batch)
        flush(draw);
    release(draw->self, oldest);
    draw->stats->evictions++;
    return true;
}

static strl_status add(gl45_draw *draw, const strl_draw_item *item, strl_cache_entry **out, strl_error *err)
{
    gl45_renderer *self = draw->self;
    strl_cache_entry placed = {0}, *entry;
    /* A quarter more indices than now: refining shall not mean a new place each time. */
    uint32_t room = item->index_count + item->index_count / 4;
    while (!strl__gl_store_place(&self->store, &placed, item->vertex_count, room))
        if (!evict_one(draw))
            return strl__fail(err, STRL_ERR_LIMIT,
                              "a node of %" PRIu32 " vertices and %" PRIu32
                              " indices does not fit into GPU memory, the budget is %" PRIu64 " bytes",
                              item->vertex_count, item->index_count, self->gl.base.desc.gpu_memory_bytes);
    entry = strl__cache_add(&self->gl.cache, item->key);
    if (!entry) {
        strl__gl_store_release(&self->store, &placed);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the renderer's table of nodes");
    }
    entry->place = placed.place;
    entry->index_capacity = placed.index_capacity;
    entry->translucent = strl__item_is_translucent(item);
    *out = entry;
    return STRL_OK;
}

static strl_status upload(gl45_draw *draw, const strl_cache_entry *entry, const strl_draw_item *item,
                          strl_cache_upload plan, strl_error *err)
{
    gl45_renderer *self = draw->self;
    uint32_t slab = entry->place.range.slab;
    if (plan.vertices) {
        const strl_vertex *vertices =
            strl__style_vertices(entry, item, draw->options, &self->styled, &self->styled_capacity);
        if (!vertices)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for the styled vertices of node %" PRIu32, item->node);
        strl__gl_store_upload(&self->store, &self->ring, slab,
                              (uint64_t)entry->place.range.vertex_at * STRL_GRANULE_BYTES, vertices,
                              item->vertex_count * sizeof *vertices);
        draw->stats->uploaded_vertices += item->vertex_count;
    }
    if (plan.index_count > 0) {
        uint64_t at = (uint64_t)entry->place.range.index_at * STRL_GRANULE_BYTES + plan.first_index * sizeof(uint16_t);
        strl__gl_store_upload(&self->store, &self->ring, slab, at, item->indices + plan.first_index,
                              plan.index_count * sizeof(uint16_t));
        draw->stats->uploaded_indices += plan.index_count;
    }
    return STRL_OK;
}

static strl_status make_resident(gl45_draw *draw, const strl_draw_item *item, strl_cache_entry **out, strl_error *err)
{
    gl45_renderer *self = draw->self;
    strl_cache_entry *entry = strl__cache_find(&self->gl.cache, item->key);
    strl_cache_upload plan = strl__cache_plan(entry, item, draw->frame);
    if (entry && entry->batch == self->batch && (plan.vertices || plan.index_count))
        flush(draw); /* another state of the same key: what is queued needs what lies there now */
    if (entry && plan.vertices) {
        release(self, entry);
        entry = NULL;
    }
    if (entry && entry->index_capacity < item->index_count) {
        if (strl__gl_store_grow_indices(&self->store, entry, item->index_count + item->index_count / 4)) {
            plan = (strl_cache_upload){false, 0, item->index_count};
        } else {
            release(self, entry);
            entry = NULL;
            plan = (strl_cache_upload){true, 0, item->index_count};
        }
    }
    if (entry) {
        strl__cache_touch(&self->gl.cache, entry);
    } else {
        strl_status status = add(draw, item, &entry, err);
        if (status != STRL_OK)
            return status;
    }
    plan.vertices |= strl__style_update(entry, item, draw->options);
    strl_status status = upload(draw, entry, item, plan, err);
    if (status != STRL_OK) {
        release(self, entry);
        return status;
    }
    strl__cache_commit(entry, item, draw->frame);
    *out = entry;
    return STRL_OK;
}

static strl_status queue_item(gl45_draw *draw, const strl_draw_item *item, const strl_gl_item *record, bool mirrors,
                              strl_error *err)
{
    gl45_renderer *self = draw->self;
    if (self->batch_count == self->batch_most)
        flush(draw);
    strl_cache_entry *entry;
    strl_status status = make_resident(draw, item, &entry, err);
    if (status != STRL_OK)
        return status;
    if (entry->hidden)
        return STRL_OK;
    uint32_t at = self->batch_count++;
    uint32_t first_index =
        entry->place.range.index_at * (STRL_GRANULE_BYTES / (uint32_t)sizeof(uint16_t)) + item->draw_first;
    int32_t first_vertex =
        (int32_t)(entry->place.range.vertex_at * (STRL_GRANULE_BYTES / (uint32_t)sizeof(strl_vertex)));
    self->records[at] = *record;
    self->queued[at] = (gl45_queued){{item->draw_count, 1, first_index, first_vertex, at},
                                     entry->place.range.slab,
                                     entry->translucent || entry->hides,
                                     item->point_px > 0,
                                     mirrors};
    draw->mirrors |= mirrors;
    entry->batch = self->batch;
    draw->stats->triangles += item->point_px > 0 ? 0 : item->draw_count / 3;
    draw->stats->items++;
    return STRL_OK;
}

static uint64_t fixed_bytes(const gl45_renderer *self)
{
    return self->ring.segment_bytes * STRL_RING_SEGMENTS;
}

static strl_status gl45_draw_list(strl_renderer *renderer, const strl_draw_setup *setup, const strl_draw_list *list,
                                  strl_render_stats *stats, strl_error *err)
{
    gl45_renderer *self = (gl45_renderer *)renderer;
    gl45_draw draw = {.self = self, .frame = list->frame, .options = &setup->options, .stats = stats};
    strl_gl_placing placing = {0};
    strl_status status = STRL_OK;
    strl__gl_make_current(&self->gl);
    strl__gl_begin_draw(&self->gl, setup);
    for (uint32_t i = 0; status == STRL_OK && i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        if (!item->visible || item->draw_count == 0 || strl__item_style(item, &setup->options) == STRL_PART_HIDDEN)
            continue;
        status = strl__check_item_counts(item, err);
        if (status != STRL_OK)
            continue;
        strl_gl_item record;
        strl__gl_item_make(&placing, setup, item, &record);
        status = queue_item(&draw, item, &record, setup->cull_back && placing.mirrors, err);
    }
    flush(&draw);
    stats->uploaded_bytes = stats->uploaded_vertices * sizeof(strl_vertex) + stats->uploaded_indices * sizeof(uint16_t);
    stats->gpu_bytes = strl__gl_store_bytes(&self->store) + fixed_bytes(self);
    strl_status ended = strl__gl_end_draw(&self->gl, status == STRL_OK ? err : NULL);
    return status != STRL_OK ? status : ended;
}

static strl_status init_batch(gl45_renderer *self, strl_error *err)
{
    self->queued = strl__alloc(self->batch_most, sizeof *self->queued);
    self->records = strl__alloc(self->batch_most, sizeof *self->records);
    if (self->queued && self->records)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_MEMORY, "no memory for a batch of %" PRIu32 " draws", self->batch_most);
}

/* A small budget gets a small ring: most of it is for nodes. */
static strl_status init_buffers(gl45_renderer *self, strl_error *err)
{
    uint64_t budget = self->gl.base.desc.gpu_memory_bytes;
    size_t segment = budget >= (64u << 20) ? 1u << 20 : 256u << 10;
    self->batch = 1;
    self->batch_most = (uint32_t)(segment / sizeof(strl_gl_item) / 2);
    strl_status status = strl__gl_ring_init(&self->ring, segment, err);
    if (status == STRL_OK)
        status = init_batch(self, err);
    if (status == STRL_OK)
        strl__gl_store_init(&self->store, budget - fixed_bytes(self));
    return status;
}

static void gl45_destroy(strl_renderer *renderer)
{
    gl45_renderer *self = (gl45_renderer *)renderer;
    strl__gl_make_current(&self->gl);
    strl__gl_store_deinit(&self->store);
    strl__gl_ring_deinit(&self->ring);
    strl__gl_deinit(&self->gl);
    strl__free(self->queued);
    strl__free(self->records);
    strl__free(self->styled);
    strl__free(self);
}

static const strl_renderer_class gl45_class = {
    .backend = STRL_BACKEND_GL45,
    .draw = gl45_draw_list,
    .finish = strl__gl_finish,
    .resize = strl__gl_resize,
    .read_colour = strl__gl_read_colour,
    .read_depth = strl__gl_read_depth,
    .present = strl__gl_present,
    .destroy = gl45_destroy,
};

strl_status strl__gl45_renderer_create(const strl_renderer_desc *desc, strl_renderer **renderer, strl_error *err)
{
    gl45_renderer *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a renderer");
    strl_status status = strl__gl_init(&self->gl, &gl45_class, desc, err);
    if (status != STRL_OK) {
        strl__free(self);
        return status;
    }
    status = init_buffers(self, err);
    if (status != STRL_OK) {
        gl45_destroy(&self->gl.base);
        return status;
    }
    *renderer = &self->gl.base;
    return STRL_OK;
}
