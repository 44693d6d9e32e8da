/* The steps of a node payload: vertex splits. docs/format-payload.md, "Steps", is normative. */
#include "geometry/payload_decode.h"

#include <inttypes.h>

#include "base/fail.h"

struct splitter {
    struct strl__decoder *d;
    struct strl__star star;
    uint32_t step_first; /* first vertex of the step */
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

/* The arc of u's star that moves, by kind. */
static bool decode_arc(struct splitter *s, unsigned kind, struct strl__arc *arc)
{
    const struct strl__star *star = &s->star;
    uint32_t at = strl__pull(&s->d->in, STRL__STREAM_SPOKE);
    *arc = (struct strl__arc){star->chain, 0, 0};
    if (kind == STRL__KIND_CHAIN) {
        if (at >= star->chain_count)
            return false;
        arc->chain += at;
        arc->triangles = arc->chain->triangles;
        return true;
    }
    if (at >= star->spoke_count)
        return false;
    uint32_t last = star->chain_count - 1;
    while ((uint32_t)(arc->chain - star->chain) < last && at >= arc->chain[1].first_spoke)
        arc->chain++;
    arc->from = at - arc->chain->first_spoke;
    if (kind == STRL__KIND_CUT) {
        arc->triangles = strl__pull(&s->d->in, STRL__STREAM_ARC);
        return arc->triangles <= arc->chain->triangles - (arc->chain->closed ? 0 : arc->from);
    }
    if (arc->chain->closed)
        return false;
    arc->triangles = arc->chain->triangles - arc->from;
    if (kind == STRL__KIND_HEAD) {
        arc->triangles = arc->from;
        arc->from = 0;
    }
    return true;
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

/* A wedge whose corners are an arc. The spokes differ in position from u already; v must differ from them and from u. */
static bool decode_simple(struct splitter *s, const struct wedge *w, unsigned kind)
{
    struct strl__star *star = &s->star;
    struct strl__arc arc;
    if (!decode_arc(s, kind, &arc))
        return false;
    int32_t(*position)[3] = s->d->mesh.position;
    const int32_t *origin = position[w->parent];
    if (w->is_first) {
        struct strl__mean mean = {0};
        for (uint32_t i = 0; i <= arc.triangles; i++)
            strl__mean_add(&mean, origin, position[strl__arc_spoke(star, &arc, i)]);
        set_first_position(s, w, &mean);
    }
    const int32_t(*fixed)[3] = (const int32_t(*)[3])position;
    bool sound = kind == STRL__KIND_CHAIN || !strl__same_position(fixed, w->vertex, w->parent);
    for (uint32_t i = 0; i <= arc.triangles; i++)
        sound &= !strl__same_position(fixed, w->vertex, strl__arc_spoke(star, &arc, i));
    for (uint32_t i = 0; i < arc.triangles; i++)
        star->moves[star->order[strl__arc_place(&arc, i)]] = 1;
    uint32_t a = strl__arc_spoke(star, &arc, 0), b = strl__arc_spoke(star, &arc, arc.triangles);
    strl__star_move(star, &s->d->mesh, w->parent, w->vertex);
    if (sound && (kind == STRL__KIND_CUT || kind == STRL__KIND_TAIL))
        sound = add_triangle(s, w->vertex, w->parent, a);
    if (sound && (kind == STRL__KIND_CUT || kind == STRL__KIND_HEAD))
        sound = add_triangle(s, w->vertex, b, w->parent);
    return sound;
}

static bool decode_corner(struct splitter *s, uint32_t parent, uint32_t *vertex)
{
    uint32_t code = strl__pull(&s->d->in, STRL__STREAM_GENERAL), spokes = s->star.spoke_count;
    *vertex = code == 0 ? parent : code <= spokes ? s->star.spoke[code - 1] : code - 1 - spokes;
    return *vertex < s->step_first;
}

/* Runs of corners that stay and go, in turn. */
static bool decode_runs(struct splitter *s, const struct wedge *w, struct strl__mean *mean)
{
    struct strl__star *star = &s->star;
    const int32_t(*position)[3] = (const int32_t(*)[3])s->d->mesh.position;
    uint8_t moves = 0;
    for (uint32_t done = 0; done < star->count; moves ^= 1) {
        uint32_t run = strl__pull(&s->d->in, STRL__STREAM_GENERAL);
        if (run > star->count - done || (run == 0 && done) || s->d->in.failed)
            return false;
        for (uint32_t end = done + run; done < end; done++) {
            uint32_t place = star->order[done];
            star->moves[place] = moves;
            for (unsigned k = 0; moves && k < 2; k++)
                strl__mean_add(mean, position[w->parent], position[star->wing[place][k]]);
        }
    }
    return true;
}

static bool decode_general(struct splitter *s, const struct wedge *w)
{
    struct strl__star *star = &s->star;
    const int32_t(*position)[3] = (const int32_t(*)[3])s->d->mesh.position;
    struct strl__mean mean = {0};
    if (!decode_runs(s, w, &mean))
        return false;
    if (w->is_first)
        set_first_position(s, w, &mean);
    for (uint32_t i = 0; i < star->count; i++)
        for (unsigned k = 0; star->moves[i] && k < 2; k++)
            if (strl__same_position(position, w->vertex, star->wing[i][k]))
                return false;
    strl__star_move(star, &s->d->mesh, w->parent, w->vertex);
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
    return kind == STRL__KIND_GENERAL ? decode_general(s, &w) : kind < STRL__KIND_GENERAL && decode_simple(s, &w, kind);
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

strl_status strl__decode_steps(struct strl__decoder *d)
{
    struct splitter s = {.d = d};
    if (!strl__star_init(&s.star, d->sizes.vertex_count, d->sizes.triangle_count, d->scratch))
        return strl__fail(d->err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    for (uint32_t step = 1; step <= d->sizes.step_count; step++) {
        if (!decode_step(&s))
            return strl__fail(d->err, STRL_ERR_FORMAT, "node payload's step %" PRIu32 " of %" PRIu32 " is broken", step,
                              d->sizes.step_count);
        d->pm->vertex_end[step] = d->mesh.vertex_count;
        d->pm->triangle_end[step] = d->mesh.triangle_count;
    }
    if (d->mesh.vertex_count != d->sizes.vertex_count || d->mesh.triangle_count != d->sizes.triangle_count)
        return strl__fail(d->err, STRL_ERR_FORMAT, "node payload's steps end with %" PRIu32 " vertices and %" PRIu32
                          " triangles, announced were %" PRIu32 " and %" PRIu32, d->mesh.vertex_count, d->mesh.triangle_count,
                          d->sizes.vertex_count, d->sizes.triangle_count);
    return STRL_OK;
}
