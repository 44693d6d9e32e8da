/* A payload's head, and the order of its parts. */
#include "verify/payload.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"

#define HEAD_BYTES 39u
#define MOST_TRIANGLES 131072u

bool strl__v_add_triangle(strl__v_payload *self, uint32_t a, uint32_t b, uint32_t c)
{
    if (self->triangle_count == self->triangles || strl__v_same_position(self, a, b) ||
        strl__v_same_position(self, b, c) || strl__v_same_position(self, c, a))
        return false;
    uint32_t corner = 3 * self->triangle_count++;
    strl__v_list_corner(self, corner, a);
    strl__v_list_corner(self, corner + 1, b);
    strl__v_list_corner(self, corner + 2, c);
    return true;
}

void strl__v_join(strl__v_payload *self, uint32_t vertex, uint32_t to)
{
    self->ring[vertex] = self->ring[to];
    self->ring[to] = (uint16_t)vertex;
}

static strl_status read_head(strl__v_payload *self, strl_cursor *cursor)
{
    uint32_t version = strl_cursor_u8(cursor);
    self->flags = strl_cursor_u8(cursor);
    self->normal_bits = strl_cursor_u8(cursor);
    self->vertices = strl_cursor_u16(cursor);
    self->base_vertices = strl_cursor_u16(cursor);
    self->steps = strl_cursor_u16(cursor);
    self->entries = strl_cursor_u16(cursor);
    self->triangles = strl_cursor_u32(cursor);
    self->base_triangles = strl_cursor_u32(cursor);
    self->words = strl_cursor_u32(cursor);
    for (unsigned i = 0; i < 4; i++)
        self->coder[i] = strl_cursor_u32(cursor);
    if (cursor->failed)
        return strl__fail(self->err, STRL_ERR_FORMAT, "the payload ends within its first %u bytes", HEAD_BYTES);
    if (version != 1 || self->flags > 15)
        return strl__fail(self->err, STRL_ERR_FORMAT, "payload of version %" PRIu32 " with flags %" PRIu32, version,
                          self->flags);
    if (self->normal_bits != 8 && self->normal_bits != 10)
        return strl__fail(self->err, STRL_ERR_FORMAT, "payload with normals of %" PRIu32 " bits", self->normal_bits);
    if ((self->flags & 4) == 0 ? self->told_by != NULL : self->told_by == NULL)
        return strl__fail(self->err, STRL_ERR_FORMAT,
                          "payload with flags %" PRIu32 ", but its record says that it is %s", self->flags,
                          self->told_by ? "told by its parent's" : "self-contained");
    if (self->base_vertices > self->vertices || self->steps > self->vertices - self->base_vertices ||
        self->entries == 0 || self->triangles > MOST_TRIANGLES || self->base_triangles > self->triangles)
        return strl__fail(self->err, STRL_ERR_FORMAT,
                          "payload of %" PRIu32 " of %" PRIu32 " vertices, %" PRIu32 " steps, %" PRIu32 " of %" PRIu32
                          " triangles, %" PRIu32 " palette entries",
                          self->base_vertices, self->vertices, self->steps, self->base_triangles, self->triangles,
                          self->entries);
    return STRL_OK;
}

static strl_status reserve(strl__v_payload *self)
{
    strl_arena *arena = self->arena;
    strl__vmesh *mesh = self->mesh;
    uint32_t v = self->vertices, states = self->steps + 1;
    *mesh = (strl__vmesh){.vertex_count = v,
                          .triangle_count = self->triangles,
                          .step_count = self->steps,
                          .palette_count = self->entries};
    mesh->position = strl_arena_alloc(arena, v, sizeof *mesh->position);
    mesh->normal = strl_arena_alloc_zero(arena, v, sizeof *mesh->normal);
    mesh->colour = self->flags & 1 ? strl_arena_alloc_zero(arena, v, sizeof *mesh->colour) : NULL;
    mesh->texcoord = self->flags & 8 ? strl_arena_alloc_zero(arena, v, sizeof *mesh->texcoord) : NULL;
    mesh->palette_index = self->flags & 2 ? strl_arena_alloc(arena, v, sizeof *mesh->palette_index) : NULL;
    mesh->parent = strl_arena_alloc_zero(arena, v, sizeof *mesh->parent);
    mesh->triangle = strl_arena_alloc(arena, self->triangles, sizeof *mesh->triangle);
    mesh->vertex_end = strl_arena_alloc(arena, states, sizeof *mesh->vertex_end);
    mesh->triangle_end = strl_arena_alloc(arena, states, sizeof *mesh->triangle_end);
    mesh->geometric_error = strl_arena_alloc(arena, states, sizeof *mesh->geometric_error);
    mesh->appearance_error = strl_arena_alloc(arena, states, sizeof *mesh->appearance_error);
    mesh->palette = strl_arena_alloc(arena, self->entries, sizeof *mesh->palette);
    self->first = strl_arena_alloc(arena, v, sizeof *self->first);
    self->next = strl_arena_alloc(arena, 3 * (size_t)self->triangles, sizeof *self->next);
    self->ring = strl_arena_alloc(arena, v, sizeof *self->ring);
    self->from = strl_arena_alloc_zero(arena, self->base_vertices, sizeof *self->from);
    bool good = mesh->position && mesh->normal && (mesh->colour || !(self->flags & 1)) &&
                (mesh->texcoord || !(self->flags & 8)) && (mesh->palette_index || !(self->flags & 2)) && mesh->parent &&
                mesh->triangle && mesh->vertex_end && mesh->triangle_end && mesh->geometric_error &&
                mesh->appearance_error && mesh->palette && self->first && self->next && self->ring && self->from;
    if (!good)
        return strl__fail(self->err, STRL_ERR_MEMORY, "no memory for a mesh of %" PRIu32 " vertices", v);
    memset(self->first, 0xff, (size_t)v * sizeof *self->first);
    for (uint32_t i = 0; i < v; i++)
        self->ring[i] = (uint16_t)i;
    return STRL_OK;
}

strl_status strl__v_payload_ends(const strl__v_payload *self)
{
    if (self->starved)
        return strl__fail(self->err, STRL_ERR_FORMAT, "the payload has too few values in a stream");
    for (unsigned i = 0; i < STRL__V_STREAMS; i++)
        if (self->stream[i].at != self->stream[i].count)
            return strl__fail(self->err, STRL_ERR_FORMAT,
                              "stream %u of the payload has %" PRIu32 " values, %" PRIu32 " were asked for", i,
                              self->stream[i].count, self->stream[i].at);
    return STRL_OK;
}

strl_status strl__v_payload_decode(const uint8_t *data, size_t size, const strl__v_told *told, strl_arena *arena,
                                   bool with_looks, strl__vmesh *mesh, strl_error *err)
{
    strl__v_payload self = {.mesh = mesh, .arena = arena, .err = err};
    strl_cursor cursor = strl_cursor_make(data, size);
    if (told) {
        self.told_by = told->mesh;
        memcpy(self.offset, told->offset, sizeof self.offset);
    }
    strl_status status = read_head(&self, &cursor);
    /* The streams come first: they bound the counts by the payload's size before anything is reserved for them. */
    if (status == STRL_OK)
        status = strl__v_payload_streams(&self, &cursor, size, self.flags & 8 ? STRL__V_STREAMS : STRL__V_TEXCOORD);
    if (status == STRL_OK)
        status = reserve(&self);
    if (status == STRL_OK)
        status = strl__v_payload_copies(&self);
    if (status == STRL_OK)
        status = strl__v_payload_base(&self);
    if (status == STRL_OK)
        status = strl__v_payload_steps(&self);
    if (status == STRL_OK)
        status = strl__v_payload_attributes(&self, with_looks);
    return status == STRL_OK ? strl__v_payload_ends(&self) : status;
}
