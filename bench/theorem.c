/* Theorem 1 of the sample tree (Klein et al. 2005) on a container, from the bytes alone: nothing of the builder or the
 * walk.
 *
 *     theorem FILE.stroll [--pairs N] [--seed S] [--probability P]
 *
 * A pair is a cell of the octree, each as likely as any other, and an eye from which the cell covers half a pixel to a
 * whole one. Content of a cell: the triangles whose centroid lies in it and that are stored in it, below it, or above
 * it and within its ball (one side round its centre), so not those that were too large for it. Drawn when the front
 * ends at the cell: those of them that it and the cells above it store. Cells that store all of their content (leaves)
 * cannot fail and are no candidates.
 *
 * Of each pair the content is rasterised with a depth test, 16 x 16 samples over the square that the cell covers at
 * most, which moves at random below them. Three questions, ever less strict: unsampled  no sample shows a drawn
 * triangle hidden     nor does any of four points in each drawn triangle: no triangle is before one of them broken of
 * the hidden ones, those in which what is visible has an area of at least A(P(u)) / q, a group of the proof One JSON
 * line. Holds all triangles of the first tree in memory. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sample_cells.h"

#define BUFFER 16                /* samples along the square that a cell covers */
#define WINDOW 32                /* samples along the buffer: triangles stand out of cells */
#define SQUARE_OF_CUBE 1.3160741 /* sqrt(sqrt(3)): a cube covers at most the square of so many sides */
#define FOCAL_PX 623.5383        /* of an image of 720 lines at 60 degrees */
#define PROBES 4                 /* points in a drawn triangle */
#define FIRST_PROBED 48u         /* drawn triangles; the others only where these are hidden */
#define MOST_DRAWS 8192.0        /* samples are cut there: docs/algorithms/samples.md */
#define NEARER 1e-5f             /* cell sides; what is as near hides nothing */

typedef struct random_source {
    uint64_t state;
} random_source;

static uint64_t random_bits(random_source *random)
{
    uint64_t z = random->state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

static double random_unit(random_source *random)
{
    return (double)(random_bits(random) >> 11) * 0x1p-53;
}

/* Cells that leave some of their content to those below come to the front; returns how many they are. */
static bool find_candidates(model *m, size_t *candidates, uint64_t *triangles)
{
    content c = {0};
    bool good = true;
    *candidates = 0;
    for (size_t i = 0; i < m->cell_count && good; i++) {
        good = gather(m, &m->cells[i], &c);
        if (!good || c.drawn_count == c.count || !(c.area > 0))
            continue;
        triangles[*candidates] = c.count;
        m->cells[(*candidates)++] = m->cells[i];
    }
    content_deinit(&c);
    return good;
}

/* ---- an eye */

typedef struct eye {
    float right[3], up[3], to[3]; /* unit vectors; `to` from the cell to the eye */
    float distance;               /* sides */
    float scale, offset[2];       /* image plane at the cell's centre to samples */
} eye;

static void random_direction(random_source *random, float out[3])
{
    double z = 2 * random_unit(random) - 1, angle = 2 * 3.14159265358979323846 * random_unit(random),
           r = sqrt(1 - z * z);
    out[0] = (float)(r * cos(angle));
    out[1] = (float)(r * sin(angle));
    out[2] = (float)z;
}

static eye make_eye(random_source *random)
{
    eye e;
    float other[3], length = 0;
    random_direction(random, e.to);
    do {
        random_direction(random, other);
        cross(e.to, other, e.right);
        length = sqrtf(e.right[0] * e.right[0] + e.right[1] * e.right[1] + e.right[2] * e.right[2]);
    } while (length < 0.01f);
    for (int k = 0; k < 3; k++)
        e.right[k] /= length;
    cross(e.to, e.right, e.up);
    e.distance = (float)(SQUARE_OF_CUBE * FOCAL_PX / (0.5 + 0.5 * random_unit(random)));
    e.scale = (float)(BUFFER / SQUARE_OF_CUBE);
    for (int k = 0; k < 2; k++)
        e.offset[k] = (float)(WINDOW / 2 - 0.5 + random_unit(random));
    return e;
}

/* x and y in samples; z grows towards the eye and is linear over the image. */
static void project(const eye *e, content *c)
{
    const float *restrict x = c->at[0], *restrict y = c->at[1], *restrict z = c->at[2];
    float *restrict right = c->image[0], *restrict up = c->image[1], *restrict to = c->image[2];
    for (size_t i = 0; i < 3 * (size_t)c->count; i++) {
        float near = x[i] * e->to[0] + y[i] * e->to[1] + z[i] * e->to[2];
        float shrink = e->distance / (e->distance - near), scale = shrink * e->scale;
        right[i] = (x[i] * e->right[0] + y[i] * e->right[1] + z[i] * e->right[2]) * scale + e->offset[0];
        up[i] = (x[i] * e->up[0] + y[i] * e->up[1] + z[i] * e->up[2]) * scale + e->offset[1];
        to[i] = near * shrink;
    }
}

/* ---- a triangle in the image */

typedef struct shape {
    float corner[3][3];
    float area; /* twice, with a sign */
} shape;

typedef struct frame {
    float low[2], high[2];
} frame;

static float least(const float *of)
{
    float two = of[0] < of[1] ? of[0] : of[1];
    return two < of[2] ? two : of[2];
}

static float most(const float *of)
{
    float two = of[0] > of[1] ? of[0] : of[1];
    return two > of[2] ? two : of[2];
}

static frame frame_of(const content *c, uint32_t t)
{
    const float *x = c->image[0] + 3 * (size_t)t, *y = c->image[1] + 3 * (size_t)t;
    return (frame){{least(x), least(y)}, {most(x), most(y)}};
}

static bool make_shape(const content *c, uint32_t t, shape *s)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            s->corner[i][k] = c->image[k][3 * (size_t)t + (size_t)i];
    s->area = (s->corner[1][0] - s->corner[0][0]) * (s->corner[2][1] - s->corner[0][1]) -
              (s->corner[1][1] - s->corner[0][1]) * (s->corner[2][0] - s->corner[0][0]);
    return s->area != 0;
}

static float edge(const float a[3], const float b[3], float x, float y)
{
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

static bool depth_at(const shape *s, float x, float y, float *depth)
{
    float sign = s->area < 0 ? -1 : 1;
    float a = sign * edge(s->corner[1], s->corner[2], x, y), b = sign * edge(s->corner[2], s->corner[0], x, y);
    float c = sign * edge(s->corner[0], s->corner[1], x, y), sum = a + b + c;
    if (a < 0 || b < 0 || c < 0 || !(sum > 0))
        return false;
    *depth = (a * s->corner[0][2] + b * s->corner[1][2] + c * s->corner[2][2]) / sum;
    return true;
}

/* First and last sample of an axis within the window; false = none. */
static bool clip(float low, float high, int *first, int *last)
{
    *first = low <= 0 ? 0 : low > WINDOW ? WINDOW : (int)ceilf(low);
    *last = high >= WINDOW - 1 ? WINDOW - 1 : high < 0 ? -1 : (int)floorf(high);
    return *first <= *last;
}

/* ---- the id buffer */

typedef struct id_buffer {
    float depth[WINDOW][WINDOW];
    uint32_t id[WINDOW][WINDOW]; /* UINT32_MAX = nothing */
} id_buffer;

static void draw(const content *c, id_buffer *buffer)
{
    memset(buffer->id, 0xff, sizeof buffer->id);
    for (uint32_t t = 0; t < c->count; t++) {
        frame f = frame_of(c, t);
        shape s;
        int x0, x1, y0, y1;
        if (!clip(f.low[0], f.high[0], &x0, &x1) || !clip(f.low[1], f.high[1], &y0, &y1) || !make_shape(c, t, &s))
            continue;
        for (int y = y0; y <= y1; y++)
            for (int x = x0; x <= x1; x++) {
                float depth;
                if (!depth_at(&s, (float)x, (float)y, &depth) ||
                    (buffer->id[y][x] != UINT32_MAX && depth <= buffer->depth[y][x]))
                    continue;
                buffer->depth[y][x] = depth;
                buffer->id[y][x] = t;
            }
    }
}

typedef struct seen {
    bool drawn, above; /* a sample shows a drawn triangle; one that a cell above stores */
    double area;       /* of what is visible, over that of the cell's side */
} seen;

static seen look(const eye *e, const content *c, const id_buffer *buffer)
{
    seen s = {0};
    double each = 1 / ((double)e->scale * (double)e->scale);
    for (int y = 0; y < WINDOW; y++)
        for (int x = 0; x < WINDOW; x++) {
            uint32_t t = buffer->id[y][x];
            if (t == UINT32_MAX)
                continue;
            float normal[3];
            area_vector(c, t, normal);
            double cosine = fabs((double)dot(normal, e->to)) / sqrt((double)dot(normal, normal));
            s.drawn |= c->drawn[t] != 0;
            s.above |= c->drawn[t] == 2;
            s.area += each / fmax(cosine, 1e-3);
        }
    return s;
}

/* ---- points of drawn triangles */

typedef struct probe {
    float at[3];
    uint32_t face, next; /* the next one at the same sample, PROBE_END = none */
    bool hidden;
} probe;

#define PROBE_END UINT32_MAX

typedef struct probes {
    probe *probe;
    size_t capacity;
    uint32_t count, first[WINDOW][WINDOW]; /* those whose coordinates are rounded down to this sample */
} probes;

static bool set_probes(const content *c, uint32_t begin, uint32_t end, random_source *random, probes *p)
{
    p->count = 0;
    memset(p->first, 0xff, sizeof p->first);
    if (!strl__grow(&p->probe, &p->capacity, (size_t)PROBES * (end - begin), sizeof *p->probe))
        return false;
    for (uint32_t i = begin; i < end; i++) {
        shape s;
        if (!make_shape(c, c->drawn_face[i], &s))
            continue;
        for (int n = 0; n < PROBES; n++) {
            float u = (float)random_unit(random), v = (float)random_unit(random);
            float share[3] = {1 - sqrtf(u), sqrtf(u) * (1 - v), sqrtf(u) * v};
            probe *to = &p->probe[p->count];
            *to = (probe){.face = c->drawn_face[i]};
            for (int k = 0; k < 3; k++)
                to->at[k] = n == 0 ? (s.corner[0][k] + s.corner[1][k] + s.corner[2][k]) / 3
                                   : share[0] * s.corner[0][k] + share[1] * s.corner[1][k] + share[2] * s.corner[2][k];
            int x = (int)floorf(to->at[0]), y = (int)floorf(to->at[1]);
            if (x < 0 || y < 0 || x >= WINDOW || y >= WINDOW)
                continue;
            to->next = p->first[y][x];
            p->first[y][x] = p->count++;
        }
    }
    return true;
}

static void hide(const shape *s, uint32_t t, int x, int y, probes *p)
{
    for (uint32_t i = p->first[y][x]; i != PROBE_END; i = p->probe[i].next) {
        probe *at = &p->probe[i];
        float depth;
        if (!at->hidden && at->face != t && depth_at(s, at->at[0], at->at[1], &depth) && depth > at->at[2] + NEARER)
            at->hidden = true;
    }
}

/* True where a probe of drawn triangles [begin, end) is before all of the content. */
static bool any_visible(const content *c, uint32_t begin, uint32_t end, random_source *random, probes *p, bool *good)
{
    *good = set_probes(c, begin, end, random, p);
    for (uint32_t t = 0; t < c->count && *good; t++) {
        frame f = frame_of(c, t);
        if (f.high[0] < 0 || f.high[1] < 0 || f.low[0] >= WINDOW || f.low[1] >= WINDOW)
            continue;
        int x0 = f.low[0] > 0 ? (int)f.low[0] : 0, x1 = f.high[0] < WINDOW ? (int)f.high[0] : WINDOW - 1;
        int y0 = f.low[1] > 0 ? (int)f.low[1] : 0, y1 = f.high[1] < WINDOW ? (int)f.high[1] : WINDOW - 1;
        for (int y = y0; y <= y1; y++)
            for (int x = x0; x <= x1; x++) {
                shape s;
                if (p->first[y][x] != PROBE_END && make_shape(c, t, &s))
                    hide(&s, t, x, y, p);
            }
    }
    for (uint32_t i = 0; i < p->count && *good; i++)
        if (!p->probe[i].hidden)
            return true;
    return false;
}

/* ---- pairs */

typedef struct figures {
    uint64_t pairs, unsampled, hidden, above_unsampled;
    uint64_t premise, premise_hidden; /* what is visible is a group of the proof, and the sample is not cut */
    uint64_t failing_cells;           /* with a hidden pair */
    double fullest_group;             /* of the hidden pairs: the most of what was visible over a group */
} figures;

/* Some drawn triangles at random, so that those probed first lie anywhere. */
static void shuffle_drawn(content *c, random_source *random)
{
    for (uint32_t i = c->drawn_count; i > 1; i--) {
        uint32_t k = (uint32_t)(random_unit(random) * i), kept = c->drawn_face[i - 1];
        c->drawn_face[i - 1] = c->drawn_face[k];
        c->drawn_face[k] = kept;
    }
}

static bool is_visible(const content *c, random_source *random, probes *p, bool *good)
{
    uint32_t first = c->drawn_count < FIRST_PROBED ? c->drawn_count : FIRST_PROBED;
    if (any_visible(c, 0, first, random, p, good))
        return true;
    return *good && first < c->drawn_count && any_visible(c, first, c->drawn_count, random, p, good);
}

/* `pairs` eyes of one cell. */
static bool test_cell(const model *m, const cell *at, uint64_t pairs, double coupons, random_source *random, content *c,
                      probes *p, figures *f)
{
    static id_buffer buffer;
    bool good = gather(m, at, c), failed = false;
    double groups = ceil(c->area);
    bool is_whole = groups * log(groups) + coupons * groups <= MOST_DRAWS;
    if (good)
        shuffle_drawn(c, random);
    for (uint64_t i = 0; i < pairs && good; i++) {
        eye e = make_eye(random);
        project(&e, c);
        draw(c, &buffer);
        seen s = look(&e, c, &buffer);
        bool premise = is_whole && s.area >= c->area / groups;
        f->pairs++;
        f->premise += premise;
        f->above_unsampled += !s.above;
        if (s.drawn)
            continue;
        f->unsampled++;
        if (is_visible(c, random, p, &good))
            continue;
        f->hidden++;
        f->premise_hidden += premise;
        f->fullest_group = fmax(f->fullest_group, s.area * groups / c->area);
        failed = true;
    }
    f->failing_cells += failed;
    return good;
}

static bool test(model *m, size_t candidates, uint64_t pairs, double probability, uint64_t seed, figures *f)
{
    random_source random = {seed};
    content c = {0};
    probes p = {0};
    double coupons = -log(-log(probability));
    uint64_t *count = strl__alloc_zero(candidates, sizeof *count);
    bool good = count != NULL;
    for (uint64_t i = 0; i < pairs && good && candidates; i++)
        count[(size_t)(random_unit(&random) * (double)candidates)]++;
    for (size_t i = 0; i < candidates && good; i++)
        if (count[i])
            good = test_cell(m, &m->cells[i], count[i], coupons, &random, &c, &p, f);
    strl__free(count);
    content_deinit(&c);
    strl__free(p.probe);
    return good;
}

static int by_number(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static strl_status report(model *m, uint64_t pairs, double probability, uint64_t seed)
{
    size_t cells = m->cell_count, candidates;
    figures f = {0};
    uint64_t *triangles = strl__alloc(cells, sizeof *triangles);
    bool good =
        triangles && find_candidates(m, &candidates, triangles) && test(m, candidates, pairs, probability, seed, &f);
    if (good) {
        qsort(triangles, candidates, sizeof *triangles, by_number);
        printf("{\"triangles\":%zu,\"lost\":%" PRIu64 ",\"cells\":%zu,\"candidates\":%zu,\"triangles_median\":%" PRIu64
               ",\"triangles_most\":%" PRIu64 ",\"probability\":%.17g,\"pairs\":%" PRIu64 ",\"unsampled\":%" PRIu64
               ",\"hidden\":%" PRIu64 ",\"failing_cells\":%" PRIu64 ",\"fullest_group\":%.4f,\"premise\":%" PRIu64
               ",\"broken\":%" PRIu64 ",\"above_unsampled\":%" PRIu64 "}\n",
               m->face_count, m->lost, cells, candidates, candidates ? triangles[candidates / 2] : 0,
               candidates ? triangles[candidates - 1] : 0, probability, f.pairs, f.unsampled, f.hidden, f.failing_cells,
               f.fullest_group, f.premise, f.premise_hidden, f.above_unsampled);
    }
    strl__free(triangles);
    return good ? STRL_OK : STRL_ERR_MEMORY;
}

int main(int count, char **words)
{
    model m = {0};
    strl_error err = {0};
    uint64_t pairs = 1000000, seed = 1;
    double probability = 1 - 1e-6;
    for (int i = 2; i + 1 < count; i += 2) {
        if (strcmp(words[i], "--pairs") == 0)
            pairs = strtoull(words[i + 1], NULL, 10);
        else if (strcmp(words[i], "--seed") == 0)
            seed = strtoull(words[i + 1], NULL, 10);
        else if (strcmp(words[i], "--probability") == 0)
            probability = strtod(words[i + 1], NULL);
    }
    if (count < 2 || count % 2 || !(probability > 0 && probability < 1)) {
        fprintf(stderr, "usage: theorem FILE.stroll [--pairs N] [--seed S] [--probability P]\n");
        return 2;
    }
    strl_status status = strl_container_open_path(words[1], &m.container, &err);
    if (!status)
        status = load_model(&m, &err);
    if (!status)
        status = report(&m, pairs, probability, seed);
    if (status)
        fprintf(stderr, "theorem: %s: %s\n", words[1], status == STRL_ERR_MEMORY ? "no memory" : err.message);
    model_deinit(&m);
    return status ? 1 : 0;
}
