/* Cones of normals against the eye (Shirman and Abi-Ezzi 1993).
 *
 * A face with the normal n through the point p shows its front to an eye e where n . (e - p) > 0. An affine placement x
 * -> L x + t takes n to det(L) L^-T n, or, as one that mirrors does not turn faces round, to |det(L)| L^-T n; so the
 * sign of that product is the same before and after it, and the eye is taken into the tree's lattice: nothing need be
 * known of the placement but that it has an inverse.
 *
 * With a cone of the half angle alpha about a all normals at p show their backs where p - e is within 90 degrees -
 * alpha of a. Such vectors are a convex cone themselves: where the corners of a box lie in it, so does the box. */
#include "walk/facing.h"

#include <float.h>
#include <math.h>

/* Below this share of the sum of its terms a determinant says little; the placement is then taken for flat. */
#define LEAST_DETERMINANT 1e-6
/* Of numbers of which each took some roundings. */
#define ROUNDINGS (64 * DBL_EPSILON)

/* Rows of L^-1, and how much each element may be off. */
typedef struct inverse {
    double row[3][3], error[3][3];
} inverse;

static bool invert(const double m[12], inverse *out)
{
    double minors[3][3], sizes[3][3], determinant = 0, size = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            double a = m[i1 * 4 + j1] * m[i2 * 4 + j2], b = m[i1 * 4 + j2] * m[i2 * 4 + j1];
            minors[i][j] = a - b;
            sizes[i][j] = fabs(a) + fabs(b);
        }
    for (int j = 0; j < 3; j++) {
        determinant += m[j] * minors[0][j];
        size += fabs(m[j]) * sizes[0][j];
    }
    if (!(fabs(determinant) > LEAST_DETERMINANT * size) || !isfinite(1 / determinant))
        return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            out->row[i][j] = minors[j][i] / determinant;
            out->error[i][j] = sizes[j][i] / fabs(determinant) * (size / fabs(determinant)) * ROUNDINGS;
        }
    return true;
}

strl__facing strl__facing_find(const strl_view *view, const strl_tree *tree, const double transform[12])
{
    strl__facing facing = {.orthographic = view->orthographic};
    inverse back;
    if (!invert(transform, &back))
        return facing;
    facing.known = true;
    for (int i = 0; i < 3; i++) {
        double sum = 0, error = 0;
        for (int j = 0; j < 3; j++) {
            double from = view->orthographic ? view->forward[j] : view->eye[j] - transform[4 * j + 3];
            sum += back.row[i][j] * from;
            error += back.error[i][j] * fabs(from);
        }
        facing.eye[i] = view->orthographic ? sum : (sum - tree->origin[i]) / tree->step;
        facing.error[i] =
            view->orthographic ? error : (error + ROUNDINGS * (fabs(sum) + fabs(tree->origin[i]))) / tree->step;
        facing.known = facing.known && isfinite(facing.eye[i]) && isfinite(facing.error[i]);
    }
    return facing;
}

/* Whether a vector is within 90 degrees less the cone's half angle of its axis, however it is off. */
static bool is_behind(const strl_cone *cone, double sine, const double way[3], const double error[3])
{
    double along = 0, square = 0, axis = 0, slack = 0;
    for (int k = 0; k < 3; k++) {
        along += way[k] * cone->axis[k];
        square += way[k] * way[k];
        axis += (double)cone->axis[k] * cone->axis[k];
        slack += error[k];
    }
    return along >= sqrt(axis) * (sine * sqrt(square) + 2 * slack + ROUNDINGS * sqrt(square));
}

bool strl__faces_away(const strl__facing *facing, const strl_node *record)
{
    const strl_cone *cone = &record->cone;
    if (!facing->known || cone->cosine == 0)
        return false;
    double cosine = (double)cone->cosine / STRL_CONE_SCALE, sine = sqrt((1 - cosine) * (1 + cosine));
    if (facing->orthographic)
        return is_behind(cone, sine, facing->eye, facing->error);
    for (unsigned corner = 0; corner < 8; corner++) {
        double way[3], error[3];
        for (unsigned k = 0; k < 3; k++) {
            double at = (double)(corner >> k & 1 ? record->box_max[k] : record->box_min[k]);
            way[k] = at - facing->eye[k];
            error[k] = facing->error[k] + ROUNDINGS * (fabs(at) + fabs(facing->eye[k]));
        }
        if (!is_behind(cone, sine, way, error))
            return false;
    }
    return true;
}
