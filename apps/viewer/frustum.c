#include "viewer/frustum.h"

#include <math.h>
#include <string.h>

#include "frame/view.h"

/* The near rectangle's share of the far distance: large enough to be seen as one. */
#define NEAR_SHARE 0.02
/* Lines are cut where they come this close to the eye, as a share of their length. */
#define LEAST_DEPTH 1e-4

/* In the axes of the view: right, up, forward. */
static void to_view(const strl_view *view, const double point[3], double out[3])
{
    const double *axes[3] = {view->right, view->up, view->forward};
    for (int a = 0; a < 3; a++) {
        out[a] = 0;
        for (int i = 0; i < 3; i++)
            out[a] += axes[a][i] * (point[i] - view->eye[i]);
    }
}

static void corner_of(const strl_view *view, double distance, unsigned corner, double out[3])
{
    double x = (corner & 1 ? 1 : -1) * view->tan_x * distance, y = (corner & 2 ? 1 : -1) * view->tan_y * distance;
    for (int i = 0; i < 3; i++)
        out[i] = view->eye[i] + view->forward[i] * distance + view->right[i] * x + view->up[i] * y;
}

/* Cuts the line off at depth `least`. False where nothing is left. */
static bool clip(double a[3], double b[3], double least)
{
    if (a[2] < least && b[2] < least)
        return false;
    double *behind = a[2] < least ? a : b[2] < least ? b : NULL, *before = behind == a ? b : a;
    if (!behind)
        return true;
    double share = (least - behind[2]) / (before[2] - behind[2]);
    for (int i = 0; i < 3; i++)
        behind[i] += (before[i] - behind[i]) * share;
    return true;
}

static void project(const strl_view *view, const strl_camera *camera, const double point[3], float out[2])
{
    out[0] = (float)((1 + point[0] / (point[2] * view->tan_x)) / 2 * camera->width);
    out[1] = (float)((1 - point[1] / (point[2] * view->tan_y)) / 2 * camera->height);
}

uint32_t strl_frustum_lines(const strl_camera *seen, double far, const strl_camera *by,
                            float lines[STRL_FRUSTUM_LINES][4])
{
    /* Corners 0 to 3 are near, 4 to 7 far. */
    static const unsigned char edges[STRL_FRUSTUM_LINES][2] = {{0, 1}, {1, 3}, {3, 2}, {2, 0}, {4, 5}, {5, 7},
                                                               {7, 6}, {6, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
    strl_view from, view;
    double corners[8][3];
    uint32_t count = 0;
    if (!strl_view_init(&from, seen) || !strl_view_init(&view, by) || from.orthographic || view.orthographic)
        return 0;
    for (unsigned c = 0; c < 8; c++) {
        double world[3];
        corner_of(&from, c < 4 ? far * NEAR_SHARE : far, c & 3, world);
        to_view(&view, world, corners[c]);
    }
    for (unsigned e = 0; e < STRL_FRUSTUM_LINES; e++) {
        double a[3], b[3];
        memcpy(a, corners[edges[e][0]], sizeof a);
        memcpy(b, corners[edges[e][1]], sizeof b);
        if (!clip(a, b, far * LEAST_DEPTH))
            continue;
        project(&view, by, a, lines[count]);
        project(&view, by, b, lines[count] + 2);
        count++;
    }
    return count;
}
