#include "render_normals.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define CREASE_COSINE 0.76604444f /* 40 degrees */
/* Faces looked at round one corner: a pole with a million faces would take a million squared. They are spread evenly
 * over all. */
#define MOST_FACES 2048u

typedef struct face {
    uint32_t corner[3]; /* position numbers */
    float normal[3];    /* unit; zero where the face has no area */
} face;

struct strl_smooth_normals {
    float (*position)[3];
    size_t position_count, position_capacity;
    uint32_t *slots; /* position number + 1 by hash; power of two */
    size_t slot_count;
    face *faces;
    size_t face_count, face_capacity;
    uint32_t *first;   /* [position_count + 1] into corners */
    uint32_t *corners; /* 3 * face + corner, grouped by position */
};

static strl_status fail_memory(const strl_smooth_normals *normals, strl_error *err)
{
    return strl__fail(err, STRL_ERR_MEMORY, "no memory for the normals of more than %zu triangles",
                      normals->face_count);
}

strl_status strl_smooth_normals_create(strl_smooth_normals **normals, strl_error *err)
{
    *normals = strl__alloc_zero(1, sizeof **normals);
    return *normals ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for normals");
}

void strl_smooth_normals_destroy(strl_smooth_normals *normals)
{
    if (!normals)
        return;
    strl__free(normals->position);
    strl__free(normals->slots);
    strl__free(normals->faces);
    strl__free(normals->first);
    strl__free(normals->corners);
    strl__free(normals);
}

static size_t slot_of(const strl_smooth_normals *normals, const float position[3])
{
    uint32_t bits[3];
    memcpy(bits, position, sizeof bits);
    size_t at = strl__mix64(((uint64_t)bits[0] << 32 | bits[1]) ^ strl__mix64(bits[2])) & (normals->slot_count - 1);
    while (normals->slots[at] && memcmp(normals->position[normals->slots[at] - 1], position, 3 * sizeof(float)) != 0)
        at = (at + 1) & (normals->slot_count - 1);
    return at;
}

static bool grow_slots(strl_smooth_normals *normals)
{
    if (normals->position_count * 2 < normals->slot_count)
        return true;
    size_t count = normals->slot_count ? normals->slot_count * 2 : 1024;
    uint32_t *slots = strl__alloc_zero(count, sizeof *slots);
    if (!slots)
        return false;
    strl__free(normals->slots);
    normals->slots = slots;
    normals->slot_count = count;
    for (size_t p = 0; p < normals->position_count; p++)
        slots[slot_of(normals, normals->position[p])] = (uint32_t)p + 1;
    return true;
}

static bool number_position(strl_smooth_normals *normals, const float position[3], uint32_t *number)
{
    /* Minus zero is zero: they are one place. */
    const float plain[3] = {position[0] + 0.f, position[1] + 0.f, position[2] + 0.f};
    if (!grow_slots(normals))
        return false;
    size_t at = slot_of(normals, plain);
    if (!normals->slots[at]) {
        if (normals->position_count >= UINT32_MAX - 1 ||
            !strl__grow(&normals->position, &normals->position_capacity, normals->position_count + 1,
                        sizeof *normals->position))
            return false;
        memcpy(normals->position[normals->position_count++], plain, sizeof plain);
        normals->slots[at] = (uint32_t)normals->position_count;
    }
    *number = normals->slots[at] - 1;
    return true;
}

strl_status strl_smooth_normals_add(strl_smooth_normals *normals, const float position[3][3], strl_error *err)
{
    if (normals->face_count >= UINT32_MAX / 3)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "more than %zu triangles without normals cannot be drawn as read; give the file normals",
                          normals->face_count);
    if (!strl__grow(&normals->faces, &normals->face_capacity, normals->face_count + 1, sizeof *normals->faces))
        return fail_memory(normals, err);
    face *made = &normals->faces[normals->face_count];
    double edge[2][3], n[3];
    for (int c = 0; c < 3; c++)
        if (!number_position(normals, position[c], &made->corner[c]))
            return fail_memory(normals, err);
    for (int i = 0; i < 3; i++) {
        edge[0][i] = (double)position[1][i] - position[0][i];
        edge[1][i] = (double)position[2][i] - position[0][i];
    }
    for (int i = 0; i < 3; i++)
        n[i] = edge[0][(i + 1) % 3] * edge[1][(i + 2) % 3] - edge[0][(i + 2) % 3] * edge[1][(i + 1) % 3];
    double area = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 3; i++)
        made->normal[i] = area > 0 ? (float)(n[i] / area) : 0;
    normals->face_count++;
    return STRL_OK;
}

strl_status strl_smooth_normals_finish(strl_smooth_normals *normals, strl_error *err)
{
    strl__free(normals->slots);
    normals->slots = NULL;
    normals->first = strl__alloc_zero(normals->position_count + 2, sizeof *normals->first);
    normals->corners = strl__alloc(normals->face_count * 3, sizeof *normals->corners);
    if (!normals->first || !normals->corners)
        return fail_memory(normals, err);
    /* Counting sort: first[p + 1] walks from the start of p's corners to their end. */
    for (size_t c = 0; c < 3 * normals->face_count; c++)
        normals->first[normals->faces[c / 3].corner[c % 3] + 2]++;
    for (size_t p = 2; p < normals->position_count + 2; p++)
        normals->first[p] += normals->first[p - 1];
    for (size_t c = 0; c < 3 * normals->face_count; c++)
        normals->corners[normals->first[normals->faces[c / 3].corner[c % 3] + 1]++] = (uint32_t)c;
    return STRL_OK;
}

static float angle_at(const strl_smooth_normals *normals, uint32_t corner)
{
    const face *of = &normals->faces[corner / 3];
    const float *p = normals->position[of->corner[corner % 3]];
    const float *q = normals->position[of->corner[(corner % 3 + 1) % 3]];
    const float *r = normals->position[of->corner[(corner % 3 + 2) % 3]];
    double a[3], b[3], aa = 0, bb = 0, ab = 0;
    for (int i = 0; i < 3; i++) {
        a[i] = (double)q[i] - p[i], b[i] = (double)r[i] - p[i];
        aa += a[i] * a[i], bb += b[i] * b[i], ab += a[i] * b[i];
    }
    double cosine = ab / sqrt(aa * bb);
    return cosine >= -1 && cosine <= 1 ? acosf((float)cosine) : cosine > 1 ? 0 : (float)M_PI;
}

void strl_smooth_normals_corner(const strl_smooth_normals *normals, uint64_t triangle, int corner, float normal[3])
{
    const face *own = &normals->faces[triangle];
    uint32_t position = own->corner[corner], begin = normals->first[position], end = normals->first[position + 1];
    uint32_t step = (end - begin) / MOST_FACES + 1;
    float sum[3] = {0};
    for (uint32_t at = begin; at < end; at += step) {
        const float *n = normals->faces[normals->corners[at] / 3].normal;
        if (n[0] * own->normal[0] + n[1] * own->normal[1] + n[2] * own->normal[2] < CREASE_COSINE)
            continue;
        float angle = angle_at(normals, normals->corners[at]);
        for (int i = 0; i < 3; i++)
            sum[i] += angle * n[i];
    }
    bool empty = sum[0] == 0 && sum[1] == 0 && sum[2] == 0;
    memcpy(normal, empty ? own->normal : sum, 3 * sizeof *normal);
}
