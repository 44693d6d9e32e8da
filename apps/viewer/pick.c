#include "viewer/pick.h"

#include <math.h>
#include <string.h>

#include "frame/view.h"

/* The ray in the coordinates of an item's vertices: lattice cells from its anchor, or model units from its origin. A
 * parameter t along it is the same as along the ray in world units. */
typedef struct local_ray {
    double from[3], way[3];
} local_ray;

typedef struct hit {
    double t, normal[3]; /* normal: local, not unit */
    uint32_t vertex;     /* the triangle's first */
} hit;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

bool strl_ray_through(const strl_camera *camera, double x, double y, strl_ray *ray)
{
    strl_view view;
    if (!strl_view_init(&view, camera))
        return false;
    double right = (x + 0.5) / camera->width * 2 - 1, up = 1 - (y + 0.5) / camera->height * 2, length = 0;
    right *= view.orthographic ? view.half_width : view.tan_x;
    up *= view.orthographic ? view.half_height : view.tan_y;
    for (int i = 0; i < 3; i++) {
        double aside = view.right[i] * right + view.up[i] * up;
        ray->from[i] = view.eye[i] + (view.orthographic ? aside : 0);
        ray->way[i] = view.forward[i] + (view.orthographic ? 0 : aside);
        length += ray->way[i] * ray->way[i];
    }
    for (int i = 0; i < 3; i++)
        ray->way[i] /= sqrt(length);
    return true;
}

/* False where the placement is flat and has no inverse. */
static bool to_local(const strl_draw_item *item, const strl_ray *ray, local_ray *out)
{
    const double *m = item->transform;
    double column[3][3], shifted[3];
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++)
            column[j][i] = m[4 * i + j];
    for (int i = 0; i < 3; i++)
        shifted[i] = ray->from[i] - m[4 * i + 3];
    double determinant = 0;
    for (int j = 0; j < 3; j++) {
        double row[3];
        cross(column[(j + 1) % 3], column[(j + 2) % 3], row);
        determinant = dot(row, column[j]);
        if (determinant == 0 || !isfinite(determinant))
            return false;
        out->from[j] = dot(row, shifted) / determinant - item->origin[j];
        out->way[j] = dot(row, ray->way) / determinant;
        if (item->positions == STRL_POSITIONS_LATTICE) {
            out->from[j] = out->from[j] / item->step - (double)item->anchor[j];
            out->way[j] /= item->step;
        }
    }
    return true;
}

/* Whether the ray meets the item's box before t. Boxes hold all vertices; half a cell more covers rounding. */
static bool meets_box(const strl_draw_item *item, const local_ray *ray, double t)
{
    double least = 0, most = t;
    if (item->positions != STRL_POSITIONS_LATTICE)
        return true;
    for (int i = 0; i < 3; i++) {
        double low = (double)(item->box_min[i] - item->anchor[i]) - 0.5;
        double high = (double)(item->box_max[i] - item->anchor[i]) + 0.5;
        if (ray->way[i] == 0) {
            if (ray->from[i] < low || ray->from[i] > high)
                return false;
            continue;
        }
        double a = (low - ray->from[i]) / ray->way[i], b = (high - ray->from[i]) / ray->way[i];
        least = fmax(least, fmin(a, b));
        most = fmin(most, fmax(a, b));
    }
    return least <= most;
}

static void vertex_of(const strl_draw_item *item, uint32_t vertex, double out[3])
{
    const int32_t *position = item->vertices[vertex].position;
    float bits[3];
    memcpy(bits, position, sizeof bits);
    for (int i = 0; i < 3; i++)
        out[i] = item->positions == STRL_POSITIONS_LATTICE ? (double)position[i] : (double)bits[i];
}

/* Two-sided; edges count as inside, or a ray could slip through between two triangles. */
static bool meets_triangle(const double p[3][3], const local_ray *ray, double *t, double normal[3])
{
    double a[3], b[3], from[3], turned[3], q[3];
    for (int i = 0; i < 3; i++) {
        a[i] = p[1][i] - p[0][i];
        b[i] = p[2][i] - p[0][i];
        from[i] = ray->from[i] - p[0][i];
    }
    cross(ray->way, b, turned);
    double determinant = dot(a, turned);
    if (determinant == 0)
        return false;
    double u = dot(from, turned) / determinant;
    if (!(u >= -1e-9 && u <= 1 + 1e-9))
        return false;
    cross(from, a, q);
    double v = dot(ray->way, q) / determinant;
    if (!(v >= -1e-9 && u + v <= 1 + 1e-9))
        return false;
    *t = dot(b, q) / determinant;
    cross(a, b, normal);
    return *t > 0;
}

static bool is_item_hidden(const strl_pick_filter *filter, const strl_draw_item *item)
{
    uint32_t part = item->own_part - 1; /* of none: more than any count */
    return filter->part_styles && part < filter->part_count && filter->part_styles[part] == STRL_PART_HIDDEN;
}

static bool is_hidden(const strl_pick_filter *filter, const strl_draw_item *item, uint32_t vertex)
{
    if (!item->labels || !filter->part_styles)
        return false;
    uint32_t part = item->labels[vertex].part;
    return part < filter->part_count && filter->part_styles[part] == STRL_PART_HIDDEN;
}

static bool is_cut_off(const strl_pick_filter *filter, const strl_ray *ray, double t)
{
    const double *plane = filter->section;
    double side = 0;
    for (int i = 0; i < 3; i++)
        side += plane[i] * (ray->from[i] + t * ray->way[i]);
    return (plane[0] != 0 || plane[1] != 0 || plane[2] != 0) && side > plane[3];
}

static bool pick_item(const strl_draw_item *item, const strl_ray *world, const local_ray *ray,
                      const strl_pick_filter *filter, strl_cull cull, hit *best)
{
    bool found = false;
    for (uint32_t k = item->draw_first; k + 2 < item->draw_first + item->draw_count; k += 3) {
        double p[3][3], t, normal[3];
        uint32_t vertex = item->indices[k];
        for (int c = 0; c < 3; c++)
            vertex_of(item, item->indices[k + (uint32_t)c], p[c]);
        if (!meets_triangle(p, ray, &t, normal) || t >= best->t || is_hidden(filter, item, vertex) ||
            is_cut_off(filter, world, t) ||
            (cull == STRL_CULL_BACK && dot(normal, ray->way) > 0)) /* in the model's own space no placement mirrors */
            continue;
        *best = (hit){t, {normal[0], normal[1], normal[2]}, vertex};
        found = true;
    }
    return found;
}

/* Normals go by the inverse transposed: the rows of cofactors, up to length and sign. */
static void world_normal(const strl_draw_item *item, const double local[3], const double way[3], double out[3])
{
    double row[3][3], length;
    for (int i = 0; i < 3; i++)
        memcpy(row[i], item->transform + 4 * i, sizeof row[i]);
    for (int i = 0; i < 3; i++) {
        double cofactor[3];
        cross(row[(i + 1) % 3], row[(i + 2) % 3], cofactor);
        out[i] = dot(cofactor, local);
    }
    length = sqrt(dot(out, out)) * (dot(out, way) > 0 ? -1 : 1);
    for (int i = 0; i < 3; i++)
        out[i] = length != 0 ? out[i] / length : -way[i];
}

static void fill(const strl_draw_item *item, const strl_ray *ray, const hit *best, strl_pick *pick)
{
    double scale = 0;
    for (int i = 0; i < 3; i++)
        scale = fmax(scale, sqrt(dot(item->transform + 4 * i, item->transform + 4 * i)));
    *pick = (strl_pick){.distance = best->t,
                        .error = item->error * scale,
                        .part = item->own_part ? item->own_part - 1
                                : item->labels ? item->labels[best->vertex].part
                                               : UINT32_MAX,
                        .material = item->labels ? item->labels[best->vertex].material : UINT32_MAX,
                        .placement = item->placement,
                        .node = item->node};
    for (int i = 0; i < 3; i++)
        pick->point[i] = ray->from[i] + best->t * ray->way[i];
    world_normal(item, best->normal, ray->way, pick->normal);
}

bool strl_pick_list(const strl_draw_list *list, const strl_ray *ray, const strl_pick_filter *filter, strl_pick *pick)
{
    static const strl_pick_filter none;
    hit best = {.t = INFINITY};
    const strl_draw_item *nearest = NULL;
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        local_ray local;
        if (item->draw_count == 0 || item->point_px > 0 || is_item_hidden(filter ? filter : &none, item) ||
            !to_local(item, ray, &local) || !meets_box(item, &local, best.t))
            continue;
        if (pick_item(item, ray, &local, filter ? filter : &none, list->cull, &best))
            nearest = item;
    }
    if (nearest)
        fill(nearest, ray, &best, pick);
    return nearest != NULL;
}

/* ---- bounds */

static void add_point(const strl_draw_item *item, const double local[3], double bounds[6])
{
    double model[3];
    for (int i = 0; i < 3; i++)
        model[i] =
            item->origin[i] +
            (item->positions == STRL_POSITIONS_LATTICE ? item->step * ((double)item->anchor[i] + local[i]) : local[i]);
    for (int i = 0; i < 3; i++) {
        double world = dot(item->transform + 4 * i, model) + item->transform[4 * i + 3];
        bounds[i] = fmin(bounds[i], world);
        bounds[3 + i] = fmax(bounds[3 + i], world);
    }
}

bool strl_pick_style_bounds(const strl_draw_list *list, const uint8_t *part_styles, uint32_t part_count,
                            strl_part_style style, double bounds[6])
{
    for (int i = 0; i < 3; i++)
        bounds[i] = INFINITY, bounds[3 + i] = -INFINITY;
    for (uint32_t i = 0; i < list->count; i++) {
        const strl_draw_item *item = &list->items[i];
        for (uint32_t k = 0; item->labels && k < item->index_count; k++) {
            double local[3];
            uint32_t part = item->labels[item->indices[k]].part, own = item->own_part - 1;
            if ((part >= part_count || part_styles[part] != style) && (own >= part_count || part_styles[own] != style))
                continue;
            vertex_of(item, item->indices[k], local);
            add_point(item, local, bounds);
        }
    }
    return bounds[0] <= bounds[3];
}
