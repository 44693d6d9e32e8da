#include "readers/image.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "readers/image_internal.h"

/* ---- averages */

/* Colours count by their alpha, or what is cut away would show at edges; a little even where that
 * is 0, so that there is a colour everywhere. */
static double weight_of(uint8_t alpha)
{
    return alpha + 1 / 256.;
}

static void add_texel(double sums[4], const strl__srgb *srgb, const uint8_t *texel)
{
    const double weight = weight_of(texel[3]);
    for (unsigned i = 0; i < 3; i++)
        sums[i] += srgb->linear[texel[i]] * weight;
    sums[3] += texel[3];
}

static void end_texel(const double sums[4], const strl__srgb *srgb, uint32_t count, uint8_t *texel)
{
    const double weight = sums[3] + count / 256.;
    for (unsigned i = 0; i < 3; i++)
        texel[i] = strl__srgb_encode(srgb, sums[i] / weight);
    texel[3] = (uint8_t)(sums[3] / count + 0.5);
}

/* ---- levels */

static uint32_t halved(uint64_t side, unsigned times)
{
    return (uint32_t)((side + ((uint64_t)1 << times) - 1) >> times);
}

/* Fills in what is held when the file's sides are halved so many times. Returns the texels of all
 * levels. */
static uint64_t plan_levels(strl__image *image, unsigned halvings)
{
    uint64_t texels = 0;
    uint32_t width = halved(image->width, halvings), height = halved(image->height, halvings);
    image->halvings = halvings;
    for (image->level_count = 0;;) {
        image->level[image->level_count++] = (strl__image_level){width, height, (size_t)texels};
        texels += (uint64_t)width * height;
        if (width == 1 && height == 1)
            return texels;
        width = halved(width, 1);
        height = halved(height, 1);
    }
}

strl_status strl__image_begin(strl__image_making *making, uint64_t width, uint64_t height, uint64_t working_bytes,
                              strl_error *err)
{
    strl__image *image = making->image;
    const uint64_t limit = making->room->limit_bytes, share = making->room->image_bytes;
    uint64_t texels, sums_bytes = 0;
    unsigned halvings = 0;
    if (width == 0 || height == 0 || width > STRL__IMAGE_SIDE_MAX || height > STRL__IMAGE_SIDE_MAX ||
        width * height > STRL__IMAGE_TEXELS_MAX)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "has %" PRIu64 " x %" PRIu64 " texels, expected 1 to %u a side and at "
                          "most %" PRIu64 " in all",
                          width, height, STRL__IMAGE_SIDE_MAX, STRL__IMAGE_TEXELS_MAX);
    *image = (strl__image){.width = (uint32_t)width, .height = (uint32_t)height};
    for (texels = plan_levels(image, 0);
         4 * texels + sums_bytes + working_bytes > limit || (share && 4 * texels > share);) {
        texels = plan_levels(image, ++halvings);
        sums_bytes = 4 * sizeof *making->sums * (uint64_t)image->level[0].width;
        if (image->level_count == 1)
            break;
    }
    const uint64_t needed = 4 * texels + sums_bytes + working_bytes;
    if (needed > limit)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "takes %" PRIu64 " bytes while it is decoded, of which the memory budget "
                          "allows %" PRIu64 "%s%s",
                          needed, limit, making->room->advice ? ": " : "",
                          making->room->advice ? making->room->advice : "");
    if (making->room->make)
        making->room->make(making->room->context, needed);
    image->bytes = 4 * texels;
    image->texels = strl__alloc((size_t)texels, 4);
    if (halvings)
        making->sums = strl__alloc_zero(image->level[0].width, 4 * sizeof *making->sums);
    if (!image->texels || (halvings && !making->sums))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for an image of %" PRIu64 " texels", texels);
    return STRL_OK;
}

static uint32_t cell_side(uint32_t index, uint64_t side, unsigned halvings)
{
    const uint64_t cell = (uint64_t)1 << halvings, begin = index * cell;
    return (uint32_t)(side - begin < cell ? side - begin : cell);
}

void strl__image_row(strl__image_making *making, const uint8_t *row)
{
    strl__image *image = making->image;
    const strl__image_level *finest = &image->level[0];
    const unsigned halvings = image->halvings;
    const uint32_t y = making->row++ >> halvings;
    uint8_t *out = image->texels + 4 * (size_t)y * finest->width;
    if (!making->sums) {
        memcpy(out, row, 4 * (size_t)image->width);
        return;
    }
    for (uint32_t x = 0; x < image->width; x++)
        add_texel(making->sums + 4 * (size_t)(x >> halvings), making->srgb, row + 4 * (size_t)x);
    const uint32_t rows = cell_side(y, image->height, halvings);
    if (making->row != (y << halvings) + rows)
        return;
    for (uint32_t x = 0; x < finest->width; x++)
        end_texel(making->sums + 4 * (size_t)x, making->srgb, rows * cell_side(x, image->width, halvings),
                  out + 4 * (size_t)x);
    memset(making->sums, 0, 4 * sizeof *making->sums * finest->width);
}

static void make_level(strl__image *image, const strl__srgb *srgb, unsigned number)
{
    const strl__image_level *from = &image->level[number - 1], *to = &image->level[number];
    for (uint32_t y = 0; y < to->height; y++)
        for (uint32_t x = 0; x < to->width; x++) {
            double sums[4] = {0};
            uint32_t count = 0;
            for (uint32_t row = 2 * y; row < 2 * y + 2 && row < from->height; row++)
                for (uint32_t column = 2 * x; column < 2 * x + 2 && column < from->width; column++, count++)
                    add_texel(sums, srgb, image->texels + 4 * (from->first + (size_t)row * from->width + column));
            end_texel(sums, srgb, count, image->texels + 4 * (to->first + (size_t)y * to->width + x));
        }
}

/* ---- decoding */

static strl_status refuse_kind(const uint8_t *first, size_t size, strl_error *err)
{
    static const struct {
        const char *bytes;
        unsigned length, at;
        const char *kind;
    } kinds[] = {{"\xabKTX 20\xbb", 8, 0, "a KTX2 image"},
                 {"\xabKTX 11\xbb", 8, 0, "a KTX image"},
                 {"WEBP", 4, 8, "a WebP image"},
                 {"BM", 2, 0, "a BMP image"},
                 {"GIF8", 4, 0, "a GIF image"},
                 {"DDS ", 4, 0, "a DDS image"},
                 {"II*\0", 4, 0, "a TIFF image"},
                 {"MM\0*", 4, 0, "a TIFF image"},
                 {"ftypavif", 8, 4, "an AVIF image"},
                 {"\x0a", 1, 0, "perhaps a PCX image"}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (size >= kinds[i].at + kinds[i].length && memcmp(first + kinds[i].at, kinds[i].bytes, kinds[i].length) == 0)
            return strl__fail(err, STRL_ERR_UNSUPPORTED, "is %s, which is not read", kinds[i].kind);
    return strl__fail(err, STRL_ERR_UNSUPPORTED, "is neither a PNG nor a JPEG image");
}

strl_status strl__image_read(const strl__image_making *making, uint64_t at, void *data, size_t size, strl_error *err)
{
    const strl__image_source *source = making->source;
    if (size == 0 || at > source->bytes || size > source->bytes - at)
        return strl__fail(err, STRL_ERR_FORMAT, "is cut off after %" PRIu64 " bytes", source->bytes);
    strl_status status = source->read(source->context, at, data, size, err);
    return status ? strl__fail_context(err, status, "cannot be read") : STRL_OK;
}

static strl_status decode(strl__image_making *making, strl_error *err)
{
    static const uint8_t png[8] = {137, 'P', 'N', 'G', 13, 10, 26, 10}, jpeg[3] = {255, 216, 255};
    uint8_t first[16];
    const uint64_t bytes = making->source->bytes;
    const size_t size = bytes < sizeof first ? (size_t)bytes : sizeof first;
    if (size == 0)
        return strl__fail(err, STRL_ERR_FORMAT, "is empty");
    strl_status status = strl__image_read(making, 0, first, size, err);
    if (status)
        return status;
    if (size > sizeof png && memcmp(first, png, sizeof png) == 0)
        return strl__image_read_png(making, err);
    if (size > sizeof jpeg && memcmp(first, jpeg, sizeof jpeg) == 0)
        return strl__image_read_jpeg(making, err);
    return refuse_kind(first, size, err);
}

strl_status strl__image_decode(const strl__image_source *source, const strl__image_room *room, const strl__srgb *srgb,
                               strl__image *image, strl_error *err)
{
    strl__image_making making = {.source = source, .room = room, .srgb = srgb, .image = image};
    *image = (strl__image){0};
    strl_status status = decode(&making, err);
    if (!status && making.row != image->height)
        status = strl__fail(err, STRL_ERR_FORMAT, "ends after %u of its %u rows", making.row, image->height);
    for (unsigned i = 1; i < image->level_count && !status; i++)
        make_level(image, srgb, i);
    strl__free(making.sums);
    if (status)
        strl__image_deinit(image);
    return status;
}

void strl__image_deinit(strl__image *image)
{
    strl__free(image->texels);
    *image = (strl__image){0};
}

/* ---- sampling */

/* The texel that stands for one of any index. */
static uint32_t wrap(int64_t index, uint32_t side, strl__wrap how)
{
    const int64_t count = side;
    if (how == STRL__WRAP_CLAMP)
        return (uint32_t)(index < 0 ? 0 : index >= count ? count - 1 : index);
    const int64_t period = how == STRL__WRAP_MIRROR ? 2 * count : count;
    int64_t in_period = index % period;
    in_period += in_period < 0 ? period : 0;
    return (uint32_t)(in_period < count ? in_period : period - 1 - in_period);
}

/* The coordinate within one period, so that no index is too large for an integer. */
static double within(double coordinate, strl__wrap how)
{
    if (!(coordinate > -1e12 && coordinate < 1e12))
        return 0;
    if (how == STRL__WRAP_CLAMP)
        return coordinate < -1 ? -1 : coordinate > 2 ? 2 : coordinate;
    const double periods = coordinate / 2;
    return coordinate - 2 * (double)(int64_t)(periods < 0 ? periods - 1 : periods);
}

/* Between the four texels round the place. Alpha weighs colours, as in averages. */
static void sample_level(const strl__image *image, unsigned number, const strl__srgb *srgb,
                         const strl__image_spot *spot, double rgba[4])
{
    const strl__image_level *level = &image->level[number];
    const double scale = 1 / (double)((uint64_t)1 << (number + image->halvings));
    const double x = within(spot->u, spot->wrap[0]) * image->width * scale - 0.5;
    const double y = within(spot->v, spot->wrap[1]) * image->height * scale - 0.5;
    const int64_t left = (int64_t)x - (x < 0), top = (int64_t)y - (y < 0);
    double weights = 0, sums[4] = {0};
    for (unsigned corner = 0; corner < 4; corner++) {
        const unsigned right = corner & 1, below = corner >> 1;
        const double share =
            (right ? x - (double)left : 1 - (x - (double)left)) * (below ? y - (double)top : 1 - (y - (double)top));
        const uint32_t column = wrap(left + right, level->width, spot->wrap[0]);
        const uint32_t row = wrap(top + below, level->height, spot->wrap[1]);
        const uint8_t *texel = image->texels + 4 * (level->first + (size_t)row * level->width + column);
        const double weight = share * weight_of(texel[3]);
        for (unsigned i = 0; i < 3; i++)
            sums[i] += srgb->linear[texel[i]] * weight;
        sums[3] += share * texel[3];
        weights += weight;
    }
    for (unsigned i = 0; i < 3; i++)
        rgba[i] = weights > 0 ? sums[i] / weights : 0;
    rgba[3] = sums[3] / 255;
}

/* A level's texels are squares of 2^level of the file's, and looking up between four of them covers
 * about two. */
void strl__image_sample(const strl__image *image, const strl__srgb *srgb, const strl__image_spot *spot, double rgba[4])
{
    double coarse[4], side = (double)((uint64_t)1 << image->halvings);
    unsigned number = 0;
    for (; number + 1 < image->level_count && spot->footprint >= 2 * side; number++)
        side *= 2;
    sample_level(image, number, srgb, spot, rgba);
    if (number + 1 == image->level_count || !(spot->footprint > side))
        return;
    const double part = spot->footprint / side - 1; /* 0 .. 1 */
    sample_level(image, number + 1, srgb, spot, coarse);
    for (unsigned i = 0; i < 4; i++)
        rgba[i] += part * (coarse[i] - rgba[i]);
}
