/* See affine.h. */
#include "scenes/parts/affine.h"

#include <math.h>

strl__affine strl__affine_identity(void)
{
    return (strl__affine){.axis = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
}

strl__affine strl__affine_move(double x, double y, double z)
{
    return (strl__affine){.axis = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .origin = {x, y, z}};
}

strl__affine strl__affine_turn(double turns, double x, double y, double z)
{
    double c, s;
    strl__circle(turns, &c, &s);
    return (strl__affine){.axis = {{c, s, 0}, {-s, c, 0}, {0, 0, 1}}, .origin = {x, y, z}};
}

strl__affine strl__affine_along(const double origin[3], const double direction[3])
{
    strl__affine made = {.origin = {origin[0], origin[1], origin[2]}};
    double *x = made.axis[0], *y = made.axis[1], *z = made.axis[2];
    for (int i = 0; i < 3; i++)
        z[i] = direction[i];
    strl__normalise(z);
    const int up = fabs(z[2]) > 0.999 ? 1 : 2;
    const double guide[3] = {0, up == 1, up == 2};
    strl__cross(guide, z, x);
    strl__normalise(x);
    strl__cross(z, x, y);
    return made;
}

strl__affine strl__affine_of(const strl__affine *outer, const strl__affine *inner)
{
    strl__affine made;
    for (int i = 0; i < 3; i++)
        strl__affine_vector(outer, inner->axis[i], made.axis[i]);
    strl__affine_point(outer, inner->origin, made.origin);
    return made;
}

void strl__affine_vector(const strl__affine *affine, const double from[3], double to[3])
{
    double made[3];
    for (int i = 0; i < 3; i++)
        made[i] = from[0] * affine->axis[0][i] + from[1] * affine->axis[1][i] + from[2] * affine->axis[2][i];
    for (int i = 0; i < 3; i++)
        to[i] = made[i];
}

void strl__affine_point(const strl__affine *affine, const double from[3], double to[3])
{
    strl__affine_vector(affine, from, to);
    for (int i = 0; i < 3; i++)
        to[i] += affine->origin[i];
}

double strl__affine_determinant(const strl__affine *affine)
{
    double product[3];
    strl__cross(affine->axis[0], affine->axis[1], product);
    return product[0] * affine->axis[2][0] + product[1] * affine->axis[2][1] + product[2] * affine->axis[2][2];
}

void strl__circle(double turns, double *cosine, double *sine)
{
    double quarters = rint(turns * 4), x = (turns - quarters * 0.25) * 6.283185307179586476925, square = x * x;
    double c = 1, s = x, term = 1;
    for (int i = 2; i < 20; i += 2) { /* Taylor: |x| is at most an eighth of a turn */
        term *= -square / (i * (i - 1));
        c += term;
        s += term * x / (i + 1);
    }
    int quarter = (int)fmod(quarters, 4);
    quarter = quarter < 0 ? quarter + 4 : quarter;
    *cosine = quarter == 0 ? c : quarter == 1 ? -s : quarter == 2 ? -c : s;
    *sine = quarter == 0 ? s : quarter == 1 ? c : quarter == 2 ? -s : -c;
}

void strl__circle_step(int step, int steps, double *cosine, double *sine)
{
    strl__circle((double)(step % steps) / steps, cosine, sine);
}

void strl__cross(const double a[3], const double b[3], double to[3])
{
    for (int i = 0; i < 3; i++)
        to[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

double strl__normalise(double vector[3])
{
    double length = sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    for (int i = 0; i < 3 && length > 0; i++)
        vector[i] /= length;
    return length;
}
