/* EXT_meshopt_compression. The library's decoders work on whole views and end the process where
 * strides or counts are not theirs: all that is checked before each call. What they give may hold
 * any number; whoever reads indices checks them.
 *
 * A view is decompressed once: one that has to make room for another goes to scratch. Two views of
 * one primitive that do not fit together would otherwise be decompressed again for each window. */
#include <inttypes.h>
#include <string.h>

#include <meshoptimizer.h>

#include "base/fail.h"
#include "readers/gltf.h"

static uint64_t add(uint64_t a, uint64_t b)
{
    uint64_t sum;
    return __builtin_add_overflow(a, b, &sum) ? UINT64_MAX : sum;
}

/* With so many bytes more. */
static uint64_t held_with(const strl__gltf *gltf, uint64_t bytes)
{
    return add(bytes, gltf->decoded_bytes + gltf->draco_bytes);
}

static uint64_t limit_of(const strl__gltf *gltf)
{
    const uint64_t half = gltf->reader->memory_bytes / 2;
    const uint64_t held = gltf->table_bytes + gltf->arena.total_bytes + gltf->reader->textures.held_bytes;
    return held < half ? half - held : 0;
}

/* Once images have made room for so many bytes. One that a placement shows stays. */
static uint64_t limit_for(strl__gltf *gltf, uint64_t bytes)
{
    if (held_with(gltf, bytes) > limit_of(gltf)) {
        if (gltf->paint.image)
            strl__textures_shed(&gltf->reader->textures);
        else
            strl__textures_rest(&gltf->reader->textures);
    }
    return limit_of(gltf);
}

static void drop(strl__gltf *gltf, strl__gltf_decoded *decoded)
{
    gltf->decoded_bytes -= decoded->size;
    strl__free(decoded->bytes);
    *decoded = (strl__gltf_decoded){0};
}

uint64_t strl__gltf_room(strl__gltf *gltf)
{
    for (unsigned i = 0; i < STRL__GLTF_DECODED_MAX; i++)
        drop(gltf, &gltf->decoded[i]);
    return limit_of(gltf);
}

void strl__gltf_close_decoded(strl__gltf *gltf)
{
    for (unsigned i = 0; i < STRL__GLTF_DECODED_MAX; i++)
        drop(gltf, &gltf->decoded[i]);
    strl__draco_close(gltf->draco);
    gltf->draco = NULL;
    gltf->draco_bytes = 0;
    strl_file_close(gltf->stored, NULL); /* scratch */
    gltf->stored = NULL;
}

/* The view that was used longest ago; NULL where there is none. */
static strl__gltf_decoded *find_oldest(strl__gltf *gltf)
{
    strl__gltf_decoded *oldest = NULL;
    for (unsigned i = 0; i < STRL__GLTF_DECODED_MAX; i++)
        if (gltf->decoded[i].bytes && (!oldest || gltf->decoded[i].used_at < oldest->used_at))
            oldest = &gltf->decoded[i];
    return oldest;
}

strl_status strl__gltf_make_room(strl__gltf *gltf, uint64_t bytes, const char *what, strl_error *err)
{
    strl__gltf_decoded *oldest;
    const uint64_t limit = limit_for(gltf, bytes);
    while (held_with(gltf, bytes) > limit && (oldest = find_oldest(gltf)) != NULL)
        drop(gltf, oldest);
    if (add(bytes, gltf->draco_bytes) <= limit)
        return STRL_OK;
    char advice[STRL__ADVICE_BYTES];
    const uint64_t half = gltf->reader->memory_bytes / 2;
    const strl__image *image = gltf->paint.image;
    const uint64_t others = add(bytes, gltf->table_bytes + gltf->arena.total_bytes);
    /* A halved image is larger where there is more memory: half of the half, which is its most. */
    const uint64_t needed = add(others, image && image->halvings ? others : gltf->reader->textures.held_bytes);
    strl__reader_advise(gltf->reader, needed, half, advice);
    return strl__fail(err, STRL_ERR_LIMIT,
                      "%s: %s takes %" PRIu64 " bytes decompressed, the memory budget allows %" PRIu64 ": %s",
                      gltf->reader->path, what, bytes, limit, advice);
}

static bool is_sound(const strl__gltf_meshopt *meshopt)
{
    const uint32_t stride = meshopt->stride;
    if (meshopt->mode != STRL__MESHOPT_ATTRIBUTES)
        return (stride == 2 || stride == 4) && meshopt->filter == STRL__MESHOPT_NONE &&
               (meshopt->mode == STRL__MESHOPT_INDICES || meshopt->count % 3 == 0);
    if (meshopt->filter == STRL__MESHOPT_OCTAHEDRAL)
        return stride == 4 || stride == 8;
    if (meshopt->filter == STRL__MESHOPT_QUATERNION)
        return stride == 8;
    return stride % 4 == 0 && stride > 0 && stride <= 256;
}

strl_status strl__gltf_check_meshopt(strl__gltf *gltf, uint32_t index, strl_error *err)
{
    const strl__gltf_view *view = &gltf->views[index];
    const strl__gltf_meshopt *meshopt = view->meshopt;
    const char *path = gltf->reader->path;
    uint64_t end;
    if (!is_sound(meshopt) || meshopt->count > UINT32_MAX || view->bytes > meshopt->count * meshopt->stride)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, bufferViews[%u]: a compressed count of %" PRIu64 " and stride of %u "
                          "do not fit its mode, filter and length",
                          path, index, meshopt->count, meshopt->stride);
    if (meshopt->buffer >= gltf->buffer_count)
        return strl__gltf_fail_index(gltf, ", a compressed bufferView", "buffers", gltf->buffer_count, meshopt->buffer,
                                     err);
    if (__builtin_add_overflow(meshopt->offset, meshopt->bytes, &end) || end > gltf->buffers[meshopt->buffer].bytes)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, bufferViews[%u]: its %" PRIu64 " compressed bytes at %" PRIu64
                          " end after the buffer's %" PRIu64,
                          path, index, meshopt->bytes, meshopt->offset, gltf->buffers[meshopt->buffer].bytes);
    strl_status status = strl__gltf_open_buffer(gltf, meshopt->buffer, err);
    uint64_t decoded = meshopt->count * meshopt->stride;
    return status ? status : strl__gltf_make_room(gltf, decoded + meshopt->bytes, "a compressed buffer view", err);
}

static int decode(const strl__gltf_meshopt *meshopt, const uint8_t *packed, uint8_t *bytes)
{
    const size_t count = (size_t)meshopt->count, size = (size_t)meshopt->bytes;
    int failed;
    switch (meshopt->mode) {
    case STRL__MESHOPT_TRIANGLES:
        return meshopt_decodeIndexBuffer(bytes, count, meshopt->stride, packed, size);
    case STRL__MESHOPT_INDICES:
        return meshopt_decodeIndexSequence(bytes, count, meshopt->stride, packed, size);
    case STRL__MESHOPT_ATTRIBUTES:
        break;
    }
    failed = meshopt_decodeVertexBuffer(bytes, count, meshopt->stride, packed, size);
    if (failed)
        return failed;
    if (meshopt->filter == STRL__MESHOPT_OCTAHEDRAL)
        meshopt_decodeFilterOct(bytes, count, meshopt->stride);
    else if (meshopt->filter == STRL__MESHOPT_QUATERNION)
        meshopt_decodeFilterQuat(bytes, count, meshopt->stride);
    else if (meshopt->filter == STRL__MESHOPT_EXPONENTIAL)
        meshopt_decodeFilterExp(bytes, count, meshopt->stride);
    return 0;
}

static strl_status decompress(strl__gltf *gltf, uint32_t index, uint8_t *bytes, strl_error *err)
{
    const strl__gltf_meshopt *meshopt = gltf->views[index].meshopt;
    uint8_t *packed = strl__alloc((size_t)meshopt->bytes, 1);
    strl_status status =
        packed ? strl__gltf_read_buffer(gltf, meshopt->buffer, meshopt->offset, packed, (size_t)meshopt->bytes, err)
               : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a compressed buffer view", gltf->reader->path);
    if (!status && meshopt->count > 0 && decode(meshopt, packed, bytes) != 0)
        status = strl__fail(err, STRL_ERR_FORMAT, "%s, bufferViews[%u]: its %" PRIu64 " compressed bytes are damaged",
                            gltf->reader->path, index, meshopt->bytes);
    strl__free(packed);
    return status;
}

bool strl__gltf_store(strl__gltf *gltf, const void *bytes, size_t size, uint64_t *at)
{
    const char *folder = gltf->reader->scratch_dir;
    *at = gltf->stored_bytes;
    if (!folder || (!gltf->stored && strl_file_create_nameless(folder, &gltf->stored, NULL)) ||
        strl_file_write(gltf->stored, *at, bytes, size, NULL))
        return false;
    gltf->stored_bytes += size;
    return true;
}

/* Makes room for another view. Without scratch, or a place in it, this one is decompressed again. */
static void store_away(strl__gltf *gltf, strl__gltf_decoded *decoded)
{
    strl__gltf_view *view = &gltf->views[decoded->view];
    if (!view->is_stored)
        view->is_stored = strl__gltf_store(gltf, decoded->bytes, (size_t)decoded->size, &view->stored_at);
    drop(gltf, decoded);
}

void strl__gltf_rest_decoded(strl__gltf *gltf)
{
    for (unsigned i = 0; i < STRL__GLTF_DECODED_MAX; i++)
        if (gltf->decoded[i].bytes)
            store_away(gltf, &gltf->decoded[i]);
    strl__draco_close(gltf->draco);
    gltf->draco = NULL;
    gltf->draco_bytes = 0;
}

static strl_status add_decoded(strl__gltf *gltf, uint32_t index, strl__gltf_decoded **added, strl_error *err)
{
    const strl__gltf_meshopt *meshopt = gltf->views[index].meshopt;
    const uint64_t size = meshopt->count * meshopt->stride, limit = limit_for(gltf, size + meshopt->bytes);
    strl__gltf_decoded *place = NULL, *oldest;
    while (held_with(gltf, size + meshopt->bytes) > limit && (oldest = find_oldest(gltf)) != NULL)
        store_away(gltf, oldest);
    strl_status status = strl__gltf_make_room(gltf, size + meshopt->bytes, "a compressed buffer view", err);
    for (unsigned i = 0; i < STRL__GLTF_DECODED_MAX && !place; i++)
        place = gltf->decoded[i].bytes ? NULL : &gltf->decoded[i];
    if (status)
        return status;
    if (!place) {
        place = find_oldest(gltf);
        store_away(gltf, place);
    }
    uint8_t *bytes = strl__alloc((size_t)size, 1);
    status = bytes ? decompress(gltf, index, bytes, err)
                   : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for %" PRIu64 " decompressed bytes",
                                gltf->reader->path, size);
    if (status) {
        strl__free(bytes);
        return status;
    }
    *place = (strl__gltf_decoded){.view = index, .bytes = bytes, .size = size};
    gltf->decoded_bytes += size;
    *added = place;
    return STRL_OK;
}

strl_status strl__gltf_decode_view(strl__gltf *gltf, uint32_t index, const uint8_t **bytes, strl_error *err)
{
    strl__gltf_decoded *found = NULL;
    strl_status status = STRL_OK;
    for (unsigned i = 0; i < STRL__GLTF_DECODED_MAX && !found; i++)
        if (gltf->decoded[i].bytes && gltf->decoded[i].view == index)
            found = &gltf->decoded[i];
    if (!found)
        status = add_decoded(gltf, index, &found, err);
    if (status)
        return status;
    found->used_at = ++gltf->clock;
    *bytes = found->bytes;
    return STRL_OK;
}
