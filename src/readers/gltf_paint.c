/* Vertices under an image: what each stands for of it, which depends on the triangles round it and
 * on nothing else, so that triangles that share a vertex agree about its colour; and its colour. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"

/* Of the budget, what measuring a primitive may take. Larger ones are guessed. */
#define MEASURE_SHARE 16u

typedef struct measure {
    strl__gltf *gltf;
    const strl__gltf_primitive *primitive;
    double (*places)[2];   /* owned; of the vertices that are loaded, in texels; NULL: those are read one by one */
    uint64_t first, count; /* these vertices */
    double log_sum;        /* where corners are no one's but their triangle's */
    uint64_t log_count;
} measure;

/* In the image, 1 = all of it. count <= STRL__GLTF_CHUNK */
static strl_status read_places(strl__gltf *gltf, uint64_t first, size_t count, double (*places)[2], strl_error *err)
{
    const strl__gltf_paint *paint = &gltf->paint;
    const strl__texture *texture = &gltf->reader->textures.items[paint->texture];
    strl_status status = strl__gltf_read_attribute(
        gltf, paint->texcoord, gltf->accessors[paint->texcoord].values.normalized, paint->draco_id, first, count, err);
    for (size_t i = 0; i < count && !status; i++)
        strl__texture_place(texture, gltf->values + 2 * i, places[i]);
    return status;
}

static strl_status read_texels(measure *self, uint64_t first, size_t count, double (*texels)[2], strl_error *err)
{
    const strl__image *image = self->gltf->paint.image;
    strl_status status = read_places(self->gltf, first, count, texels, err);
    for (size_t i = 0; i < count && !status; i++) {
        texels[i][0] *= image->width;
        texels[i][1] *= image->height;
    }
    return status;
}

static strl_status read_all_places(measure *self, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint64_t at = 0; at < self->count && !status; at += STRL__GLTF_CHUNK) {
        const uint64_t left = self->count - at;
        const size_t count = left < STRL__GLTF_CHUNK ? (size_t)left : STRL__GLTF_CHUNK;
        status = read_texels(self, self->first + at, count, self->places + at, err);
    }
    return status;
}

static strl_status add_triangle(measure *self, const uint32_t corners[3], strl_error *err)
{
    double places[3][2];
    strl_status status = STRL_OK;
    for (unsigned i = 0; i < 3; i++) {
        if (corners[i] < self->first || corners[i] - self->first >= self->count)
            return STRL_OK; /* refused when it is read */
        if (self->places)
            memcpy(places[i], self->places[corners[i] - self->first], sizeof places[i]);
        else
            status = read_texels(self, corners[i], 1, &places[i], err);
        if (status)
            return status;
    }
    const double side = strl__footprint_of((const double(*)[2])places, 3);
    if (!self->gltf->paint.footprints) {
        self->log_sum += side > 1 ? log2(side) : 0;
        self->log_count++;
        return STRL_OK;
    }
    for (unsigned i = 0; i < 3; i++)
        strl__footprint_add(&self->gltf->paint.footprints[corners[i] - self->first], side);
    return STRL_OK;
}

static strl_status add_triangles(measure *self, strl_error *err)
{
    strl__gltf *gltf = self->gltf;
    const unsigned mode = strl__gltf_mode_of(self->primitive);
    const bool is_indexed = self->primitive->indices != STRL__NO_ITEM;
    const size_t most = mode == 4 ? STRL__GLTF_CHUNK / 3 : STRL__GLTF_CHUNK - 2;
    uint32_t centre = 0;
    strl_status status = STRL_OK;
    if (is_indexed && mode == 6)
        status = strl__gltf_read_elements(gltf, self->primitive, 0, 1, &centre, err);
    for (uint64_t first = 0; first < gltf->pass.triangle_count && !status; first += most) {
        const uint64_t left = gltf->pass.triangle_count - first;
        const size_t count = left < most ? (size_t)left : most;
        const uint64_t begin = mode == 4 ? 3 * first : mode == 5 ? first : first + 1;
        if (is_indexed)
            status = strl__gltf_read_elements(gltf, self->primitive, begin,
                                              mode == 4   ? 3 * count
                                              : mode == 5 ? count + 2
                                                          : count + 1,
                                              gltf->elements, err);
        for (size_t i = 0; i < count && !status; i++) {
            uint32_t slots[3];
            strl__gltf_corners_of(mode, first + i, i, slots);
            for (unsigned k = 0; k < 3; k++)
                slots[k] = slots[k] == STRL__GLTF_FAN_CENTRE ? centre
                           : is_indexed                      ? gltf->elements[slots[k]]
                                                             : (uint32_t)(begin + slots[k]);
            status = add_triangle(self, slots, err);
        }
    }
    return status;
}

static void forget_measure(strl__gltf_paint *paint)
{
    strl__free(paint->footprints);
    paint->footprints = NULL;
    paint->measured = STRL__NO_ITEM;
}

/* Of vertices that lie far apart one place is read after the other, as their corners are later, and
 * all have the mean; of the others those that are loaded. */
static strl_status measure_vertices(measure *self, strl_error *err)
{
    strl__gltf_paint *paint = &self->gltf->paint;
    const bool is_scattered = self->gltf->pass.is_scattered;
    const bool is_shared = self->primitive->indices != STRL__NO_ITEM && !is_scattered;
    strl_status status = STRL_OK;
    if (!is_scattered)
        self->places = strl__alloc((size_t)self->count, sizeof *self->places);
    if (is_shared)
        paint->footprints = strl__alloc_zero((size_t)self->count, sizeof *paint->footprints);
    if ((!is_scattered && !self->places) || (is_shared && !paint->footprints))
        status = strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for texture coordinates", self->gltf->reader->path);
    if (!status && !is_scattered)
        status = read_all_places(self, err);
    if (!status)
        status = add_triangles(self, err);
    if (self->log_count)
        paint->footprint = exp2(self->log_sum / (double)self->log_count);
    strl__free(self->places);
    return status;
}

/* What the vertices of the primitive stand for, unless that is known from the placement before. */
static strl_status measure_primitive(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    strl__gltf_paint *paint = &gltf->paint;
    const strl__gltf_pass *pass = &gltf->pass;
    const uint32_t index = (uint32_t)(primitive - gltf->primitives);
    const uint64_t each = sizeof(double[2]) + sizeof *paint->footprints;
    measure self = {.gltf = gltf,
                    .primitive = primitive,
                    .first = pass->is_scattered ? 0 : pass->first_loaded,
                    .count = pass->is_scattered ? pass->vertex_count : pass->loaded_count};
    strl_status status = STRL_OK;
    if (paint->measured == index && paint->first == pass->first_loaded && paint->count == pass->loaded_count)
        return STRL_OK;
    forget_measure(paint);
    paint->first = pass->first_loaded;
    paint->count = pass->loaded_count;
    paint->footprint = strl__footprint_guess(paint->image, self.count);
    if (pass->is_scattered || self.count <= gltf->reader->memory_bytes / MEASURE_SHARE / each)
        status = measure_vertices(&self, err);
    if (status)
        forget_measure(paint);
    else
        paint->measured = index;
    return status;
}

strl_status strl__gltf_begin_paint(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    strl__gltf_paint *paint = &gltf->paint;
    const uint32_t texcoord = strl__gltf_texcoord(gltf, primitive);
    paint->image = NULL;
    paint->texcoord = texcoord;
    if (texcoord == STRL__NO_ITEM)
        return STRL_OK;
    const strl__gltf_material *material = &gltf->materials[primitive->material];
    paint->texture = material->texture;
    paint->draco_id = primitive->draco ? primitive->draco->texcoord[material->set] : STRL__NO_ITEM;
    strl_status status = strl__textures_get(&gltf->reader->textures, material->texture, &paint->image, err);
    if (status || !paint->image)
        return status;
    return measure_primitive(gltf, primitive, err);
}

void strl__gltf_end_paint(strl__gltf *gltf)
{
    forget_measure(&gltf->paint);
    gltf->paint.image = NULL;
}

strl_status strl__gltf_paint_corners(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t first,
                                     size_t count, strl__corner *corners, strl_error *err)
{
    const strl__gltf_paint *paint = &gltf->paint;
    const strl__textures *textures = &gltf->reader->textures;
    const strl__srgb *srgb = &textures->srgb;
    double places[STRL__GLTF_CHUNK][2];
    strl__image_spot spot;
    strl_status status = read_places(gltf, first, count, places, err);
    memcpy(spot.wrap, textures->items[paint->texture].wrap, sizeof spot.wrap);
    for (size_t i = 0; i < count && !status; i++)
        for (unsigned k = 0; k < 2; k++)
            corners[i].texcoord[k] = (float)places[i][k];
    for (size_t i = 0; i < count && !status && paint->image; i++) {
        const double *tint = gltf->tints + 4 * i;
        double texel[4];
        spot.u = places[i][0];
        spot.v = places[i][1];
        spot.footprint =
            paint->footprints ? strl__footprint_side(paint->footprints[first - paint->first + i]) : paint->footprint;
        strl__image_sample(paint->image, srgb, &spot, texel);
        corners[i].colour =
            strl__pack_colour(strl__srgb_encode(srgb, texel[0] * tint[0]), strl__srgb_encode(srgb, texel[1] * tint[1]),
                              strl__srgb_encode(srgb, texel[2] * tint[2]),
                              strl__gltf_alpha(gltf, primitive->material, texel[3] * tint[3]));
    }
    return status;
}
