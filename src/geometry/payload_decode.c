/* Reading a node payload: head, number streams, base mesh, steps, attributes. docs/format-payload.md is normative. */
#include "geometry/payload_decode.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"

enum { FLAG_COLOUR = 1, FLAG_PALETTE_INDEX = 2, FLAG_COPIES = 4, FLAG_TEXCOORD = 8, FLAGS_KNOWN = 15 };

struct head {
    uint8_t flags, normal_bits;
};

static strl_status read_head(strl_cursor *cursor, strl_payload_sizes *sizes, struct head *head, strl_error *err)
{
    uint8_t version = strl_cursor_u8(cursor);
    head->flags = strl_cursor_u8(cursor);
    head->normal_bits = strl_cursor_u8(cursor);
    sizes->vertex_count = strl_cursor_u16(cursor);
    sizes->base_vertex_count = strl_cursor_u16(cursor);
    sizes->step_count = strl_cursor_u16(cursor);
    sizes->palette_count = strl_cursor_u16(cursor);
    sizes->triangle_count = strl_cursor_u32(cursor);
    sizes->base_triangle_count = strl_cursor_u32(cursor);
    if (cursor->failed)
        return strl__fail(err, STRL_ERR_FORMAT, "node payload of %zu bytes is too short for its head", cursor->size);
    if (version != 1 || head->flags > FLAGS_KNOWN)
        return strl__fail(err, STRL_ERR_FORMAT, "node payload has version %u and flags %u, expected 1 and at most 15",
                          version, head->flags);
    if (head->normal_bits != 8 && head->normal_bits != 10)
        return strl__fail(err, STRL_ERR_FORMAT, "node payload has normals of 2 x %u bits, expected 8 or 10",
                          head->normal_bits);
    if (sizes->triangle_count > STRL_PM_MAX_TRIANGLES || sizes->base_triangle_count > sizes->triangle_count ||
        sizes->base_vertex_count > sizes->vertex_count || sizes->palette_count < 1 ||
        sizes->step_count > sizes->vertex_count - sizes->base_vertex_count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node payload announces %" PRIu32 " vertices (base %" PRIu32 "), %" PRIu32
                          " triangles (base %" PRIu32 "), %" PRIu32 " steps and %" PRIu32
                          " palette entries, which cannot be",
                          sizes->vertex_count, sizes->base_vertex_count, sizes->triangle_count,
                          sizes->base_triangle_count, sizes->step_count, sizes->palette_count);
    uint64_t items = (uint64_t)sizes->vertex_count + sizes->triangle_count + sizes->palette_count;
    if (items > (uint64_t)cursor->size * STRL__MAX_ITEMS_A_BYTE)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "node payload announces %" PRIu64 " items, more than its %zu bytes can hold", items,
                          cursor->size);
    return STRL_OK;
}

strl_status strl_payload_peek(const void *data, size_t size, strl_payload_sizes *sizes, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    struct head head;
    return read_head(&cursor, sizes, &head, err);
}

static strl_status allocate(const strl_payload_sizes *sizes, uint8_t flags, strl_arena *arena, strl_pm *pm,
                            strl_error *err)
{
    pm->vertex_count = sizes->vertex_count;
    pm->triangle_count = sizes->triangle_count;
    pm->step_count = sizes->step_count;
    pm->palette_count = sizes->palette_count;
    if (!strl_pm_create(pm, flags & FLAG_COLOUR, flags & FLAG_PALETTE_INDEX, flags & FLAG_TEXCOORD, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    memset(pm->parent, 0, sizes->base_vertex_count * sizeof *pm->parent);
    return STRL_OK;
}

static strl_status decode_parts(struct strl__decoder *d, strl_cursor *cursor)
{
    const strl_payload_sizes *sizes = &d->sizes;
    uint64_t items = (uint64_t)sizes->vertex_count + sizes->triangle_count + sizes->palette_count;
    strl_status status = strl__streams_read(cursor, strl__stream_count(d->pm->texcoord != NULL), cursor->size, items,
                                            d->scratch, &d->in, d->err);
    if (status)
        return status;
    d->from = strl_arena_alloc(d->scratch, (size_t)sizes->base_vertex_count + 3, sizeof *d->from);
    if (!d->from || !strl__mesh_init(&d->mesh, sizes->vertex_count, sizes->triangle_count, d->pm->position, d->scratch))
        return strl__fail(d->err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    status = strl__decode_copies(d);
    if (!status)
        status = strl__decode_base(d);
    if (!status)
        status = strl__decode_steps(d);
    if (!status)
        status = strl__decode_attributes(d);
    if (!status && !strl__streams_done(&d->in))
        status = strl__fail(d->err, STRL_ERR_FORMAT, "node payload has numbers left over or too few");
    for (uint32_t t = 0; !status && t < sizes->triangle_count; t++)
        strl__mesh_get_triangle(&d->mesh, t, d->pm->triangle[t]);
    return status;
}

/* Makes scratch one block of about what a decode needs: blocks that come and go cost more page faults than the
 * decoding. Where more is needed, the arena grows as usual. It keeps to what the caller's arena may still take. */
static void reserve(const struct strl__decoder *d, size_t size, const strl_arena *arena, strl_arena *scratch)
{
    size_t limit = 0, wanted = 2 * size + (size_t)d->sizes.vertex_count * 160 + (size_t)d->sizes.triangle_count * 64 +
                               (size_t)d->sizes.base_triangle_count * 60 + 32768;
    if (arena->limit_bytes)
        limit = arena->limit_bytes > arena->total_bytes ? arena->limit_bytes - arena->total_bytes : 1;
    strl_arena_init(scratch, limit);
    strl_arena_mark empty = strl_arena_get_mark(scratch);
    strl_arena_alloc(scratch, wanted, 1);
    strl_arena_rewind(scratch, empty);
}

strl_status strl_payload_decode(const void *data, size_t size, const strl_payload_reference *reference,
                                strl_arena *arena, strl_pm *pm, strl_error *err)
{
    strl_cursor cursor = strl_cursor_make(data, size);
    strl_pm mesh = {0};
    strl_arena scratch;
    struct strl__decoder decoder = {.pm = &mesh, .reference = reference, .scratch = &scratch, .err = err};
    struct head head;
    *pm = mesh;
    strl_status status = read_head(&cursor, &decoder.sizes, &head, err);
    if (status)
        return status;
    decoder.normal_most = (1u << head.normal_bits) - 1;
    if (!(head.flags & FLAG_COPIES) != !reference)
        return strl__fail(err, STRL_ERR_FORMAT, "node payload %s another node's mesh, which was %s",
                          reference ? "does not use" : "needs", reference ? "given" : "not given");
    strl_arena_mark before = strl_arena_get_mark(arena);
    status = allocate(&decoder.sizes, head.flags, arena, &mesh, err);
    reserve(&decoder, size, arena, &scratch);
    if (!status)
        status = decode_parts(&decoder, &cursor);
    strl_arena_deinit(&scratch);
    if (status)
        strl_arena_rewind(arena, before);
    else
        *pm = mesh;
    return status;
}
