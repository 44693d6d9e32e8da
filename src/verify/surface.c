#include "verify/surface.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"

#define NONE UINT32_MAX

/* ---- tree of chunks ---- */

static void float_boxes(const strl__surface *surface, float (*boxes)[6])
{
    for (uint32_t i = 0; i < surface->count; i++)
        for (unsigned k = 0; k < 3; k++) {
            boxes[i][k] = nextafterf((float)(surface->box[i][0][k] - surface->base[k]), -INFINITY);
            boxes[i][3 + k] = nextafterf((float)(surface->box[i][1][k] - surface->base[k]), INFINITY);
        }
}

strl_status strl__v_surface_init(strl__surface *surface, uint32_t count, double (*box)[2][3], strl_error *err)
{
    surface->count = count;
    surface->box = box;
    surface->oldest = surface->newest = NONE;
    strl_mutex_init(&surface->mutex);
    strl_condition_init(&surface->loaded);
    float(*boxes)[6] = strl__alloc(count, sizeof *boxes);
    surface->nodes = strl__alloc((size_t)strl__bvh_nodes(count), sizeof *surface->nodes);
    surface->order = strl__alloc(count, sizeof *surface->order);
    surface->slots = strl__alloc_zero(count, sizeof *surface->slots);
    bool good = boxes && surface->nodes && surface->order && surface->slots;
    if (good && count) {
        memcpy(surface->base, box[0][0], sizeof surface->base);
        float_boxes(surface, boxes);
        strl__v_bvh_build((const float(*)[6])boxes, count, surface->order, surface->nodes);
    }
    strl__free(boxes);
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the %u pieces of a surface", count);
}

void strl__v_surface_deinit(strl__surface *surface)
{
    if (!surface->box)
        return;
    for (uint32_t i = 0; surface->slots && i < surface->count; i++)
        strl__free(surface->slots[i].chunk);
    strl__free(surface->slots);
    strl__free(surface->order);
    strl__free(surface->nodes);
    strl__free(surface->box);
    strl_condition_deinit(&surface->loaded);
    strl_mutex_deinit(&surface->mutex);
    *surface = (strl__surface){0};
}

/* ---- what is held ---- */

static void unlink_slot(strl__surface *surface, uint32_t index)
{
    strl__surface_slot *slot = &surface->slots[index];
    if (slot->older != NONE)
        surface->slots[slot->older].newer = slot->newer;
    else
        surface->oldest = slot->newer;
    if (slot->newer != NONE)
        surface->slots[slot->newer].older = slot->older;
    else
        surface->newest = slot->older;
}

static void link_newest(strl__surface *surface, uint32_t index)
{
    strl__surface_slot *slot = &surface->slots[index];
    slot->older = surface->newest;
    slot->newer = NONE;
    if (surface->newest != NONE)
        surface->slots[surface->newest].newer = index;
    else
        surface->oldest = index;
    surface->newest = index;
}

static void evict(strl__surface *surface)
{
    for (uint32_t i = surface->oldest, next; i != NONE && surface->held > surface->budget; i = next) {
        strl__surface_slot *slot = &surface->slots[i];
        next = slot->newer;
        if (slot->pins)
            continue;
        unlink_slot(surface, i);
        surface->held -= slot->chunk->bytes;
        strl__free(slot->chunk);
        slot->chunk = NULL;
    }
}

/* Loads outside the lock; others who want the same chunk wait for it. */
static strl_status load_slot(strl__surface *surface, uint32_t index, unsigned worker, strl_error *err)
{
    strl__surface_slot *slot = &surface->slots[index];
    strl__chunk *chunk = NULL;
    slot->loading = true;
    strl_mutex_unlock(&surface->mutex);
    strl_status status = surface->load(surface->context, index, worker, &chunk, err);
    strl_mutex_lock(&surface->mutex);
    slot->loading = false;
    strl_condition_broadcast(&surface->loaded);
    if (status != STRL_OK)
        return status;
    slot->chunk = chunk;
    surface->held += chunk->bytes;
    link_newest(surface, index);
    return STRL_OK;
}

strl_status strl__v_surface_pin(strl__surface *surface, uint32_t index, unsigned worker, const strl__chunk **chunk,
                                strl_error *err)
{
    strl_status status = STRL_OK;
    strl__surface_slot *slot = &surface->slots[index];
    *chunk = NULL;
    strl_mutex_lock(&surface->mutex);
    while (slot->loading)
        strl_condition_wait(&surface->loaded, &surface->mutex);
    if (slot->chunk) {
        unlink_slot(surface, index);
        link_newest(surface, index);
    } else {
        status = load_slot(surface, index, worker, err);
    }
    if (status == STRL_OK) {
        slot->pins++;
        *chunk = slot->chunk;
        evict(surface);
    }
    strl_mutex_unlock(&surface->mutex);
    return status;
}

void strl__v_surface_unpin(strl__surface *surface, uint32_t index)
{
    strl_mutex_lock(&surface->mutex);
    surface->slots[index].pins--;
    strl_mutex_unlock(&surface->mutex);
}

/* ---- queries ---- */

void strl__v_seeker_init(strl__seeker *seeker, strl__surface *surface, unsigned worker, uint64_t most_bytes)
{
    *seeker = (strl__seeker){.surface = surface, .worker = worker, .most_bytes = most_bytes, .last_place = NONE};
}

void strl__v_seeker_deinit(strl__seeker *seeker)
{
    for (uint32_t i = 0; i < seeker->pinned; i++)
        strl__v_surface_unpin(seeker->surface, seeker->index[i]);
    seeker->pinned = 0;
    seeker->pinned_bytes = 0;
    seeker->last_place = NONE;
}

/* Place among the pinned ones; NONE after a failure. The chunk stays valid until the next call. */
static uint32_t pinned_place(strl__seeker *seeker, uint32_t index)
{
    for (uint32_t i = 0; i < seeker->pinned; i++)
        if (seeker->index[i] == index)
            return i;
    if (seeker->pinned == STRL__SEEKER_PINS || seeker->pinned_bytes > seeker->most_bytes)
        strl__v_seeker_deinit(seeker);
    const strl__chunk *chunk;
    seeker->status = strl__v_surface_pin(seeker->surface, index, seeker->worker, &chunk, &seeker->error);
    if (seeker->status != STRL_OK)
        return NONE;
    seeker->index[seeker->pinned] = index;
    seeker->chunk[seeker->pinned] = chunk;
    seeker->pinned_bytes += chunk->bytes;
    return seeker->pinned++;
}

static double chunk_triangle_distance2(const strl__chunk *chunk, uint32_t t, const double p[3])
{
    const uint16_t *c = chunk->triangle[t];
    return strl__v_triangle_distance2(p, chunk->vertex[c[0]], chunk->vertex[c[1]], chunk->vertex[c[2]]);
}

/* Nearest triangle of a chunk within best; p relative to its base. */
static double search_chunk(const strl__chunk *chunk, const double p[3], double best, uint32_t *triangle)
{
    struct {
        uint32_t node;
        double distance2;
    } stack[STRL__BVH_STACK];
    unsigned top = 0;
    stack[top].node = 0;
    stack[top++].distance2 = strl__bvh_distance2(&chunk->nodes[0], p);
    while (top) {
        top--;
        if (stack[top].distance2 >= best)
            continue;
        const strl__bvh_node *node = &chunk->nodes[stack[top].node];
        if (node->count) {
            for (uint32_t t = node->first; t < node->first + node->count; t++) {
                double distance2 = chunk_triangle_distance2(chunk, t, p);
                if (distance2 < best) {
                    best = distance2;
                    *triangle = t;
                }
            }
            continue;
        }
        double left = strl__bvh_distance2(&chunk->nodes[node->first], p);
        double right = strl__bvh_distance2(&chunk->nodes[node->first + 1], p);
        uint32_t near = left <= right ? 0 : 1;
        stack[top].node = node->first + 1 - near;
        stack[top++].distance2 = near ? left : right;
        stack[top].node = node->first + near;
        stack[top++].distance2 = near ? right : left;
    }
    return best;
}

static double box_distance2(double (*box)[3], const double p[3])
{
    double sum = 0;
    for (unsigned k = 0; k < 3; k++) {
        double outside = fmax(0, fmax(box[0][k] - p[k], p[k] - box[1][k]));
        sum += outside * outside;
    }
    return sum;
}

static double search_place(strl__seeker *seeker, uint32_t index, const double p[3], double best)
{
    if (box_distance2(seeker->surface->box[index], p) >= best)
        return best;
    uint32_t place = pinned_place(seeker, index);
    if (place == NONE)
        return best;
    const strl__chunk *chunk = seeker->chunk[place];
    const double q[3] = {p[0] - chunk->base[0], p[1] - chunk->base[1], p[2] - chunk->base[2]};
    uint32_t triangle = NONE;
    double found = search_chunk(chunk, q, best, &triangle);
    if (triangle != NONE) {
        seeker->last_place = place;
        seeker->last_triangle = triangle;
    }
    return found;
}

/* A first bound: the distance from what was found for the query before. */
static double first_bound(const strl__seeker *seeker, const double p[3])
{
    if (seeker->last_place == NONE)
        return INFINITY;
    const strl__chunk *chunk = seeker->chunk[seeker->last_place];
    const double q[3] = {p[0] - chunk->base[0], p[1] - chunk->base[1], p[2] - chunk->base[2]};
    return chunk_triangle_distance2(chunk, seeker->last_triangle, q);
}

double strl__v_seeker_claimed(const strl__seeker *seeker)
{
    return seeker->last_place == NONE ? 0 : seeker->chunk[seeker->last_place]->claimed;
}

/* The claim of a chunk is known once it is pinned: before, the largest of all stands for it. */
static double excess_at(strl__seeker *seeker, uint32_t index, const double p[3], double best)
{
    double reach = best + seeker->surface->most_claimed;
    if (box_distance2(seeker->surface->box[index], p) >= reach * reach)
        return best;
    uint32_t place = pinned_place(seeker, index), triangle = NONE;
    if (place == NONE)
        return best;
    const strl__chunk *chunk = seeker->chunk[place];
    const double q[3] = {p[0] - chunk->base[0], p[1] - chunk->base[1], p[2] - chunk->base[2]};
    reach = best + chunk->claimed;
    double found = search_chunk(chunk, q, reach * reach, &triangle);
    return triangle == NONE ? best : sqrt(found) - chunk->claimed;
}

double strl__v_seeker_excess(strl__seeker *seeker, const double p[3], double best)
{
    const strl__surface *surface = seeker->surface;
    const double q[3] = {p[0] - surface->base[0], p[1] - surface->base[1], p[2] - surface->base[2]};
    uint32_t stack[STRL__BVH_STACK];
    unsigned top = 0;
    stack[top++] = 0;
    while (top && seeker->status == STRL_OK && surface->count && best > 0) {
        const strl__bvh_node *node = &surface->nodes[stack[--top]];
        double reach = best + surface->most_claimed;
        if (strl__bvh_distance2(node, q) >= reach * reach)
            continue;
        for (uint32_t i = node->first; i < node->first + node->count && best > 0; i++)
            best = excess_at(seeker, surface->order[i], p, best);
        if (node->count)
            continue;
        stack[top++] = node->first;
        stack[top++] = node->first + 1;
    }
    return best;
}

double strl__v_seeker_distance2(strl__seeker *seeker, const double p[3])
{
    const strl__surface *surface = seeker->surface;
    double best = first_bound(seeker, p);
    const double q[3] = {p[0] - surface->base[0], p[1] - surface->base[1], p[2] - surface->base[2]};
    uint32_t stack[STRL__BVH_STACK];
    unsigned top = 0;
    stack[top++] = 0;
    while (top && seeker->status == STRL_OK && surface->count) {
        const strl__bvh_node *node = &surface->nodes[stack[--top]];
        if (strl__bvh_distance2(node, q) >= best)
            continue;
        if (node->count) {
            for (uint32_t i = node->first; i < node->first + node->count; i++)
                best = search_place(seeker, surface->order[i], p, best);
            continue;
        }
        uint32_t near = strl__bvh_distance2(&surface->nodes[node->first], q) <=
                                strl__bvh_distance2(&surface->nodes[node->first + 1], q)
                            ? 0
                            : 1;
        stack[top++] = node->first + 1 - near;
        stack[top++] = node->first + near;
    }
    return best;
}
