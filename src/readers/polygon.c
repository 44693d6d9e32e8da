/* Ear clipping (Meisters 1975; Eberly, "Triangulation by ear clipping"). Orientation is decided
 * exactly, after Shewchuk
 * ("Adaptive precision floating-point arithmetic", 1997): a filter, then an expansion of the six
 * products. */
#include "readers/polygon.h"

#include <string.h>

#include "base/memory.h"

/* a + b == *high + *low exactly. */
static void two_sum(double a, double b, double *high, double *low)
{
    double sum = a + b;
    double b_part = sum - a;
    double a_part = sum - b_part;
    *high = sum;
    *low = (a - a_part) + (b - b_part);
}

static void split(double a, double *high, double *low)
{
    double c = 134217729.0 * a; /* 2^27 + 1 */
    *high = c - (c - a);
    *low = a - *high;
}

/* a * b == *high + *low exactly. */
static void two_product(double a, double b, double *high, double *low)
{
    double a_high, a_low, b_high, b_low;
    split(a, &a_high, &a_low);
    split(b, &b_high, &b_low);
    *high = a * b;
    *low = a_low * b_low - (((*high - a_high * b_high) - a_low * b_high) - a_high * b_low);
}

/* Adds one number to an expansion whose parts do not overlap, in growing order. */
static void grow_expansion(double *parts, unsigned *count, double value)
{
    double carry = value;
    for (unsigned i = 0; i < *count; i++)
        two_sum(carry, parts[i], &carry, &parts[i]);
    parts[(*count)++] = carry;
}

static double exact_orientation(const double a[2], const double b[2], const double c[2])
{
    const double left[6] = {a[0], b[0], c[0], -b[0], -c[0], -a[0]};
    const double right[6] = {b[1], c[1], a[1], a[1], b[1], c[1]};
    double parts[12];
    unsigned count = 0;
    for (unsigned i = 0; i < 6; i++) {
        double high, low;
        two_product(left[i], right[i], &high, &low);
        grow_expansion(parts, &count, low);
        grow_expansion(parts, &count, high);
    }
    while (count > 0 && parts[count - 1] == 0)
        count--;
    return count ? parts[count - 1] : 0;
}

double strl__orientation(const double a[2], const double b[2], const double c[2])
{
    double left = (a[0] - c[0]) * (b[1] - c[1]);
    double right = (a[1] - c[1]) * (b[0] - c[0]);
    double area = left - right;
    double bound = 3.3306690738754716e-16 * ((left < 0 ? -left : left) + (right < 0 ? -right : right));
    return area > bound || -area > bound ? area : exact_orientation(a, b, c);
}

void strl__polygon_deinit(strl__polygon *polygon)
{
    strl__free(polygon->triangles);
    strl__free(polygon->plane);
    strl__free(polygon->previous);
    strl__free(polygon->next);
    strl__free(polygon->reflex);
    strl__free(polygon->is_reflex);
    *polygon = (strl__polygon){0};
}

static bool reserve(strl__polygon *polygon, uint32_t corner_count)
{
    if (corner_count <= polygon->capacity)
        return true;
    size_t capacity = corner_count < 64 ? 64 : (size_t)corner_count + corner_count / 2;
    strl__polygon_deinit(polygon);
    polygon->triangles = strl__alloc(capacity, 3 * sizeof *polygon->triangles);
    polygon->plane = strl__alloc(capacity, 2 * sizeof *polygon->plane);
    polygon->previous = strl__alloc(capacity, sizeof *polygon->previous);
    polygon->next = strl__alloc(capacity, sizeof *polygon->next);
    polygon->reflex = strl__alloc(capacity, sizeof *polygon->reflex);
    polygon->is_reflex = strl__alloc(capacity, 1);
    if (!polygon->triangles || !polygon->plane || !polygon->previous || !polygon->next || !polygon->reflex ||
        !polygon->is_reflex) {
        strl__polygon_deinit(polygon);
        return false;
    }
    polygon->capacity = capacity;
    return true;
}

static const double *position_at(const double *positions, size_t stride_bytes, uint32_t corner)
{
    return (const double *)(const void *)((const char *)positions + corner * stride_bytes);
}

/* Newell's normal, relative to the first corner to keep its digits. */
static void newell_normal(const double *positions, size_t stride_bytes, uint32_t count, double normal[3])
{
    const double *origin = positions;
    memset(normal, 0, 3 * sizeof *normal);
    for (uint32_t i = 0; i < count; i++) {
        const double *p = position_at(positions, stride_bytes, i);
        const double *q = position_at(positions, stride_bytes, i + 1 < count ? i + 1 : 0);
        for (unsigned axis = 0; axis < 3; axis++) {
            unsigned u = (axis + 1) % 3, v = (axis + 2) % 3;
            normal[axis] += (p[u] - origin[u]) * (q[v] - origin[v]) - (p[v] - origin[v]) * (q[u] - origin[u]);
        }
    }
}

/* Drops the axis along which the polygon's plane is steepest, so that coordinates stay exact;
 * counterclockwise after. */
static void project(strl__polygon *polygon, const double *positions, size_t stride_bytes, uint32_t count)
{
    double normal[3];
    newell_normal(positions, stride_bytes, count, normal);
    unsigned dropped = 0;
    for (unsigned axis = 1; axis < 3; axis++)
        if (normal[axis] * normal[axis] > normal[dropped] * normal[dropped])
            dropped = axis;
    unsigned u = (dropped + 1) % 3, v = (dropped + 2) % 3;
    if (normal[dropped] < 0) {
        unsigned swapped = u;
        u = v;
        v = swapped;
    }
    for (uint32_t i = 0; i < count; i++) {
        const double *p = position_at(positions, stride_bytes, i);
        polygon->plane[2 * i] = p[u];
        polygon->plane[2 * i + 1] = p[v];
    }
}

static double turn(const strl__polygon *polygon, uint32_t a, uint32_t b, uint32_t c)
{
    return strl__orientation(polygon->plane + 2 * (size_t)a, polygon->plane + 2 * (size_t)b,
                             polygon->plane + 2 * (size_t)c);
}

static void emit(strl__polygon *polygon, uint32_t index, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *triangle = polygon->triangles + 3 * (size_t)index;
    triangle[0] = a;
    triangle[1] = b;
    triangle[2] = c;
}

static bool fan(strl__polygon *polygon, uint32_t count)
{
    for (uint32_t i = 1; i + 1 < count; i++) {
        if (count > 3 && !(turn(polygon, 0, i, i + 1) > 0))
            return false;
        emit(polygon, i - 1, 0, i, i + 1);
    }
    return true;
}

static bool same_point(const strl__polygon *polygon, uint32_t a, uint32_t b)
{
    const double *p = polygon->plane + 2 * (size_t)a, *q = polygon->plane + 2 * (size_t)b;
    return p[0] == q[0] && p[1] == q[1];
}

typedef struct ear_clipper {
    strl__polygon *polygon;
    uint32_t reflex_count;
    uint64_t tests_left; /* bounds the time that a hostile polygon can take */
} ear_clipper;

/* A corner that turns left and whose triangle holds no corner that turns right. */
static bool is_ear(ear_clipper *clipper, uint32_t corner)
{
    strl__polygon *polygon = clipper->polygon;
    uint32_t a = polygon->previous[corner], c = polygon->next[corner];
    if (clipper->tests_left)
        clipper->tests_left--;
    if (polygon->is_reflex[corner])
        return false;
    for (uint32_t i = 0; i < clipper->reflex_count && clipper->tests_left; i++) {
        uint32_t p = polygon->reflex[i];
        if (!polygon->is_reflex[p] || p == a || p == c)
            continue;
        clipper->tests_left--;
        if (turn(polygon, a, corner, p) >= 0 && turn(polygon, corner, c, p) >= 0 && turn(polygon, c, a, p) >= 0 &&
            !same_point(polygon, p, a) && !same_point(polygon, p, corner) && !same_point(polygon, p, c))
            return false;
    }
    return true;
}

/* Keeps the list of reflex corners short: those that turned convex or were clipped leave it. */
static void compact_reflex(ear_clipper *clipper)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < clipper->reflex_count; i++)
        if (clipper->polygon->is_reflex[clipper->polygon->reflex[i]])
            clipper->polygon->reflex[kept++] = clipper->polygon->reflex[i];
    clipper->reflex_count = kept;
}

static void update_reflex(strl__polygon *polygon, uint32_t corner)
{
    if (polygon->is_reflex[corner])
        polygon->is_reflex[corner] = !(turn(polygon, polygon->previous[corner], corner, polygon->next[corner]) > 0);
}

static void start_clipper(ear_clipper *clipper, uint32_t count)
{
    strl__polygon *polygon = clipper->polygon;
    for (uint32_t i = 0; i < count; i++) {
        polygon->previous[i] = i ? i - 1 : count - 1;
        polygon->next[i] = i + 1 < count ? i + 1 : 0;
    }
    for (uint32_t i = 0; i < count; i++) {
        polygon->is_reflex[i] = !(turn(polygon, polygon->previous[i], i, polygon->next[i]) > 0);
        if (polygon->is_reflex[i])
            polygon->reflex[clipper->reflex_count++] = i;
    }
}

static void clip_ears(strl__polygon *polygon, uint32_t count)
{
    ear_clipper clipper = {polygon, 0, (uint64_t)count * 512};
    start_clipper(&clipper, count);
    uint32_t corner = 1, tried = 0, left = count;
    for (uint32_t index = 0; index < count - 2;) {
        /* A whole round without an ear: the polygon crosses itself or is flat. Any corner then
         * goes. */
        if (tried < left && clipper.tests_left && left > 3 && !is_ear(&clipper, corner)) {
            corner = polygon->next[corner];
            tried++;
            continue;
        }
        uint32_t before = polygon->previous[corner], after = polygon->next[corner];
        emit(polygon, index++, before, corner, after);
        polygon->next[before] = after;
        polygon->previous[after] = before;
        polygon->is_reflex[corner] = 0;
        update_reflex(polygon, before);
        update_reflex(polygon, after);
        if (index % 16 == 0)
            compact_reflex(&clipper);
        left--;
        tried = 0;
        corner = polygon->next[after]; /* not the neighbour: that would make slivers */
    }
}

bool strl__polygon_triangulate(strl__polygon *polygon, const double *positions, size_t stride_bytes,
                               uint32_t corner_count)
{
    if (!reserve(polygon, corner_count))
        return false;
    project(polygon, positions, stride_bytes, corner_count);
    if (!fan(polygon, corner_count))
        clip_ears(polygon, corner_count);
    return true;
}
