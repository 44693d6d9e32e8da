/* Placements of parts, and the circle. Nothing here calls the C library's sine, which differs from one to the next: the
 * same arguments give the same bits everywhere. */
#ifndef STRL_SCENES_PARTS_AFFINE_H
#define STRL_SCENES_PARTS_AFFINE_H

/* p goes to origin + p[0] axis[0] + p[1] axis[1] + p[2] axis[2]. Scenes use rotations, mirrors and uniform scales. */
typedef struct strl__affine {
    double axis[3][3];
    double origin[3];
} strl__affine;

strl__affine strl__affine_identity(void);
strl__affine strl__affine_move(double x, double y, double z);
/* Turned about z by a part of a full turn, then moved. */
strl__affine strl__affine_turn(double turns, double x, double y, double z);
/* z along the direction (any length above 0), y as far up as can be; vertical ones have y along +y. */
strl__affine strl__affine_along(const double origin[3], const double direction[3]);
/* First inner, then outer. */
strl__affine strl__affine_of(const strl__affine *outer, const strl__affine *inner);
void strl__affine_point(const strl__affine *affine, const double from[3], double to[3]);
void strl__affine_vector(const strl__affine *affine, const double from[3], double to[3]);
double strl__affine_determinant(const strl__affine *affine);

/* Cosine and sine of an angle given in full turns; exact at quarters. */
void strl__circle(double turns, double *cosine, double *sine);
/* Cosine and sine of step / steps of a turn: the same for step and step + steps. */
void strl__circle_step(int step, int steps, double *cosine, double *sine);

void strl__cross(const double a[3], const double b[3], double to[3]);
/* To length 1; returns the length before. A zero vector stays. */
double strl__normalise(double vector[3]);

#endif
