/* Images, textures (here maps, because the reader's own textures are what comes of them) and
 * samplers. Of a texture that also has a form which is not read (KHR_texture_basisu,
 * EXT_texture_webp) the plain image is taken where it has one. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"

#define NAME_BYTES 256u

/* Fields whose failures make an item empty and do not refuse the file: nothing else depends on
 * it. */
static strl__fields quiet_fields(const char *path, strl_error *ignored)
{
    return (strl__fields){.path = path, .member = "textures", .err = ignored};
}

strl_status strl__gltf_parse_map(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    static const char *const others[] = {"KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif",
                                         "MSFT_texture_dds"};
    strl_error ignored = {0};
    strl__fields quiet = quiet_fields(fields->path, &ignored);
    strl__gltf_map map = {.image = strl__fields_index(&quiet, value, "source"),
                          .sampler = strl__fields_index(&quiet, value, "sampler")};
    for (unsigned i = 0; i < sizeof others / sizeof *others && map.image == STRL__NO_ITEM; i++)
        map.image = strl__fields_index(&quiet, strl__fields_extension(&quiet, value, others[i]), "source");
    if (quiet.status)
        map = (strl__gltf_map){STRL__NO_ITEM, STRL__NO_ITEM};
    strl_status status =
        strl__gltf_add(gltf, &gltf->maps, &gltf->map_count, &gltf->map_capacity, sizeof map, fields->err);
    if (!status)
        gltf->maps[gltf->map_count - 1] = map;
    return status;
}

static strl__wrap parse_wrap(strl__fields *fields, const json_t *value, const char *key)
{
    switch (strl__fields_count(fields, value, key, 10497)) {
    case 33071:
        return STRL__WRAP_CLAMP;
    case 33648:
        return STRL__WRAP_MIRROR;
    default:
        return STRL__WRAP_REPEAT;
    }
}

strl_status strl__gltf_parse_sampler(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    strl_error ignored = {0};
    strl__fields quiet = quiet_fields(fields->path, &ignored);
    const strl__gltf_sampler sampler = {{parse_wrap(&quiet, value, "wrapS"), parse_wrap(&quiet, value, "wrapT")}};
    strl_status status = strl__gltf_add(gltf, &gltf->samplers, &gltf->sampler_count, &gltf->sampler_capacity,
                                        sizeof sampler, fields->err);
    if (!status)
        gltf->samplers[gltf->sampler_count - 1] = sampler;
    return status;
}

strl_status strl__gltf_parse_image(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    strl_error ignored = {0};
    strl__fields quiet = quiet_fields(fields->path, &ignored);
    strl__gltf_image image = {.uri = strl__gltf_keep_text(gltf, &quiet, value, "uri"),
                              .name = strl__gltf_keep_text(gltf, &quiet, value, "name"),
                              .view = strl__fields_index(&quiet, value, "bufferView")};
    if (quiet.status == STRL_ERR_MEMORY)
        return strl__fail(fields->err, quiet.status, "%s", ignored.message);
    if (quiet.status)
        image = (strl__gltf_image){.view = STRL__NO_ITEM};
    strl_status status =
        strl__gltf_add(gltf, &gltf->images, &gltf->image_count, &gltf->image_capacity, sizeof image, fields->err);
    if (!status)
        gltf->images[gltf->image_count - 1] = image;
    return status;
}

/* KHR_texture_transform: scaled, turned, moved. Counter-clockwise as one sees the image, whose v
 * goes down. */
static void parse_transform(strl__fields *fields, const json_t *info, double transform[6], uint32_t *set)
{
    const json_t *value = strl__fields_extension(fields, info, "KHR_texture_transform");
    double offset[2] = {0, 0}, scale[2] = {1, 1};
    const double angle = strl__fields_number(fields, value, "rotation", 0);
    strl__fields_numbers(fields, value, "offset", offset, 2);
    strl__fields_numbers(fields, value, "scale", scale, 2);
    *set = (uint32_t)fmin((double)strl__fields_count(fields, value, "texCoord", *set), 1e9);
    const double turned[2] = {cos(angle), sin(angle)};
    const double rows[6] = {turned[0] * scale[0],  turned[1] * scale[1], offset[0],
                            -turned[1] * scale[0], turned[0] * scale[1], offset[1]};
    memcpy(transform, rows, sizeof rows);
}

void strl__gltf_parse_map_use(const char *path, strl__gltf_material *material, const json_t *info)
{
    strl_error ignored = {0};
    strl__fields quiet = quiet_fields(path, &ignored);
    material->map = STRL__NO_ITEM;
    if (!info)
        return;
    material->map = strl__fields_index(&quiet, info, "index");
    material->set = (uint32_t)fmin((double)strl__fields_count(&quiet, info, "texCoord", 0), 1e9);
    parse_transform(&quiet, info, material->transform, &material->set);
    if (quiet.status || material->map == STRL__NO_ITEM)
        material->map = STRL__NO_ITEM - 1; /* there is one, but nobody knows which */
}

/* ---- linking */

static void name_image(const strl__gltf *gltf, uint32_t index, char name[NAME_BYTES])
{
    const strl__gltf_image *image = &gltf->images[index];
    const char *called = image->name && *image->name ? image->name : NULL;
    snprintf(name, NAME_BYTES, "images[%u]%s%.200s%s", index, called ? " (" : "", called ? called : "",
             called ? ")" : "");
}

/* The picture of a map: images that are files go by their names, so that one which several have is
 * decoded once. */
static strl_status add_picture(strl__gltf *gltf, uint32_t map, uint32_t *picture, strl_error *err)
{
    strl__textures *textures = &gltf->reader->textures;
    const uint32_t index = map < gltf->map_count ? gltf->maps[map].image : STRL__NO_ITEM;
    char name[NAME_BYTES];
    if (index >= gltf->image_count)
        return strl__textures_add_picture(textures, "", "", STRL__NO_ITEM, picture, err);
    const char *uri = gltf->images[index].uri;
    if (uri && strncmp(uri, "data:", 5) != 0)
        return strl__textures_add_picture(textures, uri, uri, index, picture, err);
    name_image(gltf, index, name);
    return strl__textures_add_picture(textures, name, name, index, picture, err);
}

strl_status strl__gltf_link_maps(strl__gltf *gltf, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; i < gltf->material_count && !status; i++) {
        strl__gltf_material *material = &gltf->materials[i];
        if (material->map == STRL__NO_ITEM)
            continue;
        const uint32_t sampler = material->map < gltf->map_count ? gltf->maps[material->map].sampler : STRL__NO_ITEM;
        strl__texture texture = {.set = material->set};
        if (sampler < gltf->sampler_count)
            memcpy(texture.wrap, gltf->samplers[sampler].wrap, sizeof texture.wrap);
        memcpy(texture.transform, material->transform, sizeof texture.transform);
        status = add_picture(gltf, material->map, &texture.picture, err);
        if (!status)
            status = strl__textures_add(&gltf->reader->textures, &texture, &material->texture, err);
    }
    return status ? strl__fail_context(err, status, "%s", gltf->reader->path) : STRL_OK;
}

uint32_t strl__gltf_texcoord(const strl__gltf *gltf, const strl__gltf_primitive *primitive)
{
    if (primitive->material == STRL__NO_ITEM)
        return STRL__NO_ITEM;
    const strl__gltf_material *material = &gltf->materials[primitive->material];
    return material->texture != STRL__NO_TEXTURE && material->set < STRL__GLTF_SETS ? primitive->texcoord[material->set]
                                                                                    : STRL__NO_ITEM;
}

/* ---- bytes */

typedef struct place {
    strl__gltf *gltf;
    strl__gltf_buffer buffer; /* of a uri */
    char *renamed;            /* owned; the uri where it is not the image's own */
    uint32_t view;            /* else */
} place;

static strl_status read_place(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    place *self = context;
    if (self->view != STRL__NO_ITEM)
        return strl__gltf_read_view(self->gltf, self->view, offset, data, size, err);
    if (!self->buffer.memory)
        return strl_file_read(self->buffer.file, offset, data, size, err);
    memcpy(data, self->buffer.memory + offset, size);
    return STRL_OK;
}

static void close_place(void *context)
{
    place *self = context;
    strl__gltf_close_buffer(self->gltf, &self->buffer);
    strl__free(self->renamed);
    strl__free(self);
}

static strl_status find_bytes(place *self, uint32_t image, const char *ending, uint64_t *bytes, strl_error *err)
{
    strl__gltf *gltf = self->gltf;
    const strl__gltf_image *from = &gltf->images[image];
    strl_status status = STRL_OK;
    if (ending && (!from->uri || strncmp(from->uri, "data:", 5) == 0))
        return strl__fail(err, STRL_ERR_UNSUPPORTED, "is no file");
    self->renamed = ending ? strl__texture_rename(from->uri, ending) : NULL;
    if (ending && !self->renamed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (from->uri) {
        self->view = STRL__NO_ITEM;
        self->buffer.uri = ending ? self->renamed : from->uri;
        status = strl__gltf_open_loose(gltf, &self->buffer, image, err);
        *bytes = self->buffer.bytes;
        return status;
    }
    if (from->view >= gltf->view_count)
        return strl__fail(err, STRL_ERR_FORMAT, "expected a uri or one of %zu buffer views", gltf->view_count);
    status = strl__gltf_check_view(gltf, from->view, err);
    *bytes = gltf->views[from->view].bytes;
    return status;
}

strl_status strl__gltf_open_picture(void *context, const strl__picture *picture, const char *ending,
                                    strl__picture_place *found, strl_error *err)
{
    strl__gltf *gltf = context;
    if (picture->item >= gltf->image_count)
        return strl__fail(err, STRL_ERR_FORMAT, "names no image that is there");
    place *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open an image");
    const uint32_t image = (uint32_t)picture->item;
    self->gltf = gltf;
    self->view = gltf->images[image].view;
    *found = (strl__picture_place){.source = {.context = self, .read = read_place}, .close = close_place};
    strl_status status = find_bytes(self, image, ending, &found->source.bytes, err);
    return status ? strl__fail_context(err, status, "cannot be read") : STRL_OK;
}
