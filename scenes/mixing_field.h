/* The scalar field whose zero level is scene `isosurface`: a turbulent mixing layer between a light fluid below and a
 * heavy one above, as after a Richtmyer-Meshkov instability.
 *
 * It is a pyramid of uniform cubic B-splines. Level 0 is a height profile plus bubbles and spikes on a coarse lattice;
 * each further level refines the lattice by two (which represents the same function exactly) and adds seeded noise of
 * its own scale, weaker by a constant factor and mostly near the interface that the coarser levels have made. So more
 * levels are the same surface with more detail, never another one. A spline stays within the range of its coefficients:
 * boxes without surface are found early, without sampling them.
 *
 * Every sample is a pure function of (seed, levels, position): two boxes agree bit by bit where they overlap. Only
 * additions, multiplications, divisions and square roots are used, so that every machine computes the same bits. */
#ifndef STRL_SCENES_MIXING_FIELD_H
#define STRL_SCENES_MIXING_FIELD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    STRL__FIELD_LEVELS_MAX = 16,
    STRL__FIELD_SIDE = 66,        /* samples along an axis of a box, at most */
    STRL__FIELD_STRIDE = 68,      /* floats from one row of samples to the next */
    STRL__FIELD_LATTICE_SIDE = 40 /* coefficients along an axis, at most */
};

/* The layer's height; its other two sides are 1 long. */
#define STRL__FIELD_HEIGHT 0.5

typedef struct strl__field {
    uint64_t seed;
    unsigned levels; /* 1 ... STRL__FIELD_LEVELS_MAX */
} strl__field;

/* Sample (i, j, k) of a box stands at (first + i) * step along each axis. At least two samples must fall between two
 * coefficients: step <= 0.5 * strl__field_spacing(). */
typedef struct strl__field_box {
    int64_t first[3];
    unsigned count[3]; /* 1 ... STRL__FIELD_SIDE */
    double step;
} strl__field_box;

/* Working memory of one thread. */
typedef struct strl__field_scratch {
    float samples[STRL__FIELD_SIDE * STRL__FIELD_SIDE * STRL__FIELD_STRIDE]; /* the result, x fastest */
    float lattice[2][STRL__FIELD_LATTICE_SIDE * STRL__FIELD_LATTICE_SIDE * STRL__FIELD_LATTICE_SIDE];
    float rows[STRL__FIELD_LATTICE_SIDE * STRL__FIELD_LATTICE_SIDE * STRL__FIELD_STRIDE];
    float planes[STRL__FIELD_LATTICE_SIDE * STRL__FIELD_SIDE * STRL__FIELD_STRIDE];
} strl__field_scratch;

/* Distance between coefficients of the finest level; its noise has wavelengths of 2 to 3 of them. */
double strl__field_spacing(const strl__field *field);

/* Fills scratch->samples; false, and nothing filled, where no sample of the box can have another sign than the others.
 */
bool strl__field_sample(const strl__field *field, const strl__field_box *box, strl__field_scratch *scratch);

static inline const float *strl__field_at(const strl__field_scratch *scratch, unsigned x, unsigned y, unsigned z)
{
    return scratch->samples + ((size_t)z * STRL__FIELD_SIDE + y) * STRL__FIELD_STRIDE + x;
}

#endif
