/* Identical faces in great number: no collapse can reduce them without losing the surface, so above the leaves they go
 * in pairs. An edge keeps its parity, and every node keeps a face at every place. */
#include <math.h>
#include <string.h>

#include "base/hash.h"
#include "build/clusters/hierarchy.h"

/* A face by its points, rotated so that the least comes first: faces of opposite orientation differ. */
typedef struct face_slot {
    uint32_t point[3], owner;
    uint32_t count;   /* 0 = free */
    uint32_t drop;    /* how many of them are still to go */
    strl_drift drift; /* of all of them */
} face_slot;

static face_slot *find_face(face_slot *slots, uint32_t mask, const strl_mesh *mesh, const uint32_t *owner,
                            uint32_t triangle)
{
    uint32_t point[3], least = 0;
    for (uint32_t c = 1; c < 3; c++)
        if (mesh->wedge[mesh->triangle[triangle][c]].point < mesh->wedge[mesh->triangle[triangle][least]].point)
            least = c;
    for (uint32_t c = 0; c < 3; c++)
        point[c] = mesh->wedge[mesh->triangle[triangle][(least + c) % 3]].point;
    uint32_t at = (uint32_t)strl__mix64(((uint64_t)point[0] << 32 | point[1]) ^
                                        strl__mix64((uint64_t)point[2] << 32 | owner[triangle])) &
                  mask;
    while (slots[at].count && (slots[at].owner != owner[triangle] || memcmp(slots[at].point, point, sizeof point)))
        at = (at + 1) & mask;
    memcpy(slots[at].point, point, sizeof point);
    slots[at].owner = owner[triangle];
    return &slots[at];
}

bool strl__drop_duplicate_pairs(strl_mesh *mesh, uint32_t *owner, uint32_t *dropped, strl_arena *arena)
{
    uint32_t size = 16, to = 0;
    while (size < 2 * mesh->triangle_count)
        size *= 2;
    face_slot *slots = strl_arena_alloc_zero(arena, size, sizeof *slots);
    if (!slots)
        return false;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        face_slot *face = find_face(slots, size - 1, mesh, owner, t);
        face->drop = face->count++ & 1 ? face->drop : face->count - 1; /* an even number of them */
        for (int k = 0; k < 3; k++) {
            face->drift.least[k] = fminf(face->drift.least[k], mesh->drift[t].least[k]);
            face->drift.most[k] = fmaxf(face->drift.most[k], mesh->drift[t].most[k]);
        }
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        face_slot *face = find_face(slots, size - 1, mesh, owner, t);
        if (face->drop) {
            face->drop--;
            continue;
        }
        memcpy(mesh->triangle[to], mesh->triangle[t], sizeof *mesh->triangle);
        mesh->drift[to] = face->drift;
        mesh->deviation[to] = mesh->deviation[t];
        mesh->shift[to] = mesh->shift[t];
        owner[to++] = owner[t];
    }
    *dropped = mesh->triangle_count - to;
    mesh->triangle_count = to;
    return true;
}
