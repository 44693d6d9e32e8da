/* The vertex path in numbers. With c a vertex's cell and r the reference cell next to the eye,
 *     view = V (L (origin + step c) + t - eye) = V L step (c - r) + V (L (origin + step r) + t - eye).
 * c - r is exact in integers and small near the eye, where it matters; the second term is small too and the same for
 * all vertices of a placement. r depends on camera, origin, step and transform only, never on the node. */
#include "render/glcommon/item.h"

#include <math.h>
#include <string.h>

#include "base/affine.h"
#include "base/hash.h"
#include "render/style.h"

#define FLAG_FLOAT_POSITIONS 1
/* Reference cells stay this close to the lattice's origin, so that differences fit 64 bits. */
#define MOST_CELL 0x1p61

/* The cell that the eye is in; 0 where the placement is flat and the eye has no model point. */
static void find_reference(strl_gl_placing *placing, const double cofactor[9], double determinant, const double eye[3])
{
    const double *m = placing->transform;
    for (int j = 0; j < 3; j++) {
        double point = 0;
        for (int i = 0; i < 3; i++)
            point += cofactor[3 * i + j] * (eye[i] - m[i * 4 + 3]);
        double cell = round((point / determinant - placing->origin[j]) / placing->step);
        placing->reference[j] = isfinite(cell) ? (int64_t)fmax(-MOST_CELL, fmin(MOST_CELL, cell)) : 0;
    }
}

static void make_rows(strl_gl_placing *placing, const strl_view *view, const double cofactor[9])
{
    const double *m = placing->transform;
    const double *axes[3] = {view->right, view->up, view->forward};
    bool lattice = placing->positions == STRL_POSITIONS_LATTICE;
    double scale = lattice ? placing->step : 1, offset[3], start[3];
    for (int j = 0; j < 3; j++)
        start[j] = placing->origin[j] + (lattice ? placing->step * (double)placing->reference[j] : 0);
    for (int i = 0; i < 3; i++)
        offset[i] =
            m[i * 4] * start[0] + m[i * 4 + 1] * start[1] + m[i * 4 + 2] * start[2] + m[i * 4 + 3] - view->eye[i];
    for (int row = 0; row < 3; row++) {
        const double *axis = axes[row];
        float *to_view = placing->shared.rows[row], *normal = placing->shared.rows[3 + row];
        for (int j = 0; j < 3; j++) {
            to_view[j] = (float)(scale * (axis[0] * m[j] + axis[1] * m[4 + j] + axis[2] * m[8 + j]));
            normal[j] = (float)(axis[0] * cofactor[j] + axis[1] * cofactor[3 + j] + axis[2] * cofactor[6 + j]);
        }
        to_view[3] = (float)(axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2]);
    }
}

/* A placement that mirrors has cofactors that point to the other side, which lighting from both sides does not see.
 * Cofactors grow with the square of a placement's scale: normals are brought near unit length here. */
static void scale_cofactors(double cofactor[9])
{
    double largest = 0;
    for (int k = 0; k < 9; k++)
        largest = fmax(largest, fabs(cofactor[k]));
    for (int k = 0; largest > 0 && k < 9; k++)
        cofactor[k] /= largest;
}

static void place(strl_gl_placing *placing, const strl_view *view, const strl_draw_item *item)
{
    if (placing->valid && placing->positions == item->positions && placing->step == item->step &&
        memcmp(placing->origin, item->origin, sizeof item->origin) == 0 &&
        memcmp(placing->transform, item->transform, sizeof item->transform) == 0)
        return;
    placing->valid = true;
    placing->positions = item->positions;
    placing->step = item->step;
    memcpy(placing->origin, item->origin, sizeof item->origin);
    memcpy(placing->transform, item->transform, sizeof item->transform);
    double cofactor[9], determinant = strl_affine_cofactors(item->transform, cofactor);
    placing->mirrors = determinant < 0;
    if (item->positions == STRL_POSITIONS_LATTICE)
        find_reference(placing, cofactor, determinant, view->eye);
    scale_cofactors(cofactor);
    make_rows(placing, view, cofactor);
}

static void hue(double angle, double value, float rgb[3])
{
    for (int i = 0; i < 3; i++) {
        double wave = 0.5 + 0.5 * cos(2 * M_PI * (angle - i / 3.0));
        rgb[i] = (float)(value * (0.12 + 0.88 * wave * wave));
    }
}

static void debug_colour(strl_debug_colour debug, const strl_draw_item *item, float rgb[3])
{
    uint64_t mixed;
    switch (debug) {
    case STRL_DEBUG_CLUSTER:
        mixed = strl__mix64(((uint64_t)item->placement << 32 | item->node) + 0x9e3779b97f4a7c15u);
        hue((double)(mixed >> 40) * 0x1p-24, 0.45 + (double)(mixed & 0xff) / 500, rgb);
        break;
    case STRL_DEBUG_LEVEL:
        hue(item->level * 0.381966, 0.8, rgb);
        break;
    case STRL_DEBUG_ERROR:
        hue(2.0 / 3 * (1 - fmin(fmax(item->error_px, 0), 2) / 2), 0.8, rgb);
        break;
    default:
        rgb[0] = rgb[1] = rgb[2] = -1;
    }
}

/* What the shader takes instead of the vertices' colour, or, below -1, what it mixes to it. */
static void tint_of(const strl_draw_setup *setup, const strl_draw_item *item, float rgb[3])
{
    debug_colour(setup->options.debug, item, rgb);
    bool marked = rgb[0] < 0 && strl__item_style(item, &setup->options) == STRL_PART_MARKED;
    for (int i = 0; i < 3 && marked; i++)
        rgb[i] = -2 - strl__style_mark[i] / 255.f;
}

void strl__gl_item_make(strl_gl_placing *placing, const strl_draw_setup *setup, const strl_draw_item *item,
                        strl_gl_item *out)
{
    place(placing, &setup->view, item);
    *out = placing->shared;
    float tint[3];
    tint_of(setup, item, tint);
    for (int i = 0; i < 3; i++) {
        bool lattice = item->positions == STRL_POSITIONS_LATTICE;
        uint64_t base = lattice ? (uint64_t)item->anchor[i] - (uint64_t)placing->reference[i] : 0;
        out->base[0][i] = (int32_t)(uint32_t)base;
        out->base[1][i] = (int32_t)(uint32_t)(base >> 32);
        out->rows[3 + i][3] = tint[i];
    }
    float point_size = (float)setup->supersample * item->point_px;
    memcpy(&out->base[1][3], &point_size, sizeof point_size);
    out->base[0][3] = item->positions == STRL_POSITIONS_FLOAT ? FLAG_FLOAT_POSITIONS : 0;
}
