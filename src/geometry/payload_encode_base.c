/* Writing the base mesh of a node payload: walks the gates that the decoder will walk and says what lies behind each.
 * docs/format-payload.md, "Base mesh", is normative. */
#include "geometry/payload_encode.h"

#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "geometry/payload_front.h"

struct walker {
    struct strl__encoder *e;
    struct strl__front front;
    uint32_t *edge_bucket, *edge_next; /* directed edges of unwritten triangles, 3 t + k from corner k to the next */
    uint32_t edge_mask;
    uint32_t *place_bucket; /* one written vertex of each position, by the decoder's number */
    uint32_t place_mask;
    uint32_t seed; /* triangles before it are written */
};

static uint32_t table_size(uint32_t items)
{
    uint32_t size = 16;
    while (size < items + items / 2)
        size *= 2;
    return size;
}

static uint32_t edge_slot(const struct walker *w, uint32_t from, uint32_t to)
{
    return (uint32_t)(((uint64_t)from << 16 | to) * 0x9e3779b97f4a7c15u >> 40) & w->edge_mask;
}

/* The slot of the written vertex at the position of pm's vertex, or the empty slot for it. */
static uint32_t *find_place(struct walker *w, uint32_t vertex)
{
    const int32_t *p = w->e->pm->position[vertex];
    uint64_t key = strl__mix64((uint64_t)(uint32_t)p[0] | (uint64_t)(uint32_t)p[1] << 32) ^ (uint32_t)p[2];
    uint32_t slot = (uint32_t)strl__mix64(key) & w->place_mask;
    for (;; slot = (slot + 1) & w->place_mask) {
        uint32_t there = w->place_bucket[slot];
        if (there == STRL__NONE || !memcmp(w->e->mesh.position[there], p, sizeof *w->e->pm->position))
            return &w->place_bucket[slot];
    }
}

static bool walker_init(struct walker *w)
{
    const strl_pm *pm = w->e->pm;
    uint32_t vertices = pm->vertex_end[0], triangles = pm->triangle_end[0];
    uint32_t edges = table_size(triangles * 3), places = table_size(vertices);
    w->edge_mask = edges - 1;
    w->place_mask = places - 1;
    w->edge_bucket = strl_arena_alloc(w->e->scratch, edges, sizeof *w->edge_bucket);
    w->edge_next = strl_arena_alloc(w->e->scratch, (size_t)triangles * 3, sizeof *w->edge_next);
    w->place_bucket = strl_arena_alloc(w->e->scratch, places, sizeof *w->place_bucket);
    if (!w->edge_bucket || !w->edge_next || !w->place_bucket ||
        !strl__front_init(&w->front, vertices, triangles, w->e->scratch))
        return false;
    memset(w->edge_bucket, 0xff, edges * sizeof *w->edge_bucket);
    memset(w->place_bucket, 0xff, places * sizeof *w->place_bucket);
    for (uint32_t edge = triangles * 3; edge-- > 0;) {
        const uint16_t *corner = w->e->birth[edge / 3];
        uint32_t *bucket = &w->edge_bucket[edge_slot(w, corner[edge % 3], corner[strl__next3(edge % 3)])];
        w->edge_next[edge] = *bucket;
        *bucket = edge;
    }
    for (uint32_t v = 0; v < w->e->copied; v++) {
        uint32_t *place = find_place(w, w->e->vertex[v]);
        *place = *place == STRL__NONE ? v : *place;
    }
    return true;
}

/* An unwritten triangle with the directed edge (from, to) of pm's vertices: 3 t + corner of `from`, or STRL__NONE.
 * Forgets the written ones that it meets, or an edge of very many triangles would cost their square. */
static uint32_t find_edge(struct walker *w, uint32_t from, uint32_t to)
{
    uint32_t *link = &w->edge_bucket[edge_slot(w, from, to)];
    while (*link != STRL__NONE) {
        uint32_t edge = *link;
        const uint16_t *corner = w->e->birth[edge / 3];
        if (w->e->triangle_of[edge / 3] != STRL__NONE) {
            *link = w->edge_next[edge];
            continue;
        }
        if (corner[edge % 3] == from && corner[strl__next3(edge % 3)] == to)
            return edge;
        link = &w->edge_next[edge];
    }
    return STRL__NONE;
}

/* Gives pm's vertex the next number. Returns its twin's number, or STRL__NONE where it is alone at its position so far.
 */
static uint32_t number_vertex(struct walker *w, uint32_t vertex, uint32_t from)
{
    struct strl__encoder *e = w->e;
    uint32_t *place = find_place(w, vertex), twin = *place, number = e->mesh.vertex_count++;
    e->number[vertex] = (uint16_t)number;
    e->vertex[number] = (uint16_t)vertex;
    memcpy(e->mesh.position[number], e->pm->position[vertex], sizeof *e->pm->position);
    e->from[number] = (uint16_t)(twin == STRL__NONE ? from : twin);
    if (twin == STRL__NONE)
        *place = number;
    else
        strl__twin_join(e->mesh.twin, twin, number);
    return twin;
}

static bool is_numbered(const struct strl__encoder *e, uint32_t vertex)
{
    uint32_t number = e->number[vertex];
    return number < e->mesh.vertex_count && e->vertex[number] == vertex;
}

static void as_prediction(const int32_t position[3], uint32_t predicted[3])
{
    for (unsigned k = 0; k < 3; k++)
        predicted[k] = (uint32_t)position[k];
}

static uint32_t latest(const struct strl__encoder *e, uint32_t predicted[3])
{
    uint32_t count = e->mesh.vertex_count;
    predicted[0] = predicted[1] = predicted[2] = 0;
    if (count)
        as_prediction(e->mesh.position[count - 1], predicted);
    return count ? count - 1 : 0;
}

static void encode_seed(struct walker *w, uint32_t t)
{
    struct strl__encoder *e = w->e;
    uint32_t corner[3];
    for (unsigned k = 0; k < 3; k++) {
        uint32_t vertex = e->birth[t][k], predicted[3], count = e->mesh.vertex_count, from = latest(e, predicted);
        if (k) {
            from = corner[k - 1];
            as_prediction(e->mesh.position[from], predicted);
        }
        if (is_numbered(e, vertex)) {
            strl__push(&e->out, STRL__STREAM_SEED, 2 + count - 1 - e->number[vertex]);
        } else {
            uint32_t twin = number_vertex(w, vertex, from);
            strl__push(&e->out, STRL__STREAM_SEED, twin != STRL__NONE);
            if (twin == STRL__NONE)
                strl__push_position(e, STRL__STREAM_BASE_POSITION, predicted, count);
            else
                strl__push(&e->out, STRL__STREAM_TWIN, count - 1 - twin);
        }
        corner[k] = e->number[vertex];
    }
    strl__front_seed(&w->front, corner[0], corner[1], corner[2]);
    strl__encode_triangle(e, t, 0, corner);
}

/* The operation that brings pm's vertex c behind the current gate; numbers c where it is new. */
static unsigned choose_operation(struct walker *w, uint32_t vertex)
{
    struct strl__encoder *e = w->e;
    const struct strl__gate *gate = &w->front.gate[w->front.current];
    uint32_t count = e->mesh.vertex_count;
    if (is_numbered(e, vertex)) {
        uint32_t c = e->number[vertex];
        if (c == w->front.gate[gate->next].end)
            return STRL__OP_RIGHT;
        if (c == w->front.gate[gate->previous].start)
            return STRL__OP_LEFT;
        strl__push(&e->out, STRL__STREAM_REFERENCE, count - 1 - c);
        return STRL__OP_SPLIT;
    }
    uint32_t twin = number_vertex(w, vertex, gate->start);
    if (twin != STRL__NONE) {
        strl__push(&e->out, STRL__STREAM_TWIN, count - 1 - twin);
        return STRL__OP_TWIN;
    }
    uint32_t predicted[3];
    const int32_t *p = e->mesh.position[gate->start], *q = e->mesh.position[gate->end],
                  *r = e->mesh.position[gate->behind];
    for (unsigned k = 0; k < 3; k++)
        predicted[k] = (uint32_t)p[k] + (uint32_t)q[k] - (uint32_t)r[k];
    strl__push_position(e, STRL__STREAM_BASE_POSITION, predicted, count);
    return STRL__OP_NEW;
}

static void encode_operation(struct walker *w)
{
    struct strl__encoder *e = w->e;
    strl__front_settle(&w->front);
    if (w->front.current == STRL__NONE) {
        while (e->triangle_of[w->seed] != STRL__NONE)
            w->seed++;
        encode_seed(w, w->seed);
    } else {
        const struct strl__gate *gate = &w->front.gate[w->front.current];
        unsigned context = strl__front_context(&w->front), operation = STRL__OP_BORDER;
        uint32_t a = gate->start, b = gate->end, edge = find_edge(w, e->vertex[b], e->vertex[a]), c = 0;
        if (edge != STRL__NONE) {
            uint32_t apex = e->birth[edge / 3][(edge % 3 + 2) % 3];
            operation = choose_operation(w, apex);
            c = e->number[apex];
        }
        strl__push(&e->out, STRL__STREAM_OPERATION + context, operation);
        strl__front_apply(&w->front, operation, c);
        if (operation == STRL__OP_BORDER)
            return;
        strl__encode_triangle(e, edge / 3, edge % 3, (uint32_t[3]){b, a, c});
    }
    uint16_t added[3];
    strl__mesh_get_triangle(&e->mesh, e->mesh.triangle_count - 1, added);
    for (unsigned k = 0; k < 3; k++)
        strl__front_count(&w->front, added[k]);
}

strl_status strl__encode_base(struct strl__encoder *e)
{
    struct walker w = {.e = e};
    if (!walker_init(&w))
        return strl__fail(e->err, STRL_ERR_MEMORY, "no memory to encode a node payload");
    while (e->mesh.triangle_count < e->pm->triangle_end[0])
        encode_operation(&w);
    for (uint32_t v = 0; v < e->pm->vertex_end[0]; v++) {
        if (is_numbered(e, v))
            continue;
        uint32_t predicted[3], from = latest(e, predicted), number = e->mesh.vertex_count++;
        e->number[v] = (uint16_t)number;
        e->vertex[number] = (uint16_t)v;
        e->from[number] = (uint16_t)from;
        memcpy(e->mesh.position[number], e->pm->position[v], sizeof *e->pm->position);
        strl__push_position(e, STRL__STREAM_BASE_POSITION, predicted, number);
    }
    return STRL_OK;
}
