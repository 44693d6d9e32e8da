/* docs/format-payload.md, "Attributes". */
#include <math.h>

#include "base/fail.h"
#include "verify/payload.h"

/* ---- normals ---- */

static void add_normals(const strl__vmesh *mesh, uint64_t (*sum)[3])
{
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint16_t *c = mesh->triangle[t];
        uint64_t u[3], v[3];
        for (unsigned k = 0; k < 3; k++) {
            u[k] = (uint64_t)((int64_t)mesh->position[c[1]][k] - mesh->position[c[0]][k]);
            v[k] = (uint64_t)((int64_t)mesh->position[c[2]][k] - mesh->position[c[0]][k]);
        }
        for (unsigned k = 0; k < 3; k++) {
            uint64_t n = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
            for (unsigned i = 0; i < 3; i++)
                sum[c[i]][k] += n;
        }
    }
}

static uint64_t magnitude(uint64_t value)
{
    return value >> 63 ? 0 - value : value;
}

/* most: the largest coordinate that the payload's normals have. */
static void predict_normal(const uint64_t sum[3], int64_t most, uint32_t predicted[2])
{
    uint64_t all = magnitude(sum[0]) | magnitude(sum[1]) | magnitude(sum[2]) | 1;
    unsigned width = 64 - (unsigned)__builtin_clzll(all), shift = width > 18 ? width - 18 : 0;
    int64_t x = (int64_t)(magnitude(sum[0]) >> shift), y = (int64_t)(magnitude(sum[1]) >> shift),
            z = (int64_t)(magnitude(sum[2]) >> shift), l = x + y + z;
    predicted[0] = predicted[1] = (uint32_t)(most + 1) / 2;
    if (l == 0)
        return;
    if (sum[2] >> 63) {
        int64_t folded = l - y;
        y = l - x;
        x = folded;
    }
    x = sum[0] >> 63 ? -x : x;
    y = sum[1] >> 63 ? -y : y;
    predicted[0] = (uint32_t)(((x + l) * most + l) / (2 * l));
    predicted[1] = (uint32_t)(((y + l) * most + l) / (2 * l));
}

static strl_status read_normals(strl__v_payload *self)
{
    strl__vmesh *mesh = self->mesh;
    uint32_t most = (1u << self->normal_bits) - 1;
    uint64_t(*sum)[3] = strl_arena_alloc_zero(self->arena, mesh->vertex_count, sizeof *sum);
    if (!sum)
        return strl__fail(self->err, STRL_ERR_MEMORY, "no memory for %u normals", mesh->vertex_count);
    add_normals(mesh, sum);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        uint32_t predicted[2];
        unsigned stream = v < self->copied ? STRL__V_COPY_NORMAL : STRL__V_NORMAL;
        predict_normal(sum[v], most, predicted);
        for (unsigned i = 0; i < 2; i++) {
            if (v < self->copied)
                predicted[i] = (self->told_by->normal[self->copied_from[v]][i] * most + 511) / 1023;
            uint32_t value = (predicted[i] + strl__v_residual(self, stream + i)) % (most + 1);
            mesh->normal[v][i] = (uint16_t)((value * 1023 + most / 2) / most);
        }
    }
    return STRL_OK;
}

/* ---- colours and palette ---- */

static uint32_t predecessor(const strl__v_payload *self, uint32_t v)
{
    return v < self->base_vertices ? self->from[v] : self->mesh->parent[v];
}

static void read_colours(strl__v_payload *self)
{
    uint32_t *colour = self->mesh->colour;
    for (uint32_t v = 0; colour && v < self->mesh->vertex_count; v++) {
        uint32_t before = v ? colour[predecessor(self, v)] : 0xffffffffu, d[4];
        for (unsigned i = 0; i < 4; i++)
            d[i] = strl__v_residual(self, STRL__V_COLOUR + i); /* green, red, blue, alpha */
        uint32_t red = (before + d[0] + d[1]) & 0xff, green = ((before >> 8) + d[0]) & 0xff,
                 blue = ((before >> 16) + d[0] + d[2]) & 0xff, alpha = ((before >> 24) + d[3]) & 0xff;
        colour[v] = red | green << 8 | blue << 16 | alpha << 24;
    }
}

static void read_texcoords(strl__v_payload *self)
{
    uint16_t(*texcoord)[2] = self->mesh->texcoord;
    for (uint32_t v = 0; texcoord && v < self->mesh->vertex_count; v++)
        for (unsigned i = 0; i < 2; i++)
            texcoord[v][i] =
                (uint16_t)((v ? texcoord[predecessor(self, v)][i] : 0) + strl__v_residual(self, STRL__V_TEXCOORD + i));
}

static strl_status read_palette(strl__v_payload *self)
{
    strl__vmesh *mesh = self->mesh;
    for (uint32_t v = 0; mesh->palette_index && v < mesh->vertex_count; v++) {
        uint32_t index = (v ? mesh->palette_index[predecessor(self, v)] : 0) + strl__v_residual(self, STRL__V_INDEX);
        if (index >= mesh->palette_count)
            return strl__fail(self->err, STRL_ERR_FORMAT, "vertex %u has entry %u of a palette of %u", v, index,
                              mesh->palette_count);
        mesh->palette_index[v] = (uint16_t)index;
    }
    uint32_t entry[3] = {0, 0, 0};
    for (uint32_t i = 0; i < mesh->palette_count; i++) {
        for (unsigned k = 0; k < 3; k++)
            entry[k] += strl__v_residual(self, STRL__V_PALETTE + k);
        mesh->palette[i][0] = entry[0];
        mesh->palette[i][1] = entry[1];
    }
    return STRL_OK;
}

/* ---- errors ---- */

static const uint32_t mantissa[16] = {8388608,  8760004,  9147842,  9552852,  9975793,  10417459, 10878679, 11360319,
                                      11863284, 12388516, 12937003, 13509773, 14107901, 14732511, 15384775, 16065918};

static float error_of(uint32_t code)
{
    return code ? (float)ldexp(mantissa[(code - 1) % 16], (int)((code - 1) / 16) - 64 - 23) : 0;
}

static strl_status read_errors(strl__v_payload *self, unsigned number, float *errors)
{
    uint32_t code = strl__v_pull(self, number), s = 0;
    while (code <= 2049) {
        uint32_t repeat = strl__v_pull(self, number);
        if (repeat > self->steps - s || self->starved)
            break;
        float error = error_of(code);
        for (uint32_t end = s + repeat; s <= end; s++)
            errors[s] = error;
        if (s > self->steps)
            return STRL_OK;
        uint32_t fall = strl__v_pull(self, number);
        if (fall > code)
            break;
        code -= fall;
    }
    return strl__fail(self->err, STRL_ERR_FORMAT, "the errors of stream %u are not those of %u states", number,
                      self->steps + 1);
}

static void skip_stream(strl__v_payload *self, unsigned number, uint32_t count)
{
    strl__v_stream *stream = &self->stream[number];
    self->starved = self->starved || stream->count - stream->at < count;
    stream->at = stream->count - stream->at < count ? stream->count : stream->at + count;
}

strl_status strl__v_payload_attributes(strl__v_payload *self, bool with_looks)
{
    strl_status status = STRL_OK;
    if (with_looks) {
        status = read_normals(self);
        read_colours(self);
        read_texcoords(self);
    } else {
        for (unsigned i = 0; i < 2; i++) {
            skip_stream(self, STRL__V_COPY_NORMAL + i, self->copied);
            skip_stream(self, STRL__V_NORMAL + i, self->vertices - self->copied);
        }
        for (unsigned i = 0; i < 4 && self->mesh->colour; i++)
            skip_stream(self, STRL__V_COLOUR + i, self->vertices);
        for (unsigned i = 0; i < 2 && self->mesh->texcoord; i++)
            skip_stream(self, STRL__V_TEXCOORD + i, self->vertices);
    }
    if (status == STRL_OK)
        status = read_palette(self);
    if (status == STRL_OK)
        status = read_errors(self, STRL__V_GEOMETRIC, self->mesh->geometric_error);
    return status == STRL_OK ? read_errors(self, STRL__V_APPEARANCE, self->mesh->appearance_error) : status;
}
