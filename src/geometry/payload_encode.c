/* Writing a node payload: head, number streams, base mesh, steps, attributes. docs/format-payload.md is normative. */
#include "geometry/payload_encode.h"

#include <string.h>

#include "base/fail.h"

/* Walks every triangle from the finest state back to its birth; where `record`, its corners there and the corners that
 * arrive at each vertex by a step. Otherwise only counts the arrivals. */
static void walk_triangles(struct strl__encoder *e, bool record)
{
    const strl_pm *pm = e->pm;
    for (uint32_t t = 0, s = 0; t < pm->triangle_count; t++) {
        while (t >= pm->triangle_end[s])
            s++;
        for (unsigned k = 0; k < 3; k++) {
            uint32_t v = pm->triangle[t][k];
            for (; v >= pm->vertex_end[s]; v = pm->parent[v]) {
                if (record)
                    e->arrival[e->arrival_first[v]++] = 4 * t + k;
                else
                    e->arrival_first[v]++;
            }
            if (record)
                e->birth[t][k] = (uint16_t)v;
        }
    }
}

/* birth, arrival and arrival_first: a counting sort of the corners by the vertices that they pass. */
static bool find_arrivals(struct strl__encoder *e)
{
    uint32_t vertices = e->pm->vertex_count, total = 0;
    e->arrival_first = strl_arena_alloc_zero(e->scratch, (size_t)vertices + 2, sizeof *e->arrival_first);
    e->birth = strl_arena_alloc(e->scratch, e->pm->triangle_count, sizeof *e->birth);
    if (!e->arrival_first || !e->birth)
        return false;
    walk_triangles(e, false);
    for (uint32_t v = 0; v < vertices; v++) {
        uint32_t count = e->arrival_first[v];
        e->arrival_first[v] = total;
        total += count;
    }
    e->arrival = strl_arena_alloc(e->scratch, total, sizeof *e->arrival);
    if (!e->arrival)
        return false;
    walk_triangles(e, true);
    for (uint32_t v = vertices + 1; v > 0; v--) /* each first has run on to the next one's */
        e->arrival_first[v] = e->arrival_first[v - 1];
    e->arrival_first[0] = 0;
    e->arrival_first[vertices] = total;
    return true;
}

static bool init(struct strl__encoder *e)
{
    uint32_t vertices = e->pm->vertex_count, triangles = e->pm->triangle_count;
    int32_t(*position)[3] = strl_arena_alloc(e->scratch, vertices, sizeof *position);
    e->number = strl_arena_alloc_zero(e->scratch, vertices, sizeof *e->number);
    e->vertex = strl_arena_alloc(e->scratch, vertices, sizeof *e->vertex);
    e->from = strl_arena_alloc(e->scratch, e->pm->vertex_end[0], sizeof *e->from);
    e->triangle_of = strl_arena_alloc(e->scratch, triangles, sizeof *e->triangle_of);
    e->rotation = strl_arena_alloc(e->scratch, triangles, sizeof *e->rotation);
    if (!position || !e->number || !e->vertex || !e->from || !e->triangle_of || !e->rotation || !find_arrivals(e) ||
        !strl__mesh_init(&e->mesh, vertices, triangles, position, e->scratch))
        return false;
    memset(e->triangle_of, 0xff, triangles * sizeof *e->triangle_of);
    for (uint32_t v = e->pm->vertex_end[0]; v < vertices; v++)
        e->number[v] = (uint16_t)v;
    return true;
}

static void write_head(const strl_pm *pm, bool copies, strl_writer *writer)
{
    strl_writer_u8(writer, 1);
    strl_writer_u8(writer, (uint8_t)((pm->colour ? 1 : 0) | (pm->palette_index ? 2 : 0) | (copies ? 4 : 0) |
                                     (pm->texcoord ? 8 : 0)));
    strl_writer_u8(writer, (uint8_t)strl__normal_bits(pm));
    strl_writer_u16(writer, (uint16_t)pm->vertex_count);
    strl_writer_u16(writer, (uint16_t)pm->vertex_end[0]);
    strl_writer_u16(writer, (uint16_t)pm->step_count);
    strl_writer_u16(writer, (uint16_t)pm->palette_count);
    strl_writer_u32(writer, pm->triangle_count);
    strl_writer_u32(writer, pm->triangle_end[0]);
}

strl_payload_reference strl_payload_reference_of(const strl_pm *pm)
{
    return (strl_payload_reference){.vertex_count = pm->vertex_count,
                                    .triangle_count = pm->triangle_count,
                                    .position = pm->position,
                                    .normal = pm->normal,
                                    .position_stride = sizeof *pm->position,
                                    .normal_stride = sizeof *pm->normal,
                                    .triangle = (const uint16_t(*)[3])pm->triangle};
}

static void get_order(const struct strl__encoder *e, const strl_payload_order *order)
{
    for (uint32_t v = 0; v < e->pm->vertex_count; v++)
        order->vertex[e->number[v]] = (uint16_t)v;
    for (uint32_t t = 0; t < e->pm->triangle_count; t++)
        order->triangle[e->triangle_of[t]] = 4 * t + (3 - e->rotation[t]) % 3;
}

strl_status strl__payload_collect(const strl_pm *pm, const strl_payload_reference *reference, strl_arena *scratch,
                                  struct strl__streams_out *streams, const strl_payload_order *order, strl_error *err)
{
    struct strl__encoder e = {.pm = pm, .reference = reference, .scratch = scratch, .err = err};
    strl_arena_mark mark = strl_arena_get_mark(scratch);
    strl_status status = strl_pm_check(pm, err);
    if (!status && !init(&e))
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to encode a node payload");
    if (!status)
        status = strl__encode_copies(&e);
    if (!status)
        status = strl__encode_base(&e);
    if (!status)
        status = strl__encode_steps(&e);
    if (!status)
        status = strl__encode_attributes(&e);
    if (!status && order)
        get_order(&e, order);
    *streams = e.out;
    strl_arena_rewind(scratch, mark);
    return status;
}

strl_status strl_payload_encode(const strl_pm *pm, const strl_payload_reference *reference, strl_arena *scratch,
                                strl_writer *writer, const strl_payload_order *order, strl_error *err)
{
    struct strl__streams_out streams;
    size_t start = writer->size;
    strl_status status = strl__payload_collect(pm, reference, scratch, &streams, order, err);
    if (!status) {
        write_head(pm, reference != NULL, writer);
        status = strl__streams_write(&streams, strl__stream_count(pm->texcoord != NULL), start,
                                     (uint64_t)pm->vertex_count + pm->triangle_count + pm->palette_count, writer, err);
    }
    if (status && writer->size > start)
        writer->size = start;
    strl__streams_deinit(&streams);
    return status;
}
