#include "readers/texture.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

#define REFERENCE_BYTES_MAX 1000u /* longer ones are cut */

void strl__textures_init(strl__textures *textures, uint64_t limit_bytes, const char *advice)
{
    *textures = (strl__textures){.limit_bytes = limit_bytes, .advice = advice, .is_ready = true};
    strl__names_init(&textures->keys, (size_t)(limit_bytes / 16), advice);
    strl__srgb_init(&textures->srgb);
}

void strl__textures_deinit(strl__textures *textures)
{
    for (size_t i = 0; i < textures->keys.count; i++) {
        strl__image_deinit(&textures->pictures[i].image);
        strl__free(textures->pictures[i].key);
        strl__free(textures->pictures[i].reference);
    }
    strl__names_deinit(&textures->keys);
    strl__free(textures->pictures);
    strl__free(textures->items);
    *textures = (strl__textures){0};
}

strl_status strl__textures_add_picture(strl__textures *textures, const char *key, const char *reference, uint64_t item,
                                       uint32_t *picture, strl_error *err)
{
    const size_t before = textures->keys.count;
    if (!strl__grow(&textures->pictures, &textures->picture_capacity, before + 1, sizeof *textures->pictures))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu images", before + 1);
    char cut[REFERENCE_BYTES_MAX + 1];
    snprintf(cut, sizeof cut, "%s", reference);
    strl__picture added = {.key = strl__strdup(key), .reference = strl__strdup(cut), .item = item};
    strl_status status = added.key && added.reference
                             ? strl__names_add(&textures->keys, key, strlen(key), picture, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory for an image's name");
    if (!status && *picture == before) {
        textures->pictures[before] = added;
        return STRL_OK;
    }
    strl__free(added.key);
    strl__free(added.reference);
    return status;
}

strl_status strl__textures_add(strl__textures *textures, const strl__texture *texture, uint32_t *index, strl_error *err)
{
    if (textures->count >= STRL__NO_TEXTURE || textures->count * sizeof *texture > textures->limit_bytes / 16)
        return strl__fail(err, STRL_ERR_LIMIT, "%zu textures are more than the memory budget allows: %s",
                          textures->count, textures->advice);
    if (!strl__grow(&textures->items, &textures->capacity, textures->count + 1, sizeof *texture))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu textures", textures->count + 1);
    textures->items[textures->count] = *texture;
    *index = (uint32_t)textures->count++;
    return STRL_OK;
}

/* ---- decoding */

static void forget(strl__textures *textures, strl__picture *picture)
{
    textures->held_bytes -= picture->image.bytes;
    strl__image_deinit(&picture->image);
    picture->is_held = false;
}

static strl__picture *find_oldest(strl__textures *textures)
{
    strl__picture *oldest = NULL;
    for (size_t i = 0; i < textures->keys.count; i++) {
        strl__picture *picture = &textures->pictures[i];
        if (picture->is_held && (!oldest || picture->used_at < oldest->used_at))
            oldest = picture;
    }
    return oldest;
}

static void make_room(void *context, uint64_t bytes)
{
    strl__textures *textures = context;
    while (textures->held_bytes && textures->held_bytes + bytes > textures->limit_bytes)
        forget(textures, find_oldest(textures));
}

void strl__textures_rest(strl__textures *textures)
{
    make_room(textures, textures->limit_bytes);
}

void strl__textures_shed(strl__textures *textures)
{
    strl__picture *oldest;
    while ((oldest = find_oldest(textures)) && oldest->used_at != textures->clock)
        forget(textures, oldest);
}

char *strl__texture_rename(const char *name, const char *ending)
{
    const char *slash = strrchr(name, '/'), *dot = strrchr(name, '.');
    const size_t stem = dot && (!slash || dot > slash) ? (size_t)(dot - name) : strlen(name);
    char *renamed = strl__alloc(stem + strlen(ending) + 2, 1);
    if (!renamed)
        return NULL;
    memcpy(renamed, name, stem);
    renamed[stem] = '.';
    strcpy(renamed + stem + 1, ending);
    return renamed;
}

static strl_status decode_as(strl__textures *textures, strl__picture *picture, const char *ending, strl_error *err)
{
    strl__picture_place place = {.close = NULL};
    const strl__image_room room = {.limit_bytes = textures->limit_bytes,
                                   .image_bytes = textures->image_bytes,
                                   .advice = textures->advice,
                                   .context = textures,
                                   .make = make_room};
    strl_status status = textures->open(textures->context, picture, ending, &place, err);
    if (!status)
        status = strl__image_decode(&place.source, &room, &textures->srgb, &picture->image, err);
    if (place.close)
        place.close(place.source.context);
    return status;
}

/* Of files that are missing, or of a kind that is not read, others often lie beside them. */
static strl_status decode(strl__textures *textures, strl__picture *picture, strl_error *err)
{
    static const char *const endings[] = {"png", "jpg", "jpeg"};
    strl_status status = decode_as(textures, picture, NULL, err);
    for (unsigned i = 0; i < sizeof endings / sizeof *endings; i++) {
        strl_error other = {0};
        if (status != STRL_ERR_IO && status != STRL_ERR_UNSUPPORTED)
            break;
        strl_status tried = decode_as(textures, picture, endings[i], &other);
        if (tried == STRL_ERR_MEMORY)
            return strl__fail(err, tried, "%s", other.message);
        status = tried ? status : STRL_OK;
    }
    return status;
}

/* Named once, where the reason does not name it. */
static void note_unusable(strl__textures *textures, strl__picture *picture, const strl_error *why)
{
    const char *name = !*picture->reference                       ? "a texture"
                       : strstr(why->message, picture->reference) ? "an image"
                                                                  : picture->reference;
    picture->is_unusable = true;
    if (textures->unusable_count++ == 0)
        strl__fail(&textures->first_unusable, why->status, "%.400s %s", name, why->message);
}

strl_status strl__textures_get(strl__textures *textures, uint32_t texture, const strl__image **image, strl_error *err)
{
    strl__picture *picture = &textures->pictures[textures->items[texture].picture];
    *image = NULL;
    if (picture->is_unusable)
        return STRL_OK;
    if (!picture->is_held) {
        strl_error why = {0};
        strl_status status = decode(textures, picture, &why);
        if (status == STRL_ERR_MEMORY)
            return strl__fail(err, status, "%s", why.message);
        if (status) {
            note_unusable(textures, picture, &why);
            return STRL_OK;
        }
        picture->is_held = true;
        textures->held_bytes += picture->image.bytes;
    }
    picture->used_at = ++textures->clock;
    *image = &picture->image;
    return STRL_OK;
}

/* ---- footprints: the sum of codes, of which each is a 16th of an octave, and how many there are */

#define COUNT_MAX 255u
#define CODES_OF_OCTAVE 16
#define CODE_MAX 255

double strl__footprint_of(const double (*corners)[2], uint32_t count)
{
    double sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        const double *a = corners[i], *b = corners[i + 1 < count ? i + 1 : 0];
        sum += sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]));
    }
    return sum / count / 2;
}

void strl__footprint_add(strl__footprint *footprint, double side)
{
    const uint32_t count = *footprint >> 16;
    int code = 0;
    if (count == COUNT_MAX || side != side)
        return;
    if (side > 1)
        code = side < 65536 ? (int)(log2(side) * CODES_OF_OCTAVE + 0.5) : CODE_MAX;
    *footprint += (1u << 16) + (uint32_t)(code < CODE_MAX ? code : CODE_MAX);
}

double strl__footprint_side(strl__footprint footprint)
{
    const uint32_t count = footprint >> 16;
    return count ? exp2((double)(footprint & 0xffff) / count / CODES_OF_OCTAVE) : 1;
}

double strl__footprint_guess(const strl__image *image, uint64_t vertices)
{
    const double texels = (double)image->width * image->height;
    return vertices ? fmax(sqrt(texels / (double)vertices) / 2, 1) : 1;
}

void strl__texture_place(const strl__texture *texture, const double given[2], double placed[2])
{
    const double *t = texture->transform;
    placed[0] = t[0] * given[0] + t[1] * given[1] + t[2];
    placed[1] = t[3] * given[0] + t[4] * given[1] + t[5];
}
