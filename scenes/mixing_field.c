/* See mixing_field.h. */
#include "scenes/mixing_field.h"

#include <assert.h>
#include <math.h>

#include "base/hash.h"

#define BASE_CELLS 4.0  /* of level 0 per unit */
#define FALLOFF 0.7f    /* a fine level's amplitude over that of the coarser one: a fractal dimension of about 2.5 */
#define COLUMN_LEVELS 2 /* the first levels, whose noise is partly one value per column: bubbles and spikes */
#define COLUMN_SHARE 0.6f
#define FOCUS 5.0f /* noise is halved where the coarser field is this many of its amplitudes away from zero */

/* Noise amplitude of the levels that make the large shapes; the profile rises from -1 to 1. Finer ones follow by
 * FALLOFF. */
static const float coarse_amplitudes[] = {0.7f, 1.6f, 2.8f, 4.4f, 4.0f};

enum { COARSE_LEVELS = sizeof coarse_amplitudes / sizeof coarse_amplitudes[0] };

static float level_amplitude(unsigned level)
{
    float amplitude = coarse_amplitudes[level < COARSE_LEVELS ? level : COARSE_LEVELS - 1];
    for (unsigned fine = COARSE_LEVELS; fine <= level; fine++)
        amplitude *= FALLOFF;
    return amplitude;
}

/* What all levels finer than this one can add, at most. */
static float reach_beyond(unsigned level)
{
    float reach = 0.0f;
    for (level++; level < COARSE_LEVELS; level++)
        reach += coarse_amplitudes[level];
    return reach + level_amplitude(level) / (1.0f - FALLOFF);
}

/* A range of lattice points of one level, with `side` of them along each axis. */
typedef struct lattice_box {
    int64_t first[3];
    unsigned side[3];
} lattice_box;

double strl__field_spacing(const strl__field *field)
{
    return 1.0 / (BASE_CELLS * (double)(1u << (field->levels - 1)));
}

static int64_t floor_half(int64_t value)
{
    return value >= 0 ? value / 2 : -((1 - value) / 2);
}

static lattice_box parent_of(const lattice_box *box)
{
    lattice_box parent;
    for (int axis = 0; axis < 3; axis++) {
        int64_t last = box->first[axis] + box->side[axis] - 1;
        parent.first[axis] = floor_half(box->first[axis]) - 1;
        parent.side[axis] = (unsigned)(floor_half(last) + 1 - parent.first[axis] + 1);
    }
    return parent;
}

/* Uniform in [-1, 1). */
static float seeded(uint64_t key)
{
    return (float)((int32_t)(uint32_t)(strl__mix64(key) >> 40) - (1 << 23)) * 0x1p-23f;
}

static uint64_t row_key(uint64_t seed, unsigned level, int64_t y, int64_t z)
{
    uint64_t key = strl__mix64(seed + 0x9e3779b97f4a7c15u * (level + 1));
    key = strl__mix64(key + 0xd1342543de82ef95u * (uint64_t)z);
    return strl__mix64(key + 0xaf251af3b0f025b5u * (uint64_t)y);
}

/* The strength of all noise at a height: 0 at and beyond the layer's floor and top, 1 in its middle. */
static float envelope(double height)
{
    double zeta = height * (2.0 / STRL__FIELD_HEIGHT) - 1.0;
    double rest = 1.0 - zeta * zeta;
    return rest > 0 ? (float)rest : 0.0f;
}

static void fill_coarsest(const strl__field *field, const lattice_box *box, float *out)
{
    for (unsigned k = 0; k < box->side[2]; k++) {
        double height = (double)(box->first[2] + k) / BASE_CELLS;
        double zeta = height * (2.0 / STRL__FIELD_HEIGHT) - 1.0;
        float profile =
            (float)(zeta * (0.15 + 0.85 * zeta * zeta)); /* flat in the middle, where the fluids have mixed */
        for (unsigned j = 0; j < box->side[1]; j++) {
            for (unsigned i = 0; i < box->side[0]; i++)
                *out++ = profile;
        }
    }
    (void)field;
}

/* Along one axis: even points are (1 6 1) / 8 of the coarse ones, odd points (1 1) / 2 (the two-scale relation).
 * `inner` is the run of floats that moves as one, `outer` how often the axis is repeated. */
static void refine_axis(const float *in, float *out, unsigned outer, size_t inner, int64_t in_first, unsigned in_side,
                        int64_t out_first, unsigned out_side)
{
    for (unsigned o = 0; o < outer; o++) {
        for (unsigned p = 0; p < out_side; p++) {
            int64_t point = out_first + p;
            const float *b = in + ((size_t)o * in_side + (size_t)(floor_half(point) - in_first)) * inner;
            float *to = out + ((size_t)o * out_side + p) * inner;
            if (point & 1) {
                for (size_t i = 0; i < inner; i++)
                    to[i] = 0.5f * (b[i] + b[i + inner]);
            } else {
                const float *a = b - inner;
                for (size_t i = 0; i < inner; i++)
                    to[i] = 0.125f * (a[i] + b[i + inner]) + 0.75f * b[i];
            }
        }
    }
}

/* Refines coarse (of box `parent`) into fine (of box `box`), with rows and planes as room between the axes. */
static void refine(const lattice_box *parent, const float *coarse, const lattice_box *box, float *fine,
                   strl__field_scratch *scratch)
{
    const unsigned *p = parent->side;
    const unsigned *b = box->side;
    refine_axis(coarse, scratch->planes, 1, (size_t)p[0] * p[1], parent->first[2], p[2], box->first[2], b[2]);
    refine_axis(scratch->planes, scratch->rows, b[2], p[0], parent->first[1], p[1], box->first[1], b[1]);
    refine_axis(scratch->rows, fine, b[2] * b[1], 1, parent->first[0], p[0], box->first[0], b[0]);
}

/* Adds one level's noise, near the interface so far. */
static void add_noise(const strl__field *field, unsigned level, float amplitude, const lattice_box *box, float *values)
{
    double spacing = 1.0 / (BASE_CELLS * (double)(1u << level));
    float column_share = level < COLUMN_LEVELS ? COLUMN_SHARE : 0.0f;
    float narrow = level == 0 ? 0.0f : 1.0f / (FOCUS * amplitude);
    for (unsigned k = 0; k < box->side[2]; k++) {
        float strength = amplitude * envelope((double)(box->first[2] + k) * spacing);
        for (unsigned j = 0; j < box->side[1]; j++, values += box->side[0]) {
            if (strength <= 0.0f)
                continue;
            uint64_t key = row_key(field->seed, level, box->first[1] + j, box->first[2] + k);
            uint64_t column_key = row_key(field->seed, level + 64, box->first[1] + j, 0);
            for (unsigned i = 0; i < box->side[0]; i++) {
                uint64_t x = 0x9e3779b97f4a7c15u * (uint64_t)(box->first[0] + i);
                float noise = seeded(key + x);
                if (column_share > 0.0f)
                    noise += column_share * (seeded(column_key + x) - noise);
                float away = values[i] * narrow;
                values[i] += strength * noise / (1.0f + away * away);
            }
        }
    }
}

/* Whether all values are on one side of zero by more than `reach`. */
static bool one_sided(const float *values, size_t count, float reach)
{
    float low[8];
    float high[8];
    for (int lane = 0; lane < 8; lane++)
        low[lane] = high[lane] = values[0];
    size_t at = 0;
    for (; at + 8 <= count; at += 8) {
        for (int lane = 0; lane < 8; lane++) {
            float value = values[at + (size_t)lane];
            low[lane] = value < low[lane] ? value : low[lane];
            high[lane] = value > high[lane] ? value : high[lane];
        }
    }
    for (; at < count; at++) {
        low[0] = values[at] < low[0] ? values[at] : low[0];
        high[0] = values[at] > high[0] ? values[at] : high[0];
    }
    for (int lane = 1; lane < 8; lane++) {
        low[0] = low[lane] < low[0] ? low[lane] : low[0];
        high[0] = high[lane] > high[0] ? high[lane] : high[0];
    }
    return low[0] > reach || high[0] < -reach;
}

/* Which coefficients a sample needs, and their weights. */
typedef struct sample_weights {
    uint8_t at[STRL__FIELD_SIDE]; /* index of the first of four */
    float w[4][STRL__FIELD_SIDE];
} sample_weights;

static void place_samples(const strl__field_box *box, double spacing, lattice_box *lattice, sample_weights weights[3])
{
    for (int axis = 0; axis < 3; axis++) {
        int64_t cell = 0;
        for (unsigned i = 0; i < box->count[axis]; i++) {
            double place = (double)(box->first[axis] + i) * box->step / spacing;
            double whole = floor(place);
            float f = (float)(place - whole);
            float g = 1.0f - f;
            cell = (int64_t)whole;
            if (i == 0)
                lattice->first[axis] = cell - 1;
            weights[axis].at[i] = (uint8_t)(cell - 1 - lattice->first[axis]);
            weights[axis].w[0][i] = g * g * g * (1.0f / 6.0f);
            weights[axis].w[1][i] = (4.0f + f * f * (3.0f * f - 6.0f)) * (1.0f / 6.0f);
            weights[axis].w[2][i] = (4.0f + g * g * (3.0f * g - 6.0f)) * (1.0f / 6.0f);
            weights[axis].w[3][i] = f * f * f * (1.0f / 6.0f);
        }
        lattice->side[axis] = (unsigned)(cell + 3 - lattice->first[axis]);
        assert(lattice->side[axis] <= STRL__FIELD_LATTICE_SIDE);
    }
}

static void sample_x(const lattice_box *lattice, const float *values, const sample_weights *weights, unsigned count,
                     float *rows)
{
    for (size_t row = 0; row < (size_t)lattice->side[1] * lattice->side[2]; row++) {
        for (unsigned i = 0; i < count; i++) {
            const float *c = values + weights->at[i];
            rows[i] = (weights->w[0][i] * c[0] + weights->w[1][i] * c[1]) +
                      (weights->w[2][i] * c[2] + weights->w[3][i] * c[3]);
        }
        values += lattice->side[0];
        rows += STRL__FIELD_STRIDE;
    }
}

/* One run of samples from four runs of coefficients. */
static void blend(const float *c, size_t stride, const float w[4], size_t count, float *restrict out)
{
    const float *c1 = c + stride;
    const float *c2 = c1 + stride;
    const float *c3 = c2 + stride;
    for (size_t i = 0; i < count; i++)
        out[i] = (w[0] * c[i] + w[1] * c1[i]) + (w[2] * c2[i] + w[3] * c3[i]);
}

static void sample_box(const strl__field_box *box, const lattice_box *lattice, const float *values,
                       const sample_weights weights[3], strl__field_scratch *scratch)
{
    const size_t stride = STRL__FIELD_STRIDE;
    const size_t run = (box->count[0] + 3) / 4 * 4; /* whole vectors; the padding is defined and never read */
    sample_x(lattice, values, &weights[0], box->count[0], scratch->rows);
    for (unsigned k = 0; k < lattice->side[2]; k++) {
        for (unsigned j = 0; j < box->count[1]; j++) {
            const float w[4] = {weights[1].w[0][j], weights[1].w[1][j], weights[1].w[2][j], weights[1].w[3][j]};
            blend(scratch->rows + ((size_t)k * lattice->side[1] + weights[1].at[j]) * stride, stride, w, run,
                  scratch->planes + ((size_t)k * STRL__FIELD_SIDE + j) * stride);
        }
    }
    for (unsigned k = 0; k < box->count[2]; k++) {
        const float w[4] = {weights[2].w[0][k], weights[2].w[1][k], weights[2].w[2][k], weights[2].w[3][k]};
        blend(scratch->planes + (size_t)weights[2].at[k] * STRL__FIELD_SIDE * stride, STRL__FIELD_SIDE * stride, w,
              box->count[1] * stride, scratch->samples + (size_t)k * STRL__FIELD_SIDE * stride);
    }
}

bool strl__field_sample(const strl__field *field, const strl__field_box *box, strl__field_scratch *scratch)
{
    lattice_box levels[STRL__FIELD_LEVELS_MAX];
    sample_weights weights[3];
    unsigned last = field->levels - 1;
    place_samples(box, strl__field_spacing(field), &levels[last], weights);
    for (unsigned level = last; level > 0; level--)
        levels[level - 1] = parent_of(&levels[level]);

    float *values = scratch->lattice[0];
    fill_coarsest(field, &levels[0], values);
    for (unsigned level = 0; level <= last; level++) {
        if (level > 0) {
            float *fine = scratch->lattice[level & 1];
            refine(&levels[level - 1], values, &levels[level], fine, scratch);
            values = fine;
        }
        add_noise(field, level, level_amplitude(level), &levels[level], values);
        const unsigned *side = levels[level].side;
        if (one_sided(values, (size_t)side[0] * side[1] * side[2], level == last ? 0.0f : reach_beyond(level)))
            return false;
    }
    sample_box(box, &levels[last], values, weights, scratch);
    return true;
}
