/* The steps of a node payload: vertex splits. docs/format-payload.md, "Steps", is normative. */
#include "geometry/payload_decode.h"

#include <inttypes.h>

#include "base/fail.h"

struct splitter {
    struct strl__decoder *d;
    struct strl__star star;
    uint32_t step_first; /* first vertex of the step */
    uint32_t *arc;       /* [triangles], places of the corners that move */
    uint64_t moves;      /* work so far, see STRL_PM_MAX_MOVES */
};

/* The parent of a step's second and further vertices: the same, another vertex at its position, or any. */
static bool decode_wedge_parent(struct splitter *s, uint32_t previous, uint32_t *parent)
{
    const uint16_t *twin = s->d->mesh.twin;
    uint32_t code = strl__pull(&s->d->in, STRL__STREAM_WEDGE_PARENT), at = previous;
    do {
        if (code-- == 0) {
            *parent = at;
            return true;
        }
        at = twin[at];
        s->moves++;
    } while (at != previous);
    *parent = code;
    return code < s->step_first;
}

/* What a step still needs of a wedge once its corners are known. */
struct wedge {
    uint32_t vertex, parent;
    bool is_first; /* it brings the step's position */
};

static void set_first_position(struct splitter *s, const struct wedge *w, const struct strl__mean *mean)
{
    uint32_t predicted[3];
    strl__mean_get(mean, s->d->mesh.position[w->parent], predicted);
    strl__pull_position(&s->d->in, STRL__STREAM_STEP_POSITION, predicted, s->d->mesh.position[w->vertex]);
}

static bool add_triangle(struct splitter *s, uint32_t a, uint32_t b, uint32_t c)
{
    if (s->d->mesh.triangle_count >= s->d->sizes.triangle_count)
        return false;
    strl__mesh_add_triangle(&s->d->mesh, a, b, c);
    return true;
}

/* A wedge whose corners are an arc. The neighbours differ in position from u already; v must differ from them and from
 * u. */
static bool decode_arc(struct splitter *s, const struct wedge *w, unsigned kind)
{
    struct strl__star *star = &s->star;
    struct strl__mesh *mesh = &s->d->mesh;
    const int32_t(*position)[3] = (const int32_t(*)[3])mesh->position;
    const int32_t *origin = position[w->parent], *v = position[w->vertex];
    uint32_t start = strl__pull(&s->d->in, STRL__STREAM_START), count = strl__pull(&s->d->in, STRL__STREAM_ARC),
             place = start;
    struct strl__mean mean = {0};
    bool sound = count < star->count;
    if (!sound || start >= star->count)
        return false;
    strl__mean_add(&mean, position[star->wing[start][0]]);
    for (uint32_t i = 0;; i++) {
        s->arc[i] = place;
        strl__mean_add(&mean, position[star->wing[place][1]]);
        sound &= !star->moves[place];
        star->moves[place] = 1;
        if (i == count)
            break;
        place = strl__star_follower(star, star->wing[place][1]);
        if (place == STRL__NONE)
            return false;
    }
    if (w->is_first)
        set_first_position(s, w, &mean);
    uint16_t a = star->wing[start][0], b = star->wing[place][1];
    sound &= !strl__is_at(v, position[a]) && (!kind || !strl__is_at(v, origin));
    sound &= strl__star_move(star, mesh, w->parent, w->vertex, s->arc, count + 1);
    if (sound && kind & STRL__KIND_START)
        sound = add_triangle(s, w->vertex, w->parent, a);
    if (sound && kind & STRL__KIND_END)
        sound = add_triangle(s, w->vertex, b, w->parent);
    return sound;
}

/* 0 is the parent; then the x of all places, then their y; then vertices by number. */
static bool decode_corner(struct splitter *s, uint32_t parent, uint32_t *vertex)
{
    uint32_t code = strl__pull(&s->d->in, STRL__STREAM_GENERAL), count = s->star.count;
    if (code == 0)
        *vertex = parent;
    else if (code - 1 < 2 * count)
        *vertex = s->star.wing[(code - 1) % count][(code - 1) / count];
    else
        *vertex = code - 1 - 2 * count;
    return *vertex < s->step_first;
}

/* Runs of corners that stay and go, in turn. Those that go are put in s->arc. */
static bool decode_runs(struct splitter *s, struct strl__mean *mean, uint32_t *moved)
{
    struct strl__star *star = &s->star;
    const int32_t(*position)[3] = (const int32_t(*)[3])s->d->mesh.position;
    bool moves = false;
    for (uint32_t done = 0; done < star->count; moves = !moves) {
        uint32_t run = strl__pull(&s->d->in, STRL__STREAM_GENERAL);
        if (run > star->count - done || (run == 0 && done) || s->d->in.failed)
            return false;
        for (uint32_t end = done + run; done < end; done++) {
            if (!moves)
                continue;
            s->arc[(*moved)++] = done;
            star->moves[done] = 1;
            strl__mean_add(mean, position[star->wing[done][0]]);
            strl__mean_add(mean, position[star->wing[done][1]]);
        }
    }
    return true;
}

static bool decode_general(struct splitter *s, const struct wedge *w)
{
    struct strl__star *star = &s->star;
    const int32_t(*position)[3] = (const int32_t(*)[3])s->d->mesh.position;
    struct strl__mean mean = {0};
    uint32_t moved = 0;
    if (!decode_runs(s, &mean, &moved))
        return false;
    if (w->is_first)
        set_first_position(s, w, &mean);
    for (uint32_t i = 0; i < moved; i++)
        if (strl__same_position(position, w->vertex, star->wing[s->arc[i]][0]))
            return false;
    if (!strl__star_move(star, &s->d->mesh, w->parent, w->vertex, s->arc, moved))
        return false;
    uint32_t triangles = strl__pull(&s->d->in, STRL__STREAM_GENERAL);
    for (uint32_t i = 0; i < triangles; i++) {
        uint32_t x, y;
        if (!decode_corner(s, w->parent, &x) || !decode_corner(s, w->parent, &y) || s->d->in.failed ||
            strl__same_position(position, x, y) || strl__same_position(position, w->vertex, x) ||
            strl__same_position(position, w->vertex, y) || !add_triangle(s, w->vertex, x, y))
            return false;
    }
    return true;
}

static bool decode_wedge(struct splitter *s, uint32_t parent, unsigned kind)
{
    struct strl__mesh *mesh = &s->d->mesh;
    struct wedge w = {mesh->vertex_count, parent, mesh->vertex_count == s->step_first};
    s->d->pm->parent[w.vertex] = (uint16_t)parent;
    mesh->vertex_count++;
    if (!w.is_first) {
        for (unsigned k = 0; k < 3; k++)
            mesh->position[w.vertex][k] = mesh->position[s->step_first][k];
        strl__twin_join(mesh->twin, s->step_first, w.vertex);
    }
    strl__star_build(&s->star, mesh, parent);
    s->moves += s->star.count;
    if (s->moves > STRL_PM_MAX_MOVES)
        return false;
    return kind == STRL__KIND_GENERAL ? decode_general(s, &w) : kind < STRL__KIND_GENERAL && decode_arc(s, &w, kind);
}

static bool decode_step(struct splitter *s)
{
    struct strl__decoder *d = s->d;
    uint32_t previous = STRL__NONE, code;
    s->step_first = d->mesh.vertex_count;
    do {
        uint32_t parent;
        if (d->mesh.vertex_count >= d->sizes.vertex_count)
            return false;
        if (previous == STRL__NONE)
            parent = s->step_first - 1 - strl__pull(&d->in, STRL__STREAM_PARENT);
        else if (!decode_wedge_parent(s, previous, &parent))
            return false;
        code = strl__pull(&d->in, STRL__STREAM_KIND);
        if (parent >= s->step_first || d->in.failed || !decode_wedge(s, parent, code >> 1))
            return false;
        previous = parent;
    } while (code & 1);
    return true;
}

/* Brings the list of a step to come into the cache: its parent is known but where steps between add more than one
 * vertex. */
static inline void prefetch(const struct strl__decoder *d, uint32_t step)
{
    enum { AHEAD = 4 };
    const struct strl__stream_in *parents = &d->in.stream[STRL__STREAM_PARENT];
    if (step - 1 + AHEAD >= parents->count)
        return;
    uint32_t parent = d->mesh.vertex_count - 1 + AHEAD - parents->values[step - 1 + AHEAD];
    if (parent < d->mesh.vertex_count)
        __builtin_prefetch(&d->mesh.chunk[parent]);
}

strl_status strl__decode_steps(struct strl__decoder *d)
{
    struct splitter s = {.d = d};
    s.arc = strl_arena_alloc(d->scratch, d->sizes.triangle_count, sizeof *s.arc);
    if (!s.arc || !strl__star_init(&s.star, d->sizes.vertex_count, d->sizes.triangle_count, d->scratch))
        return strl__fail(d->err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    for (uint32_t step = 1; step <= d->sizes.step_count; step++) {
        prefetch(d, step);
        if (!decode_step(&s))
            return strl__fail(d->err, STRL_ERR_FORMAT, "node payload's step %" PRIu32 " of %" PRIu32 " is broken", step,
                              d->sizes.step_count);
        d->pm->vertex_end[step] = d->mesh.vertex_count;
        d->pm->triangle_end[step] = d->mesh.triangle_count;
    }
    if (d->mesh.vertex_count != d->sizes.vertex_count || d->mesh.triangle_count != d->sizes.triangle_count)
        return strl__fail(d->err, STRL_ERR_FORMAT,
                          "node payload's steps end with %" PRIu32 " vertices and %" PRIu32
                          " triangles, announced were %" PRIu32 " and %" PRIu32,
                          d->mesh.vertex_count, d->mesh.triangle_count, d->sizes.vertex_count, d->sizes.triangle_count);
    return STRL_OK;
}
