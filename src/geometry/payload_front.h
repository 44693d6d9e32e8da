/* The front of the base mesh's traversal: rings of gates, as in the cut-border machine (Gumhold and Strasser 1998). A
 * gate is a directed edge of a known triangle behind which the next triangle may lie; consecutive gates of a ring share
 * a vertex. Encoder and decoder run the same operations. docs/format-payload.md, "Base mesh", is normative. Internal to
 * the payload codec. */
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

/* Makes the live gate with the smallest number current, or none. */
void strl__front_find_oldest(struct strl__front *front);

/* The gate to treat next is made current: the current one if it lives, else the oldest that does, else none. */
static inline void strl__front_settle(struct strl__front *front)
{
    if (front->current == STRL__NONE || front->gate[front->current].state != STRL__GATE_LIVE)
        strl__front_find_oldest(front);
}

static inline unsigned strl__front_context(const struct strl__front *front)
{
    return front->degree[front->gate[front->current].end] - 1u;
}

static inline void strl__front_count(struct strl__front *front, uint32_t vertex)
{
    front->degree[vertex] += front->degree[vertex] < STRL__OPERATION_CONTEXTS;
}

static inline void strl__gates_join(struct strl__front *front, uint32_t gate, uint32_t next)
{
    front->gate[gate].next = next;
    front->gate[next].previous = gate;
}

static inline void strl__gate_set(struct strl__front *front, uint32_t gate, uint32_t start, uint32_t end,
                                  uint32_t behind)
{
    struct strl__gate *g = &front->gate[gate];
    g->start = (uint16_t)start;
    g->end = (uint16_t)end;
    g->behind = (uint16_t)behind;
    g->state = STRL__GATE_LIVE;
    front->gate_at[start] = gate;
}

/* Whether a gate and the next one are the two sides of one edge. */
static inline bool strl__gate_closes(const struct strl__front *front, uint32_t gate)
{
    const struct strl__gate *g = &front->gate[gate], *n = &front->gate[g->next];
    return n->end == g->start && g->next != gate && g->state == STRL__GATE_LIVE && n->state == STRL__GATE_LIVE;
}

/* Takes pairs of gates that are the two sides of one edge out of the ring, beginning at `gate`. Returns the gate to go
 * on with, or STRL__NONE where the ring is used up. */
uint32_t strl__front_zip(struct strl__front *front, uint32_t gate);

/* A triangle (a, b, c) apart from all gates: its three edges become a ring. */
void strl__front_seed(struct strl__front *front, uint32_t a, uint32_t b, uint32_t c);

/* STRL__OP_SPLIT: the current gate (a, b) becomes (a, c), followed by a new gate (c, b). Where c lies on a ring, the
 * rings are cut and joined there. */
void strl__front_split(struct strl__front *front, uint32_t c);

/* Applies an operation to the current gate; c: the new triangle's third vertex, unless it is STRL__OP_BORDER. */
static inline void strl__front_apply(struct strl__front *front, unsigned operation, uint32_t c)
{
    uint32_t g = front->current;
    struct strl__gate *gate = &front->gate[g];
    uint32_t a = gate->start, b = gate->end, next = gate->next, previous = gate->previous;
    if (operation == STRL__OP_NEW || operation == STRL__OP_TWIN) {
        uint32_t added = front->gate_count++;
        strl__gates_join(front, g, added);
        strl__gates_join(front, added, next);
        strl__gate_set(front, g, a, c, b);
        strl__gate_set(front, added, c, b, a);
        front->current = added;
    } else if (operation == STRL__OP_RIGHT || operation == STRL__OP_LEFT) {
        bool right = operation == STRL__OP_RIGHT;
        front->gate[right ? next : previous].state = STRL__GATE_REMOVED;
        if (right) {
            strl__gates_join(front, g, front->gate[next].next);
            strl__gate_set(front, g, a, c, b);
        } else {
            strl__gates_join(front, front->gate[previous].previous, g);
            strl__gate_set(front, g, c, b, a);
        }
        front->current = strl__front_zip(front, g);
    } else if (operation == STRL__OP_SPLIT) {
        strl__front_split(front, c);
    } else {
        gate->state = STRL__GATE_DEAD;
        front->current = next;
    }
}

#endif
