/* docs/format-payload.md, "Steps". Names are that text's. */
#include <string.h>

#include "base/fail.h"
#include "verify/payload.h"

#define NONE UINT32_MAX
/* A decoder may refuse more: places of stars and vertices passed in rings. */
#define MOST_WORK ((uint64_t)1 << 26)

enum { GENERAL = 4 };

/* The corners at u by place, before any of them moves. */
typedef struct vertex_star {
    uint32_t count;
    uint32_t *corner;
    uint16_t (*wing)[2]; /* x, y */
    bool *moves;
    uint32_t *starting; /* [V] the last place with this x; stale ones are recognised */
    uint32_t *order;    /* places that move, in order */
    uint32_t moving;
} vertex_star;

typedef struct stepping {
    strl__v_payload *payload;
    vertex_star star;
    uint64_t work;
    uint32_t step;
} stepping;

static strl_status refuse(const stepping *self, const char *what)
{
    return strl__fail(self->payload->err, STRL_ERR_FORMAT, "step %u: %s", self->step, what);
}

static bool find_parent(stepping *self, uint32_t first, uint32_t before, uint32_t *u)
{
    strl__v_payload *p = self->payload;
    if (before == NONE) {
        uint32_t value = strl__v_pull(p, STRL__V_PARENT);
        *u = first - 1 - value;
        return value < first;
    }
    uint32_t w = strl__v_pull(p, STRL__V_WEDGE), passed = 0;
    *u = before;
    while (passed < w) {
        *u = p->ring[*u];
        passed++;
        if (*u == before) { /* passed is the size of the ring */
            *u = w - passed;
            break;
        }
    }
    self->work += passed;
    return *u < first;
}

static void build_star(stepping *self, uint32_t u)
{
    strl__v_payload *p = self->payload;
    vertex_star *star = &self->star;
    star->count = star->moving = 0;
    for (uint32_t c = p->first[u]; c != NONE; c = p->next[c]) {
        const uint16_t *triangle = p->mesh->triangle[c / 3];
        uint32_t place = star->count++;
        star->corner[place] = c;
        star->wing[place][0] = triangle[(c % 3 + 1) % 3];
        star->wing[place][1] = triangle[(c % 3 + 2) % 3];
        star->moves[place] = false;
        star->starting[star->wing[place][0]] = place;
    }
    self->work += star->count;
}

static uint32_t follower(const vertex_star *star, uint32_t place)
{
    uint16_t y = star->wing[place][1];
    uint32_t found = star->starting[y];
    return found < star->count && star->wing[found][0] == y ? found : NONE;
}

static void move_place(vertex_star *star, uint32_t place)
{
    star->moves[place] = true;
    star->order[star->moving++] = place;
}

/* Where the first vertex of a step is expected: near the mean of its parent and some neighbours. */
typedef struct position_mean {
    uint32_t sum[3];
    uint32_t count;
} position_mean;

static void mean_add(const strl__v_payload *p, position_mean *mean, uint32_t vertex)
{
    for (unsigned k = 0; k < 3; k++)
        mean->sum[k] += (uint32_t)p->mesh->position[vertex][k];
    mean->count++;
}

static void place_vertex(strl__v_payload *p, const position_mean *mean, uint32_t u, uint32_t v)
{
    int64_t s = 65536 / (mean->count + 1);
    for (unsigned k = 0; k < 3; k++) {
        uint32_t at = (uint32_t)p->mesh->position[u][k];
        int64_t d = (int32_t)(mean->sum[k] - mean->count * at);
        uint32_t predicted = at + (uint32_t)((d * s + 32768) >> 16);
        p->mesh->position[v][k] = (int32_t)(predicted + strl__v_residual(p, STRL__V_STEP + k));
    }
}

static void move_corners(stepping *self, uint32_t u, uint32_t v)
{
    strl__v_payload *p = self->payload;
    const vertex_star *star = &self->star;
    uint32_t *tail = &p->first[u];
    for (uint32_t place = 0; place < star->count; place++)
        if (!star->moves[place]) {
            *tail = star->corner[place];
            tail = &p->next[star->corner[place]];
        }
    *tail = NONE;
    for (uint32_t i = 0; i < star->moving; i++)
        strl__v_list_corner(p, star->corner[star->order[i]], v);
}

/* ---- arcs ---- */

static bool choose_arc(stepping *self)
{
    vertex_star *star = &self->star;
    uint32_t place = strl__v_pull(self->payload, STRL__V_START), m = strl__v_pull(self->payload, STRL__V_ARC);
    if (place >= star->count || m >= star->count)
        return false;
    for (uint32_t i = 0; i <= m; i++) {
        if (place == NONE || star->moves[place])
            return false;
        move_place(star, place);
        place = i < m ? follower(star, place) : NONE;
    }
    return true;
}

static strl_status split_arc(stepping *self, uint32_t kind, uint32_t u, uint32_t v, bool is_first)
{
    strl__v_payload *p = self->payload;
    vertex_star *star = &self->star;
    position_mean mean = {0};
    if (!choose_arc(self))
        return refuse(self, "an arc is not one");
    uint32_t a = star->wing[star->order[0]][0], b = star->wing[star->order[star->moving - 1]][1];
    mean_add(p, &mean, a);
    for (uint32_t i = 0; i < star->moving; i++)
        mean_add(p, &mean, star->wing[star->order[i]][1]);
    if (is_first)
        place_vertex(p, &mean, u, v);
    bool good = !strl__v_same_position(p, v, a) && (kind == 0 || !strl__v_same_position(p, v, u));
    for (uint32_t i = 0; i < star->moving; i++)
        good = good && !strl__v_same_position(p, v, star->wing[star->order[i]][1]);
    if (!good)
        return refuse(self, "a vertex is where a neighbour is");
    move_corners(self, u, v);
    if ((kind & 1 && !strl__v_add_triangle(p, v, u, a)) || (kind & 2 && !strl__v_add_triangle(p, v, b, u)))
        return refuse(self, "too many triangles, or a degenerate one");
    return STRL_OK;
}

/* ---- general splits ---- */

static bool choose_places(stepping *self)
{
    vertex_star *star = &self->star;
    uint32_t at = 0;
    for (uint32_t run = 0; at < star->count; run++) {
        uint32_t length = strl__v_pull(self->payload, STRL__V_GENERAL);
        if (length > star->count - at || (length == 0 && run > 0))
            return false;
        for (uint32_t end = at + length; at < end; at++)
            if (run % 2)
                move_place(star, at);
    }
    return true;
}

static bool named_vertex(stepping *self, uint32_t u, uint32_t first, uint32_t *vertex)
{
    const vertex_star *star = &self->star;
    uint32_t value = strl__v_pull(self->payload, STRL__V_GENERAL), n = star->count;
    if (value == 0)
        *vertex = u;
    else if (value - 1 < n)
        *vertex = star->wing[value - 1][0];
    else if (value - 1 < 2 * n)
        *vertex = star->wing[value - 1 - n][1];
    else
        *vertex = value - 1 - 2 * n;
    return *vertex < first;
}

static strl_status split_general(stepping *self, uint32_t u, uint32_t v, uint32_t first)
{
    strl__v_payload *p = self->payload;
    vertex_star *star = &self->star;
    position_mean mean = {0};
    if (!choose_places(self))
        return refuse(self, "runs of places do not add up");
    for (uint32_t i = 0; i < 2 * star->moving; i++)
        mean_add(p, &mean, star->wing[star->order[i / 2]][i % 2]);
    if (v == first)
        place_vertex(p, &mean, u, v);
    for (uint32_t i = 0; i < 2 * star->moving; i++)
        if (strl__v_same_position(p, v, star->wing[star->order[i / 2]][i % 2]))
            return refuse(self, "a vertex is where a neighbour is");
    move_corners(self, u, v);
    uint32_t triangles = strl__v_pull(p, STRL__V_GENERAL), x, y;
    if (triangles > p->triangles - p->triangle_count)
        return refuse(self, "too many triangles");
    for (uint32_t i = 0; i < triangles; i++)
        if (!named_vertex(self, u, first, &x) || !named_vertex(self, u, first, &y) || !strl__v_add_triangle(p, v, x, y))
            return refuse(self, "a corner is out of range, or a triangle degenerate");
    return STRL_OK;
}

/* ---- steps ---- */

/* before: parent of the step's vertex before, NONE for the first; receives this one's. */
static strl_status add_vertex(stepping *self, uint32_t first, uint32_t *before, bool *more)
{
    strl__v_payload *p = self->payload;
    uint32_t u, v = p->vertex_count;
    bool is_first = *before == NONE;
    if (v == p->vertices || !find_parent(self, first, *before, &u))
        return refuse(self, "too many vertices, or a parent out of range");
    p->vertex_count++;
    p->mesh->parent[v] = (uint16_t)u;
    *before = u;
    if (!is_first) {
        strl__v_join(p, v, first);
        memcpy(p->mesh->position[v], p->mesh->position[first], sizeof *p->mesh->position);
    }
    uint32_t value = strl__v_pull(p, STRL__V_KIND), kind = value / 2;
    *more = value % 2;
    build_star(self, u);
    if (self->work > MOST_WORK || kind > GENERAL || p->starved)
        return refuse(self, "too much work, an unknown kind, or a value is missing");
    return kind == GENERAL ? split_general(self, u, v, first) : split_arc(self, kind, u, v, is_first);
}

static strl_status take_step(stepping *self)
{
    uint32_t first = self->payload->vertex_count, before = NONE;
    bool more = true;
    strl_status status = STRL_OK;
    while (status == STRL_OK && more)
        status = add_vertex(self, first, &before, &more);
    return status;
}

static bool star_init(vertex_star *star, const strl__v_payload *p)
{
    size_t corners = 3 * (size_t)p->triangles;
    star->corner = strl_arena_alloc(p->arena, corners, sizeof *star->corner);
    star->wing = strl_arena_alloc(p->arena, corners, sizeof *star->wing);
    star->moves = strl_arena_alloc(p->arena, corners, sizeof *star->moves);
    star->order = strl_arena_alloc(p->arena, corners, sizeof *star->order);
    star->starting = strl_arena_alloc_zero(p->arena, p->vertices, sizeof *star->starting);
    return star->corner && star->wing && star->moves && star->order && star->starting;
}

strl_status strl__v_payload_steps(strl__v_payload *payload)
{
    stepping self = {.payload = payload};
    if (!star_init(&self.star, payload))
        return strl__fail(payload->err, STRL_ERR_MEMORY, "no memory for %u steps", payload->steps);
    for (self.step = 1; self.step <= payload->steps; self.step++) {
        strl_status status = take_step(&self);
        if (status != STRL_OK)
            return status;
        payload->mesh->vertex_end[self.step] = payload->vertex_count;
        payload->mesh->triangle_end[self.step] = payload->triangle_count;
    }
    if (payload->vertex_count != payload->vertices || payload->triangle_count != payload->triangles)
        return strl__fail(payload->err, STRL_ERR_FORMAT, "the steps end with %u of %u vertices and %u of %u triangles",
                          payload->vertex_count, payload->vertices, payload->triangle_count, payload->triangles);
    return STRL_OK;
}
