#include "build/ingest/normals.h"

#include <math.h>
#include <string.h>

#include "base/hash.h"
#include "geometry/octahedral.h"

#define CREASE_COSINE 0.76604444f /* 40 degrees */
#define MOST_FACES 1024u          /* round one position; the rest has no say */
#define NO_INDEX UINT32_MAX

typedef struct face_facts {
    float normal[3]; /* unit; zero where the face has no area */
    float angle[3];
} face_facts;

static face_facts face_of(const strl_soup_triangle *triangle)
{
    face_facts face = {0};
    double edge[3][3], length[3], n[3];
    for (int c = 0; c < 3; c++) {
        for (int k = 0; k < 3; k++)
            edge[c][k] = (double)triangle->corner[(c + 1) % 3].position[k] - triangle->corner[c].position[k];
        length[c] = sqrt(edge[c][0] * edge[c][0] + edge[c][1] * edge[c][1] + edge[c][2] * edge[c][2]);
    }
    n[0] = edge[0][1] * edge[1][2] - edge[0][2] * edge[1][1];
    n[1] = edge[0][2] * edge[1][0] - edge[0][0] * edge[1][2];
    n[2] = edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0];
    double area = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3 && area > 0; k++)
        face.normal[k] = (float)(n[k] / area);
    for (int c = 0; c < 3; c++) {
        const double *a = edge[c], *b = edge[(c + 2) % 3];
        double cosine = -(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (length[c] * length[(c + 2) % 3]);
        face.angle[c] = acosf((float)fmax(-1, fmin(1, cosine)));
    }
    return face;
}

/* The corners at each position. Positions are numbered as they come, so that what lies side by side in space does in
 * memory. */
typedef struct fans {
    uint32_t *position; /* [3 * count] of each corner */
    uint32_t *first;    /* [positions + 1] into corner[] */
    uint32_t *corner;   /* [3 * count] by position, ascending */
    uint32_t positions;
} fans;

/* First corner of each position, by hash. */
typedef struct corner_table {
    uint32_t *head; /* [mask + 1] NO_INDEX = free */
    uint32_t mask;
} corner_table;

#define AHEAD 48u /* corners whose places in the table are asked for before they are looked at */

static uint32_t place_of(const corner_table *table, const uint32_t position[3])
{
    uint64_t hash = strl__mix64(((uint64_t)position[0] << 32 | position[1]) ^ strl__mix64(position[2]));
    return (uint32_t)hash & table->mask;
}

/* The corner that has this position already, or `corner` from now on. */
static uint32_t find_first(corner_table *table, const strl_soup_triangle *triangles, uint32_t at, uint32_t corner)
{
    const uint32_t *position = triangles[corner / 3].corner[corner % 3].position;
    while (table->head[at] != NO_INDEX) {
        uint32_t other = table->head[at];
        if (memcmp(triangles[other / 3].corner[other % 3].position, position, sizeof triangles->corner->position) == 0)
            return other;
        at = (at + 1) & table->mask;
    }
    table->head[at] = corner;
    return corner;
}

static void number_positions(fans *f, corner_table *table, const strl_soup_triangle *triangles, uint32_t corners)
{
    uint32_t place[AHEAD];
    f->positions = 0;
    for (uint32_t begin = 0; begin < corners; begin += AHEAD) {
        uint32_t count = corners - begin < AHEAD ? corners - begin : AHEAD;
        for (uint32_t i = 0; i < count; i++) {
            place[i] = place_of(table, triangles[(begin + i) / 3].corner[(begin + i) % 3].position);
            __builtin_prefetch(&table->head[place[i]], 1);
        }
        for (uint32_t i = 0; i < count; i++) {
            uint32_t first = find_first(table, triangles, place[i], begin + i);
            f->position[begin + i] = first == begin + i ? f->positions++ : f->position[first];
        }
    }
}

/* Their places are counted, and then filled from the last on. */
static bool list_corners(fans *f, uint32_t corners, strl_arena *scratch)
{
    f->first = strl_arena_alloc_zero(scratch, (size_t)f->positions + 1, sizeof *f->first);
    f->corner = strl_arena_alloc(scratch, corners, sizeof *f->corner);
    if (!f->first || !f->corner)
        return false;
    for (uint32_t c = 0; c < corners; c++)
        f->first[f->position[c]]++;
    for (uint32_t p = 0; p < f->positions; p++)
        f->first[p + 1] += f->first[p];
    for (uint32_t c = corners; c-- > 0;)
        f->corner[--f->first[f->position[c]]] = c;
    return true;
}

static bool build_fans(fans *f, const strl_soup_triangle *triangles, uint32_t count, strl_arena *scratch)
{
    corner_table table = {.mask = 15};
    while (table.mask < 4 * count)
        table.mask = 2 * table.mask + 1;
    table.head = strl_arena_alloc(scratch, (size_t)table.mask + 1, sizeof *table.head);
    f->position = strl_arena_alloc(scratch, (size_t)count * 3, sizeof *f->position);
    if (!table.head || !f->position)
        return false;
    memset(table.head, 0xff, ((size_t)table.mask + 1) * sizeof *table.head);
    number_positions(f, &table, triangles, 3 * count);
    return list_corners(f, 3 * count, scratch);
}

/* Of the faces at one position. */
typedef struct fan_face {
    float normal[3], angle;
} fan_face;

static void mean_normal(const fan_face *face, uint32_t count, const float axis[3], uint16_t normal[2])
{
    float sum[3] = {0};
    for (uint32_t i = 0; i < count; i++) {
        const float *n = face[i].normal;
        if (n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2] < CREASE_COSINE)
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += face[i].angle * n[k];
    }
    bool any = sum[0] != 0 || sum[1] != 0 || sum[2] != 0;
    strl_oct_encode(any ? sum : axis, normal);
}

/* Faces in one plane have one normal: it is made once where they follow each other, as many equal triangles do. */
static void fill_position(const uint32_t *corners, uint32_t count, const face_facts *faces, const bool *wanted,
                          strl_soup_triangle *triangles)
{
    fan_face face[MOST_FACES];
    const uint32_t seen = count < MOST_FACES ? count : MOST_FACES;
    const float *last = NULL;
    const uint16_t *made = NULL;
    bool is_gathered = false;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t t = corners[i] / 3;
        uint16_t *normal = triangles[t].corner[corners[i] % 3].normal;
        if (!wanted[t] || normal[0] != STRL_NORMAL_MISSING)
            continue;
        for (uint32_t j = 0; j < seen && !is_gathered; j++) {
            memcpy(face[j].normal, faces[corners[j] / 3].normal, sizeof face->normal);
            face[j].angle = faces[corners[j] / 3].angle[corners[j] % 3];
        }
        is_gathered = true;
        if (last && memcmp(last, faces[t].normal, sizeof faces->normal) == 0)
            memcpy(normal, made, sizeof triangles->corner->normal);
        else
            mean_normal(face, seen, faces[t].normal, normal);
        last = faces[t].normal;
        made = normal;
    }
}

bool strl__fill_normals(strl_soup_triangle *triangles, const bool *wanted, uint32_t count, strl_arena *scratch)
{
    strl_arena_mark mark = strl_arena_get_mark(scratch);
    fans f;
    face_facts *faces = strl_arena_alloc(scratch, count, sizeof *faces);
    bool good = faces && build_fans(&f, triangles, count, scratch);
    for (uint32_t t = 0; t < count && good; t++)
        faces[t] = face_of(&triangles[t]);
    for (uint32_t p = 0; good && p < f.positions; p++)
        fill_position(f.corner + f.first[p], f.first[p + 1] - f.first[p], faces, wanted, triangles);
    strl_arena_rewind(scratch, mark);
    return good;
}
