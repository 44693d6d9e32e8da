/* docs/format-payload.md, "Copies". */
#include "base/fail.h"
#include "verify/payload.h"

#define NONE UINT32_MAX

typedef struct copying {
    strl__v_payload *payload;
    const strl__vmesh *from;
    uint32_t *copy;     /* [its vertices] number of the copy, or NONE */
    bool *taken, *left; /* [its vertices] a triangle at it was */
    uint32_t run[4];    /* what is left of a context's run */
    bool leaving[4];
} copying;

static unsigned context_of(const copying *self, const uint16_t corners[3])
{
    unsigned context = 0;
    for (unsigned k = 0; k < 3; k++) {
        bool taken = self->taken[corners[k]], left = self->left[corners[k]];
        context |= taken && !left ? 1u : 0u;
        context |= left && !taken ? 2u : 0u;
    }
    return context;
}

/* False where there is no run left. */
static bool next_choice(copying *self, const uint16_t corners[3], bool *leave)
{
    unsigned context = context_of(self, corners);
    while (self->run[context] == 0) {
        self->run[context] = strl__v_pull(self->payload, STRL__V_SELECT + context);
        self->leaving[context] = !self->leaving[context];
        if (self->payload->starved)
            return false;
    }
    self->run[context]--;
    *leave = self->leaving[context];
    return true;
}

static bool copy_vertex(copying *self, uint32_t vertex, uint32_t before)
{
    strl__v_payload *p = self->payload;
    uint32_t number = p->vertex_count;
    if (number == p->base_vertices)
        return false;
    for (unsigned k = 0; k < 3; k++)
        p->mesh->position[number][k] = (int32_t)((uint32_t)self->from->position[vertex][k] + p->offset[k]);
    p->from[number] = (uint16_t)before;
    p->copied_from[number] = (uint16_t)vertex;
    self->copy[vertex] = p->vertex_count++;
    return true;
}

static bool copy_triangle(copying *self, const uint16_t corners[3])
{
    strl__v_payload *p = self->payload;
    uint32_t before = p->vertex_count ? p->vertex_count - 1 : 0;
    if (p->triangle_count == p->base_triangles)
        return false;
    for (unsigned k = 0; k < 3; k++) {
        if (self->copy[corners[k]] == NONE && !copy_vertex(self, corners[k], before))
            return false;
        before = self->copy[corners[k]];
    }
    return strl__v_add_triangle(p, self->copy[corners[0]], self->copy[corners[1]], self->copy[corners[2]]);
}

strl_status strl__v_payload_copies(strl__v_payload *payload)
{
    copying self = {.payload = payload, .from = payload->told_by, .leaving = {true, true, true, true}};
    if (!self.from)
        return STRL_OK;
    uint32_t vertices = self.from->vertex_count;
    self.copy = strl_arena_alloc(payload->arena, vertices, sizeof *self.copy);
    self.taken = strl_arena_alloc_zero(payload->arena, vertices, sizeof *self.taken);
    self.left = strl_arena_alloc_zero(payload->arena, vertices, sizeof *self.left);
    payload->copied_from = strl_arena_alloc(payload->arena, payload->base_vertices, sizeof *payload->copied_from);
    if (!self.copy || !self.taken || !self.left || !payload->copied_from)
        return strl__fail(payload->err, STRL_ERR_MEMORY, "no memory for copies of %u vertices", vertices);
    memset(self.copy, 0xff, vertices * sizeof *self.copy);
    for (uint32_t t = 0; t < self.from->triangle_count; t++) {
        const uint16_t *corners = self.from->triangle[t];
        bool leave;
        if (!next_choice(&self, corners, &leave) || (!leave && !copy_triangle(&self, corners)))
            return strl__fail(payload->err, STRL_ERR_FORMAT, "copies, triangle %u of the parent: out of range", t);
        for (unsigned k = 0; k < 3; k++)
            (leave ? self.left : self.taken)[corners[k]] = true;
    }
    if (self.run[0] || self.run[1] || self.run[2] || self.run[3])
        return strl__fail(payload->err, STRL_ERR_FORMAT, "copies: a run goes on past the parent's triangles");
    payload->copied = payload->vertex_count;
    return STRL_OK;
}
