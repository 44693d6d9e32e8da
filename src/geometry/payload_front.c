#include "geometry/payload_front.h"

bool strl__front_init(struct strl__front *front, uint32_t vertices, uint32_t triangles, strl_arena *scratch)
{
    *front = (struct strl__front){.current = STRL__NONE};
    front->gate = strl_arena_alloc(scratch, (size_t)triangles * 3, sizeof *front->gate);
    front->gate_at = strl_arena_alloc(scratch, vertices, sizeof *front->gate_at);
    front->degree = strl_arena_alloc_zero(scratch, vertices, sizeof *front->degree);
    if (!front->gate || !front->gate_at || !front->degree)
        return false;
    for (uint32_t v = 0; v < vertices; v++)
        front->gate_at[v] = STRL__NONE;
    return true;
}

void strl__front_settle(struct strl__front *front)
{
    if (front->current != STRL__NONE && front->gate[front->current].state == STRL__GATE_LIVE)
        return;
    while (front->oldest < front->gate_count && front->gate[front->oldest].state != STRL__GATE_LIVE)
        front->oldest++;
    front->current = front->oldest < front->gate_count ? front->oldest : STRL__NONE;
}

static void join(struct strl__front *front, uint32_t gate, uint32_t next)
{
    front->gate[gate].next = next;
    front->gate[next].previous = gate;
}

static void set_gate(struct strl__front *front, uint32_t gate, uint32_t start, uint32_t end, uint32_t behind)
{
    struct strl__gate *g = &front->gate[gate];
    g->start = (uint16_t)start;
    g->end = (uint16_t)end;
    g->behind = (uint16_t)behind;
    g->state = STRL__GATE_LIVE;
    front->gate_at[start] = gate;
}

void strl__front_seed(struct strl__front *front, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t first = front->gate_count;
    front->gate_count += 3;
    set_gate(front, first, a, b, c);
    set_gate(front, first + 1, b, c, a);
    set_gate(front, first + 2, c, a, b);
    join(front, first, first + 1);
    join(front, first + 1, first + 2);
    join(front, first + 2, first);
    front->current = first;
}

/* Whether a gate and the next one are the two sides of one edge. */
static bool closes(const struct strl__front *front, uint32_t gate)
{
    const struct strl__gate *g = &front->gate[gate], *n = &front->gate[g->next];
    return g->next != gate && g->state == STRL__GATE_LIVE && n->state == STRL__GATE_LIVE && n->end == g->start;
}

/* Takes pairs of gates that are the two sides of one edge out of the ring, beginning at `gate`. Returns the gate to go on with,
 * or STRL__NONE where the ring is used up. */
static uint32_t zip(struct strl__front *front, uint32_t gate)
{
    uint32_t at = closes(front, gate) ? gate : front->gate[gate].previous;
    uint32_t result = gate;
    while (closes(front, at)) {
        uint32_t other = front->gate[at].next, previous = front->gate[at].previous;
        result = front->gate[other].next;
        front->gate[at].state = front->gate[other].state = STRL__GATE_REMOVED;
        if (result == at)
            return STRL__NONE;
        join(front, previous, result);
        front->gate_at[front->gate[result].start] = result;
        at = previous;
    }
    return result;
}

/* The gate g becomes (a, c), followed by a new gate (c, b). Where c lies on a ring, the rings are cut and joined there. */
static uint32_t insert(struct strl__front *front, uint32_t g, uint32_t c)
{
    uint32_t a = front->gate[g].start, b = front->gate[g].end, next = front->gate[g].next;
    uint32_t there = front->gate_at[c], added = front->gate_count++;
    if (there != STRL__NONE && front->gate[there].state != STRL__GATE_REMOVED) {
        uint32_t before = front->gate[there].previous;
        join(front, before, added);
        join(front, g, there);
    } else {
        join(front, g, added);
    }
    join(front, added, next);
    set_gate(front, g, a, c, b);
    set_gate(front, added, c, b, a);
    return added;
}

void strl__front_apply(struct strl__front *front, unsigned operation, uint32_t c)
{
    uint32_t g = front->current;
    struct strl__gate *gate = &front->gate[g];
    uint32_t a = gate->start, b = gate->end;
    if (operation == STRL__OP_BORDER) {
        gate->state = STRL__GATE_DEAD;
        front->current = gate->next;
    } else if (operation == STRL__OP_RIGHT) {
        front->gate[gate->next].state = STRL__GATE_REMOVED;
        join(front, g, front->gate[gate->next].next);
        set_gate(front, g, a, c, b);
        front->current = zip(front, g);
    } else if (operation == STRL__OP_LEFT) {
        front->gate[gate->previous].state = STRL__GATE_REMOVED;
        join(front, front->gate[gate->previous].previous, g);
        set_gate(front, g, c, b, a);
        front->current = zip(front, g);
    } else {
        uint32_t added = insert(front, g, c);
        front->current = added;
        if (operation == STRL__OP_SPLIT) {
            zip(front, g);
            front->current = front->gate[added].state == STRL__GATE_LIVE ? zip(front, added) : STRL__NONE;
        }
    }
}
