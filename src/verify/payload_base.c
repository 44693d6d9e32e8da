/* docs/format-payload.md, "Base mesh". Names are that text's. */
#include <string.h>

#include "base/fail.h"
#include "verify/payload.h"

#define NONE UINT32_MAX
#define MOST_DEGREE 6u

enum { NEW, RIGHT, LEFT, BORDER, SPLIT, TWIN };
enum { LIVE, DEAD, REMOVED };

typedef struct front_gate {
    uint32_t start, end, behind, next, previous;
    unsigned state;
} front_gate;

typedef struct front {
    strl__v_payload *payload;
    front_gate *gates;
    uint32_t gate_count, current, oldest;
    uint32_t *at;    /* [Vb] */
    uint8_t *degree; /* [Vb] */
} front;

static strl_status refuse(const front *self, const char *what)
{
    return strl__fail(self->payload->err, STRL_ERR_FORMAT, "base mesh, triangle %u: %s", self->payload->triangle_count,
                      what);
}

static void set_gate(front *self, uint32_t g, uint32_t start, uint32_t end, uint32_t behind)
{
    front_gate *gate = &self->gates[g];
    gate->start = start;
    gate->end = end;
    gate->behind = behind;
    gate->state = LIVE;
    self->at[start] = g;
}

static void link_gates(front *self, uint32_t g, uint32_t h)
{
    self->gates[g].next = h;
    self->gates[h].previous = g;
}

static bool closes(const front *self, uint32_t x)
{
    uint32_t n = self->gates[x].next;
    return n != x && self->gates[x].state == LIVE && self->gates[n].state == LIVE &&
           self->gates[n].end == self->gates[x].start;
}

static uint32_t zip(front *self, uint32_t g)
{
    uint32_t x = closes(self, g) ? g : self->gates[g].previous, result = g;
    while (closes(self, x)) {
        uint32_t o = self->gates[x].next, p = self->gates[x].previous;
        result = self->gates[o].next;
        self->gates[x].state = self->gates[o].state = REMOVED;
        if (result == x)
            return NONE;
        link_gates(self, p, result);
        self->at[self->gates[result].start] = result;
        x = p;
    }
    return result;
}

/* ---- vertices ---- */

static bool new_vertex(front *self, const uint32_t predicted[3], uint32_t from, uint32_t *number)
{
    strl__v_payload *p = self->payload;
    if (p->vertex_count == p->base_vertices)
        return false;
    *number = p->vertex_count++;
    for (unsigned k = 0; k < 3; k++)
        p->mesh->position[*number][k] = (int32_t)(predicted[k] + strl__v_residual(p, STRL__V_BASE + k));
    p->from[*number] = (uint16_t)from;
    return true;
}

static bool earlier_vertex(const strl__v_payload *p, uint32_t distance, uint32_t *number)
{
    if (distance >= p->vertex_count)
        return false;
    *number = p->vertex_count - 1 - distance;
    return true;
}

static bool new_twin(front *self, uint32_t *number)
{
    strl__v_payload *p = self->payload;
    uint32_t q;
    if (p->vertex_count == p->base_vertices || !earlier_vertex(p, strl__v_pull(p, STRL__V_TWIN), &q))
        return false;
    *number = p->vertex_count++;
    memcpy(p->mesh->position[*number], p->mesh->position[q], sizeof *p->mesh->position);
    strl__v_join(p, *number, q);
    p->from[*number] = (uint16_t)q;
    return true;
}

static void position_of(const strl__v_payload *p, uint32_t v, uint32_t out[3])
{
    for (unsigned k = 0; k < 3; k++)
        out[k] = (uint32_t)p->mesh->position[v][k];
}

/* ---- triangles ---- */

static bool add_triangle(front *self, uint32_t a, uint32_t b, uint32_t c)
{
    const uint32_t corners[3] = {a, b, c};
    if (!strl__v_add_triangle(self->payload, a, b, c))
        return false;
    for (unsigned k = 0; k < 3; k++)
        self->degree[corners[k]] += self->degree[corners[k]] < MOST_DEGREE;
    return true;
}

static bool seed_corner(front *self, unsigned k, const uint32_t *before, uint32_t *corner)
{
    strl__v_payload *p = self->payload;
    uint32_t value = strl__v_pull(p, STRL__V_SEED), predicted[3] = {0, 0, 0};
    if (value == 1)
        return new_twin(self, corner);
    if (value > 1)
        return earlier_vertex(p, value - 2, corner);
    uint32_t from = k ? *before : p->vertex_count ? p->vertex_count - 1 : NONE;
    if (from != NONE)
        position_of(p, from, predicted);
    return new_vertex(self, predicted, from == NONE ? 0 : from, corner);
}

static strl_status seed(front *self)
{
    uint32_t c[3] = {0, 0, 0}, g = self->gate_count;
    for (unsigned k = 0; k < 3; k++)
        if (!seed_corner(self, k, k ? &c[k - 1] : NULL, &c[k]))
            return refuse(self, "a seed's corner is out of range");
    if (!add_triangle(self, c[0], c[1], c[2]))
        return refuse(self, "a seed's corners share a position");
    self->gate_count += 3;
    for (unsigned k = 0; k < 3; k++)
        set_gate(self, g + k, c[k], c[(k + 1) % 3], c[(k + 2) % 3]);
    for (unsigned k = 0; k < 3; k++)
        link_gates(self, g + k, g + (k + 1) % 3);
    self->current = g;
    return STRL_OK;
}

static bool third_vertex(front *self, unsigned operation, uint32_t *c)
{
    strl__v_payload *p = self->payload;
    const front_gate *g = &self->gates[self->current];
    if (operation == RIGHT || operation == LEFT) {
        *c = operation == RIGHT ? self->gates[g->next].end : self->gates[g->previous].start;
        return true;
    }
    if (operation == SPLIT)
        return earlier_vertex(p, strl__v_pull(p, STRL__V_REFERENCE), c);
    if (operation == TWIN)
        return new_twin(self, c);
    uint32_t predicted[3];
    for (unsigned k = 0; k < 3; k++)
        predicted[k] = (uint32_t)p->mesh->position[g->start][k] + (uint32_t)p->mesh->position[g->end][k] -
                       (uint32_t)p->mesh->position[g->behind][k];
    return new_vertex(self, predicted, g->start, c);
}

static void change_gates(front *self, unsigned operation, uint32_t c)
{
    uint32_t g = self->current, a = self->gates[g].start, b = self->gates[g].end, n = self->gates[g].next;
    if (operation == RIGHT) {
        self->gates[n].state = REMOVED;
        link_gates(self, g, self->gates[n].next);
        set_gate(self, g, a, c, b);
        self->current = zip(self, g);
        return;
    }
    if (operation == LEFT) {
        uint32_t p = self->gates[g].previous;
        self->gates[p].state = REMOVED;
        link_gates(self, self->gates[p].previous, g);
        set_gate(self, g, c, b, a);
        self->current = zip(self, g);
        return;
    }
    uint32_t h = self->gate_count++, k = operation == SPLIT ? self->at[c] : NONE;
    if (k != NONE && self->gates[k].state != REMOVED) {
        link_gates(self, self->gates[k].previous, h);
        link_gates(self, g, k);
    } else {
        link_gates(self, g, h);
    }
    link_gates(self, h, n);
    set_gate(self, g, a, c, b);
    set_gate(self, h, c, b, a);
    self->current = h;
    if (operation == SPLIT) {
        zip(self, g);
        self->current = self->gates[h].state == LIVE ? zip(self, h) : NONE;
    }
}

static strl_status advance(front *self)
{
    front_gate *g = &self->gates[self->current];
    uint32_t operation = strl__v_pull(self->payload, STRL__V_OPERATION + self->degree[g->end] - 1u), c;
    if (self->payload->starved || operation > TWIN)
        return refuse(self, "an operation is missing or unknown");
    if (operation == BORDER) {
        g->state = DEAD;
        self->current = g->next;
        return STRL_OK;
    }
    if (!third_vertex(self, operation, &c))
        return refuse(self, "a vertex is out of range");
    if (c == g->start || c == g->end || !add_triangle(self, g->end, g->start, c))
        return refuse(self, "two corners share a position");
    change_gates(self, operation, c);
    return STRL_OK;
}

static void settle(front *self)
{
    if (self->current != NONE && self->gates[self->current].state == LIVE)
        return;
    while (self->oldest < self->gate_count && self->gates[self->oldest].state != LIVE)
        self->oldest++;
    self->current = self->oldest < self->gate_count ? self->oldest : NONE;
}

static strl_status loose_vertices(front *self)
{
    strl__v_payload *p = self->payload;
    while (p->vertex_count < p->base_vertices) {
        uint32_t predicted[3] = {0, 0, 0}, number, from = p->vertex_count ? p->vertex_count - 1 : 0;
        if (p->vertex_count)
            position_of(p, from, predicted);
        new_vertex(self, predicted, from, &number);
    }
    return STRL_OK;
}

strl_status strl__v_payload_base(strl__v_payload *payload)
{
    front self = {.payload = payload, .current = NONE};
    /* A triangle makes three gates at most. */
    self.gates = strl_arena_alloc(payload->arena, 3 * (size_t)payload->base_triangles, sizeof *self.gates);
    self.at = strl_arena_alloc(payload->arena, payload->base_vertices, sizeof *self.at);
    self.degree = strl_arena_alloc_zero(payload->arena, payload->base_vertices, 1);
    if (!self.gates || !self.at || !self.degree)
        return strl__fail(payload->err, STRL_ERR_MEMORY, "no memory for %u base triangles", payload->base_triangles);
    memset(self.at, 0xff, (size_t)payload->base_vertices * sizeof *self.at);
    strl_status status = STRL_OK;
    while (status == STRL_OK && payload->triangle_count < payload->base_triangles) {
        settle(&self);
        status = self.current == NONE ? seed(&self) : advance(&self);
    }
    if (status == STRL_OK)
        status = loose_vertices(&self);
    payload->mesh->vertex_end[0] = payload->vertex_count;
    payload->mesh->triangle_end[0] = payload->triangle_count;
    return status;
}
