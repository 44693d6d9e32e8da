/* Images that materials name: decoded when first looked up, forgotten when others need the room, and
 * what cannot be used of them, which leaves a material its colour alone. */
#ifndef STRL_READERS_TEXTURE_H
#define STRL_READERS_TEXTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "readers/image.h"
#include "readers/names.h"

#define STRL__NO_TEXTURE UINT32_MAX

typedef struct strl__picture {
    char *key;       /* owned; one for each picture */
    char *reference; /* owned; as the model names it */
    uint64_t item;   /* of the format */
    strl__image image;
    bool is_unusable, is_held;
    uint64_t used_at;
} strl__picture;

/* How a material uses a picture. */
typedef struct strl__texture {
    uint32_t picture;
    uint32_t set; /* of texture coordinates; glTF */
    strl__wrap wrap[2];
    double transform[6]; /* u' = t[0] u + t[1] v + t[2], v' = t[3] u + t[4] v + t[5]; v' is down */
} strl__texture;

/* Where a picture's bytes are. */
typedef struct strl__picture_place {
    strl__image_source source;
    void (*close)(void *context); /* of source.context; may be NULL */
} strl__picture_place;

typedef struct strl__textures {
    strl__texture *items; /* owned */
    size_t count, capacity;
    strl__names keys;        /* of pictures */
    strl__picture *pictures; /* owned */
    size_t picture_capacity;
    uint64_t limit_bytes, held_bytes, clock;
    uint64_t image_bytes; /* of one image at most; 0 = limit_bytes */
    const char *advice;
    strl__srgb srgb;
    bool is_ready;
    /* ending: NULL, or what the file's name is to end in instead of its own. `err` says why not in
     * words that follow the picture's name. */
    strl_status (*open)(void *context, const strl__picture *picture, const char *ending, strl__picture_place *place,
                        strl_error *err);
    void *context;
    uint32_t unusable_count;
    strl_error first_unusable; /* its message */
} strl__textures;

/* open and context may be set later. advice: as of names. */
void strl__textures_init(strl__textures *textures, uint64_t limit_bytes, const char *advice);
void strl__textures_deinit(strl__textures *textures); /* zeroed is legal */
/* The picture of a key, which is added where it is new. */
strl_status strl__textures_add_picture(strl__textures *textures, const char *key, const char *reference, uint64_t item,
                                       uint32_t *picture, strl_error *err);
strl_status strl__textures_add(strl__textures *textures, const strl__texture *texture, uint32_t *index,
                               strl_error *err);
/* The decoded image of a texture, valid until the next call; NULL where it cannot be used, which is
 * counted once. Fails only without memory. */
strl_status strl__textures_get(strl__textures *textures, uint32_t texture, const strl__image **image, strl_error *err);
void strl__textures_rest(strl__textures *textures); /* gives decoded images back */
void strl__textures_shed(strl__textures *textures); /* all but the one that was looked up last */
/* A name with another ending, owned by the caller; NULL without memory. */
char *strl__texture_rename(const char *name, const char *ending);

/* ---- how much of an image a vertex stands for: of the triangles round it the geometric mean of half
 * their mean edge, in texels. Order-independent up to 255 of them; the others do not count. */

typedef uint32_t strl__footprint; /* zeroed: nothing was added */

/* corners: in texels. */
double strl__footprint_of(const double (*corners)[2], uint32_t count);
void strl__footprint_add(strl__footprint *footprint, double side);
double strl__footprint_side(strl__footprint footprint);
/* Of vertices that are too many to look at: as if they covered the image evenly. */
double strl__footprint_guess(const strl__image *image, uint64_t vertices);

/* A place in the file's own coordinates. */
void strl__texture_place(const strl__texture *texture, const double given[2], double placed[2]);

#endif
