/* Of an MTL file only the diffuse colour (Kd, taken as sRGB as most programs write it) and the
 * opacity (d, or Tr = 1 - d) are used. */
#include "readers/mtl.h"

#include <inttypes.h>

#include "base/fail.h"
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
        channel[i] =
            strl__colour_channel(STRL__F64, values[i < count ? i : 0]); /* "Kd r" means grey */
    return strl__pack_colour(channel[0], channel[1], channel[2], (uint8_t)(rgba >> 24));
}

static uint32_t with_opacity(uint32_t rgba, double opacity)
{
    return (rgba & 0xffffffu) | (uint32_t)strl__colour_channel(STRL__F64, opacity) << 24;
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

static strl_status read_materials(strl__input *input, strl__names *materials, strl_error *err)
{
    uint32_t current = UINT32_MAX;
    strl__text_skip_byte_order_mark(input);
    for (;; strl__text_skip_line(input)) {
        strl__text_skip_blanks(input);
        if (input->at == input->end)
            return STRL_OK;
        if (strl__text_token_is(input, "newmtl")) {
            input->at += 6;
            strl__text_skip_blanks(input);
            strl_status status = strl__names_add(materials, input->at,
                                                 strl__text_rest_of_line(input), &current, err);
            if (status)
                return strl__fail_context(err, status, "%s, line %" PRIu64,
                                          input->name, input->line);
            materials->items[current].rgba = 0xffffffffu;
        } else if (current != UINT32_MAX) {
            read_statement(input, &materials->items[current]);
        }
    }
}

strl_status strl__mtl_read(const char *path, strl__names *materials, strl_error *why,
                           strl_error *err)
{
    strl_file *file = NULL;
    *why = (strl_error){0};
    if (strl_file_open(path, &file, why))
        return why->status == STRL_ERR_MEMORY ? strl__fail(err, why->status, "%s", why->message)
                                              : STRL_OK;
    strl__input input;
    strl_status status = strl__input_init(&input, file, BUFFER_BYTES, err);
    if (!status)
        status = read_materials(&input, materials, err);
    if (!status)
        strl__input_status(&input, why);
    strl__input_deinit(&input);
    strl_file_close(file, NULL); /* only read from */
    return status;
}
