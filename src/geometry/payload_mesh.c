#include "geometry/payload_mesh.h"

#include <string.h>

bool strl__mesh_init(struct strl__mesh *mesh, uint32_t vertices, uint32_t triangles, int32_t (*position)[3], strl_arena *scratch)
{
    *mesh = (struct strl__mesh){.position = position};
    mesh->triangle = strl_arena_alloc(scratch, triangles, sizeof *mesh->triangle);
    mesh->next = strl_arena_alloc(scratch, (size_t)triangles * 4, sizeof *mesh->next);
    mesh->first = strl_arena_alloc(scratch, vertices, sizeof *mesh->first);
    mesh->twin = strl_arena_alloc(scratch, vertices, sizeof *mesh->twin);
    if (!mesh->triangle || !mesh->next || !mesh->first || !mesh->twin)
        return false;
    for (uint32_t v = 0; v < vertices; v++) {
        mesh->first[v] = STRL__NONE;
        mesh->twin[v] = (uint16_t)v;
    }
    return true;
}

bool strl__star_init(struct strl__star *star, uint32_t vertices, uint32_t triangles, strl_arena *scratch)
{
    *star = (struct strl__star){0};
    star->corner = strl_arena_alloc(scratch, triangles, sizeof *star->corner);
    star->wing = strl_arena_alloc(scratch, triangles, sizeof *star->wing);
    star->order = strl_arena_alloc(scratch, triangles, sizeof *star->order);
    star->spoke = strl_arena_alloc(scratch, (size_t)triangles * 2, sizeof *star->spoke);
    star->chain = strl_arena_alloc(scratch, triangles, sizeof *star->chain);
    star->moves = strl_arena_alloc(scratch, triangles, sizeof *star->moves);
    star->link = strl_arena_alloc(scratch, triangles, sizeof *star->link);
    star->placed = strl_arena_alloc(scratch, triangles, sizeof *star->placed);
    star->begins = strl_arena_alloc_zero(scratch, vertices, sizeof *star->begins);
    star->ends = strl_arena_alloc_zero(scratch, vertices, sizeof *star->ends);
    return star->corner && star->wing && star->order && star->spoke && star->chain && star->moves && star->link && star->placed &&
           star->begins && star->ends;
}

/* The common case, an inner vertex of a manifold: one closed chain. If first-listed successors lead through all triangles and
 * back, every x and so every y is there once, and the general rule gives the same. */
static bool build_closed(struct strl__star *star)
{
    uint32_t place = 0;
    for (uint32_t i = 0; i < star->count; i++) {
        star->order[i] = place;
        star->spoke[i] = star->wing[place][0];
        uint16_t y = star->wing[place][1];
        place = star->begins[y];
        if (place >= star->count || star->wing[place][0] != y || (place == 0 && i + 1 < star->count))
            return false;
    }
    if (place != 0)
        return false;
    star->spoke_count = star->count;
    star->chain_count = 1;
    star->chain[0] = (struct strl__chain){0, star->count, 0, true};
    return true;
}

static void link_places(struct strl__star *star)
{
    for (uint32_t i = star->count; i-- > 0;)
        star->ends[star->wing[i][1]] = i;
    for (uint32_t i = 0; i < star->count; i++) {
        uint16_t y = star->wing[i][1];
        uint32_t follower = star->begins[y];
        bool linked = star->ends[y] == i && follower < star->count && star->wing[follower][0] == y;
        star->link[i] = linked ? follower : STRL__NONE;
        star->placed[i] = 0;
    }
}

/* The triangle linked to `place`, or STRL__NONE. */
static uint32_t before(const struct strl__star *star, uint32_t place)
{
    uint16_t x = star->wing[place][0];
    uint32_t previous = star->ends[x];
    bool linked = previous < star->count && star->wing[previous][1] == x && star->link[previous] == place;
    return linked ? previous : STRL__NONE;
}

static void build_chains(struct strl__star *star)
{
    link_places(star);
    uint32_t done = 0;
    star->spoke_count = star->chain_count = 0;
    for (uint32_t i = 0; i < star->count; i++) {
        if (star->placed[i])
            continue;
        uint32_t start = i, previous;
        while ((previous = before(star, start)) != STRL__NONE && previous != i)
            start = previous;
        bool closed = previous == i;
        start = closed ? i : start;
        struct strl__chain *chain = &star->chain[star->chain_count++];
        *chain = (struct strl__chain){done, 0, star->spoke_count, closed};
        uint32_t place = start, last;
        do {
            last = place;
            star->placed[place] = 1;
            star->order[done++] = place;
            star->spoke[star->spoke_count++] = star->wing[place][0];
            place = star->link[place];
        } while (place != STRL__NONE && place != start);
        chain->triangles = done - chain->first_triangle;
        if (!closed)
            star->spoke[star->spoke_count++] = star->wing[last][1];
    }
}

void strl__star_build(struct strl__star *star, const struct strl__mesh *mesh, uint32_t vertex)
{
    uint32_t count = 0;
    for (uint32_t c = mesh->first[vertex]; c != STRL__NONE; c = mesh->next[c]) {
        const uint16_t *t = mesh->triangle[c >> 2];
        unsigned k = strl__next3(c & 3);
        star->corner[count] = c;
        star->wing[count][0] = t[k];
        star->wing[count][1] = t[strl__next3(k)];
        star->moves[count++] = 0;
    }
    star->count = count;
    for (uint32_t i = count; i-- > 0;)
        star->begins[star->wing[i][0]] = i;
    if (count == 0)
        star->spoke_count = star->chain_count = 0;
    else if (!build_closed(star))
        build_chains(star);
}

void strl__star_move(const struct strl__star *star, struct strl__mesh *mesh, uint32_t from, uint32_t vertex)
{
    uint32_t *tail[2] = {&mesh->first[from], &mesh->first[vertex]};
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t corner = star->corner[i];
        unsigned moved = star->moves[i];
        *tail[moved] = corner;
        tail[moved] = &mesh->next[corner];
        mesh->triangle[corner >> 2][corner & 3] = (uint16_t)(moved ? vertex : from);
    }
    *tail[0] = *tail[1] = STRL__NONE;
}

uint64_t (*strl__normal_sums(const int32_t (*position)[3], uint32_t vertices, const uint16_t (*triangle)[4], uint32_t triangles,
                             strl_arena *scratch))[4]
{
    uint64_t(*sum)[4] = strl_arena_alloc_zero(scratch, vertices, sizeof *sum);
    for (uint32_t t = 0; sum && t < triangles; t++) {
        const uint16_t *corner = triangle[t];
        const int32_t *p = position[corner[0]], *q = position[corner[1]], *r = position[corner[2]];
        uint64_t a[3], b[3], n[3];
        for (unsigned k = 0; k < 3; k++) {
            a[k] = (uint64_t)((int64_t)q[k] - p[k]);
            b[k] = (uint64_t)((int64_t)r[k] - p[k]);
        }
        for (unsigned k = 0; k < 3; k++)
            n[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
        for (unsigned c = 0; c < 3; c++)
            for (unsigned k = 0; k < 3; k++)
                sum[corner[c]][k] += n[k];
    }
    return sum;
}

/* strl_oct_encode in integers, after scaling the sum to 18 bits. */
void strl__normal_predict(const uint64_t sum[4], uint32_t predicted[2])
{
    uint64_t magnitude[3], all = 1;
    for (unsigned k = 0; k < 3; k++) {
        magnitude[k] = sum[k] >> 63 ? 0 - sum[k] : sum[k];
        all |= magnitude[k];
    }
    int width = 64 - __builtin_clzll(all), shift = width > 18 ? width - 18 : 0;
    int32_t x = (int32_t)(magnitude[0] >> shift), y = (int32_t)(magnitude[1] >> shift), z = (int32_t)(magnitude[2] >> shift);
    int32_t length = x + y + z;
    if (length == 0) {
        predicted[0] = predicted[1] = 512;
        return;
    }
    if (sum[2] >> 63) { /* fold the lower half outward */
        int32_t folded = length - y;
        y = length - x;
        x = folded;
    }
    x = sum[0] >> 63 ? -x : x;
    y = sum[1] >> 63 ? -y : y;
    predicted[0] = ((uint32_t)(x + length) * 1023u + (uint32_t)length) / (2 * (uint32_t)length);
    predicted[1] = ((uint32_t)(y + length) * 1023u + (uint32_t)length) / (2 * (uint32_t)length);
}
