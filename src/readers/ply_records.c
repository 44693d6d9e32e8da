/* Reading and skipping the records of PLY elements, in text and in binary, and what to say where
 * they are broken. */
#include "readers/ply.h"

#include <inttypes.h>

#include "base/fail.h"

strl_status strl__ply_record_fail(strl_reader *reader, const char *what, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    const strl__ply_element *element = &ply->header.elements[ply->element];
    if (ply->header.ascii)
        return strl__text_expected(&reader->input, what, err);
    strl_status failed = strl__input_status(&reader->input, err);
    return failed ? failed
                  : strl__fail(err, STRL_ERR_FORMAT,
                               "%s, byte %" PRIu64 ": expected %s, found the end of the file in "
                               "record %" PRIu64 " of %" PRIu64 " of element '%s'",
                               reader->path, strl__input_offset(&reader->input), what, ply->record + 1, element->count,
                               element->name);
}

strl_status strl__ply_value_fail(strl_reader *reader, const char *what, uint64_t limit, double found, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    uint64_t place = ply->header.ascii ? reader->input.line : strl__input_offset(&reader->input);
    strl_status failed = strl__input_status(&reader->input, err);
    if (failed)
        return failed;
    return strl__fail(err, STRL_ERR_FORMAT, "%s, %s %" PRIu64 ": expected %s below %" PRIu64 ", found %.17g",
                      reader->path, ply->header.ascii ? "line" : "before byte", place, what, limit, found);
}

void strl__ply_begin_record(strl_reader *reader)
{
    const strl__ply_state *ply = reader->state;
    strl__input *input = &reader->input;
    if (!ply->header.ascii)
        return;
    strl__text_skip_space(input);
    while (strl__text_token_is(input, "comment") || strl__text_token_is(input, "obj_info")) {
        strl__text_skip_line(input);
        strl__text_skip_space(input);
    }
}

void strl__ply_end_record(strl_reader *reader)
{
    const strl__ply_state *ply = reader->state;
    if (ply->header.ascii)
        strl__text_skip_line(&reader->input);
}

strl_status strl__ply_read_count(strl_reader *reader, const strl__ply_property *property, uint64_t *count,
                                 strl_error *err)
{
    strl__ply_state *ply = reader->state;
    double value;
    if (!strl__ply_next_scalar(ply, &reader->input, property->count_type, &value))
        return strl__ply_record_fail(reader, "the length of a list", err);
    uint64_t item_bytes = ply->header.ascii ? 2 : strl__scalar_bytes(property->type);
    uint64_t limit = (strl__input_left(&reader->input) + 1) / item_bytes + 1;
    if (!(value >= 0 && value < (double)limit) || value != (double)(uint64_t)value)
        return strl__ply_value_fail(reader, "the length of a list", limit, value, err);
    *count = (uint64_t)value;
    return STRL_OK;
}

static strl_status skip_items(strl_reader *reader, strl__scalar type, uint64_t count, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    if (!ply->header.ascii)
        return strl__input_skip(&reader->input, count * strl__scalar_bytes(type))
                   ? STRL_OK
                   : strl__ply_record_fail(reader, "a list", err);
    double ignored;
    for (uint64_t i = 0; i < count; i++)
        if (!strl__ply_next_scalar(ply, &reader->input, type, &ignored))
            return strl__ply_record_fail(reader, "a number", err);
    return STRL_OK;
}

strl_status strl__ply_skip_property(strl_reader *reader, const strl__ply_property *property, strl_error *err)
{
    uint64_t count = 1;
    strl_status status = property->is_list ? strl__ply_read_count(reader, property, &count, err) : STRL_OK;
    return status ? status : skip_items(reader, property->type, count, err);
}

strl_status strl__ply_skip_element(strl_reader *reader, strl_error *err)
{
    strl__ply_state *ply = reader->state;
    const strl__ply_element *element = &ply->header.elements[ply->element];
    if (element->property_count == 0)
        return STRL_OK;
    if (!ply->header.ascii && !element->has_list) /* the product was checked with the header */
        return strl__input_skip(&reader->input, element->count * element->stride)
                   ? STRL_OK
                   : strl__ply_record_fail(reader, "a record", err);
    strl_status status = STRL_OK;
    for (ply->record = 0; !status && ply->record < element->count; ply->record++) {
        strl__ply_begin_record(reader);
        for (uint32_t i = 0; !status && i < element->property_count; i++)
            status = strl__ply_skip_property(reader, &element->properties[i], err);
        strl__ply_end_record(reader);
    }
    return status;
}
