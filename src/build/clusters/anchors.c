#include "build/clusters/anchors.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "geometry/near.h"
#include "store/pack.h"

/* below, what is claimed without certificates is tight, and most of the triangles are there */
#define EARLY_FIRST 3u
/* so far from the root certificates begin without --certify: the few levels where claims by drifts are loose */
#define FEW_LEVELS 4u
#define CROWD 3u /* pieces a triangle: the more, the tighter and the dearer */
/* levels of so few keep the anchors they have for longer: they cost little there, and errors grow slowly */
#define FEW_NODES 8u
#define FEW_CROWD 20u
#define CANDIDATES 256u
#define PARTS_MAX 64u
/* Of the distance of a piece's middle: what lies so near is looked at. */
#define NEAR_ENOUGH 1.5
/* A corner that was cut is rounded to the lattice. */
#define CUT_ERROR 0.8661f

/* ---- plan ---- */

uint32_t strl_anchor_first_level(uint32_t depth, bool certify)
{
    uint32_t late = depth > FEW_LEVELS ? depth - FEW_LEVELS : depth / 2;
    uint32_t early = late > EARLY_FIRST ? EARLY_FIRST : late - (late > 0);
    return certify ? early : late;
}

strl_anchor_plan strl_anchor_plan_of(uint32_t level, uint32_t depth, bool certify)
{
    uint32_t first = strl_anchor_first_level(depth, certify);
    bool are_few = 1u << (depth - level) <= FEW_NODES;
    return (strl_anchor_plan){.begins = level == first && level<depth, .measures = level> first,
                              .crowd = level == depth ? 0
                                       : are_few      ? FEW_CROWD
                                                      : CROWD};
}

/* ---- pieces ---- */

void strl_pieces_deinit(strl_pieces *pieces)
{
    strl__free(pieces->item);
    *pieces = (strl_pieces){0};
}

void strl_anchors_deinit(strl_anchors *anchors)
{
    strl_pieces_deinit(&anchors->own);
    strl_pieces_deinit(&anchors->beside);
    anchors->granted = 0;
}

static bool add_piece(strl_pieces *pieces, const strl_piece *piece)
{
    if (pieces->count == UINT32_MAX ||
        !strl__grow(&pieces->item, &pieces->capacity, (size_t)pieces->count + 1, sizeof *piece))
        return false;
    pieces->item[pieces->count++] = *piece;
    return true;
}

/* What numbers of pieces are like: the way from piece to piece, from corner to corner, and claims. */
typedef struct piece_models {
    strl_pack_model corner[3][3];
    strl_pack_same claim;
} piece_models;

void strl_pieces_write(const strl_pieces *pieces, strl_writer *writer)
{
    strl_packer packer = {.out = writer};
    piece_models m = {0};
    strl_piece last = {0};
    uint32_t last_claim = 0;
    strl_writer_u32(writer, pieces->count);
    for (uint32_t i = 0; i < pieces->count; i++) {
        const strl_piece *piece = &pieces->item[i];
        uint32_t claim;
        memcpy(&claim, &piece->claim, sizeof claim);
        for (unsigned c = 0; c < 3; c++)
            for (unsigned k = 0; k < 3; k++) {
                uint32_t from = (uint32_t)(c ? piece->corner[c - 1][k] : last.corner[2][k]);
                strl_pack(&packer, &m.corner[c][k], strl_pack_zigzag((uint32_t)piece->corner[c][k] - from));
            }
        strl_pack_beside(&packer, &m.claim, claim, last_claim);
        last = *piece;
        last_claim = claim;
    }
    strl_pack_finish(&packer);
}

static void unpack_pieces(strl_unpacker *unpacker, uint32_t count, const int64_t moved[3], strl_piece *to)
{
    piece_models m = {0};
    uint32_t at[3] = {0}, claim = 0;
    for (uint32_t i = 0; i < count; i++) {
        for (unsigned c = 0; c < 3; c++)
            for (unsigned k = 0; k < 3; k++) {
                at[k] += strl_unpack_zigzag(strl_unpack(unpacker, &m.corner[c][k]));
                to[i].corner[c][k] = (int32_t)(at[k] + (uint32_t)moved[k]);
            }
        claim = strl_unpack_beside(unpacker, &m.claim, claim);
        memcpy(&to[i].claim, &claim, sizeof claim);
    }
}

strl_status strl_pieces_read(const void *data, size_t size, const int64_t moved[3], strl_pieces *pieces,
                             strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    uint32_t count = strl_cursor_u32(&cursor);
    /* a piece takes ten bits at least, so a damaged count costs no more memory than some times the bytes read */
    if (cursor.failed || count > strl_cursor_left(&cursor) || count > UINT32_MAX - pieces->count)
        return strl__fail(err, STRL_ERR_INTERNAL, "a node's anchors are %zu bytes, not what %u pieces are", size,
                          count);
    if (!strl__grow(&pieces->item, &pieces->capacity, (size_t)pieces->count + count, sizeof *pieces->item))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %u pieces", count);
    strl_unpacker unpacker = strl_unpacker_make((const uint8_t *)data + cursor.at, size - cursor.at);
    unpack_pieces(&unpacker, count, moved, pieces->item + pieces->count);
    if (unpacker.failed)
        return strl__fail(err, STRL_ERR_INTERNAL, "a node's anchors in scratch are cut off or damaged");
    pieces->count += count;
    return STRL_OK;
}

bool strl_anchors_bear(const strl_mesh *base, const strl_certificate *certificate, strl_pieces *born)
{
    for (uint32_t t = 0; t < base->triangle_count; t++) {
        strl_piece piece = {.claim = strl_mesh_error(base, strl_drift_length(&base->drift[t]))};
        if (certificate) /* the claims of the older pieces, which these hold, have the start's error already */
            piece.claim = fminf(fmaxf(certificate->triangle_down[t], fminf(certificate->triangle_up[t], piece.claim)),
                                base->most_error > 0 ? base->most_error : INFINITY);
        for (unsigned c = 0; c < 3; c++)
            memcpy(piece.corner[c], base->position[base->wedge[base->triangle[t][c]].point], sizeof piece.corner[c]);
        if (!add_piece(born, &piece))
            return false;
    }
    return true;
}

/* ---- beside ---- */

typedef struct extent {
    double least[3], most[3];
} extent;

static void include_piece(extent *e, const strl_piece *piece)
{
    for (unsigned i = 0; i < 9; i++) {
        double x = piece->corner[i / 3][i % 3];
        e->least[i % 3] = fmin(e->least[i % 3], x);
        e->most[i % 3] = fmax(e->most[i % 3], x);
    }
}

static const extent nothing = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

static bool lies_near(const extent *e, const strl_piece *piece, double reach)
{
    extent own = nothing;
    include_piece(&own, piece);
    bool near = true;
    for (unsigned k = 0; k < 3; k++)
        near &= own.least[k] <= e->most[k] + reach && own.most[k] >= e->least[k] - reach;
    return near;
}

bool strl_anchors_find_beside(strl_anchors *shares, uint32_t members, double reach)
{
    bool good = true;
    for (uint32_t m = 0; m < members; m++) {
        extent e = nothing;
        for (uint32_t i = 0; i < shares[m].own.count; i++)
            include_piece(&e, &shares[m].own.item[i]);
        for (uint32_t other = 0; other < members; other++)
            for (uint32_t i = 0; other != m && i < shares[other].own.count && good; i++)
                if (lies_near(&e, &shares[other].own.item[i], reach))
                    good = add_piece(&shares[m].beside, &shares[other].own.item[i]);
    }
    return good;
}

/* ---- dividing among members ---- */

typedef struct part {
    uint32_t member;
    strl_fragment fragment;
} part;

typedef struct divider {
    const uint32_t *owner;
    strl_near tree;
    uint32_t triangles;
    strl_facet *facet; /* [triangles] */
    uint32_t candidate[CANDIDATES], candidate_count;
    /* distances within which a member's triangles are near enough: always, and to the piece at hand */
    double tolerance, enough;
    double distance; /* of the middle of the piece from the first candidate */
    part parts[PARTS_MAX];
    uint32_t part_count;
    bool is_full;
} divider;

static void take_part(void *context, uint32_t by, const strl_fragment *fragment)
{
    divider *d = context;
    if (d->part_count == PARTS_MAX)
        d->is_full = true;
    else
        d->parts[d->part_count++] = (part){d->owner[by], *fragment};
}

static bool add_part(const part *p, float claim, strl_pieces *pieces)
{
    int32_t corner[STRL_FRAGMENT_MAX][3];
    for (uint32_t i = 0; i < p->fragment.count; i++)
        for (unsigned k = 0; k < 3; k++)
            corner[i][k] = (int32_t)lround(p->fragment.corner[i][k]);
    for (uint32_t i = 1; i + 1 < p->fragment.count; i++) {
        strl_piece piece = {.claim = (claim + CUT_ERROR) * STRL_ROUND_UP};
        memcpy(piece.corner[0], corner[0], sizeof corner[0]);
        memcpy(piece.corner[1], corner[i], sizeof corner[i]);
        memcpy(piece.corner[2], corner[i + 1], sizeof corner[i]);
        if (!add_piece(pieces, &piece))
            return false;
    }
    return true;
}

/* The triangle nearest to the piece's middle becomes the first candidate. */
static void find_nearest(divider *d, const strl_facet *piece)
{
    double middle[3];
    strl_facet_middle(piece, middle);
    d->candidate[0] = strl_near_find(&d->tree, middle, d->candidate[0], &d->distance);
    d->enough = fmax(NEAR_ENOUGH * d->distance, d->tolerance);
}

static void list_candidates(divider *d, const strl_facet *piece, double reach)
{
    d->candidate_count = 1 + strl_near_list(&d->tree, piece, reach, d->candidate + 1, CANDIDATES - 1);
}

static bool is_near_first(const divider *d, const strl_facet *piece, uint32_t member)
{
    uint32_t first = d->candidate[0];
    double distance;
    return d->owner[first] == member && strl_facet_is_near(&d->facet[first], piece, d->enough, &distance);
}

/* Pieces come in the order of the triangles that they are or were: the next piece belongs to the next triangle, or to
 * the same. */
static bool is_near_likely(divider *d, const strl_facet *piece, uint32_t member)
{
    uint32_t last = d->candidate[0];
    d->enough = d->tolerance;
    for (uint32_t i = 2; i-- > 0;) {
        d->candidate[0] = last + i < d->triangles ? last + i : last;
        if (is_near_first(d, piece, member))
            return true;
    }
    return false;
}

static bool is_near_all(const divider *d, uint32_t member)
{
    for (uint32_t i = 0; i < d->candidate_count; i++)
        if (d->owner[d->candidate[i]] != member)
            return false;
    return true;
}

static bool parts_are_of_one(const divider *d)
{
    for (uint32_t i = 1; i < d->part_count; i++)
        if (d->parts[i].member != d->parts[0].member)
            return false;
    return true;
}

/* A piece need not be cut where one member's triangles are near enough to all of it. */
static bool is_near_to(divider *d, const strl_facet *piece, const double along[3], uint32_t member)
{
    uint32_t pick[CANDIDATES], count = 0;
    for (uint32_t i = 0; i < d->candidate_count; i++)
        if (d->owner[d->candidate[i]] == member)
            pick[count++] = d->candidate[i];
    strl_cover cover = {.by = d->facet, .pick = pick, .count = count, .along = along, .enough = d->enough};
    return count && strl_cover_bound(piece, &cover) <= d->enough;
}

/* What was a member's stays with it where it can: where sheets overlap, the nearest may well be another's. */
static bool divide_piece(divider *d, const strl_piece *piece, uint32_t own, strl_anchors *shares)
{
    strl_facet facet;
    double along[3];
    strl_piece_facet(piece, &facet);
    facet.claim = 0;
    if (is_near_likely(d, &facet, own))
        return add_piece(&shares[own].own, piece);
    find_nearest(d, &facet);
    if (is_near_first(d, &facet, own))
        return add_piece(&shares[own].own, piece);
    list_candidates(d, &facet, NEAR_ENOUGH * d->distance);
    if (is_near_all(d, own))
        return add_piece(&shares[own].own, piece);
    list_candidates(d, &facet, d->enough);
    strl_facet_normal(&d->facet[d->candidate[0]], along);
    if (is_near_to(d, &facet, along, own))
        return add_piece(&shares[own].own, piece);
    d->part_count = 0;
    d->is_full = false;
    strl_cover_bound(&facet, &(strl_cover){.by = d->facet,
                                           .pick = d->candidate,
                                           .count = d->candidate_count,
                                           .along = along,
                                           .enough = d->enough,
                                           .take = take_part,
                                           .context = d});
    if (d->is_full || parts_are_of_one(d))
        return add_piece(&shares[d->is_full ? d->owner[d->candidate[0]] : d->parts[0].member].own, piece);
    bool good = true;
    for (uint32_t i = 0; i < d->part_count && good; i++)
        good = add_part(&d->parts[i], piece->claim, &shares[d->parts[i].member].own);
    return good;
}

static bool prepare_divider(divider *d, const strl_mesh *mesh, strl_arena *arena)
{
    d->facet = strl_arena_alloc(arena, mesh->triangle_count, sizeof *d->facet);
    if (!d->facet)
        return false;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        double corner[3][3];
        for (unsigned i = 0; i < 9; i++)
            corner[i / 3][i % 3] = mesh->position[mesh->wedge[mesh->triangle[t][i / 3]].point][i % 3];
        strl_facet_set(&d->facet[t], corner[0], corner[1], corner[2]);
        d->facet[t].claim = 0;
    }
    return strl_near_create(&d->tree, d->facet, mesh->triangle_count, arena);
}

static bool divide_pieces(divider *d, const strl_pieces *pieces, uint32_t own, strl_anchors *shares)
{
    bool good = true;
    for (uint32_t i = 0; i < pieces->count && good; i++)
        good = divide_piece(d, &pieces->item[i], own, shares);
    return good;
}

strl_status strl_anchors_divide(const strl_mesh *mesh, const uint32_t *owner, uint32_t members, double tolerance,
                                const strl_pieces *own, strl_arena *arena, strl_anchors *shares, strl_error *err)
{
    strl_arena_mark mark = strl_arena_get_mark(arena);
    divider *d = strl_arena_alloc(arena, 1, sizeof *d);
    bool good = d != NULL;
    if (good)
        d->owner = owner, d->triangles = mesh->triangle_count, d->tolerance = tolerance, d->candidate[0] = 0;
    good = good && prepare_divider(d, mesh, arena);
    for (uint32_t m = 0; m < members && good; m++)
        good = divide_pieces(d, &own[m], m, shares);
    strl_arena_rewind(arena, mark);
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the anchors of a group");
}
