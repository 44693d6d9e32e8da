#include "geometry/record.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"

#define NO_INDEX UINT32_MAX

/* Where each point and wedge goes. */
typedef struct ordering {
    uint32_t *point_step;   /* per point: 0 = base, else the refinement step that adds it */
    uint32_t *step_first;   /* [steps + 2] prefix sums of wedges per step, then vertex index of the step's first */
    uint32_t *wedge_vertex; /* per wedge */
    uint32_t *point_vertex; /* per point: the vertex of one of its wedges */
} ordering;

static bool order_vertices(const strl_mesh *mesh, const strl_simplified *simplified, strl_arena *arena, ordering *o)
{
    uint32_t steps = simplified->collapse_count;
    o->point_step = strl_arena_alloc_zero(arena, mesh->point_count, sizeof *o->point_step);
    o->step_first = strl_arena_alloc_zero(arena, (size_t)steps + 2, sizeof *o->step_first);
    o->wedge_vertex = strl_arena_alloc(arena, simplified->wedge_count, sizeof *o->wedge_vertex);
    o->point_vertex = strl_arena_alloc_zero(arena, mesh->point_count, sizeof *o->point_vertex);
    if (!o->point_step || !o->step_first || !o->wedge_vertex || !o->point_vertex)
        return false;
    for (uint32_t i = 0; i < steps; i++)
        o->point_step[simplified->collapses[i].from] = steps - i;
    for (uint32_t w = 0; w < simplified->wedge_count; w++)
        o->step_first[o->point_step[simplified->wedge[w].point] + 1]++;
    for (uint32_t i = 0; i <= steps; i++)
        o->step_first[i + 1] += o->step_first[i];
    for (uint32_t w = 0; w < simplified->wedge_count; w++)
        o->point_vertex[simplified->wedge[w].point] = o->wedge_vertex[w] =
            o->step_first[o->point_step[simplified->wedge[w].point]]++;
    /* step_first[i] is now the end of step i */
    return true;
}

static bool allocate(strl_pm *pm, uint32_t vertices, uint32_t triangles, uint32_t steps, strl_arena *arena)
{
    *pm = (strl_pm){.vertex_count = vertices, .triangle_count = triangles, .step_count = steps};
    pm->position = strl_arena_alloc(arena, vertices, sizeof *pm->position);
    pm->normal = strl_arena_alloc(arena, vertices, sizeof *pm->normal);
    pm->colour = strl_arena_alloc(arena, vertices, sizeof *pm->colour);
    pm->texcoord = strl_arena_alloc(arena, vertices, sizeof *pm->texcoord);
    pm->palette_index = strl_arena_alloc(arena, vertices, sizeof *pm->palette_index);
    pm->parent = strl_arena_alloc_zero(arena, vertices, sizeof *pm->parent);
    pm->triangle = strl_arena_alloc(arena, triangles, sizeof *pm->triangle);
    pm->vertex_end = strl_arena_alloc(arena, (size_t)steps + 1, sizeof *pm->vertex_end);
    pm->triangle_end = strl_arena_alloc_zero(arena, (size_t)steps + 2, sizeof *pm->triangle_end);
    pm->geometric_error = strl_arena_alloc(arena, (size_t)steps + 1, sizeof(float));
    pm->appearance_error = strl_arena_alloc(arena, (size_t)steps + 1, sizeof(float));
    return pm->position && pm->normal && pm->colour && pm->texcoord && pm->palette_index && pm->parent &&
           pm->triangle && pm->vertex_end && pm->triangle_end && pm->geometric_error && pm->appearance_error;
}

/* Palette ids in order of first use by wedges. */
static bool fill_palette(strl_pm *pm, const strl_simplified *simplified, const ordering *o,
                         const strl_palette_entry *palette, strl_arena *arena)
{
    uint32_t capacity = 16, *ids = strl_arena_alloc(arena, capacity, sizeof *ids), last = 0;
    pm->palette_count = 0;
    for (uint32_t w = 0; w < simplified->wedge_count && ids; w++) {
        uint32_t id = simplified->wedge[w].palette, at = last;
        if (!pm->palette_count || ids[at] != id)
            for (at = 0; at < pm->palette_count && ids[at] != id; at++)
                ;
        if (at == pm->palette_count) {
            if (at == capacity) {
                uint32_t *more = strl_arena_alloc(arena, (size_t)capacity * 2, sizeof *more);
                if (!more)
                    return false;
                memcpy(more, ids, capacity * sizeof *ids);
                ids = more;
                capacity *= 2;
            }
            ids[pm->palette_count++] = id;
        }
        pm->palette_index[o->wedge_vertex[w]] = (uint16_t)at;
        last = at;
    }
    pm->palette = ids ? strl_arena_alloc(arena, pm->palette_count, sizeof *pm->palette) : NULL;
    for (uint32_t i = 0; pm->palette && i < pm->palette_count; i++)
        pm->palette[i] = palette[ids[i]];
    if (pm->palette_count == 1)
        pm->palette_index = NULL;
    return pm->palette != NULL;
}

static void fill_vertices(strl_pm *pm, const strl_mesh *mesh, const strl_simplified *simplified, const ordering *o)
{
    bool white = true;
    uint32_t texcoords = 0;
    for (uint32_t w = 0; w < simplified->wedge_count; w++) {
        const strl_wedge *wedge = &simplified->wedge[w];
        uint32_t v = o->wedge_vertex[w];
        memcpy(pm->position[v], mesh->position[wedge->point], sizeof *pm->position);
        memcpy(pm->normal[v], wedge->normal, sizeof *pm->normal);
        pm->colour[v] = wedge->colour;
        white &= wedge->colour == 0xffffffffu;
        texcoords |= pm->texcoord[v] = wedge->texcoord;
        uint32_t step = o->point_step[wedge->point], parent = simplified->wedge_parent[w];
        if (step && parent != w)
            pm->parent[v] = (uint16_t)o->wedge_vertex[parent];
        else if (step) /* it had lost all its triangles before: any wedge of the point that took the others */
            pm->parent[v] = (uint16_t)o->point_vertex[simplified->collapses[pm->step_count - step].to];
    }
    if (white)
        pm->colour = NULL;
    if (!texcoords)
        pm->texcoord = NULL;
    for (uint32_t s = 0; s <= pm->step_count; s++)
        pm->vertex_end[s] = o->step_first[s];
}

/* Counting sort of the triangles by the step that brings them back. */
static void fill_triangles(strl_pm *pm, const strl_mesh *mesh, const strl_simplified *simplified, const ordering *o)
{
    uint32_t steps = pm->step_count, *count = pm->triangle_end; /* [steps + 2] while counting */
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t at = simplified->removed_at[t];
        count[(at == NO_INDEX ? 0 : steps - at) + 1]++;
    }
    for (uint32_t s = 0; s <= steps; s++)
        count[s + 1] += count[s];
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t at = simplified->removed_at[t], to = count[at == NO_INDEX ? 0 : steps - at]++;
        for (int c = 0; c < 3; c++)
            pm->triangle[to][c] = (uint16_t)o->wedge_vertex[mesh->triangle[t][c]];
    }
    /* each count[s] has advanced to the end of step s */
}

static void fill_errors(strl_pm *pm, const strl_mesh *mesh, const strl_simplified *simplified)
{
    float geometric = 0, appearance = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        geometric = fmaxf(geometric, strl_mesh_error(mesh, strl_drift_length(&mesh->drift[t])));
        appearance = fmaxf(appearance, mesh->shift[t]);
    }
    pm->geometric_error[pm->step_count] = geometric;
    pm->appearance_error[pm->step_count] = appearance;
    for (uint32_t i = 0; i < pm->step_count; i++) {
        pm->geometric_error[pm->step_count - 1 - i] = simplified->collapses[i].geometric;
        pm->appearance_error[pm->step_count - 1 - i] = simplified->collapses[i].appearance;
    }
}

strl_status strl_pm_record(const strl_mesh *mesh, const strl_simplified *simplified, const strl_palette_entry *palette,
                           uint32_t palette_count, strl_arena *arena, strl_pm *pm, strl_error *err)
{
    ordering order;
    for (uint32_t w = 0; w < simplified->wedge_count; w++)
        if (simplified->wedge[w].palette >= palette_count)
            return strl__fail(err, STRL_ERR_FORMAT, "a wedge has entry %u of a palette of %u",
                              simplified->wedge[w].palette, palette_count);
    if (simplified->wedge_count > STRL_PM_MAX_VERTICES || mesh->triangle_count > STRL_PM_MAX_TRIANGLES)
        return strl__fail(err, STRL_ERR_LIMIT, "a node has %u vertices and %u triangles; the limits are %u and %u",
                          simplified->wedge_count, mesh->triangle_count, STRL_PM_MAX_VERTICES, STRL_PM_MAX_TRIANGLES);
    if (!order_vertices(mesh, simplified, arena, &order) ||
        !allocate(pm, simplified->wedge_count, mesh->triangle_count, simplified->collapse_count, arena) ||
        !fill_palette(pm, simplified, &order, palette, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node of %u triangles", mesh->triangle_count);
    fill_vertices(pm, mesh, simplified, &order);
    fill_triangles(pm, mesh, simplified, &order);
    fill_errors(pm, mesh, simplified);
    return STRL_OK;
}

/* Numbers the points and wedges that are still used, in their old order. */
static void renumber(const strl_mesh *mesh, const strl_simplified *simplified, uint32_t *points, uint32_t *wedges,
                     strl_mesh *counts)
{
    memset(points, 0xff, mesh->point_count * sizeof *points);
    memset(wedges, 0xff, simplified->wedge_count * sizeof *wedges);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3 && simplified->removed_at[t] == NO_INDEX; c++)
            wedges[simplified->corner[t][c]] = points[simplified->wedge[simplified->corner[t][c]].point] = 0;
    *counts = (strl_mesh){.triangle_count = simplified->triangles_left};
    for (uint32_t p = 0; p < mesh->point_count; p++)
        if (points[p] == 0)
            points[p] = counts->point_count++;
    for (uint32_t w = 0; w < simplified->wedge_count; w++)
        if (wedges[w] == 0)
            wedges[w] = counts->wedge_count++;
}

strl_status strl_mesh_after(const strl_mesh *mesh, const strl_simplified *simplified, uint32_t *point_map,
                            strl_arena *arena, strl_mesh *base, strl_error *err)
{
    uint32_t *points = point_map ? point_map : strl_arena_alloc(arena, mesh->point_count, sizeof *points);
    uint32_t *wedges = strl_arena_alloc(arena, simplified->wedge_count, sizeof *wedges);
    strl_mesh counts;
    if (!points || !wedges)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a mesh of %u triangles", mesh->triangle_count);
    renumber(mesh, simplified, points, wedges, &counts);
    if (!strl_mesh_create(base, counts.point_count, counts.wedge_count, counts.triangle_count, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a mesh of %u triangles", counts.triangle_count);
    base->start_error = mesh->start_error;
    base->most_error = mesh->most_error;
    for (uint32_t p = 0; p < mesh->point_count; p++)
        if (points[p] != NO_INDEX) {
            memcpy(base->position[points[p]], mesh->position[p], sizeof *base->position);
            base->flags[points[p]] = mesh->flags[p];
        }
    for (uint32_t w = 0; w < simplified->wedge_count; w++)
        if (wedges[w] != NO_INDEX) {
            base->wedge[wedges[w]] = simplified->wedge[w];
            base->wedge[wedges[w]].point = points[simplified->wedge[w].point];
            memcpy(base->wedge[wedges[w]].normal, simplified->normal[w], sizeof simplified->normal[w]);
        }
    uint32_t to = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        if (simplified->removed_at[t] != NO_INDEX)
            continue;
        for (int c = 0; c < 3; c++)
            base->triangle[to][c] = wedges[simplified->corner[t][c]];
        base->drift[to] = simplified->drift[t];
        base->deviation[to] = simplified->deviation[t];
        base->shift[to++] = simplified->shift[t];
    }
    return STRL_OK;
}
