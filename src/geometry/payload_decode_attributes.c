/* What a node payload says of vertices beside their position, and of states and palette. docs/format-payload.md,
 * "Attributes", is normative. Runs when the finest state is known. */
#include "geometry/payload_decode.h"

#include "base/fail.h"
#include "geometry/payload_reference.h"

/* Inlined with `most` a constant, by which it divides. */
static inline __attribute__((always_inline)) void set_normal(uint16_t normal[2], const uint32_t predicted[2],
                                                             uint32_t a, uint32_t b, uint32_t most)
{
    normal[0] = (uint16_t)strl__normal_widen((predicted[0] + strl__unzigzag(a)) & most, most);
    normal[1] = (uint16_t)strl__normal_widen((predicted[1] + strl__unzigzag(b)) & most, most);
}

static inline __attribute__((always_inline)) bool decode_normals(struct strl__decoder *d, uint32_t most)
{
    uint64_t(*sum)[4] = strl__normal_sums(&d->mesh, d->scratch);
    uint32_t copied = d->copied, own = d->sizes.vertex_count - copied, predicted[2];
    const uint32_t *copy_a = strl__pull_all(&d->in, STRL__STREAM_COPY_NORMAL, copied);
    const uint32_t *copy_b = strl__pull_all(&d->in, STRL__STREAM_COPY_NORMAL + 1, copied);
    const uint32_t *own_a = strl__pull_all(&d->in, STRL__STREAM_NORMAL, own);
    const uint32_t *own_b = strl__pull_all(&d->in, STRL__STREAM_NORMAL + 1, own);
    if (d->in.failed || !sum)
        return sum;
    for (uint32_t v = 0; v < copied; v++) {
        const uint16_t *from = strl__reference_normal(d->reference, d->copied_from[v]);
        for (unsigned k = 0; k < 2; k++)
            predicted[k] = strl__normal_narrow(from[k], most);
        set_normal(d->pm->normal[v], predicted, copy_a[v], copy_b[v], most);
    }
    for (uint32_t i = 0; i < own; i++) {
        strl__normal_predict(sum[copied + i], most, predicted);
        set_normal(d->pm->normal[copied + i], predicted, own_a[i], own_b[i], most);
    }
    return true;
}

/* The vertex that predicts v's colour and palette index; v itself where there is none. */
static uint32_t predictor(const struct strl__decoder *d, uint32_t v)
{
    return v < d->sizes.base_vertex_count ? d->from[v] : d->pm->parent[v];
}

static void decode_colours(struct strl__decoder *d)
{
    for (uint32_t v = 0; v < d->sizes.vertex_count; v++) {
        uint32_t before = v ? d->pm->colour[predictor(d, v)] : 0xffffffffu, delta[4];
        for (unsigned k = 0; k < 4; k++)
            delta[k] = strl__unzigzag(strl__pull(&d->in, STRL__STREAM_COLOUR + k));
        uint32_t green = (before >> 8) + delta[0];
        uint32_t red = before + delta[0] + delta[1];
        uint32_t blue = (before >> 16) + delta[0] + delta[2];
        uint32_t alpha = (before >> 24) + delta[3];
        d->pm->colour[v] = (red & 255) | (green & 255) << 8 | (blue & 255) << 16 | (alpha & 255) << 24;
    }
}

static void decode_texcoords(struct strl__decoder *d)
{
    for (uint32_t v = 0; v < d->sizes.vertex_count; v++) {
        uint32_t before = v ? d->pm->texcoord[predictor(d, v)] : 0;
        uint32_t a = before + strl__unzigzag(strl__pull(&d->in, STRL__STREAM_TEXCOORD));
        uint32_t b = (before >> 16) + strl__unzigzag(strl__pull(&d->in, STRL__STREAM_TEXCOORD + 1));
        d->pm->texcoord[v] = (a & 0xffff) | (b & 0xffff) << 16;
    }
}

static bool decode_palette_indices(struct strl__decoder *d)
{
    for (uint32_t v = 0; v < d->sizes.vertex_count; v++) {
        uint32_t before = v ? d->pm->palette_index[predictor(d, v)] : 0;
        uint32_t index = before + strl__unzigzag(strl__pull(&d->in, STRL__STREAM_PALETTE_INDEX));
        if (index >= d->sizes.palette_count)
            return false;
        d->pm->palette_index[v] = (uint16_t)index;
    }
    return true;
}

static void decode_palette(struct strl__decoder *d)
{
    strl_palette_entry entry = {0};
    for (uint32_t i = 0; i < d->sizes.palette_count; i++) {
        entry.part += strl__unzigzag(strl__pull(&d->in, STRL__STREAM_PALETTE));
        entry.material += strl__unzigzag(strl__pull(&d->in, STRL__STREAM_PALETTE + 1));
        entry.rgba += strl__unzigzag(strl__pull(&d->in, STRL__STREAM_PALETTE + 2));
        d->pm->palette[i] = entry;
    }
}

/* The first state's code; then, until the finest state: how many states keep it, and by how much it falls after them.
 */
static bool decode_errors(struct strl__decoder *d, unsigned id, float *error)
{
    uint32_t code = strl__pull(&d->in, id), state = 0, last = d->sizes.step_count;
    if (code > STRL__ERROR_CODE_MAX)
        return false;
    for (;;) {
        uint32_t run = strl__pull(&d->in, id);
        if (run > last - state)
            return false;
        float value = strl__error_of_code(code);
        for (uint32_t end = state + run; state <= end; state++)
            error[state] = value;
        if (state > last)
            return true;
        uint32_t fall = strl__pull(&d->in, id);
        if (fall > code || d->in.failed)
            return false;
        code -= fall;
    }
}

strl_status strl__decode_attributes(struct strl__decoder *d)
{
    if (!(d->normal_most == 255 ? decode_normals(d, 255) : decode_normals(d, 1023)))
        return strl__fail(d->err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    if (d->pm->colour)
        decode_colours(d);
    if (d->pm->texcoord)
        decode_texcoords(d);
    if (d->pm->palette_index && !decode_palette_indices(d))
        return strl__fail(d->err, STRL_ERR_FORMAT, "node payload names an entry past its palette");
    decode_palette(d);
    if (!decode_errors(d, STRL__STREAM_GEOMETRIC_ERROR, d->pm->geometric_error) ||
        !decode_errors(d, STRL__STREAM_APPEARANCE_ERROR, d->pm->appearance_error))
        return strl__fail(d->err, STRL_ERR_FORMAT, "node payload's errors leave their scale");
    return STRL_OK;
}
