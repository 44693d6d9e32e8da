/* Writing the steps of a node payload. docs/format-payload.md, "Steps", is normative. */
#include "geometry/payload_encode.h"

#include <string.h>

#include "base/fail.h"

struct recorder {
    struct strl__encoder *e;
    struct strl__star star;
    uint32_t *arc;   /* [triangles], places of the corners that move, in the order in which the decoder moves them */
    uint16_t *ends;  /* [vertices], the last step's vertex for which a moving triangle (u, x, y) had this y */
    uint16_t *stamp; /* [4 * triangles], the last step's vertex to which a corner went */
    uint32_t step_first; /* first vertex of the step */
    uint32_t vertex, parent;
    uint32_t moved;  /* corners that go from parent to vertex */
    uint32_t *added; /* [triangles], 3 t + corner of the vertex, for those of pm's triangles that the vertex brings */
    uint32_t added_count;
    uint64_t moves; /* work so far, counted as the decoder does, see STRL_PM_MAX_MOVES */
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

/* Follows the decoder's arc from a place: true where it is just what moves. Leaves it in r->arc. */
static bool follow_arc(struct recorder *r, uint32_t place)
{
    const struct strl__star *star = &r->star;
    uint32_t count = 0;
    bool arrived = true;
    while (arrived && place != STRL__NONE && star->moves[place]) {
        star->moves[place] = 0; /* each once */
        r->arc[count++] = place;
        arrived = count < r->moved;
        place = strl__star_follower(star, star->wing[place][1]);
    }
    for (uint32_t i = 0; i < count; i++)
        star->moves[r->arc[i]] = 1;
    return count == r->moved;
}

/* Finds the arc that begins at vertex a, or at any where a is STRL__NONE. */
static bool find_arc(struct recorder *r, uint32_t a)
{
    const struct strl__star *star = &r->star;
    uint32_t start = STRL__NONE;
    for (uint32_t i = 0; i < star->count; i++)
        if (star->moves[i])
            r->ends[star->wing[i][1]] = (uint16_t)r->vertex;
    for (uint32_t i = 0; i < star->count; i++) {
        if (!star->moves[i])
            continue;
        if (a != STRL__NONE && star->wing[i][0] == a && follow_arc(r, i))
            return true;
        if (start == STRL__NONE || r->ends[star->wing[i][0]] != r->vertex)
            start = i; /* nothing that moves leads here */
    }
    return a == STRL__NONE && start != STRL__NONE && follow_arc(r, start);
}

/* Finds the kind that says just what happens; r->arc is then the arc. Orders r->added as the kind does. */
static unsigned choose_kind(struct recorder *r)
{
    uint32_t parent = r->parent, count = r->added_count;
    if (count > 2 || r->moved == 0)
        return STRL__KIND_GENERAL;
    if (count == 2 && added_corner(r, r->added[0], 1) != parent) {
        uint32_t swap = r->added[0];
        r->added[0] = r->added[1];
        r->added[1] = swap;
    }
    bool start = count > 0 && added_corner(r, r->added[0], 1) == parent;
    bool end = count > 0 && added_corner(r, r->added[count - 1], 2) == parent;
    if (count != (uint32_t)start + end)
        return STRL__KIND_GENERAL;
    if (!find_arc(r, start ? added_corner(r, r->added[0], 2) : STRL__NONE))
        return STRL__KIND_GENERAL;
    if (end && r->star.wing[r->arc[r->moved - 1]][1] != added_corner(r, r->added[count - 1], 1))
        return STRL__KIND_GENERAL;
    return (start ? STRL__KIND_START : 0u) | (end ? STRL__KIND_END : 0u);
}

static void push_step_position(struct recorder *r, const struct strl__mean *mean)
{
    uint32_t predicted[3];
    strl__mean_get(mean, r->e->mesh.position[r->parent], predicted);
    strl__push_position(r->e, STRL__STREAM_STEP_POSITION, predicted, r->vertex);
}

static void encode_arc(struct recorder *r)
{
    struct strl__encoder *e = r->e;
    const struct strl__star *star = &r->star;
    strl__push(&e->out, STRL__STREAM_START, r->arc[0]);
    strl__push(&e->out, STRL__STREAM_ARC, r->moved - 1);
    if (r->vertex != r->step_first)
        return;
    struct strl__mean mean = {0};
    strl__mean_add(&mean, e->mesh.position[star->wing[r->arc[0]][0]]);
    for (uint32_t i = 0; i < r->moved; i++)
        strl__mean_add(&mean, e->mesh.position[star->wing[r->arc[i]][1]]);
    push_step_position(r, &mean);
}

static uint32_t corner_code(const struct recorder *r, uint32_t vertex)
{
    const struct strl__star *star = &r->star;
    if (vertex == r->parent)
        return 0;
    for (uint32_t i = 0; i < star->count; i++)
        for (uint32_t k = 0; k < 2; k++)
            if (star->wing[i][k] == vertex)
                return 1 + k * star->count + i;
    return 1 + 2 * star->count + vertex;
}

static void encode_general(struct recorder *r)
{
    struct strl__encoder *e = r->e;
    const struct strl__star *star = &r->star;
    struct strl__mean mean = {0};
    uint32_t moved = 0;
    uint8_t moves = 0;
    for (uint32_t done = 0; done < star->count; moves ^= 1) {
        uint32_t run = 0;
        for (; done < star->count && star->moves[done] == moves; done++, run++) {
            if (!moves)
                continue;
            r->arc[moved++] = done;
            strl__mean_add(&mean, e->mesh.position[star->wing[done][0]]);
            strl__mean_add(&mean, e->mesh.position[star->wing[done][1]]);
        }
        strl__push(&e->out, STRL__STREAM_GENERAL, run);
    }
    if (r->vertex == r->step_first)
        push_step_position(r, &mean);
    strl__push(&e->out, STRL__STREAM_GENERAL, r->added_count);
    for (uint32_t i = 0; i < r->added_count; i++)
        for (unsigned k = 1; k < 3; k++)
            strl__push(&e->out, STRL__STREAM_GENERAL, corner_code(r, added_corner(r, r->added[i], k)));
}

static void encode_wedge_parent(struct recorder *r, uint32_t previous)
{
    uint32_t code = 0, at = previous;
    do {
        if (at == r->parent)
            break;
        code++;
        r->moves++;
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
    unsigned kind = choose_kind(r);
    strl__push(&e->out, STRL__STREAM_KIND, kind << 1 | !is_last);
    if (kind == STRL__KIND_GENERAL)
        encode_general(r);
    else
        encode_arc(r);
    strl__star_move(&r->star, &e->mesh, r->parent, r->vertex, r->arc, r->moved);
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
    r.arc = strl_arena_alloc(e->scratch, triangles, sizeof *r.arc);
    r.ends = strl_arena_alloc_zero(e->scratch, e->pm->vertex_count, sizeof *r.ends);
    if (!r.stamp || !r.added || !r.arc || !r.ends ||
        !strl__star_init(&r.star, e->pm->vertex_count, triangles, e->scratch))
        return strl__fail(e->err, STRL_ERR_MEMORY, "no memory to encode a node payload");
    for (uint32_t step = 1; step <= e->pm->step_count; step++) {
        encode_step(&r, step);
        if (r.moves > STRL_PM_MAX_MOVES)
            return strl__fail(e->err, STRL_ERR_LIMIT, "the steps of the progressive mesh visit more than %u triangles",
                              STRL_PM_MAX_MOVES);
    }
    return STRL_OK;
}
