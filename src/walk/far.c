/* What is too far away to be told apart: a placement, or a run of them, whose box projects to no more than the allowed error is
 * drawn as one point, so that a frame costs what can be seen, however many copies there are. The point lies in the box, so it is
 * off by no more than the box is large; it is as opaque as the share of it that the faces of the run would cover. */
#include "walk/internal.h"

#include <math.h>

#include "geometry/colour.h"
#include "geometry/octahedral.h"

#define LATTICE 0x1p30 /* cells of the far points along the longest edge of the model's box */

/* ---- summaries */

static void add_to(strl__far_sums *sums, double area, uint32_t rgba, const double normal[3])
{
    sums->area += area;
    for (unsigned k = 0; k < 3; k++)
        sums->linear[k] += area * (double)strl_srgb_decode(rgba >> 8 * k & 255);
    sums->linear[3] += area * (rgba >> 24) / 255;
    double side = sums->normal[0] * normal[0] + sums->normal[1] * normal[1] + sums->normal[2] * normal[2];
    for (int k = 0; k < 3; k++)
        sums->normal[k] += (side < 0 ? -area : area) * normal[k];
}

static strl__far summary_of(const strl__far_sums *sums)
{
    strl__far far = {.area = (float)sums->area};
    float normal[3] = {(float)sums->normal[0], (float)sums->normal[1], (float)sums->normal[2]};
    if (!(sums->area > 0))
        return far;
    for (unsigned k = 0; k < 3; k++)
        far.rgba |= strl_srgb_encode((float)(sums->linear[k] / sums->area)) << 8 * k;
    far.rgba |= (uint32_t)lrint(255 * sums->linear[3] / sums->area) << 24;
    strl_oct_encode(normal, far.normal);
    return far;
}

static double triangle_area(const strl__mesh *mesh, const uint16_t corner[3], double normal[3])
{
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)mesh->vertices[corner[1]].position[k] - mesh->vertices[corner[0]].position[k];
        b[k] = (double)mesh->vertices[corner[2]].position[k] - mesh->vertices[corner[0]].position[k];
    }
    for (int k = 0; k < 3; k++)
        normal[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    for (int k = 0; k < 3; k++)
        normal[k] = length > 0 ? normal[k] / length : 0;
    return length / 2;
}

/* Of what the root draws; of a sample tree these are samples by area, and its finest splats tell how much there is. */
void strl__far_of_tree(strl__walk_tree *tree)
{
    const strl__mesh *mesh = &tree->root->mesh;
    strl__far_sums sums = {0};
    const uint16_t *corners = mesh->indices + (mesh->index_first ? mesh->index_first[mesh->step_count] : 0);
    for (uint32_t t = 0; t < mesh->triangle_end[mesh->step_count]; t++) {
        double normal[3], area = triangle_area(mesh, corners + 3 * t, normal);
        const uint8_t *rgba = mesh->vertices[corners[3 * t]].rgba;
        add_to(&sums, area, rgba[0] | rgba[1] << 8 | rgba[2] << 16 | (uint32_t)rgba[3] << 24, normal);
    }
    tree->far = summary_of(&sums);
    double splats = 0;
    for (uint32_t i = mesh->splat_end && mesh->step_count > 1 ? mesh->splat_end[mesh->step_count - 2] : 0;
         mesh->splat_end && i < mesh->splat_end[mesh->step_count - 1]; i++)
        splats += ldexp(mesh->splats[i].coverage / 255.0, 2 * mesh->splats[i].side);
    tree->far.area = fmaxf(tree->far.area, (float)splats);
}

strl__far strl__far_of_placement(const strl_walk *walk, const strl__placement *placement)
{
    const strl__walk_tree *tree = &walk->trees[placement->tree];
    double scale = placement->length_scale * (tree->tree->structure == STRL_STRUCTURE_SAMPLES ? walk->splat_ratio : 1);
    strl__far far = tree->far;
    float before[3], after[3];
    strl_oct_decode(far.normal, before);
    for (int row = 0; row < 3; row++)
        after[row] = (float)(placement->transform[4 * row] * (double)before[0] + placement->transform[4 * row + 1] * (double)before[1] +
                             placement->transform[4 * row + 2] * (double)before[2]);
    strl_oct_encode(after, far.normal);
    far.area = (float)(far.area * scale * scale);
    return far;
}

void strl__far_add(strl__far_sums *sums, const strl__far *far)
{
    float normal[3];
    strl_oct_decode(far->normal, normal);
    add_to(sums, (double)far->area, far->rgba, (const double[3]){(double)normal[0], (double)normal[1], (double)normal[2]});
}

strl__far strl__far_end(const strl__far_sums *sums)
{
    return summary_of(sums);
}

/* ---- points of a frame */

bool strl__is_far(const strl__cut *cut, const strl_box *box, double *px)
{
    const strl_sight sight = strl_view_sight(cut->view, box);
    double square = 0;
    for (int k = 0; k < 3; k++)
        square += (box->max[k] - box->min[k]) * (box->max[k] - box->min[k]);
    *px = strl_sight_error_px(&sight, sqrt(square));
    return *px <= cut->allowed_px;
}

static double lattice_step(const strl_walk *walk)
{
    double longest = 0;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, walk->bounds[3 + k] - walk->bounds[k]);
    return longest > 0 ? longest / LATTICE : 1;
}

strl_status strl__far_draw(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl__far *far, double px, strl_error *err)
{
    double depth = 0, least, largest, centre[3], step = lattice_step(walk), side = fmax(1, cut->allowed_px);
    for (int k = 0; k < 3; k++) {
        centre[k] = box->min[k] + (box->max[k] - box->min[k]) / 2;
        depth += (centre[k] - cut->view->eye[k]) * cut->view->forward[k];
    }
    if (!(px > 0) || !(depth > 0) || !(far->area > 0)) /* not in the image, or nothing */
        return STRL_OK;
    if (!strl__grow(&walk->far_points, &walk->far_capacity, walk->far_count + 1, sizeof *walk->far_points))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu splats", walk->far_count);
    strl_vertex *point = &walk->far_points[walk->far_count++];
    double scale = cut->view->focal_px / (cut->view->orthographic ? 1 : depth);
    double opacity = fmin(1, (double)far->area / 2 * scale * scale / (side * side)); /* a face is seen with half its area on average */
    for (int k = 0; k < 3; k++)
        point->position[k] = (int32_t)lrint((centre[k] - walk->bounds[k]) / step);
    for (int k = 0; k < 2; k++)
        point->normal[k] = far->normal[k];
    for (unsigned k = 0; k < 3; k++)
        point->rgba[k] = (uint8_t)(far->rgba >> 8 * k);
    point->rgba[3] = (uint8_t)lrint((far->rgba >> 24) * opacity);
    strl_view_depth_range(cut->view, box, &least, &largest);
    walk->far_near = walk->far_count == 1 ? least : fmin(walk->far_near, least);
    walk->far_far = walk->far_count == 1 ? largest : fmax(walk->far_far, largest);
    walk->far_px = walk->far_count == 1 ? px : fmax(walk->far_px, px);
    return STRL_OK;
}

/* Without placement, node or level: they stand for many. */
strl_draw_item strl__far_item(const strl_walk *walk)
{
    strl_draw_item item = {.placement = STRL_NONE, .node = STRL_NONE, .step = lattice_step(walk), .error_px = (float)walk->far_px,
                           .point_px = (float)fmin(fmax(1, walk->stats.allowed_error_px), STRL__MOST_POINT_PX)};
    for (int k = 0; k < 3; k++) {
        item.box_max[k] = (int64_t)LATTICE;
        item.origin[k] = walk->bounds[k];
        item.transform[5 * k] = 1;
    }
    return item;
}
