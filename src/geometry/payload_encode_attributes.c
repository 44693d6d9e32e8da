/* Writing normals, colours, palette and errors of a node payload. docs/format-payload.md, "Attributes", is normative.
 */
#include "geometry/payload_encode.h"

#include "base/fail.h"
#include "geometry/payload_reference.h"

/* pm's vertex with the decoder's number v. */
static uint32_t pm_vertex(const struct strl__encoder *e, uint32_t v)
{
    return v < e->pm->vertex_end[0] ? e->vertex[v] : v;
}

/* pm's vertex that predicts the one with number v > 0. */
static uint32_t predictor(const struct strl__encoder *e, uint32_t v)
{
    return v < e->pm->vertex_end[0] ? e->vertex[e->from[v]] : e->pm->parent[v];
}

unsigned strl__normal_bits(const strl_pm *pm)
{
    for (uint32_t v = 0; v < pm->vertex_count; v++)
        for (unsigned k = 0; k < 2; k++)
            if (strl__normal_widen(strl__normal_narrow(pm->normal[v][k], 255), 255) != pm->normal[v][k])
                return 10;
    return 8;
}

static bool encode_normals(struct strl__encoder *e)
{
    uint32_t count = e->pm->vertex_count, most = (1u << strl__normal_bits(e->pm)) - 1, half = (most + 1) / 2;
    uint64_t(*sum)[4] = strl__normal_sums(&e->mesh, e->scratch);
    for (uint32_t v = 0; sum && v < count; v++) {
        unsigned stream = v < e->copied ? STRL__STREAM_COPY_NORMAL : STRL__STREAM_NORMAL;
        uint32_t predicted[2];
        strl__normal_predict(sum[v], most, predicted);
        for (unsigned k = 0; k < 2; k++) {
            if (v < e->copied)
                predicted[k] = strl__normal_narrow(strl__reference_normal(e->reference, e->copied_from[v])[k], most);
            uint32_t narrow = strl__normal_narrow(e->pm->normal[pm_vertex(e, v)][k], most);
            strl__push(&e->out, stream + k, strl__zigzag(((narrow - predicted[k] + half) & most) - half));
        }
    }
    return sum;
}

/* A difference of bytes as the nearest number from -128 to 127. */
static uint32_t byte_residual(uint32_t difference)
{
    return strl__zigzag(((difference + 128u) & 255u) - 128u);
}

static void encode_colours(struct strl__encoder *e)
{
    for (uint32_t v = 0; v < e->pm->vertex_count; v++) {
        uint32_t before = v ? e->pm->colour[predictor(e, v)] : 0xffffffffu, colour = e->pm->colour[pm_vertex(e, v)];
        uint32_t green = (colour >> 8 & 255) - (before >> 8 & 255);
        uint32_t red = (colour & 255) - (before & 255), blue = (colour >> 16 & 255) - (before >> 16 & 255);
        strl__push(&e->out, STRL__STREAM_COLOUR, byte_residual(green));
        strl__push(&e->out, STRL__STREAM_COLOUR + 1, byte_residual(red - green));
        strl__push(&e->out, STRL__STREAM_COLOUR + 2, byte_residual(blue - green));
        strl__push(&e->out, STRL__STREAM_COLOUR + 3, byte_residual((colour >> 24) - (before >> 24)));
    }
}

static void encode_texcoords(struct strl__encoder *e)
{
    for (uint32_t v = 0; v < e->pm->vertex_count; v++) {
        uint32_t before = v ? e->pm->texcoord[predictor(e, v)] : 0, code = e->pm->texcoord[pm_vertex(e, v)];
        for (unsigned k = 0; k < 2; k++) {
            uint32_t difference = (code >> 16 * k) - (before >> 16 * k);
            strl__push(&e->out, STRL__STREAM_TEXCOORD + k, strl__zigzag(((difference + 0x8000u) & 0xffffu) - 0x8000u));
        }
    }
}

static void encode_palette_indices(struct strl__encoder *e)
{
    for (uint32_t v = 0; v < e->pm->vertex_count; v++) {
        uint32_t before = v ? e->pm->palette_index[predictor(e, v)] : 0;
        strl__push(&e->out, STRL__STREAM_PALETTE_INDEX, strl__zigzag(e->pm->palette_index[pm_vertex(e, v)] - before));
    }
}

static void encode_palette(struct strl__encoder *e)
{
    strl_palette_entry before = {0};
    for (uint32_t i = 0; i < e->pm->palette_count; i++) {
        const strl_palette_entry *entry = &e->pm->palette[i];
        strl__push(&e->out, STRL__STREAM_PALETTE, strl__zigzag(entry->part - before.part));
        strl__push(&e->out, STRL__STREAM_PALETTE + 1, strl__zigzag(entry->material - before.material));
        strl__push(&e->out, STRL__STREAM_PALETTE + 2, strl__zigzag(entry->rgba - before.rgba));
        before = *entry;
    }
}

static void encode_errors(struct strl__encoder *e, unsigned id, const float *error)
{
    uint32_t before = strl__code_of_error(error[0]), run = 0;
    strl__push(&e->out, id, before);
    for (uint32_t s = 1; s <= e->pm->step_count; s++) {
        uint32_t code = error[s] < error[s - 1] ? strl__code_of_error(error[s]) : before;
        if (code == before) {
            run++;
            continue;
        }
        strl__push(&e->out, id, run);
        strl__push(&e->out, id, before - code);
        before = code;
        run = 0;
    }
    strl__push(&e->out, id, run);
}

strl_status strl__encode_attributes(struct strl__encoder *e)
{
    if (!encode_normals(e))
        return strl__fail(e->err, STRL_ERR_MEMORY, "no memory to encode a node payload");
    if (e->pm->colour)
        encode_colours(e);
    if (e->pm->texcoord)
        encode_texcoords(e);
    if (e->pm->palette_index)
        encode_palette_indices(e);
    encode_palette(e);
    encode_errors(e, STRL__STREAM_GEOMETRIC_ERROR, e->pm->geometric_error);
    encode_errors(e, STRL__STREAM_APPEARANCE_ERROR, e->pm->appearance_error);
    return STRL_OK;
}
