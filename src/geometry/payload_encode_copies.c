/* Writing what a base mesh has of its reference. Triangles are the same where their corners lie at the same places in
 * the same order; which vertices correspond follows from the triangles. docs/format-payload.md, "Copies", is normative.
 */
#include "geometry/payload_encode.h"

#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "geometry/payload_reference.h"

struct matcher {
    struct strl__encoder *e;
    struct strl__copy copy;
    uint32_t *place_bucket; /* the least vertex of the base mesh at each place */
    uint32_t place_mask;
    uint32_t *place;         /* [base vertices], that vertex */
    uint32_t *bucket, *next; /* triangles of the base mesh by the places of their corners */
    uint32_t mask;
};

static uint32_t table_size(uint32_t items)
{
    uint32_t size = 16;
    while (size < items + items / 2)
        size *= 2;
    return size;
}

/* The slot of the place of a position, empty where no base vertex lies there. */
static uint32_t *find_place(const struct matcher *m, const int32_t position[3])
{
    uint64_t key = strl__mix64((uint64_t)(uint32_t)position[0] | (uint64_t)(uint32_t)position[1] << 32);
    uint32_t slot = (uint32_t)strl__mix64(key ^ (uint32_t)position[2]) & m->place_mask;
    for (;; slot = (slot + 1) & m->place_mask) {
        uint32_t there = m->place_bucket[slot];
        if (there == STRL__NONE || strl__is_at(m->e->pm->position[there], position))
            return &m->place_bucket[slot];
    }
}

/* By three places: the same for any rotation. Returns the corner to begin with. */
static unsigned first_corner(const uint32_t place[3])
{
    return place[0] < place[1] ? (place[0] < place[2] ? 0 : 2) : (place[1] < place[2] ? 1 : 2);
}

static uint32_t triangle_slot(const struct matcher *m, const uint32_t place[3])
{
    unsigned first = first_corner(place);
    uint64_t key =
        (uint64_t)place[first] | (uint64_t)place[strl__next3(first)] << 16 | (uint64_t)place[strl__last3(first)] << 32;
    return (uint32_t)strl__mix64(key) & m->mask;
}

static bool matcher_init(struct matcher *m)
{
    const strl_pm *pm = m->e->pm;
    strl_arena *scratch = m->e->scratch;
    uint32_t vertices = pm->vertex_end[0], triangles = pm->triangle_end[0];
    uint32_t places = table_size(vertices), buckets = table_size(triangles);
    m->place_mask = places - 1;
    m->mask = buckets - 1;
    m->place_bucket = strl_arena_alloc(scratch, places, sizeof *m->place_bucket);
    m->place = strl_arena_alloc(scratch, vertices, sizeof *m->place);
    m->bucket = strl_arena_alloc(scratch, buckets, sizeof *m->bucket);
    m->next = strl_arena_alloc(scratch, triangles, sizeof *m->next);
    m->e->copied_from = strl_arena_alloc(scratch, vertices, sizeof *m->e->copied_from);
    if (!m->place_bucket || !m->place || !m->bucket || !m->next || !m->e->copied_from ||
        !strl__copy_init(&m->copy, m->e->reference, scratch))
        return false;
    memset(m->place_bucket, 0xff, places * sizeof *m->place_bucket);
    memset(m->bucket, 0xff, buckets * sizeof *m->bucket);
    for (uint32_t v = 0; v < vertices; v++) {
        uint32_t *slot = find_place(m, pm->position[v]);
        *slot = m->place[v] = *slot == STRL__NONE ? v : *slot;
    }
    for (uint32_t t = triangles; t-- > 0;) {
        const uint16_t *c = m->e->birth[t];
        uint32_t *slot = &m->bucket[triangle_slot(m, (uint32_t[3]){m->place[c[0]], m->place[c[1]], m->place[c[2]]})];
        m->next[t] = *slot;
        *slot = t;
    }
    return true;
}

static bool is_numbered(const struct strl__encoder *e, uint32_t vertex)
{
    uint32_t number = e->number[vertex];
    return number < e->mesh.vertex_count && e->vertex[number] == vertex;
}

/* Whether the reference's corners can be the base triangle's from its corner `first` on: vertices correspond one to
 * one. */
static bool agrees(const struct matcher *m, const uint16_t from[3], uint32_t t, unsigned first)
{
    for (unsigned k = 0; k < 3; k++) {
        uint32_t vertex = m->e->birth[t][(first + k) % 3], number = m->copy.number[from[k]];
        if (number == STRL__NO_NUMBER ? is_numbered(m->e, vertex) : m->e->vertex[number] != vertex)
            return false;
    }
    return true;
}

/* The unwritten base triangle that is the reference's: 3 t + the corner that is its corner 0; or STRL__NONE. */
static uint32_t find_triangle(const struct matcher *m, const uint16_t from[3])
{
    uint32_t place[3];
    for (unsigned k = 0; k < 3; k++) {
        int32_t position[3];
        strl__reference_place(m->copy.from, from[k], position);
        place[k] = *find_place(m, position);
        if (place[k] == STRL__NONE)
            return STRL__NONE;
    }
    for (uint32_t t = m->bucket[triangle_slot(m, place)]; t != STRL__NONE; t = m->next[t]) {
        const uint16_t *c = m->e->birth[t];
        for (unsigned first = 0; first < 3 && m->e->triangle_of[t] == STRL__NONE; first++)
            if (m->place[c[first]] == place[0] && m->place[c[(first + 1) % 3]] == place[1] &&
                m->place[c[(first + 2) % 3]] == place[2] && agrees(m, from, t, first))
                return 3 * t + first;
    }
    return STRL__NONE;
}

/* Numbers the base vertex as the copy of the reference's. */
static uint32_t number_copy(struct matcher *m, uint32_t vertex, uint32_t from, uint32_t before)
{
    struct strl__encoder *e = m->e;
    uint32_t number = e->mesh.vertex_count++;
    e->number[vertex] = m->copy.number[from] = (uint16_t)number;
    e->vertex[number] = (uint16_t)vertex;
    e->copied_from[number] = (uint16_t)from;
    e->from[number] = (uint16_t)before;
    memcpy(e->mesh.position[number], e->pm->position[vertex], sizeof *e->pm->position);
    return number;
}

static void encode_triangle(struct matcher *m, const uint16_t from[3], uint32_t found)
{
    uint32_t corner[3], count = m->e->mesh.vertex_count, before = count ? count - 1 : 0;
    for (unsigned k = 0; k < 3; k++) {
        corner[k] = m->copy.number[from[k]];
        if (corner[k] == STRL__NO_NUMBER)
            corner[k] = number_copy(m, m->e->birth[found / 3][(found % 3 + k) % 3], from[k], before);
        before = corner[k];
    }
    strl__encode_triangle(m->e, found / 3, found % 3, corner);
}

/* Lengths of runs of triangles that are taken and left in turn, one sequence a context. */
struct runs {
    uint32_t length[STRL__SELECT_CONTEXTS];
    bool leaves[STRL__SELECT_CONTEXTS];
};

static void push_choice(struct matcher *m, struct runs *runs, unsigned context, bool leave)
{
    if (runs->leaves[context] != leave) {
        strl__push(&m->e->out, STRL__STREAM_SELECT + context, runs->length[context]);
        runs->length[context] = 0;
        runs->leaves[context] = leave;
    }
    runs->length[context]++;
}

strl_status strl__encode_copies(struct strl__encoder *e)
{
    struct matcher m = {.e = e};
    struct runs runs = {0};
    if (!e->reference)
        return STRL_OK;
    if (!matcher_init(&m))
        return strl__fail(e->err, STRL_ERR_MEMORY, "no memory to encode a node payload");
    for (uint32_t t = 0; t < e->reference->triangle_count; t++) {
        const uint16_t *from = e->reference->triangle[t];
        uint32_t found = find_triangle(&m, from);
        push_choice(&m, &runs, strl__copy_context(&m.copy, from), found == STRL__NONE);
        strl__copy_mark(&m.copy, from, found == STRL__NONE);
        if (found != STRL__NONE)
            encode_triangle(&m, from, found);
    }
    for (unsigned i = 0; i < STRL__SELECT_CONTEXTS; i++)
        if (runs.length[i])
            strl__push(&e->out, STRL__STREAM_SELECT + i, runs.length[i]);
    e->copied = e->mesh.vertex_count;
    return STRL_OK;
}
