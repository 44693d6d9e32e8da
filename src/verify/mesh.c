#include "verify/mesh.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"

/* Limit of the corners that may move when all steps are taken back: a hostile mesh could make it quadratic. */
#define MOST_MOVES ((uint64_t)1 << 26)

void strl__v_mesh_resolve(const strl__vmesh *mesh, uint32_t state, uint16_t *map)
{
    uint32_t end = mesh->vertex_end[state];
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        map[v] = v < end ? (uint16_t)v : map[mesh->parent[v]];
}

uint32_t strl__v_mesh_state(const strl__vmesh *mesh, double limit, bool with_appearance)
{
    uint32_t low = 0, high = mesh->step_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        float appearance = with_appearance ? mesh->appearance_error[middle] : 0;
        if (fmaxf(mesh->geometric_error[middle], appearance) <= limit)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

void strl__v_mesh_hash_points(const strl__vmesh *mesh, const int64_t anchor[3], strl__hash128 *points)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const int32_t *p = mesh->position[v];
        points[v] = strl__hash_point(anchor[0] + p[0], anchor[1] + p[1], anchor[2] + p[2]);
    }
}

strl__hash128 strl__v_mesh_hash(const strl__vmesh *mesh, uint32_t state, const uint16_t *map,
                                const strl__hash128 *points)
{
    strl__hash128 sum = {0, 0};
    for (uint32_t t = 0; t < mesh->triangle_end[state]; t++) {
        const uint16_t *c = mesh->triangle[t];
        strl__hash_add(&sum, strl__hash_triangle(points[map[c[0]]], points[map[c[1]]], points[map[c[2]]]));
    }
    return sum;
}

/* ---- rules ---- */

static bool same_position(const strl__vmesh *mesh, uint32_t a, uint32_t b)
{
    return memcmp(mesh->position[a], mesh->position[b], sizeof *mesh->position) == 0;
}

static strl_status check_ends(const strl__vmesh *mesh, strl_error *err)
{
    for (uint32_t s = 0; s <= mesh->step_count; s++) {
        bool grows = s == 0 || (mesh->vertex_end[s] > mesh->vertex_end[s - 1] &&
                                mesh->triangle_end[s] >= mesh->triangle_end[s - 1]);
        if (!grows || mesh->vertex_end[s] > mesh->vertex_count || mesh->triangle_end[s] > mesh->triangle_count)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "state %" PRIu32 " has %" PRIu32 " vertices and %" PRIu32 " triangles", s,
                              mesh->vertex_end[s], mesh->triangle_end[s]);
        float g = mesh->geometric_error[s], a = mesh->appearance_error[s];
        bool falls = s == 0 || (g <= mesh->geometric_error[s - 1] && a <= mesh->appearance_error[s - 1]);
        if (!(g >= 0 && a >= 0 && g <= 0x1p64f && a <= 0x1p64f) || !falls)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "state %" PRIu32 " errs by %g and %g, more than the state before it", s, (double)g,
                              (double)a);
    }
    if (mesh->vertex_end[mesh->step_count] != mesh->vertex_count ||
        mesh->triangle_end[mesh->step_count] != mesh->triangle_count)
        return strl__fail(err, STRL_ERR_FORMAT, "the last state has not all vertices and triangles");
    return STRL_OK;
}

static strl_status check_vertices(const strl__vmesh *mesh, strl_error *err)
{
    for (uint32_t s = 1; s <= mesh->step_count; s++) {
        uint32_t first = mesh->vertex_end[s - 1];
        for (uint32_t v = first; v < mesh->vertex_end[s]; v++)
            if (mesh->parent[v] >= first || !same_position(mesh, v, first) ||
                !same_position(mesh, mesh->parent[v], mesh->parent[first]))
                return strl__fail(err, STRL_ERR_FORMAT,
                                  "step %" PRIu32 ": vertex %" PRIu32 " has the parent %u, or other positions "
                                  "than vertex %" PRIu32 " and its parent",
                                  s, v, mesh->parent[v], first);
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        if (mesh->normal[v][0] > 1023 || mesh->normal[v][1] > 1023 ||
            (mesh->palette_index && mesh->palette_index[v] >= mesh->palette_count))
            return strl__fail(err, STRL_ERR_FORMAT, "vertex %" PRIu32 " has a normal or a palette index out of range",
                              v);
    return STRL_OK;
}

/* Takes all steps back, from the finest state on, with the corners at each vertex in a list. */
typedef struct unwinding {
    const strl__vmesh *mesh;
    uint16_t *corner;       /* [3 * triangle_count] now */
    uint32_t *next;         /* [3 * triangle_count] */
    uint32_t *first, *last; /* [vertex_count] corners, UINT32_MAX = none */
    uint64_t moves;
} unwinding;

static bool degenerate(const unwinding *u, uint32_t t)
{
    const uint16_t *c = &u->corner[3 * t];
    return same_position(u->mesh, c[0], c[1]) || same_position(u->mesh, c[1], c[2]) ||
           same_position(u->mesh, c[2], c[0]);
}

static void append_corner(unwinding *u, uint32_t v, uint32_t first, uint32_t last)
{
    if (u->first[v] == UINT32_MAX)
        u->first[v] = first;
    else
        u->next[u->last[v]] = first;
    u->last[v] = last;
}

static bool unwinding_init(unwinding *u, const strl__vmesh *mesh, strl_arena *scratch)
{
    size_t corners = 3 * (size_t)mesh->triangle_count;
    *u = (unwinding){.mesh = mesh};
    u->corner = strl_arena_alloc(scratch, corners, sizeof *u->corner);
    u->next = strl_arena_alloc(scratch, corners, sizeof *u->next);
    u->first = strl_arena_alloc(scratch, mesh->vertex_count, sizeof *u->first);
    u->last = strl_arena_alloc(scratch, mesh->vertex_count, sizeof *u->last);
    if (!u->corner || !u->next || !u->first || !u->last)
        return false;
    memset(u->first, 0xff, (size_t)mesh->vertex_count * sizeof *u->first);
    for (uint32_t c = 0; c < corners; c++) {
        u->corner[c] = mesh->triangle[c / 3][c % 3];
        u->next[c] = UINT32_MAX;
        append_corner(u, u->corner[c], c, c);
    }
    return true;
}

/* Moves the corners of v to its parent. Triangles of the step itself, from `stays` on, may degenerate, others
 * must not. */
static strl_status collapse_vertex(unwinding *u, uint32_t v, uint32_t stays, strl_error *err)
{
    uint32_t parent = u->mesh->parent[v];
    if (u->first[v] == UINT32_MAX)
        return STRL_OK;
    for (uint32_t c = u->first[v]; c != UINT32_MAX; c = u->next[c], u->moves++)
        u->corner[c] = (uint16_t)parent;
    if (u->moves > MOST_MOVES)
        return strl__fail(err, STRL_ERR_FORMAT, "its steps move more than %" PRIu64 " corners", MOST_MOVES);
    for (uint32_t c = u->first[v]; c != UINT32_MAX; c = u->next[c])
        if (c / 3 < stays && degenerate(u, c / 3))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "triangle %" PRIu32 " degenerates when vertex %" PRIu32 " collapses onto %" PRIu32, c / 3,
                              v, parent);
    append_corner(u, parent, u->first[v], u->last[v]);
    return STRL_OK;
}

static strl_status take_back(unwinding *u, uint32_t step, strl_error *err)
{
    const strl__vmesh *mesh = u->mesh;
    uint32_t first = mesh->vertex_end[step - 1], end = mesh->vertex_end[step], stays = mesh->triangle_end[step - 1];
    for (uint32_t t = stays; t < mesh->triangle_end[step]; t++) {
        bool own = false;
        for (unsigned k = 0; k < 3; k++)
            own = own || (u->corner[3 * t + k] >= first && u->corner[3 * t + k] < end);
        if (!own)
            return strl__fail(err, STRL_ERR_FORMAT, "step %" PRIu32 ": triangle %" PRIu32 " has no vertex of the step",
                              step, t);
    }
    for (uint32_t v = first; v < end; v++) {
        strl_status status = collapse_vertex(u, v, stays, err);
        if (status != STRL_OK)
            return status;
    }
    for (uint32_t t = stays; t < mesh->triangle_end[step]; t++)
        if (!degenerate(u, t))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "step %" PRIu32 ": triangle %" PRIu32 " would not be degenerate without it", step, t);
    return STRL_OK;
}

strl_status strl__v_mesh_check_ranges(const strl__vmesh *mesh, strl_error *err)
{
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (unsigned k = 0; k < 3; k++)
            if (mesh->triangle[t][k] >= mesh->vertex_count)
                return strl__fail(err, STRL_ERR_FORMAT,
                                  "triangle %" PRIu32 " has the corner %u of %" PRIu32 " vertices", t,
                                  mesh->triangle[t][k], mesh->vertex_count);
    strl_status status = check_ends(mesh, err);
    return status == STRL_OK ? check_vertices(mesh, err) : status;
}

strl_status strl__v_mesh_check_states(const strl__vmesh *mesh, strl_arena *scratch, strl_error *err)
{
    unwinding u;
    if (!unwinding_init(&u, mesh, scratch))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to check a mesh of %" PRIu32 " triangles",
                          mesh->triangle_count);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (degenerate(&u, t))
            return strl__fail(err, STRL_ERR_FORMAT, "triangle %" PRIu32 " is degenerate in the finest state", t);
    strl_status status = STRL_OK;
    for (uint32_t step = mesh->step_count; status == STRL_OK && step > 0; step--)
        status = take_back(&u, step, err);
    return status;
}

strl__hash128 strl__hash_placement(uint32_t tree, uint32_t own_part, const double transform[12])
{
    uint64_t names = (uint64_t)own_part << 32 | tree;
    strl__hash128 hash = {strl__mix64(names + 0x9e3779b97f4a7c15u), strl__mix64(names + 0x632be59bd9b4e019u)};
    for (unsigned i = 0; i < 12; i++) {
        uint64_t bits;
        double number = transform[i] + 0.0; /* zeros have one sign */
        memcpy(&bits, &number, sizeof bits);
        hash.low = strl__mix64(hash.low ^ bits);
        hash.high = strl__mix64(hash.high + bits);
    }
    return hash;
}
