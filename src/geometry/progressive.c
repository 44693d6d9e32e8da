#include "geometry/progressive.h"

#include <inttypes.h>

#include "base/fail.h"

bool strl_pm_create(strl_pm *pm, bool has_colours, bool has_palette_indices, bool has_texcoords, strl_arena *arena)
{
    size_t vertices = pm->vertex_count, states = (size_t)pm->step_count + 1;
    pm->position = strl_arena_alloc(arena, vertices, sizeof *pm->position);
    pm->normal = strl_arena_alloc(arena, vertices, sizeof *pm->normal);
    pm->colour = has_colours ? strl_arena_alloc(arena, vertices, sizeof *pm->colour) : NULL;
    pm->texcoord = has_texcoords ? strl_arena_alloc(arena, vertices, sizeof *pm->texcoord) : NULL;
    pm->palette_index = has_palette_indices ? strl_arena_alloc(arena, vertices, sizeof *pm->palette_index) : NULL;
    pm->parent = strl_arena_alloc(arena, vertices, sizeof *pm->parent);
    pm->triangle = strl_arena_alloc(arena, pm->triangle_count, sizeof *pm->triangle);
    pm->vertex_end = strl_arena_alloc(arena, states, sizeof *pm->vertex_end);
    pm->triangle_end = strl_arena_alloc(arena, states, sizeof *pm->triangle_end);
    pm->geometric_error = strl_arena_alloc(arena, states, sizeof *pm->geometric_error);
    pm->appearance_error = strl_arena_alloc(arena, states, sizeof *pm->appearance_error);
    pm->palette = strl_arena_alloc(arena, pm->palette_count, sizeof *pm->palette);
    return pm->position && pm->normal && (pm->colour || !has_colours) && (pm->palette_index || !has_palette_indices) &&
           (pm->texcoord || !has_texcoords) && pm->parent && pm->triangle && pm->vertex_end && pm->triangle_end &&
           pm->geometric_error && pm->appearance_error && pm->palette;
}

static strl_status check_counts(const strl_pm *pm, strl_error *err)
{
    if (pm->vertex_count > STRL_PM_MAX_VERTICES)
        return strl__fail(err, STRL_ERR_LIMIT, "progressive mesh has %" PRIu32 " vertices, more than %u",
                          pm->vertex_count, STRL_PM_MAX_VERTICES);
    if (pm->triangle_count > STRL_PM_MAX_TRIANGLES)
        return strl__fail(err, STRL_ERR_LIMIT, "progressive mesh has %" PRIu32 " triangles, more than %u",
                          pm->triangle_count, STRL_PM_MAX_TRIANGLES);
    if (pm->palette_count < 1 || pm->palette_count > STRL_PM_MAX_PALETTE)
        return strl__fail(err, STRL_ERR_LIMIT, "progressive mesh has %" PRIu32 " palette entries, expected 1 to %u",
                          pm->palette_count, STRL_PM_MAX_PALETTE);
    if (pm->step_count > pm->vertex_count)
        return strl__fail(err, STRL_ERR_LIMIT, "progressive mesh has %" PRIu32 " steps but only %" PRIu32 " vertices",
                          pm->step_count, pm->vertex_count);
    return STRL_OK;
}

static bool error_is_sound(float error, float before)
{
    return error >= 0 && error <= before;
}

static strl_status check_ends(const strl_pm *pm, strl_error *err)
{
    for (uint32_t s = 0; s <= pm->step_count; s++) {
        if (s && (pm->vertex_end[s] <= pm->vertex_end[s - 1] || pm->triangle_end[s] < pm->triangle_end[s - 1]))
            return strl__fail(err, STRL_ERR_FORMAT, "step %" PRIu32 " adds no vertex, or takes triangles away", s);
        float geometric = s ? pm->geometric_error[s - 1] : STRL_PM_MAX_ERROR;
        float appearance = s ? pm->appearance_error[s - 1] : STRL_PM_MAX_ERROR;
        if (!error_is_sound(pm->geometric_error[s], geometric) || !error_is_sound(pm->appearance_error[s], appearance))
            return strl__fail(
                err, STRL_ERR_FORMAT, "state %" PRIu32 " has errors %g and %g, expected 0 to %g and 0 to %g", s,
                (double)pm->geometric_error[s], (double)pm->appearance_error[s], (double)geometric, (double)appearance);
    }
    if (pm->vertex_end[pm->step_count] != pm->vertex_count || pm->triangle_end[pm->step_count] != pm->triangle_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "the finest state does not hold all %" PRIu32 " vertices and %" PRIu32 " triangles",
                          pm->vertex_count, pm->triangle_count);
    return STRL_OK;
}

static bool same_position(const strl_pm *pm, uint32_t a, uint32_t b)
{
    const int32_t *p = pm->position[a], *q = pm->position[b];
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

static strl_status check_vertices(const strl_pm *pm, strl_error *err)
{
    for (uint32_t v = 0; v < pm->vertex_count; v++) {
        if (pm->normal[v][0] > 1023 || pm->normal[v][1] > 1023)
            return strl__fail(err, STRL_ERR_FORMAT, "vertex %" PRIu32 " has a normal past 1023", v);
        if (pm->palette_index && pm->palette_index[v] >= pm->palette_count)
            return strl__fail(err, STRL_ERR_FORMAT, "vertex %" PRIu32 " names palette entry %u of %" PRIu32, v,
                              pm->palette_index[v], pm->palette_count);
    }
    for (uint32_t v = 0; v < pm->vertex_end[0]; v++)
        if (pm->parent[v])
            return strl__fail(err, STRL_ERR_FORMAT, "vertex %" PRIu32 " of the base mesh has a parent", v);
    for (uint32_t s = 1; s <= pm->step_count; s++)
        for (uint32_t first = pm->vertex_end[s - 1], v = first; v < pm->vertex_end[s]; v++) {
            if (pm->parent[v] >= first)
                return strl__fail(err, STRL_ERR_FORMAT,
                                  "vertex %" PRIu32 " of step %" PRIu32 " has parent %u, expected less than %" PRIu32,
                                  v, s, pm->parent[v], first);
            if (!same_position(pm, v, first))
                return strl__fail(err, STRL_ERR_FORMAT,
                                  "step %" PRIu32 " adds vertices %" PRIu32 " and %" PRIu32 " at different positions",
                                  s, first, v);
        }
    return STRL_OK;
}

static bool is_degenerate(const strl_pm *pm, const uint32_t c[3])
{
    return same_position(pm, c[0], c[1]) || same_position(pm, c[1], c[2]) || same_position(pm, c[2], c[0]);
}

/* Walks a triangle born in state s from the finest state back to its birth. Vertices are numbered in the order of
 * steps, so the largest corner is the next one that a coarser state resolves to its parent. */
static strl_status check_triangle(const strl_pm *pm, uint32_t t, uint32_t s, uint64_t *moves, strl_error *err)
{
    uint32_t c[3] = {pm->triangle[t][0], pm->triangle[t][1], pm->triangle[t][2]};
    if (c[0] >= pm->vertex_count || c[1] >= pm->vertex_count || c[2] >= pm->vertex_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "triangle %" PRIu32 " names vertices %" PRIu32 " %" PRIu32 " %" PRIu32 " of %" PRIu32, t,
                          c[0], c[1], c[2], pm->vertex_count);
    for (;;) {
        if (is_degenerate(pm, c))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "triangle %" PRIu32 " has two corners at one position in some state: vertices %" PRIu32
                              " %" PRIu32 " %" PRIu32,
                              t, c[0], c[1], c[2]);
        uint32_t *latest = c[0] > c[1] ? &c[0] : &c[1];
        latest = c[2] > *latest ? &c[2] : latest;
        if (*latest < pm->vertex_end[s]) {
            if (s && *latest < pm->vertex_end[s - 1])
                return strl__fail(err, STRL_ERR_FORMAT,
                                  "triangle %" PRIu32 " of step %" PRIu32 " holds no vertex of that step", t, s);
            return STRL_OK;
        }
        *latest = pm->parent[*latest];
        if (++*moves > STRL_PM_MAX_MOVES)
            return strl__fail(err, STRL_ERR_LIMIT, "the steps of the progressive mesh move corners more than %u times",
                              STRL_PM_MAX_MOVES);
    }
}

strl_status strl_pm_check(const strl_pm *pm, strl_error *err)
{
    strl_status status = check_counts(pm, err);
    if (!status)
        status = check_ends(pm, err);
    if (!status)
        status = check_vertices(pm, err);
    uint64_t moves = 0;
    for (uint32_t t = 0, s = 0; !status && t < pm->triangle_count; t++) {
        while (t >= pm->triangle_end[s])
            s++;
        status = check_triangle(pm, t, s, &moves, err);
    }
    return status;
}
