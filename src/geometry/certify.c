#include "geometry/certify.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "geometry/near.h"

#define NO_INDEX UINT32_MAX
#define AROUND_MAX 64u  /* triangles near a collapse that pieces are measured against at first */
#define WIDER_MAX 256u  /* the same where that was not enough */
#define FEW_PIECES 64u  /* more than this are not all looked at for one triangle */
#define FIRST_REACH 1.5 /* of the distance of a piece's middle: what lies so near is looked at */
#define FARTHEST 0x1p34 /* lattice units: nothing is farther apart */
#define QUARTERINGS 2u
#define LEAST_REACH 0.03125 /* of the bound that is good enough */
#define REACH_GROWTH 5.6
/* Of the largest coordinate: what doubles cannot tell apart in the points of fragments and their distances. */
#define ROUNDING 0x1p-34

/* A triangle is near enough where it is not much farther than a piece has been found to be: claims are the larger of
 * both. */
#define SLACK 1.1
/* Of the bound that is good enough: a piece within so much of a likely triangle is measured against that alone. */
#define LIKELY_SHARE 0.5

/* That a piece was measured against a triangle. */
typedef struct link {
    uint32_t piece, next;
} link;

typedef struct tracker {
    const strl_mesh *mesh;
    strl_facet *piece;               /* [piece_count] */
    uint32_t own_count, piece_count; /* own ones come first */
    strl_near tree, piece_tree;      /* over facet, as it was and as it is now, and over piece */
    uint32_t (*point)[3];            /* per triangle */
    bool *gone;                      /* per triangle */
    uint32_t *head, *tail;           /* per point: corners, 4 * triangle + 0, 1, 2 */
    uint32_t (*next)[3];             /* per corner: the next at its point */
    strl_facet *facet;               /* per triangle, as it is now */
    float *up, *down;                /* per triangle; per piece */
    uint32_t *first_link;            /* per triangle */
    link *links;                     /* owned; grows */
    size_t link_count, link_capacity;
    uint32_t free_link;
    uint32_t *stamp, *piece_stamp, tick; /* per triangle, per piece */
    double most_up, most_down, granted;
    uint32_t near[STRL_COVER_MAX];
    uint32_t *found; /* [own_count] gathered pieces */
    uint32_t found_count;
    uint32_t *star; /* [triangle_count] triangles that a collapse changed */
    uint32_t star_count;
    uint32_t around[WIDER_MAX], around_count;
    bool used[WIDER_MAX];
    strl_facet by[WIDER_MAX];
    strl_prism prisms[WIDER_MAX]; /* over those that are `around` */
} tracker;

/* ---- pieces and triangles ---- */

void strl_piece_facet(const strl_piece *piece, strl_facet *facet)
{
    double corner[3][3];
    for (unsigned i = 0; i < 9; i++)
        corner[i / 3][i % 3] = piece->corner[i / 3][i % 3];
    strl_facet_set(facet, corner[0], corner[1], corner[2]);
    facet->claim = piece->claim;
}

static void triangle_facet(tracker *t, uint32_t triangle)
{
    double corner[3][3];
    for (unsigned i = 0; i < 9; i++)
        corner[i / 3][i % 3] = t->mesh->position[t->point[triangle][i / 3]][i % 3];
    strl_facet_set(&t->facet[triangle], corner[0], corner[1], corner[2]);
    t->facet[triangle].claim = 0;
}

static void append_corner(tracker *t, uint32_t point, uint32_t corner)
{
    t->next[corner >> 2][corner & 3] = NO_INDEX;
    if (t->head[point] == NO_INDEX)
        t->head[point] = corner;
    else
        t->next[t->tail[point] >> 2][t->tail[point] & 3] = corner;
    t->tail[point] = corner;
}

/* ---- links ---- */

static bool add_link(tracker *t, uint32_t triangle, uint32_t piece)
{
    for (uint32_t at = t->first_link[triangle]; at != NO_INDEX; at = t->links[at].next)
        if (t->links[at].piece == piece)
            return true;
    uint32_t at = t->free_link;
    if (at != NO_INDEX)
        t->free_link = t->links[at].next;
    else if (t->link_count < NO_INDEX && strl__grow(&t->links, &t->link_capacity, t->link_count + 1, sizeof *t->links))
        at = (uint32_t)t->link_count++;
    else
        return false;
    t->links[at] = (link){piece, t->first_link[triangle]};
    t->first_link[triangle] = at;
    return true;
}

static void gather_pieces(tracker *t, uint32_t triangle)
{
    for (uint32_t at = t->first_link[triangle]; at != NO_INDEX; at = t->links[at].next) {
        uint32_t piece = t->links[at].piece;
        if (t->piece_stamp[piece] == t->tick)
            continue;
        t->piece_stamp[piece] = t->tick;
        t->found[t->found_count++] = piece;
    }
}

static void drop_links(tracker *t, uint32_t triangle)
{
    while (t->first_link[triangle] != NO_INDEX) {
        uint32_t at = t->first_link[triangle];
        t->first_link[triangle] = t->links[at].next;
        t->links[at].next = t->free_link;
        t->free_link = at;
    }
}

/* ---- what is round a collapse ---- */

static void add_around(tracker *t, uint32_t triangle)
{
    if (t->gone[triangle] || t->stamp[triangle] == t->tick || t->around_count == AROUND_MAX)
        return;
    t->stamp[triangle] = t->tick;
    t->around[t->around_count++] = triangle;
}

static void add_around_point(tracker *t, uint32_t point)
{
    for (uint32_t corner = t->head[point]; corner != NO_INDEX && t->around_count < AROUND_MAX;
         corner = t->next[corner >> 2][corner & 3])
        add_around(t, corner >> 2);
}

static void take_around(tracker *t, const double along[3])
{
    for (uint32_t i = 0; i < t->around_count; i++) {
        t->by[i] = t->facet[t->around[i]];
        strl_prism_set(&t->prisms[i], &t->by[i], along);
    }
}

/* The changed triangles, those at `point`, and those that share points with them. */
static void look_around(tracker *t, uint32_t point, const double along[3])
{
    t->tick++;
    t->around_count = 0;
    for (uint32_t i = 0; i < t->star_count; i++)
        add_around(t, t->star[i]);
    add_around_point(t, point);
    for (uint32_t i = 0, count = t->around_count; i < count; i++)
        for (unsigned c = 0; c < 3; c++)
            add_around_point(t, t->point[t->around[i]][c]);
    take_around(t, along);
}

/* ---- measuring ---- */

static void note_used(void *context, uint32_t by, const strl_fragment *fragment)
{
    tracker *t = context;
    (void)fragment;
    t->used[by] = true;
}

/* The mean normal of the triangles that a collapse changed. */
static void normal_of_star(const tracker *t, double normal[3])
{
    normal[0] = normal[1] = normal[2] = 0;
    for (uint32_t i = 0; i < t->star_count; i++) {
        double one[3];
        strl_facet_normal(&t->facet[t->star[i]], one);
        for (unsigned k = 0; k < 3; k++)
            normal[k] += one[k];
    }
}

/* A piece against the triangles of `around`, which `by` holds. */
static double measure_piece(tracker *t, const strl_facet *piece, double enough)
{
    memset(t->used, 0, t->around_count);
    return strl_cover_bound(piece, &(strl_cover){.by = t->by,
                                                 .prisms = t->prisms,
                                                 .count = t->around_count,
                                                 .enough = enough,
                                                 .take = note_used,
                                                 .context = t});
}

static bool keep_measure(tracker *t, uint32_t piece, double bound)
{
    bool good = true;
    t->down[piece] = (float)bound;
    t->most_down = bound > t->most_down ? bound : t->most_down;
    for (uint32_t i = 0; i < t->around_count; i++)
        if (t->used[i])
            good = good && add_link(t, t->around[i], piece);
    return good;
}

static double measure_facet(tracker *t, const strl_facet *facet, const uint32_t *piece, uint32_t count, double enough)
{
    return strl_cover_bound(facet, &(strl_cover){.by = t->piece, .pick = piece, .count = count, .enough = enough});
}

/* Against all pieces that are near enough: what is within a part of that does mostly. A facet near too many goes in
 * quarters. */
static double measure_near(tracker *t, const strl_facet *facet, double enough, unsigned quarterings)
{
    double bound = INFINITY;
    for (double share = LEAST_REACH; share <= 1 && bound > enough; share *= REACH_GROWTH) {
        uint32_t count = strl_near_list(&t->piece_tree, facet, share * enough, t->near, STRL_COVER_MAX);
        bound = fmin(bound, measure_facet(t, facet, t->near, count, enough));
    }
    if (bound <= enough || quarterings == 0)
        return bound;
    double middle[3][3], most = 0;
    for (unsigned c = 0; c < 3; c++)
        for (unsigned k = 0; k < 3; k++)
            middle[c][k] = (facet->corner[c][k] + facet->corner[(c + 1) % 3][k]) / 2;
    for (unsigned c = 0; c < 4; c++) {
        strl_facet quarter = {.claim = 0};
        if (c < 3)
            strl_facet_set(&quarter, facet->corner[c], middle[c], middle[(c + 2) % 3]);
        else
            strl_facet_set(&quarter, middle[0], middle[1], middle[2]);
        most = fmax(most, measure_near(t, &quarter, fmax(enough, most), quarterings - 1));
    }
    return fmin(bound, most);
}

/* A triangle against the pieces gathered, and against others where these leave something open. claim: by its drift. */
static void measure_up(tracker *t, uint32_t triangle, double claim)
{
    double enough = fmax(t->most_up, fmax(t->granted, SLACK * t->most_down)), bound = claim;
    if (claim > enough && t->found_count <= FEW_PIECES)
        bound = fmin(bound, measure_facet(t, &t->facet[triangle], t->found, t->found_count, enough));
    if (bound > enough)
        bound = fmin(bound, measure_near(t, &t->facet[triangle], enough, QUARTERINGS));
    t->up[triangle] = (float)(bound * STRL_ROUND_UP);
    t->most_up = fmax(t->most_up, bound);
}

/* ---- the start ---- */

static bool prepare_pieces(tracker *t, const strl_piece *pieces, strl_arena *arena)
{
    t->piece = strl_arena_alloc(arena, t->piece_count, sizeof *t->piece);
    t->down = strl_arena_alloc(arena, t->own_count, sizeof *t->down);
    t->piece_stamp = strl_arena_alloc_zero(arena, t->own_count, sizeof *t->piece_stamp);
    t->found = strl_arena_alloc(arena, t->own_count, sizeof *t->found);
    if (!t->piece || !t->down || !t->piece_stamp || !t->found)
        return false;
    for (uint32_t i = 0; i < t->piece_count; i++)
        strl_piece_facet(&pieces[i], &t->piece[i]);
    return strl_near_create(&t->piece_tree, t->piece, t->piece_count, arena);
}

static bool prepare(tracker *t, const strl_mesh *mesh, strl_arena *arena)
{
    uint32_t n = mesh->triangle_count;
    t->point = strl_arena_alloc(arena, n, sizeof *t->point);
    t->next = strl_arena_alloc(arena, n, sizeof *t->next);
    t->gone = strl_arena_alloc_zero(arena, n, sizeof *t->gone);
    t->facet = strl_arena_alloc(arena, n, sizeof *t->facet);
    t->up = strl_arena_alloc(arena, n, sizeof *t->up);
    t->first_link = strl_arena_alloc(arena, n, sizeof *t->first_link);
    t->stamp = strl_arena_alloc_zero(arena, n, sizeof *t->stamp);
    t->star = strl_arena_alloc(arena, n, sizeof *t->star);
    t->head = strl_arena_alloc(arena, mesh->point_count, sizeof *t->head);
    t->tail = strl_arena_alloc(arena, mesh->point_count, sizeof *t->tail);
    if (!t->point || !t->next || !t->gone || !t->facet || !t->up || !t->first_link || !t->stamp || !t->star ||
        !t->head || !t->tail)
        return false;
    memset(t->head, 0xff, mesh->point_count * sizeof *t->head);
    memset(t->first_link, 0xff, n * sizeof *t->first_link);
    t->free_link = NO_INDEX;
    for (uint32_t i = 0; i < n; i++) {
        for (unsigned c = 0; c < 3; c++) {
            t->point[i][c] = mesh->wedge[mesh->triangle[i][c]].point;
            append_corner(t, t->point[i][c], 4 * i + c);
        }
        triangle_facet(t, i);
    }
    return strl_near_create(&t->tree, t->facet, n, arena);
}

/* Pieces come in the order of the triangles that they are or were: the next piece belongs to the next triangle, or to
 * the same. */
static bool is_near_likely(tracker *t, const strl_facet *piece, double *bound)
{
    double reach = LIKELY_SHARE * (fmax(t->most_down, t->granted) - piece->claim);
    uint32_t last = t->around[0];
    for (uint32_t i = 2; i-- > 0;) {
        uint32_t triangle = last + i;
        if (triangle == t->mesh->triangle_count || !strl_facet_is_near(&t->facet[triangle], piece, reach, bound))
            continue;
        t->around[0] = triangle;
        t->around_count = 1;
        t->used[0] = true;
        return true;
    }
    return false;
}

/* A piece against the triangles within reach, and one that surely counts. */
static double measure_within(tracker *t, const strl_facet *piece, const double along[3], double reach, uint32_t most,
                             double enough)
{
    t->around_count = 1 + strl_near_list(&t->tree, piece, reach, t->around + 1, most);
    take_around(t, along);
    return measure_piece(t, piece, enough);
}

/* A piece against the triangles near it, before the first collapse. What reaches beyond the mesh, at a boundary, may be
 * nearest to one that is farther than its middle: no farther than the bound, though. */
static bool measure_first(tracker *t, uint32_t id)
{
    const strl_facet *piece = &t->piece[id];
    double middle[3], distance, along[3], bound;
    if (is_near_likely(t, piece, &bound))
        return keep_measure(t, id, bound + piece->claim);
    strl_facet_middle(piece, middle);
    t->around[0] = strl_near_find(&t->tree, middle, t->around[0], &distance);
    double reach = FIRST_REACH * distance, enough = fmax(fmax(t->most_down, t->granted) - piece->claim, reach);
    strl_facet_normal(&t->facet[t->around[0]], along);
    bound = measure_within(t, piece, along, 0, 0, enough);
    if (bound > enough)
        bound = measure_within(t, piece, along, reach, WIDER_MAX - 1, enough);
    if (bound > enough) {
        double wider = measure_within(t, piece, along, bound, WIDER_MAX - 1, enough);
        bound = wider < bound ? wider : measure_within(t, piece, along, reach, WIDER_MAX - 1, enough);
    }
    return keep_measure(t, id, bound + piece->claim);
}

static bool measure_start(tracker *t)
{
    bool good = true;
    t->around[0] = 0;
    for (uint32_t i = 0; good && i < t->own_count; i++)
        good = measure_first(t, i);
    for (uint32_t i = 0; good && i < t->mesh->triangle_count; i++) {
        t->tick++;
        t->found_count = 0;
        gather_pieces(t, i);
        measure_up(t, i, strl_mesh_error(t->mesh, strl_drift_length(&t->mesh->drift[i])));
    }
    return good;
}

/* ---- a collapse ---- */

/* Carries out u -> v. What lay over the star of u is gathered; star: what of it is left. */
static void carry_out(tracker *t, uint32_t u, uint32_t v)
{
    t->tick++;
    t->found_count = t->star_count = 0;
    for (uint32_t corner = t->head[u], next; corner != NO_INDEX; corner = next) {
        uint32_t triangle = corner >> 2, *point = t->point[triangle];
        next = t->next[triangle][corner & 3];
        if (t->gone[triangle])
            continue;
        gather_pieces(t, triangle);
        drop_links(t, triangle);
        t->gone[triangle] = point[0] == v || point[1] == v || point[2] == v;
        if (t->gone[triangle]) {
            t->facet[triangle].least[0] = INFINITY; /* near nothing */
            continue;
        }
        point[corner & 3] = v;
        append_corner(t, v, corner);
        triangle_facet(t, triangle);
        strl_near_update(&t->tree, triangle);
        t->star[t->star_count++] = triangle;
    }
    t->head[u] = NO_INDEX;
}

/* A piece against all triangles in reach, whether or not they hang together with what the collapse changed, and along
 * its own normal. */
static double measure_wider(tracker *t, const strl_facet *piece, double enough)
{
    double along[3], bound = INFINITY;
    strl_facet_normal(piece, along);
    for (double share = LEAST_REACH; share <= 1 && bound > enough; share *= REACH_GROWTH) {
        t->around_count = strl_near_list(&t->tree, piece, share * enough, t->around, WIDER_MAX);
        take_around(t, along);
        bound = measure_piece(t, piece, enough);
    }
    for (double reach = fmax(enough, 1); isinf(bound) && reach < FARTHEST; reach *= 2) {
        t->around_count = strl_near_list(&t->tree, piece, reach, t->around, WIDER_MAX);
        take_around(t, along);
        bound = measure_piece(t, piece, enough);
    }
    return bound;
}

/* claim: of the triangles that the collapse changed, by their drifts. */
static bool measure_again(tracker *t, uint32_t v, double claim)
{
    bool good = true;
    double along[3];
    normal_of_star(t, along);
    look_around(t, v, along);
    for (uint32_t i = 0; i < t->found_count && good; i++) {
        uint32_t id = t->found[i];
        const strl_facet *piece = &t->piece[id];
        double enough = fmax(t->most_down, t->granted) - piece->claim, bound = measure_piece(t, piece, enough);
        if (bound <= enough) {
            good = keep_measure(t, id, bound + piece->claim);
            continue;
        }
        double wider = measure_wider(t, piece, enough);
        bool is_better = wider < bound;
        if (is_better)
            good = keep_measure(t, id, wider + piece->claim);
        look_around(t, v, along);
        if (!is_better) {
            bound = measure_piece(t, piece, enough);
            good = keep_measure(t, id, bound + piece->claim);
        }
    }
    for (uint32_t i = 0; i < t->star_count && good; i++)
        measure_up(t, t->star[i], claim);
    return good;
}

/* What doubles cannot tell apart. */
static double rounding_of(const strl_mesh *mesh, const strl_piece *pieces, uint32_t count)
{
    double most = 1;
    for (uint32_t p = 0; p < 3 * mesh->point_count; p++)
        most = fmax(most, fabs((double)mesh->position[p / 3][p % 3]));
    for (uint32_t i = 0; i < count; i++)
        for (unsigned k = 0; k < 9; k++)
            most = fmax(most, fabs((double)pieces[i].corner[k / 3][k % 3]));
    return most * ROUNDING;
}

static float rounded_up(double value, double rounding)
{
    return nextafterf((float)(value + rounding), INFINITY);
}

static void conclude(const tracker *t, double rounding, strl_certificate *certificate)
{
    uint32_t to = 0;
    for (uint32_t i = 0; i < t->mesh->triangle_count; i++) {
        float most = 0;
        if (t->gone[i])
            continue;
        for (uint32_t at = t->first_link[i]; at != NO_INDEX; at = t->links[at].next)
            most = fmaxf(most, t->down[t->links[at].piece]);
        certificate->triangle_up[to] = rounded_up(t->up[i], rounding);
        certificate->triangle_down[to++] = rounded_up(most, rounding);
    }
}

static bool track(tracker *t, const strl_simplified *simplified, double rounding, strl_certificate *certificate)
{
    if (!measure_start(t))
        return false;
    for (uint32_t i = 0;; i++) {
        certificate->down[i] = rounded_up(t->most_down, rounding);
        certificate->up[i] = rounded_up(t->most_up, rounding);
        if (i == simplified->collapse_count)
            break;
        carry_out(t, simplified->collapses[i].from, simplified->collapses[i].to);
        if (!measure_again(t, simplified->collapses[i].to, simplified->collapses[i].own))
            return false;
    }
    conclude(t, rounding, certificate);
    return true;
}

strl_status strl_certify(const strl_mesh *mesh, const strl_simplified *simplified, const strl_older *older,
                         strl_arena *arena, strl_certificate *certificate, strl_error *err)
{
    size_t states = (size_t)simplified->collapse_count + 1;
    certificate->down = strl_arena_alloc(arena, states, sizeof(float));
    certificate->up = strl_arena_alloc(arena, states, sizeof(float));
    certificate->triangle_down = strl_arena_alloc(arena, simplified->triangles_left, sizeof(float));
    certificate->triangle_up = strl_arena_alloc(arena, simplified->triangles_left, sizeof(float));
    strl_arena_mark mark = strl_arena_get_mark(arena);
    tracker *t = strl_arena_alloc(arena, 1, sizeof *t);
    bool good = certificate->down && certificate->up && certificate->triangle_down && certificate->triangle_up && t;
    if (good) {
        *t = (tracker){.mesh = mesh, .own_count = older->own, .piece_count = older->count, .granted = older->granted};
        good = prepare(t, mesh, arena) && prepare_pieces(t, older->piece, arena) &&
               track(t, simplified, rounding_of(mesh, older->piece, older->count), certificate);
        strl__free(t->links);
    }
    strl_arena_rewind(arena, mark);
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory to certify %u triangles", mesh->triangle_count);
}
