/* Writing the steps of a node payload. docs/format-payload.md, "Steps", is normative. */
#include "geometry/payload_encode.h"

#include <string.h>

#include "base/fail.h"

struct recorder {
    struct strl__encoder *e;
    struct strl__star star;
    uint16_t *stamp;     /* [4 * triangles], the last step's vertex to which a corner went */
    uint32_t step_first; /* first vertex of the step */
    uint32_t vertex, parent;
    uint32_t moved;  /* corners that go from parent to vertex */
    uint32_t *added; /* [triangles], 3 t + corner of the vertex, for those of pm's triangles that the vertex brings */
    uint32_t added_count;
    uint64_t moves;
};

static uint32_t corner_number(const struct strl__encoder *e, uint32_t t, unsigned k)
{
    return 4 * e->triangle_of[t] + (k + e->rotation[t]) % 3;
}

static void mark_moves(struct recorder *r)
{
    const struct strl__encoder *e = r->e;
    for (uint32_t i = e->arrival_first[r->vertex]; i < e->arrival_first[r->vertex + 1]; i++)
        r->stamp[corner_number(e, e->arrival[i] / 4, e->arrival[i] % 4)] = (uint16_t)r->vertex;
    r->moved = e->arrival_first[r->vertex + 1] - e->arrival_first[r->vertex];
    for (uint32_t i = 0; i < r->star.count; i++)
        r->star.moves[i] = r->stamp[r->star.corner[i]] == r->vertex;
}

static void find_added(struct recorder *r, uint32_t step)
{
    const struct strl__encoder *e = r->e;
    r->added_count = 0;
    for (uint32_t t = e->pm->triangle_end[step - 1]; t < e->pm->triangle_end[step]; t++)
        for (unsigned k = 0; k < 3; k++)
            if (e->birth[t][k] == r->vertex)
                r->added[r->added_count++] = 3 * t + k;
}

/* The decoder's number of the i-th corner after the new vertex in an added triangle. */
static uint32_t added_corner(const struct recorder *r, uint32_t added, unsigned i)
{
    return r->e->number[r->e->birth[added / 3][(added % 3 + i) % 3]];
}

/* Whether the marked corners are just those of the arc. */
static bool moves_arc(const struct recorder *r, const struct strl__arc *arc)
{
    if (r->moved != arc->triangles)
        return false;
    for (uint32_t i = 0; i < arc->triangles; i++)
        if (!r->star.moves[r->star.order[strl__arc_place(arc, i)]])
            return false;
    return true;
}

/* Fits an arc from the spoke of a chain, by kind; end: the vertex of its last spoke, for cuts. */
static bool fit_spoke(const struct recorder *r, unsigned kind, uint32_t local, uint32_t end, struct strl__arc *arc)
{
    arc->from = kind == STRL__KIND_HEAD ? 0 : local;
    arc->triangles = kind == STRL__KIND_HEAD ? local : kind == STRL__KIND_CUT ? r->moved : arc->chain->triangles - local;
    if (kind != STRL__KIND_CUT)
        return !arc->chain->closed && moves_arc(r, arc);
    return arc->triangles <= arc->chain->triangles - (arc->chain->closed ? 0 : local) &&
           strl__arc_spoke(&r->star, arc, arc->triangles) == end && moves_arc(r, arc);
}

/* The spoke at which an arc of this kind is just what moves, or STRL__NONE. spoke: the vertex there. */
static uint32_t fit_arc(const struct recorder *r, unsigned kind, uint32_t spoke, uint32_t end, struct strl__arc *arc)
{
    const struct strl__star *star = &r->star;
    for (arc->chain = star->chain; arc->chain < star->chain + star->chain_count; arc->chain++) {
        uint32_t spokes = arc->chain->triangles + !arc->chain->closed;
        for (uint32_t local = 0; local < spokes; local++)
            if (star->spoke[arc->chain->first_spoke + local] == spoke && fit_spoke(r, kind, local, end, arc))
                return arc->chain->first_spoke + local;
    }
    return STRL__NONE;
}

static uint32_t fit_chain(const struct recorder *r, struct strl__arc *arc)
{
    for (uint32_t i = 0; i < r->star.chain_count; i++) {
        *arc = (struct strl__arc){&r->star.chain[i], 0, r->star.chain[i].triangles};
        if (moves_arc(r, arc))
            return i;
    }
    return STRL__NONE;
}

/* Finds the kind that says just what happens; *at: what the spoke stream holds for it. Orders r->added as the kind does. */
static unsigned choose_kind(struct recorder *r, uint32_t *at, struct strl__arc *arc)
{
    uint32_t parent = r->parent;
    if (r->added_count == 0 && (*at = fit_chain(r, arc)) != STRL__NONE)
        return STRL__KIND_CHAIN;
    if (r->added_count == 1) {
        uint32_t x = added_corner(r, r->added[0], 1), y = added_corner(r, r->added[0], 2);
        if (x == parent && (*at = fit_arc(r, STRL__KIND_TAIL, y, 0, arc)) != STRL__NONE)
            return STRL__KIND_TAIL;
        if (y == parent && (*at = fit_arc(r, STRL__KIND_HEAD, x, 0, arc)) != STRL__NONE)
            return STRL__KIND_HEAD;
    }
    if (r->added_count == 2) {
        if (added_corner(r, r->added[0], 1) != parent) {
            uint32_t swap = r->added[0];
            r->added[0] = r->added[1];
            r->added[1] = swap;
        }
        uint32_t a = added_corner(r, r->added[0], 2), b = added_corner(r, r->added[1], 1);
        if (added_corner(r, r->added[0], 1) == parent && added_corner(r, r->added[1], 2) == parent &&
            (*at = fit_arc(r, STRL__KIND_CUT, a, b, arc)) != STRL__NONE)
            return STRL__KIND_CUT;
    }
    return STRL__KIND_GENERAL;
}

static void push_step_position(struct recorder *r, const struct strl__mean *mean)
{
    uint32_t predicted[3];
    strl__mean_get(mean, r->e->mesh.position[r->parent], predicted);
    strl__push_position(r->e, STRL__STREAM_STEP_POSITION, predicted, r->vertex);
}

static void encode_simple(struct recorder *r, unsigned kind, uint32_t at, const struct strl__arc *arc)
{
    struct strl__encoder *e = r->e;
    strl__push(&e->out, STRL__STREAM_SPOKE, at);
    if (kind == STRL__KIND_CUT)
        strl__push(&e->out, STRL__STREAM_ARC, arc->triangles);
    if (r->vertex != r->step_first)
        return;
    struct strl__mean mean = {0};
    for (uint32_t i = 0; i <= arc->triangles; i++)
        strl__mean_add(&mean, e->mesh.position[r->parent], e->mesh.position[strl__arc_spoke(&r->star, arc, i)]);
    push_step_position(r, &mean);
}

static uint32_t corner_code(const struct recorder *r, uint32_t vertex)
{
    if (vertex == r->parent)
        return 0;
    for (uint32_t i = 0; i < r->star.spoke_count; i++)
        if (r->star.spoke[i] == vertex)
            return 1 + i;
    return 1 + r->star.spoke_count + vertex;
}

static void encode_general(struct recorder *r)
{
    struct strl__encoder *e = r->e;
    const struct strl__star *star = &r->star;
    struct strl__mean mean = {0};
    uint8_t moves = 0;
    for (uint32_t done = 0; done < star->count; moves ^= 1) {
        uint32_t run = 0;
        for (; done < star->count && star->moves[star->order[done]] == moves; done++, run++)
            for (unsigned k = 0; moves && k < 2; k++)
                strl__mean_add(&mean, e->mesh.position[r->parent], e->mesh.position[star->wing[star->order[done]][k]]);
        strl__push(&e->out, STRL__STREAM_GENERAL, run);
    }
    if (r->vertex == r->step_first)
        push_step_position(r, &mean);
    strl__push(&e->out, STRL__STREAM_GENERAL, r->added_count);
    for (uint32_t i = 0; i < r->added_count; i++)
        for (unsigned k = 1; k < 3; k++)
            strl__push(&e->out, STRL__STREAM_GENERAL, corner_code(r, added_corner(r, r->added[i], k)));
}

static void encode_wedge_parent(const struct recorder *r, uint32_t previous)
{
    uint32_t code = 0, at = previous;
    do {
        if (at == r->parent)
            break;
        code++;
        at = r->e->mesh.twin[at];
    } while (at != previous);
    strl__push(&r->e->out, STRL__STREAM_WEDGE_PARENT, at == r->parent ? code : code + r->parent);
}

static void encode_wedge(struct recorder *r, uint32_t step)
{
    struct strl__encoder *e = r->e;
    bool is_last = r->vertex + 1 == e->pm->vertex_end[step];
    e->mesh.vertex_count++;
    memcpy(e->mesh.position[r->vertex], e->pm->position[r->vertex], sizeof *e->pm->position);
    if (r->vertex != r->step_first)
        strl__twin_join(e->mesh.twin, r->step_first, r->vertex);
    strl__star_build(&r->star, &e->mesh, r->parent);
    r->moves += r->star.count;
    mark_moves(r);
    find_added(r, step);
    uint32_t at;
    struct strl__arc arc;
    unsigned kind = choose_kind(r, &at, &arc);
    strl__push(&e->out, STRL__STREAM_KIND, kind << 1 | !is_last);
    if (kind == STRL__KIND_GENERAL)
        encode_general(r);
    else
        encode_simple(r, kind, at, &arc);
    strl__star_move(&r->star, &e->mesh, r->parent, r->vertex);
    for (uint32_t i = 0; i < r->added_count; i++) {
        uint32_t corner[3] = {r->vertex, added_corner(r, r->added[i], 1), added_corner(r, r->added[i], 2)};
        strl__encode_triangle(e, r->added[i] / 3, r->added[i] % 3, corner);
    }
}

static void encode_step(struct recorder *r, uint32_t step)
{
    const strl_pm *pm = r->e->pm;
    r->step_first = pm->vertex_end[step - 1];
    for (r->vertex = r->step_first; r->vertex < pm->vertex_end[step]; r->vertex++) {
        uint32_t previous = r->parent;
        r->parent = r->e->number[pm->parent[r->vertex]];
        if (r->vertex == r->step_first)
            strl__push(&r->e->out, STRL__STREAM_PARENT, r->step_first - 1 - r->parent);
        else
            encode_wedge_parent(r, previous);
        encode_wedge(r, step);
    }
}

strl_status strl__encode_steps(struct strl__encoder *e)
{
    struct recorder r = {.e = e};
    uint32_t triangles = e->pm->triangle_count;
    r.stamp = strl_arena_alloc_zero(e->scratch, (size_t)triangles * 4, sizeof *r.stamp);
    r.added = strl_arena_alloc(e->scratch, triangles, sizeof *r.added);
    if (!r.stamp || !r.added || !strl__star_init(&r.star, e->pm->vertex_count, triangles, e->scratch))
        return strl__fail(e->err, STRL_ERR_MEMORY, "no memory to encode a node payload");
    for (uint32_t step = 1; step <= e->pm->step_count; step++) {
        encode_step(&r, step);
        if (r.moves > STRL_PM_MAX_MOVES)
            return strl__fail(e->err, STRL_ERR_LIMIT, "the steps of the progressive mesh visit more than %u triangles",
                              STRL_PM_MAX_MOVES);
    }
    return STRL_OK;
}
