/* OBJ files and images. A corner's colour depends on its texture coordinate and on the triangles
 * that use it, not on the face, so that faces agree about the corners they share. */
#include "readers/obj.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

/* ---- bytes */

static strl_status read_file(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    return strl_file_read(context, offset, data, size, err);
}

static void close_file(void *context)
{
    strl_file_close(context, NULL); /* only read from */
}

/* Paths of another machine end in a name that is often found beside the model. */
static char *beside(const strl_reader *reader, const char *path)
{
    const char *model = strrchr(reader->path, '/'), *slash = strrchr(path, '/');
    const char *name = slash ? slash + 1 : path;
    const size_t folder = model ? (size_t)(model + 1 - reader->path) : 0;
    char *joined = strl__alloc(folder + strlen(name) + 1, 1);
    if (!joined)
        return NULL;
    memcpy(joined, reader->path, folder);
    strcpy(joined + folder, name);
    return joined;
}

strl_status strl__obj_open_picture(void *context, const strl__picture *picture, const char *ending,
                                   strl__picture_place *found, strl_error *err)
{
    strl_reader *reader = context;
    char *path = ending ? strl__texture_rename(picture->key, ending) : strl__strdup(picture->key);
    char *other = path ? beside(reader, path) : NULL;
    strl_file *file = NULL;
    strl_file_info info;
    strl_status status;
    if (!path || !other)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    else
        status = strl_file_open(!strl_path_exists(path) && strl_path_exists(other) ? other : path, &file, err);
    if (!status)
        status = strl_file_stat(file, &info, err);
    if (!status)
        status = strl__reader_note_beside(reader, strl_file_path(file), &info, err);
    if (status && path && other)
        status = strl__fail_context(err, status, "cannot be read");
    if (status)
        close_file(file);
    else
        *found = (strl__picture_place){.source = {.context = file, .read = read_file, .bytes = strl_file_bytes(file)},
                                       .close = close_file};
    strl__free(path);
    strl__free(other);
    return status;
}

/* ---- faces */

/* What a run of faces of one material shows. */
typedef struct brush {
    const strl__texture *texture;
    const strl__image *image; /* NULL: nothing */
    uint32_t material;
} brush;

static strl_status take_brush(strl_reader *reader, uint32_t material, brush *self, strl_error *err)
{
    if (self->material == material)
        return STRL_OK;
    const uint32_t index = reader->materials.items[material].texture;
    *self = (brush){.material = material};
    if (index == STRL__NO_TEXTURE)
        return STRL_OK;
    self->texture = &reader->textures.items[index];
    return strl__textures_get(&reader->textures, index, &self->image, err);
}

static void place_corner(const brush *self, const strl__corner *corner, double place[2])
{
    const double given[2] = {(double)corner->texcoord[0], (double)corner->texcoord[1]};
    strl__texture_place(self->texture, given, place);
}

/* ---- footprints */

#define MEASURE_SHARE 16u

static void measure_face(const strl__obj *obj, const strl__batch *batch, const strl__face *face, size_t first,
                         const brush *with, double (*places)[2])
{
    for (uint32_t i = 0; i < face->corner_count; i++) {
        if (batch->texcoord[first + i] == STRL__NO_INDEX)
            return;
        place_corner(with, &batch->corners[first + i], places[i]);
        places[i][0] *= with->image->width;
        places[i][1] *= with->image->height;
    }
    const double side = strl__footprint_of((const double(*)[2])places, face->corner_count);
    for (uint32_t i = 0; i < face->corner_count; i++)
        strl__footprint_add(&obj->footprints[batch->texcoord[first + i]], side);
}

static strl_status measure_batch(strl_reader *reader, double (*places)[2], strl_error *err)
{
    const strl__batch *batch = &reader->batch;
    brush with = {.material = UINT32_MAX};
    size_t first = 0;
    strl_status status = STRL_OK;
    for (size_t i = 0; i < batch->face_count && !status; i++) {
        status = take_brush(reader, batch->faces[i].material, &with, err);
        if (!status && with.image)
            measure_face(reader->state, batch, &batch->faces[i], first, &with, places);
        first += batch->faces[i].corner_count;
    }
    return status;
}

strl_status strl__obj_measure(strl_reader *reader, strl_error *err)
{
    strl__obj *obj = reader->state;
    const uint64_t count = reader->texcoords.count;
    const strl_reader_drops drops = reader->drops;
    const bool ended = reader->ended;
    if (count > reader->memory_bytes / MEASURE_SHARE / sizeof *obj->footprints)
        return STRL_OK; /* guessed */
    double(*places)[2] = strl__alloc(STRL__POLYGON_CORNERS_MAX, sizeof *places);
    obj->footprints = strl__alloc_zero((size_t)count, sizeof *obj->footprints);
    strl_status status = places && obj->footprints
                             ? strl__obj_start(reader, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for texture coordinates", reader->path);
    for (reader->ended = false; !status && !reader->ended;) {
        strl__batch_reset(&reader->batch);
        status = strl__obj_fill(reader, err);
        if (!status)
            status = strl__batch_resolve_texcoords(&reader->batch, &reader->texcoords, err);
        if (!status)
            status = measure_batch(reader, places, err);
    }
    strl__batch_reset(&reader->batch);
    reader->drops = drops;
    reader->ended = ended;
    strl__free(places);
    return status;
}

/* ---- colours */

static void paint_corner(const strl_reader *reader, const brush *with, double footprint, strl__corner *corner)
{
    const strl__srgb *srgb = &reader->textures.srgb;
    strl__image_spot spot = {.footprint = footprint};
    double place[2], texel[4];
    uint8_t code[4];
    memcpy(spot.wrap, with->texture->wrap, sizeof spot.wrap);
    place_corner(with, corner, place);
    corner->texcoord[0] = (float)place[0];
    corner->texcoord[1] = (float)place[1];
    if (!with->image)
        return;
    spot.u = place[0];
    spot.v = place[1];
    strl__image_sample(with->image, srgb, &spot, texel);
    for (unsigned i = 0; i < 4; i++)
        code[i] = (uint8_t)(corner->colour >> 8 * i);
    corner->colour = strl__pack_colour(strl__srgb_encode(srgb, texel[0] * srgb->linear[code[0]]),
                                       strl__srgb_encode(srgb, texel[1] * srgb->linear[code[1]]),
                                       strl__srgb_encode(srgb, texel[2] * srgb->linear[code[2]]),
                                       strl__colour_channel(STRL__F64, texel[3] * code[3] / 255));
}

static double footprint_of(const strl_reader *reader, const brush *with, uint64_t texcoord)
{
    const strl__obj *obj = reader->state;
    if (obj->footprints)
        return strl__footprint_side(obj->footprints[texcoord]);
    return with->image ? strl__footprint_guess(with->image, reader->texcoords.count) : 1;
}

/* Also where each corner is in its image, from now on as glTF has it. */
strl_status strl__obj_paint(strl_reader *reader, strl_error *err)
{
    strl__batch *batch = &reader->batch;
    brush with = {.material = UINT32_MAX};
    size_t corner = 0;
    strl_status status = STRL_OK;
    for (size_t i = 0; i < batch->face_count && !status; i++) {
        const size_t end = corner + batch->faces[i].corner_count;
        status = take_brush(reader, batch->faces[i].material, &with, err);
        for (; corner < end && !status; corner++) {
            const uint64_t texcoord = batch->texcoord[corner];
            if (texcoord == STRL__NO_INDEX || !with.texture)
                batch->corners[corner].texcoord[0] = NAN;
            else
                paint_corner(reader, &with, footprint_of(reader, &with, texcoord), &batch->corners[corner]);
        }
        corner = end;
    }
    return status;
}
