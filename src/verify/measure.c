#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "verify/distances.h"

typedef struct measuring {
    strl__model *model;
    strl__surface *from, *to;
    uint64_t seed;
    strl__measured *results;
    uint32_t first; /* of the slice at work */
} measuring;

static void take_point(strl__seeker *seeker, const strl__chunk *chunk, const double local[3], strl__measured *result)
{
    const double p[3] = {chunk->base[0] + local[0], chunk->base[1] + local[1], chunk->base[2] + local[2]};
    double distance2 = strl__v_seeker_distance2(seeker, p), distance = sqrt(distance2);
    result->sum += distance2;
    result->points++;
    if (distance > result->most) {
        result->most = distance;
        memcpy(result->worst, p, sizeof p);
    }
    double excess = distance - strl__v_seeker_claimed(seeker);
    if (!(seeker->surface->most_claimed > 0) || excess <= result->excess)
        return;
    excess = strl__v_seeker_excess(seeker, p, excess);
    if (excess > result->excess) {
        result->excess = excess;
        memcpy(result->most_excessive, p, sizeof p);
    }
}

static double triangle_area(const strl__chunk *chunk, uint32_t t)
{
    const double *a = chunk->vertex[chunk->triangle[t][0]], *b = chunk->vertex[chunk->triangle[t][1]],
                 *c = chunk->vertex[chunk->triangle[t][2]];
    double u[3], v[3];
    for (unsigned k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
    }
    double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
    return sqrt(x * x + y * y + z * z);
}

/* Uniform in the triangle (Turk 1990). */
static void random_point(const strl__chunk *chunk, uint32_t t, double r, double s, double out[3])
{
    const uint16_t *corner = chunk->triangle[t];
    double root = sqrt(r), u = 1 - root, v = root * (1 - s), w = root * s;
    for (unsigned k = 0; k < 3; k++)
        out[k] = u * chunk->vertex[corner[0]][k] + v * chunk->vertex[corner[1]][k] + w * chunk->vertex[corner[2]][k];
}

/* One point for two triangles: each in a stratum of its own of the chunk's area, so that neighbours in the
 * chunk are neighbours in space for the seeker too. */
static void take_samples(const measuring *self, uint32_t index, const strl__chunk *chunk, strl__seeker *seeker,
                         strl__measured *result)
{
    uint32_t count = (chunk->triangle_count + 1) / 2, t = 0;
    double total = 0, passed = 0;
    for (uint32_t i = 0; i < chunk->triangle_count; i++)
        total += triangle_area(chunk, i);
    double area = triangle_area(chunk, 0);
    for (uint32_t i = 0; i < count && seeker->status == STRL_OK; i++) {
        uint64_t seed = self->seed ^ (uint64_t)index << 24;
        double at = (i + strl__random(seed, i, 0)) / count * total, p[3];
        while (t + 1 < chunk->triangle_count && passed + area < at) {
            passed += area;
            area = triangle_area(chunk, ++t);
        }
        random_point(chunk, t, strl__random(seed, i, 1), strl__random(seed, i, 2), p);
        take_point(seeker, chunk, p, result);
    }
}

static strl_status measure_chunk(void *context, uint64_t slot, unsigned worker, strl_error *err)
{
    measuring *self = context;
    uint32_t index = self->first + (uint32_t)slot;
    strl__measured *result = &self->results[index];
    const strl__chunk *chunk;
    strl__seeker seeker;
    *result = (strl__measured){0};
    strl_status status = strl__v_surface_pin(self->from, index, worker, &chunk, err);
    if (status != STRL_OK)
        return status;
    result->claimed = chunk->claimed;
    strl__v_seeker_init(&seeker, self->to, worker, self->to->budget / 4 / strl_pool_workers(self->model->pool));
    for (uint32_t v = 0; v < chunk->vertex_count && seeker.status == STRL_OK; v++)
        take_point(&seeker, chunk, chunk->vertex[v], result);
    take_samples(self, index, chunk, &seeker, result);
    status = seeker.status;
    if (status != STRL_OK && err)
        *err = seeker.error;
    strl__v_seeker_deinit(&seeker);
    strl__v_surface_unpin(self->from, index);
    return status;
}

strl_status strl__v_measure(strl__model *model, strl__surface *from, strl__surface *to, uint64_t seed,
                            strl__measured *results, strl_error *err)
{
    measuring self = {.model = model, .from = from, .to = to, .seed = seed, .results = results};
    strl_status status = STRL_OK;
    while (status == STRL_OK && self.first < from->count) {
        uint32_t left = from->count - self.first, slice = left < 128 ? left : 128;
        status = strl_pool_for(model->pool, slice, measure_chunk, &self, NULL, err);
        self.first += slice;
        if (status == STRL_OK)
            status = strl__v_report(model, "distances", self.first, from->count, err);
    }
    return status;
}
