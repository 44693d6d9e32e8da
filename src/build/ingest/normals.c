#include "build/ingest/normals.h"

#include <math.h>
#include <string.h>

#include "base/hash.h"
#include "geometry/octahedral.h"

#define CREASE_COSINE 0.76604444f /* 40 degrees */
#define MOST_FACES 1024u /* round one position; the rest has no say */
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

typedef struct fan_table {
    uint32_t *head; /* first corner of the slot's position; NO_INDEX = free */
    uint32_t *next; /* [3 * count] next corner at the same position */
    uint32_t *slot; /* [3 * count] of the corner's position */
    uint32_t *tail; /* its last corner; as soon as a normal is made there, the corner that got it */
    uint32_t mask;
} fan_table;

static uint32_t slot_of(const fan_table *table, const strl_soup_triangle *triangles, const uint32_t position[3])
{
    uint64_t hash = strl__mix64(((uint64_t)position[0] << 32 | position[1]) ^ strl__mix64(position[2]));
    uint32_t at = (uint32_t)hash & table->mask;
    while (table->head[at] != NO_INDEX &&
           memcmp(triangles[table->head[at] / 3].corner[table->head[at] % 3].position, position, 12))
        at = (at + 1) & table->mask;
    return at;
}

static bool build_fans(fan_table *table, const strl_soup_triangle *triangles, uint32_t count, strl_arena *scratch)
{
    uint32_t size = 16;
    while (size < 6 * count)
        size *= 2;
    table->mask = size - 1;
    table->head = strl_arena_alloc(scratch, size, sizeof *table->head);
    table->tail = strl_arena_alloc(scratch, size, sizeof *table->tail);
    table->next = strl_arena_alloc(scratch, (size_t)count * 3, sizeof *table->next);
    table->slot = strl_arena_alloc(scratch, (size_t)count * 3, sizeof *table->slot);
    if (!table->head || !table->tail || !table->next || !table->slot)
        return false;
    memset(table->head, 0xff, size * sizeof *table->head);
    for (uint32_t corner = 0; corner < 3 * count; corner++) {
        uint32_t at = slot_of(table, triangles, triangles[corner / 3].corner[corner % 3].position);
        table->slot[corner] = at;
        table->next[corner] = NO_INDEX;
        if (table->head[at] == NO_INDEX)
            table->head[at] = corner;
        else
            table->next[table->tail[at]] = corner;
        table->tail[at] = corner;
    }
    return true;
}

static void fill_corner(const fan_table *table, const face_facts *faces, strl_soup_triangle *triangles, uint32_t corner)
{
    strl_soup_corner *own = &triangles[corner / 3].corner[corner % 3];
    const float *axis = faces[corner / 3].normal;
    uint32_t *last = &table->tail[table->slot[corner]];
    float sum[3] = {0};
    uint32_t seen = 0;
    if (*last < corner && memcmp(faces[*last / 3].normal, axis, sizeof faces->normal) == 0) {
        memcpy(own->normal, triangles[*last / 3].corner[*last % 3].normal, sizeof own->normal);
        return; /* faces in one plane: what many equal triangles are */
    }
    *last = corner;
    for (uint32_t c = table->head[table->slot[corner]]; c != NO_INDEX && seen < MOST_FACES;
         c = table->next[c], seen++) {
        const float *n = faces[c / 3].normal;
        if (n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2] < CREASE_COSINE)
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += faces[c / 3].angle[c % 3] * n[k];
    }
    bool any = sum[0] != 0 || sum[1] != 0 || sum[2] != 0;
    strl_oct_encode(any ? sum : axis, own->normal);
}

bool strl__fill_normals(strl_soup_triangle *triangles, const bool *wanted, uint32_t count, strl_arena *scratch)
{
    strl_arena_mark mark = strl_arena_get_mark(scratch);
    fan_table table;
    face_facts *faces = strl_arena_alloc(scratch, count, sizeof *faces);
    bool good = faces && build_fans(&table, triangles, count, scratch);
    for (uint32_t t = 0; t < count && good; t++)
        faces[t] = face_of(&triangles[t]);
    for (uint32_t corner = 0; corner < 3 * count && good; corner++)
        if (wanted[corner / 3] && triangles[corner / 3].corner[corner % 3].normal[0] == STRL_NORMAL_MISSING)
            fill_corner(&table, faces, triangles, corner);
    strl_arena_rewind(scratch, mark);
    return good;
}
