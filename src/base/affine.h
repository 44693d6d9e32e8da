/* Affine transforms of space: rows of a 3 x 4 matrix, translations in the last column. */
#ifndef STRL_BASE_AFFINE_H
#define STRL_BASE_AFFINE_H

/* Row-major cofactors of the linear part: what they make of a normal stands upright on what the transform makes of its
 * plane, but on the other side where it mirrors. Returns the determinant, below 0 where it mirrors. */
double strl_affine_cofactors(const double transform[12], double cofactor[9]);

#endif
