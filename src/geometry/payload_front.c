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

void strl__front_find_oldest(struct strl__front *front)
{
    while (front->oldest < front->gate_count && front->gate[front->oldest].state != STRL__GATE_LIVE)
        front->oldest++;
    front->current = front->oldest < front->gate_count ? front->oldest : STRL__NONE;
}

void strl__front_seed(struct strl__front *front, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t first = front->gate_count;
    front->gate_count += 3;
    strl__gate_set(front, first, a, b, c);
    strl__gate_set(front, first + 1, b, c, a);
    strl__gate_set(front, first + 2, c, a, b);
    strl__gates_join(front, first, first + 1);
    strl__gates_join(front, first + 1, first + 2);
    strl__gates_join(front, first + 2, first);
    front->current = first;
}

uint32_t strl__front_zip(struct strl__front *front, uint32_t gate)
{
    uint32_t at = strl__gate_closes(front, gate) ? gate : front->gate[gate].previous, result = gate;
    while (strl__gate_closes(front, at)) {
        uint32_t other = front->gate[at].next, previous = front->gate[at].previous;
        result = front->gate[other].next;
        front->gate[at].state = front->gate[other].state = STRL__GATE_REMOVED;
        if (result == at)
            return STRL__NONE;
        strl__gates_join(front, previous, result);
        front->gate_at[front->gate[result].start] = result;
        at = previous;
    }
    return result;
}

void strl__front_split(struct strl__front *front, uint32_t c)
{
    uint32_t g = front->current, a = front->gate[g].start, b = front->gate[g].end, next = front->gate[g].next;
    uint32_t there = front->gate_at[c], added = front->gate_count++;
    if (there != STRL__NONE && front->gate[there].state != STRL__GATE_REMOVED) {
        uint32_t before = front->gate[there].previous;
        strl__gates_join(front, before, added);
        strl__gates_join(front, g, there);
    } else {
        strl__gates_join(front, g, added);
    }
    strl__gates_join(front, added, next);
    strl__gate_set(front, g, a, c, b);
    strl__gate_set(front, added, c, b, a);
    strl__front_zip(front, g);
    front->current = front->gate[added].state == STRL__GATE_LIVE ? strl__front_zip(front, added) : STRL__NONE;
}
