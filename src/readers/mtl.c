/* Of an MTL file the diffuse colour (Kd, taken as sRGB as most programs write it), its image
 * (map_Kd) and the opacity (d, or Tr = 1 - d) are used. */
#include "readers/mtl.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "readers/record.h"
#include "readers/text.h"

#define BUFFER_BYTES ((size_t)64 << 10)

/* The numbers on the rest of the line, at most 3. */
static unsigned read_numbers(strl__input *input, double values[3])
{
    unsigned count = 0;
    for (; count < 3; count++) {
        strl__text_skip_blanks(input);
        if (!strl__text_number(input, &values[count]))
            break;
    }
    return count;
}

static uint32_t with_colour(uint32_t rgba, const double values[3], unsigned count)
{
    uint8_t channel[3];
    for (unsigned i = 0; i < 3; i++)
        channel[i] = strl__colour_channel(STRL__F64, values[i < count ? i : 0]); /* "Kd r" means grey */
    return strl__pack_colour(channel[0], channel[1], channel[2], (uint8_t)(rgba >> 24));
}

static uint32_t with_opacity(uint32_t rgba, double opacity)
{
    return (rgba & 0xffffffu) | (uint32_t)strl__colour_channel(STRL__F64, opacity) << 24;
}

/* ---- images */

/* Passes over the option at `at` and what it takes; false where there is none. Numbers stay as they
 * are where the option has fewer. */
static bool take_option(strl__input *input, strl__texture *texture, double scale[3], double offset[3])
{
    static const struct {
        const char *word;
        unsigned words;
    } others[] = {{"-blendu", 1},  {"-blendv", 1}, {"-cc", 1},    {"-mm", 2}, {"-texres", 1},
                  {"-imfchan", 1}, {"-type", 1},   {"-boost", 1}, {"-bm", 1}};
    double turbulence[3];
    double *const values[] = {scale, offset, turbulence};
    static const char *const takes_numbers[] = {"-s", "-o", "-t"};
    for (unsigned i = 0; i < 3; i++)
        if (strl__text_token_is(input, takes_numbers[i])) {
            input->at += 2;
            read_numbers(input, values[i]);
            return true;
        }
    if (strl__text_token_is(input, "-clamp")) {
        input->at += 6;
        strl__text_skip_blanks(input);
        if (strl__text_token_is(input, "on"))
            texture->wrap[0] = texture->wrap[1] = STRL__WRAP_CLAMP;
        input->at += strl__text_token(input);
        return true;
    }
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        if (strl__text_token_is(input, others[i].word)) {
            for (unsigned word = 0; word <= others[i].words; word++) {
                input->at += strl__text_token(input);
                strl__text_skip_blanks(input);
            }
            return true;
        }
    return false;
}

/* The path beside the library, of which name is part; a drive of another machine is left out. Owned
 * by the caller. */
static char *image_path(const char *library, const char *name, size_t length)
{
    const char *slash = strrchr(library, '/');
    const bool has_drive = length > 2 && name[1] == ':';
    size_t folder = slash && name[0] != '/' && name[0] != '\\' ? (size_t)(slash + 1 - library) : 0;
    char *path = strl__alloc(folder + length + 1, 1);
    if (!path)
        return NULL;
    memcpy(path, library, folder);
    memcpy(path + folder, name, length);
    path[folder + length] = 0;
    for (char *c = path + folder; *c; c++)
        *c = *c == '\\' ? '/' : *c;
    const char *last = strrchr(path + folder, '/');
    if (has_drive && last)
        memmove(path + folder, last + 1, strlen(last));
    return path;
}

/* map_Kd [options] NAME, whose v is up. */
static strl_status read_map(strl__input *input, strl__name *material, strl__textures *textures, strl_error *err)
{
    strl__texture texture = {.wrap = {STRL__WRAP_REPEAT, STRL__WRAP_REPEAT}};
    double scale[3] = {1, 1, 1}, offset[3] = {0, 0, 0};
    char name[STRL__TOKEN_BYTES];
    do
        strl__text_skip_blanks(input);
    while (take_option(input, &texture, scale, offset));
    const char *text = input->at;
    size_t length = strl__text_rest_of_line(input);
    if (length >= 2 && text[0] == '"' && text[length - 1] == '"') {
        text++;
        length -= 2;
    }
    material->texture = STRL__NO_TEXTURE;
    if (length == 0 || length >= sizeof name || memchr(text, 0, length))
        return STRL_OK;
    memcpy(name, text, length);
    name[length] = 0;
    char *path = image_path(strl_file_path(input->file), name, length);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    const double transform[6] = {scale[0], 0, offset[0], 0, -scale[1], 1 - offset[1]};
    memcpy(texture.transform, transform, sizeof transform);
    strl_status status = strl__textures_add_picture(textures, path, name, 0, &texture.picture, err);
    if (!status)
        status = strl__textures_add(textures, &texture, &material->texture, err);
    strl__free(path);
    return status;
}

static void read_statement(strl__input *input, strl__name *material)
{
    double values[3];
    if (strl__text_token_is(input, "Kd")) {
        input->at += 2;
        unsigned count = read_numbers(input, values);
        if (count > 0)
            material->rgba = with_colour(material->rgba, values, count);
    } else if (strl__text_token_is(input, "d")) {
        input->at += 1;
        strl__text_skip_blanks(input);
        if (strl__text_token_is(input, "-halo"))
            input->at += 5;
        if (read_numbers(input, values) > 0)
            material->rgba = with_opacity(material->rgba, values[0]);
    } else if (strl__text_token_is(input, "Tr")) {
        input->at += 2;
        if (read_numbers(input, values) > 0)
            material->rgba = with_opacity(material->rgba, 1 - values[0]);
    }
}

static strl_status read_materials(strl__input *input, strl__names *materials, strl__textures *textures, strl_error *err)
{
    uint32_t current = UINT32_MAX;
    strl__text_skip_byte_order_mark(input);
    for (;; strl__text_skip_line(input)) {
        strl_status status = STRL_OK;
        strl__text_skip_blanks(input);
        if (input->at == input->end)
            return STRL_OK;
        if (strl__text_token_is(input, "newmtl")) {
            input->at += 6;
            strl__text_skip_blanks(input);
            status = strl__names_add(materials, input->at, strl__text_rest_of_line(input), &current, err);
            if (!status) {
                materials->items[current].rgba = 0xffffffffu;
                materials->items[current].texture = STRL__NO_TEXTURE;
            }
        } else if (current != UINT32_MAX &&
                   (strl__text_token_is(input, "map_Kd") || strl__text_token_is(input, "map_kd"))) {
            input->at += 6;
            status = read_map(input, &materials->items[current], textures, err);
        } else if (current != UINT32_MAX) {
            read_statement(input, &materials->items[current]);
        }
        if (status)
            return strl__fail_context(err, status, "%s, line %" PRIu64, input->name, input->line);
    }
}

strl_status strl__mtl_read(const char *path, strl__names *materials, strl__textures *textures, strl_error *why,
                           strl_error *err)
{
    strl_file *file = NULL;
    *why = (strl_error){0};
    if (strl_file_open(path, &file, why))
        return why->status == STRL_ERR_MEMORY ? strl__fail(err, why->status, "%s", why->message) : STRL_OK;
    strl__input input;
    strl_status status = strl__input_init(&input, file, BUFFER_BYTES, err);
    if (!status)
        status = read_materials(&input, materials, textures, err);
    if (!status)
        strl__input_status(&input, why);
    strl__input_deinit(&input);
    strl_file_close(file, NULL); /* only read from */
    return status;
}
