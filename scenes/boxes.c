/* Scene `boxes`: many closed boxes that share nothing, of any orientation and size, in the unit cube: a mesh whose
 * topology nobody can simplify across parts. The boxes' mean distance sets their size, so that few of them touch. */
#include "scenes/generator.h"

#include <math.h>
#include <string.h>

#include "base/hash.h"

enum { BATCH = 512, CORNERS = 8, FACES = 12 };

typedef struct box_frame {
    double middle[3];
    double axes[3][3]; /* rotation times half side */
} box_frame;

/* Uniform in [0, 1); each call another number. */
static double next_uniform(uint64_t *state)
{
    *state += 0x9e3779b97f4a7c15u;
    return (double)(strl__mix64(*state) >> 11) * 0x1p-53;
}

/* A uniformly distributed rotation: a random point of the 4-ball as quaternion (Marsaglia), so that no sine is needed.
 */
static void random_quaternion(uint64_t *state, double q[4])
{
    double square;
    do {
        square = 0;
        for (int i = 0; i < 4; i++) {
            q[i] = 2 * next_uniform(state) - 1;
            square += q[i] * q[i];
        }
    } while (square > 1 || square < 1e-3);
    for (int i = 0; i < 4; i++)
        q[i] /= sqrt(square);
}

static box_frame random_box(uint64_t seed, uint64_t index, double spacing)
{
    uint64_t state = strl__mix64(seed) + 0xd1342543de82ef95u * (index + 1);
    double q[4];
    random_quaternion(&state, q);
    const double rotation[3][3] = {
        {1 - 2 * (q[2] * q[2] + q[3] * q[3]), 2 * (q[1] * q[2] + q[0] * q[3]), 2 * (q[1] * q[3] - q[0] * q[2])},
        {2 * (q[1] * q[2] - q[0] * q[3]), 1 - 2 * (q[1] * q[1] + q[3] * q[3]), 2 * (q[2] * q[3] + q[0] * q[1])},
        {2 * (q[1] * q[3] + q[0] * q[2]), 2 * (q[2] * q[3] - q[0] * q[1]), 1 - 2 * (q[1] * q[1] + q[2] * q[2])}};
    double u = next_uniform(&state);
    double size = spacing * (0.06 + 0.3 * u * u); /* many small ones, few large ones */
    box_frame frame;
    for (int axis = 0; axis < 3; axis++) {
        double half = size * (0.4 + 0.6 * next_uniform(&state));
        for (int i = 0; i < 3; i++)
            frame.axes[axis][i] = rotation[axis][i] * half;
        frame.middle[axis] = next_uniform(&state);
    }
    return frame;
}

static void put_box(const box_frame *frame, float *positions, uint32_t first, uint32_t *corners)
{
    /* Corner x + 2 y + 4 z; counter-clockwise seen from outside. */
    static const uint8_t faces[3 * FACES] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                             2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    for (unsigned corner = 0; corner < CORNERS; corner++) {
        for (int i = 0; i < 3; i++) {
            double place = frame->middle[i];
            for (int axis = 0; axis < 3; axis++)
                place += corner >> axis & 1 ? frame->axes[axis][i] : -frame->axes[axis][i];
            *positions++ = (float)place;
        }
    }
    for (int i = 0; i < 3 * FACES; i++)
        corners[i] = first + faces[i];
}

strl_status strl__scene_boxes(strl__scene_run *run, strl_error *err)
{
    float positions[BATCH * CORNERS * 3];
    uint32_t corners[BATCH * FACES * 3];
    uint64_t boxes = run->desc->triangles / FACES;
    /* 1 / cube root by Newton's steps: the C library's cbrt differs from one to the next. */
    double spacing = 1.0;
    for (int step = 0; step < 80; step++)
        spacing = (4 * spacing - (double)boxes * spacing * spacing * spacing * spacing) / 3 > 0
                      ? (4 * spacing - (double)boxes * spacing * spacing * spacing * spacing) / 3
                      : spacing * 0.5;
    for (uint64_t first = 0; first < boxes; first += BATCH) {
        uint64_t count = boxes - first < BATCH ? boxes - first : BATCH;
        for (uint64_t i = 0; i < count; i++) {
            box_frame frame = random_box(run->desc->seed, first + i, spacing);
            put_box(&frame, positions + i * CORNERS * 3, (uint32_t)((first + i) * CORNERS), corners + i * FACES * 3);
        }
        strl_status status = strl__scene_mesh_vertices(run->writer, positions, count * CORNERS, err);
        if (status == STRL_OK)
            status = strl__scene_mesh_triangles(run->writer, corners, count * FACES, err);
        if (status == STRL_OK)
            status = strl__scene_report(run, "placing", first + count, boxes, err);
        if (status != STRL_OK)
            return status;
    }
    return STRL_OK;
}
