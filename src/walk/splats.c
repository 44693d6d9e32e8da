/* The points of one placement in a frame: the splats of its bricks whose cells are small enough, and coarser ones that
 * close the holes where what is below a brick has not arrived. */
#include "walk/points.h"

#include <math.h>
#include <string.h>

#define COARSE_PX 16.0  /* cells that close holes need not be smaller: they are there for moments */
#define MOST_PARTS 32.0 /* along a side of a cell that is larger than any point */
/* By measure: less turns more transparent what is seen from the side, and opens pixels between splats; more leaves
 * foliage too dense. */
#define SCATTERED 0.25f
/* What a point that closes a hole takes of the work of a frame (points.h), looking at a splat being 1. */
#define WORK_OF_POINT 8u

/* ---- points */

/* 0 = all faces are parallel, STRL_SPREAD_MOST = any direction: then their mean is half as long as they are together,
 * all being turned to one side. */
static uint16_t spread_of(const strl_splat *splat)
{
    uint32_t twice = 2 * (255u - splat->parallel);
    return (uint16_t)((twice < 255 ? twice : 255) * STRL_SPREAD_MOST / 255);
}

static void place_point(const strl__points *self, const strl_node *record, const int32_t place[3], strl_vertex *point)
{
    for (int k = 0; k < 3; k++)
        point->position[k] = (int32_t)(uint32_t)((uint64_t)record->anchor[k] - (uint64_t)self->tree->box_min[k] +
                                                 (uint64_t)(int64_t)place[k]);
}

/* Points that are larger than their cells overlap: as many as lie in one pixel hide together what a cell hides, so that
 * a wall stays one, from wherever it is looked at. Of scattered faces that lie parallel less is seen from the side, the
 * more scattered the more. */
static float opacity_of(const strl__points *self, const strl_splat *splat, const float line[3])
{
    if (splat->coverage == 255)
        return 1;
    float along = 1 - (float)spread_of(splat) / STRL_SPREAD_MOST;
    float facing = fabsf(line[0] * self->sight[0] + line[1] * self->sight[1] + line[2] * self->sight[2]);
    float turned = along * (1 - facing) * self->walk->scattered[splat->coverage];
    float hidden = (float)splat->coverage / 255 * (1 - turned);
    double share = ldexp(self->unit_share, 2 * splat->side);
    return share < 1 ? 1 - powf(1 - hidden, (float)share) : hidden;
}

static strl_vertex point_of_splat(const strl__points *self, const strl_node *record, const strl_splat *splat,
                                  const float line[3])
{
    strl_vertex point;
    place_point(self, record, splat->centre, &point);
    strl_splat_normal(splat, point.normal);
    point.normal[0] |= (uint16_t)(spread_of(splat) << STRL_SPREAD_SHIFT);
    for (int k = 0; k < 3; k++)
        point.rgba[k] = (uint8_t)(splat->rgba >> 8 * k);
    point.rgba[3] = (uint8_t)((float)(splat->rgba >> 24) * opacity_of(self, splat, line) + 0.5f);
    return point;
}

static void take_splats(strl__points *self, const strl_node *record, const strl_splat *splats, uint32_t count,
                        unsigned size)
{
    for (uint32_t i = 0; i < count && self->purpose != STRL__POINTS_COUNT; i++) {
        float line[3];
        strl_splat_line(&splats[i], line);
        const strl_vertex point = point_of_splat(self, record, &splats[i], line);
        if (self->purpose == STRL__POINTS_MERGE)
            strl__points_merge(self, size, &point, line);
        else
            self->walk->points[self->at[size] + i] = point;
    }
    self->at[size] += count;
}

void strl__points_prepare(strl_walk *walk)
{
    for (unsigned coverage = 0; coverage < 256; coverage++)
        walk->scattered[coverage] = powf(1 - (float)coverage / 255, SCATTERED);
}

/* ---- what is there */

/* The least size that covers the cells of the brick's splats: 0 = a part of the allowed one, to STRL__POINT_SHARES - 1
 * = all of it. Where that is a pixel there is but one. */
static unsigned share_of(const strl_walk *walk, const strl__active *active)
{
    const strl__mesh *mesh = &active->node->mesh;
    double allowed = walk->stats.allowed_error_px;
    if (!(walk->splat_ratio * allowed > 1))
        return STRL__POINT_SHARES - 1;
    double size = (double)mesh->errors[active->state] * active->placed->length_scale;
    double parts = ceil(STRL__POINT_SHARES * strl_sight_error_px(&active->sight, size) / walk->splat_ratio / allowed);
    return parts >= STRL__POINT_SHARES ? STRL__POINT_SHARES - 1 : parts >= 1 ? (unsigned)parts - 1 : 0;
}

/* Where the points that follow are seen from, and how much of one a cell of a lattice unit takes: `unit` of its sides.
 * As of a placement that turns and scales alike along all axes; of others near enough for looks. */
static void aim(strl__points *self, const strl__active *active, double unit)
{
    const double *transform = active->placed->transform;
    double centre[3], ray[3], turned[3], square = 0;
    if (self->purpose == STRL__POINTS_COUNT)
        return;
    for (int k = 0; k < 3; k++)
        centre[k] = (active->box.min[k] + active->box.max[k]) / 2;
    strl_view_ray(self->view, centre, ray);
    for (int k = 0; k < 3; k++) {
        turned[k] = transform[k] * ray[0] + transform[4 + k] * ray[1] + transform[8 + k] * ray[2];
        square += turned[k] * turned[k];
    }
    for (int k = 0; k < 3; k++)
        self->sight[k] = square > 0 ? (float)(turned[k] / sqrt(square)) : 0;
    self->unit_share = unit * unit;
}

/* Of the state that the brick is drawn in. */
static void take_shown(strl__points *self, const strl__active *active)
{
    const strl__mesh *mesh = &active->node->mesh;
    if (active->state >= mesh->step_count)
        return;
    uint32_t first = active->state ? mesh->splat_end[active->state - 1] : 0, end = mesh->splat_end[active->state];
    if (first == end)
        return;
    unsigned size = share_of(self->walk, active);
    aim(self, active,
        strl_sight_error_px(&active->sight, active->placed->length_scale) / fmax(1, strl__points_px(self->walk, size)));
    take_splats(self, active->node->record, mesh->splats + first, end - first, size);
}

/* ---- what is not there yet */

static strl__splat_run splats_of_state(const strl__node *node, uint32_t state)
{
    const strl__mesh *mesh = &node->mesh;
    uint32_t first = state ? mesh->splat_end[state - 1] : 0;
    return (strl__splat_run){node->record, mesh->splats + first, mesh->splat_end[state] - first};
}

static unsigned least_side(const strl__splat_run *run)
{
    unsigned side = UINT8_MAX;
    for (uint32_t i = 0; i < run->count; i++)
        side = run->splats[i].side < side ? run->splats[i].side : side;
    return side;
}

strl__preview strl__preview_of(const strl__node *node)
{
    strl__preview preview = {.least_side = UINT8_MAX};
    if (node->mesh.splat_end)
        preview.run = splats_of_state(node, node->mesh.step_count - 1);
    preview.least_side = least_side(&preview.run);
    return preview;
}

/* The least size that is not less than px, as far as there is one. */
static unsigned missing_size(double px)
{
    double halves = px > 0 ? 2 * log2(STRL__MOST_POINT_PX / px) : STRL__MISSING_SIZES;
    return STRL__POINT_SHARES + (halves <= 0                    ? 0
                                 : halves < STRL__MISSING_SIZES ? (unsigned)halves
                                                                : STRL__MISSING_SIZES - 1);
}

static bool is_within(const strl_node *record, const strl_node *from, const strl_splat *splat)
{
    for (int k = 0; k < 3; k++) {
        int64_t at = from->anchor[k] + splat->centre[k];
        if (at < record->box_min[k] || at > record->box_max[k])
            return false;
    }
    return true;
}

/* What the camera sees of the cell. */
static strl_sight sight_of(const strl__points *self, const strl__active *active, const strl_node *record,
                           const strl_splat *splat)
{
    int64_t least[3], most[3], half = ((int64_t)1 << splat->side) / 2;
    for (int k = 0; k < 3; k++) {
        least[k] = record->anchor[k] + splat->centre[k] - half;
        most[k] = record->anchor[k] + splat->centre[k] + half;
    }
    const strl_box box = strl__world_box(self->tree, active->placed, least, most);
    return strl_view_sight(self->view, &box);
}

static void cross(const float a[3], const float b[3], float product[3])
{
    for (int k = 0; k < 3; k++)
        product[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

/* Two directions in the mean plane of what lies in the cell, at right angles, of length 1. */
static void find_plane(const strl_splat *splat, float across[3], float up[3])
{
    float normal[3], axis[3] = {0};
    int least = 0;
    strl_splat_line(splat, normal);
    for (int k = 1; k < 3; k++)
        least = fabsf(normal[k]) < fabsf(normal[least]) ? k : least;
    axis[least] = 1;
    cross(normal, axis, across);
    /* not 0: the axis is far from the normal */
    float length = sqrtf(across[0] * across[0] + across[1] * across[1] + across[2] * across[2]);
    for (int k = 0; k < 3; k++)
        across[k] /= length;
    cross(normal, across, up);
}

/* A cell larger than any point is covered by several, in that plane. */
static void take_plane(strl__points *self, const strl_node *record, const strl_splat *splat, double px)
{
    const double affordable = sqrt((double)(self->work / WORK_OF_POINT));
    const int parts = (int)fmin(ceil(px / STRL__MOST_POINT_PX), fmin(MOST_PARTS, affordable));
    const double side = ldexp(STRL_SQUARE_OF_CUBE, splat->side) / fmax(parts, 1);
    float across[3], up[3];
    self->work -= (uint64_t)(parts * parts) * WORK_OF_POINT;
    if (self->purpose == STRL__POINTS_COUNT)
        self->at[STRL__POINT_SHARES] += (size_t)(parts * parts);
    if (parts == 0 || self->purpose == STRL__POINTS_COUNT)
        return;
    find_plane(splat, across, up);
    for (int i = 0; i < parts * parts; i++) {
        strl_splat part = *splat;
        double x = side * (i % parts + 0.5 - parts / 2.0), y = side * (i / parts + 0.5 - parts / 2.0);
        for (int k = 0; k < 3; k++) {
            double at = splat->centre[k] + x * (double)across[k] + y * (double)up[k],
                   anchor = (double)record->anchor[k];
            part.centre[k] = (int32_t)lrint(
                fmin(fmax(at, (double)self->tree->box_min[k] - anchor), (double)self->tree->box_max[k] - anchor));
        }
        take_splats(self, record, &part, 1, STRL__POINT_SHARES);
    }
}

static void take_cell(strl__points *self, const strl__active *active, const strl_node *record, const strl_splat *splat)
{
    const strl_sight sight = sight_of(self, active, record, splat);
    const double size = ldexp(STRL_SQUARE_OF_CUBE, splat->side) * active->placed->length_scale;
    const double px = strl_sight_error_px(&sight, size);
    if (!sight.seen)
        return;
    if (px > STRL__MOST_POINT_PX) {
        take_plane(self, record, splat, px);
    } else if (self->work >= WORK_OF_POINT) {
        self->work -= WORK_OF_POINT;
        take_splats(self, record, splat, 1, missing_size(px));
    }
}

/* The coarsest splats of the brick whose cells are no more than a few pixels, else the finest, or those of the tree's
 * preview that lie in the brick, where these are finer. A frame does so much of this and no more, whatever a file says.
 */
static void take_missing(strl__points *self, const strl__active *active)
{
    const strl__node *node = active->node;
    const strl__mesh *mesh = &node->mesh;
    uint32_t state = 0;
    if (active->state < mesh->step_count || active->open || node->record->child_count == 0)
        return;
    while (state + 1 < mesh->step_count &&
           strl_sight_error_px(&active->sight, (double)mesh->errors[state] * active->placed->length_scale) > COARSE_PX)
        state++;
    const strl__splat_run own = splats_of_state(node, state);
    const strl__preview *preview = &self->walk->trees[active->placed->tree].preview;
    bool is_coarse =
        strl_sight_error_px(&active->sight, (double)mesh->errors[state] * active->placed->length_scale) > COARSE_PX;
    bool is_finer = is_coarse && preview->least_side < least_side(&own);
    const strl__splat_run run = is_finer ? preview->run : own;
    aim(self, active, 1);
    for (uint32_t i = 0; i < run.count && self->work > 0; i++) {
        self->work--;
        if (!is_finer || is_within(node->record, run.record, &run.splats[i]))
            take_cell(self, active, run.record, &run.splats[i]);
    }
}

void strl__points_take(strl__points *self, size_t first, size_t end)
{
    for (size_t i = first; i < end; i++) {
        const strl__active *active = &self->walk->front.items[i];
        if (active->sight.empty || !active->node->mesh.splat_end)
            continue;
        take_shown(self, active);
        take_missing(self, active);
    }
}
