/* What is too far away to be told apart: a placement, or a run of them, whose box projects to no more than the allowed
 * error is drawn as one point, so that a frame costs what can be seen, however many copies there are. The point lies in
 * the box, so it is off by no more than the box is large; it is as opaque as the share of it that the faces of the run
 * would cover. In the same way a run is drawn whose placements are on their way, by as many points as its box takes. */
#include "walk/internal.h"

#include <math.h>

#include "geometry/octahedral.h"

#define LATTICE 0x1p30    /* cells of the far points along the longest edge of the model's box */
#define MOST_HALVINGS 12u /* of the box of a run that is on its way */

static double diagonal(const strl_box *box)
{
    double square = 0;
    for (int k = 0; k < 3; k++)
        square += (box->max[k] - box->min[k]) * (box->max[k] - box->min[k]);
    return sqrt(square);
}

static double size_px(const strl_view *view, const strl_box *box)
{
    const strl_sight sight = strl_view_sight(view, box);
    return strl_sight_error_px(&sight, diagonal(box));
}

bool strl__is_far(const strl__cut *cut, const strl_box *box, double *px)
{
    *px = size_px(cut->view, box);
    return *px <= cut->allowed_px;
}

double strl__far_step(const strl_walk *walk)
{
    double longest = 0;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, walk->bounds[3 + k] - walk->bounds[k]);
    return longest > 0 ? longest / LATTICE : 1;
}

double strl__far_px(double allowed_px, unsigned size)
{
    return fmin(size ? ldexp(1, (int)size) : fmax(1, allowed_px), STRL__MOST_POINT_PX);
}

/* Of a box that is so many pixels large: the least that is not smaller, as far as there is one. */
static unsigned size_of(double px)
{
    unsigned size = 1;
    while (size + 1 < STRL__FAR_SIZES && px > ldexp(1, (int)size))
        size++;
    return size;
}

static double depth_of(const strl_view *view, const double point[3])
{
    double depth = 0;
    for (int k = 0; k < 3; k++)
        depth += (point[k] - view->eye[k]) * view->forward[k];
    return depth;
}

/* Where the point is drawn; its depth is not above 0 where it can't be. Where the middle of a box is behind the eye,
 * what is missing of it is before the eye all the same. */
static double find_place(const strl_view *view, const strl_box *box, bool is_missing, double place[3])
{
    for (int k = 0; k < 3; k++)
        place[k] = box->min[k] + (box->max[k] - box->min[k]) / 2;
    double depth = depth_of(view, place), ahead = diagonal(box) / 2;
    if (!is_missing || depth > 0)
        return depth;
    for (int k = 0; k < 3; k++)
        place[k] = fmin(fmax(view->eye[k] + ahead * view->forward[k], box->min[k]), box->max[k]);
    return depth_of(view, place);
}

/* How much of the point's square the faces hide, of which parallel ones are seen as much as they face the eye: `walls`
 * is their area in such squares. */
static double opacity_of(const strl_far *far, const double sight[3], double walls)
{
    double along = 1 - (double)far->spread / STRL_SPREAD_MOST, square = 0, facing = 0;
    float normal[3];
    strl_oct_decode(far->normal, normal);
    for (int k = 0; k < 3; k++) {
        facing += sight[k] * (double)normal[k];
        square += sight[k] * sight[k];
    }
    facing = square > 0 ? fabs(facing) / sqrt(square) : 1;
    return strl_hidden_share(walls, walls * facing, along);
}

strl_vertex *strl__far_points_add(strl__far_points *points, bool labels, uint32_t own_part)
{
    if (!strl__grow(&points->items, &points->capacity, points->count + 1, sizeof *points->items) ||
        (labels && !strl__grow(&points->labels, &points->label_capacity, points->count + 1, sizeof *points->labels)))
        return NULL;
    if (labels)
        points->labels[points->count] =
            (strl_vertex_label){own_part - 1, STRL_NONE, {0, 0}}; /* of none: more than any count */
    return &points->items[points->count++];
}

void strl__far_points_deinit(strl__far_points *points)
{
    strl__free(points->items);
    strl__free(points->labels);
    *points = (strl__far_points){0};
}

int32_t strl__far_cell(double at)
{
    return (int32_t)lrint(at > 0 ? at < LATTICE ? at : LATTICE : 0);
}

/* Of what is too far away the size is 0; `error_px` is how far what the point stands for may lie from it. */
static strl_status draw_point(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl_far *far,
                              unsigned size, double error_px, uint32_t own_part, strl_error *err)
{
    double least, largest, place[3], sight[3], depth = find_place(cut->view, box, size > 0, place);
    if (!(error_px > 0) || !(depth > 0) || !(far->area > 0)) /* not in the image, or nothing */
        return STRL_OK;
    double scale = cut->view->focal_px / (cut->view->orthographic ? 1 : depth);
    double side = strl__far_px(cut->allowed_px, size);
    strl__far_points *points = &walk->far[size];
    strl_vertex *point = strl__far_points_add(points, walk->labels, own_part);
    if (!point)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu splats", points->count);
    strl_view_ray(cut->view, place, sight);
    double opacity = opacity_of(far, sight, (double)far->area * scale * scale / (side * side));
    for (int k = 0; k < 3; k++)
        point->position[k] = strl__far_cell((place[k] - walk->bounds[k]) / strl__far_step(walk));
    for (int k = 0; k < 2; k++)
        point->normal[k] = (uint16_t)(far->normal[k] | (k == 0 ? far->spread << STRL_SPREAD_SHIFT : 0));
    for (unsigned k = 0; k < 3; k++)
        point->rgba[k] = (uint8_t)(far->rgba >> 8 * k);
    point->rgba[3] = (uint8_t)lrint((far->rgba >> 24) * opacity);
    strl_view_depth_range(cut->view, box, &least, &largest);
    walk->far_near = walk->far_far > 0 ? fmin(walk->far_near, least) : least;
    walk->far_far = fmax(walk->far_far, largest);
    points->px = fmax(points->px, error_px);
    return STRL_OK;
}

strl_status strl__far_draw(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl_far *far, double px,
                           uint32_t own_part, strl_error *err)
{
    return draw_point(walk, cut, box, far, 0, px, own_part, err);
}

/* Halves of its longest edge, each with half of the faces, until a point covers what is left. The faces of the whole
 * run may lie anywhere in its box, hence `error_px`, of the whole, at each of them. */
static strl_status fill(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl_far *far,
                        unsigned halvings, double error_px, strl_error *err)
{
    if (!strl_view_sees(cut->view, box))
        return STRL_OK;
    const double px = size_px(cut->view, box);
    if (px <= STRL__MOST_POINT_PX || halvings == 0 || walk->fill_work == 0)
        return draw_point(walk, cut, box, far, size_of(px), error_px, 0, err);
    walk->fill_work--;
    unsigned longest = 0;
    for (unsigned k = 1; k < 3; k++)
        if (box->max[k] - box->min[k] > box->max[longest] - box->min[longest])
            longest = k;
    const double middle = box->min[longest] + (box->max[longest] - box->min[longest]) / 2;
    strl_box low = *box, high = *box;
    strl_far half = *far;
    low.max[longest] = high.min[longest] = middle;
    half.area /= 2;
    strl_status status = fill(walk, cut, &low, &half, halvings - 1, error_px, err);
    return status ? status : fill(walk, cut, &high, &half, halvings - 1, error_px, err);
}

strl_status strl__far_fill(strl_walk *walk, const strl__cut *cut, const strl_box *box, const strl_far *far,
                           strl_error *err)
{
    return fill(walk, cut, box, far, MOST_HALVINGS, size_px(cut->view, box), err);
}

/* Without placement, node or level: they stand for many. */
strl_draw_item strl__far_item(const strl_walk *walk, double point_px, double box_px)
{
    strl_draw_item item = {.placement = STRL_NONE,
                           .node = STRL_NONE,
                           .step = strl__far_step(walk),
                           .error_px = (float)box_px,
                           .point_px = (float)fmin(fmax(point_px, 1), STRL__MOST_POINT_PX)};
    for (int k = 0; k < 3; k++) {
        item.box_max[k] = (int64_t)LATTICE;
        item.origin[k] = walk->bounds[k];
        item.transform[5 * k] = 1;
    }
    return item;
}
