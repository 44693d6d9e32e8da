/* The front of the base mesh's traversal: rings of gates, as in the cut-border machine (Gumhold and Strasser 1998). A gate is a
 * directed edge of a known triangle behind which the next triangle may lie; consecutive gates of a ring share a vertex. Encoder
 * and decoder run the same operations. docs/format-payload.md, "Base mesh", is normative. Internal to the payload codec. */
#ifndef STRL_GEOMETRY_PAYLOAD_FRONT_H
#define STRL_GEOMETRY_PAYLOAD_FRONT_H

#include <stdbool.h>
#include <stdint.h>

#include "base/memory.h"
#include "geometry/payload_mesh.h"

/* What lies behind the gate (a, b): a triangle (b, a, c), or nothing. */
enum {
    STRL__OP_NEW,    /* c is a new vertex */
    STRL__OP_RIGHT,  /* c is where the next gate of the ring ends */
    STRL__OP_LEFT,   /* c is where the previous gate of the ring starts */
    STRL__OP_BORDER, /* nothing */
    STRL__OP_SPLIT,  /* c is an earlier vertex, referred to by its distance */
    STRL__OP_TWIN,   /* c is a new vertex at the position of an earlier one */
    STRL__OP_COUNT
};

enum { STRL__GATE_LIVE, STRL__GATE_DEAD, STRL__GATE_REMOVED };

struct strl__gate {
    uint16_t start, end, behind; /* behind: third vertex of the known triangle */
    uint16_t state;
    uint32_t previous, next;
};

struct strl__front {
    struct strl__gate *gate;
    uint32_t gate_count, current, oldest; /* current: STRL__NONE where the next triangle is a seed */
    uint32_t *gate_at;                    /* [vertices], the newest gate starting there, or STRL__NONE */
    uint8_t *degree;                      /* [vertices], triangles so far, no more than STRL__OPERATION_CONTEXTS */
};

bool strl__front_init(struct strl__front *front, uint32_t vertices, uint32_t triangles, strl_arena *scratch);

/* The gate to treat next is made current: the current one if it lives, else the oldest that does, else none. */
void strl__front_settle(struct strl__front *front);

static inline unsigned strl__front_context(const struct strl__front *front)
{
    return front->degree[front->gate[front->current].end] - 1u;
}

static inline void strl__front_count(struct strl__front *front, uint32_t vertex)
{
    front->degree[vertex] += front->degree[vertex] < STRL__OPERATION_CONTEXTS;
}

/* A triangle (a, b, c) apart from all gates: its three edges become a ring. */
void strl__front_seed(struct strl__front *front, uint32_t a, uint32_t b, uint32_t c);
/* Applies an operation to the current gate; c: the new triangle's third vertex, unless it is STRL__OP_BORDER. */
void strl__front_apply(struct strl__front *front, unsigned operation, uint32_t c);

#endif
