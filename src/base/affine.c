#include "base/affine.h"

double strl_affine_cofactors(const double transform[12], double cofactor[9])
{
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++) {
            const double *a = transform + 4 * ((row + 1) % 3), *b = transform + 4 * ((row + 2) % 3);
            int i = (column + 1) % 3, k = (column + 2) % 3;
            cofactor[3 * row + column] = a[i] * b[k] - a[k] * b[i];
        }
    return transform[0] * cofactor[0] + transform[1] * cofactor[1] + transform[2] * cofactor[2];
}
