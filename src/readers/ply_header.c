/* Parsing PLY headers, after Greg Turk's description of the format (1994) and what programs write
 * since. */
#include "readers/ply.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "readers/text.h"

typedef struct named_value {
    const char *name;
    int value;
} named_value;

static const named_value scalar_names[] = {
    {"char", STRL__I8},   {"uchar", STRL__U8},   {"short", STRL__I16},   {"ushort", STRL__U16},
    {"int", STRL__I32},   {"uint", STRL__U32},   {"float", STRL__F32},   {"double", STRL__F64},
    {"int8", STRL__I8},   {"uint8", STRL__U8},   {"int16", STRL__I16},   {"uint16", STRL__U16},
    {"int32", STRL__I32}, {"uint32", STRL__U32}, {"float32", STRL__F32}, {"float64", STRL__F64},
};

static const named_value element_names[] = {
    {"vertex", STRL__PLY_VERTEX},
    {"face", STRL__PLY_FACE},
    {"tristrips", STRL__PLY_TRISTRIPS},
    {"edge", STRL__PLY_EDGE},
};

static const named_value role_names[] = {
    {"x", STRL__PLY_X},
    {"y", STRL__PLY_Y},
    {"z", STRL__PLY_Z},
    {"nx", STRL__PLY_NORMAL_X},
    {"ny", STRL__PLY_NORMAL_Y},
    {"nz", STRL__PLY_NORMAL_Z},
    {"red", STRL__PLY_RED},
    {"green", STRL__PLY_GREEN},
    {"blue", STRL__PLY_BLUE},
    {"alpha", STRL__PLY_ALPHA},
    {"diffuse_red", STRL__PLY_RED},
    {"diffuse_green", STRL__PLY_GREEN},
    {"diffuse_blue", STRL__PLY_BLUE},
    {"diffuse_alpha", STRL__PLY_ALPHA},
    {"r", STRL__PLY_RED},
    {"g", STRL__PLY_GREEN},
    {"b", STRL__PLY_BLUE},
    {"a", STRL__PLY_ALPHA},
    {"vertex_indices", STRL__PLY_INDICES},
    {"vertex_index", STRL__PLY_INDICES},
};

#define COUNT_OF(array) (sizeof(array) / sizeof *(array))

/* The value of the token at the input under its name, `otherwise` where no name fits. */
static int value_of_token(const strl__input *input, const named_value *names, size_t count, int otherwise)
{
    for (size_t i = 0; i < count; i++)
        if (strl__text_token_is(input, names[i].name))
            return names[i].value;
    return otherwise;
}

/* Passes over the token and the blanks after it. */
static void pass_token(strl__input *input)
{
    input->at += strl__text_token(input);
    strl__text_skip_blanks(input);
}

static strl_status read_format(strl__ply_header *header, strl__input *input, strl_error *err)
{
    if (strl__text_token_is(input, "ascii"))
        header->ascii = true;
    else if (strl__text_token_is(input, "binary_big_endian"))
        header->big_endian = true;
    else if (!strl__text_token_is(input, "binary_little_endian"))
        return strl__text_expected(input, "'ascii', 'binary_little_endian' or 'binary_big_endian'", err);
    pass_token(input);
    return strl__text_token_is(input, "1.0") ? STRL_OK : strl__text_expected(input, "version '1.0'", err);
}

static strl_status read_element(strl__ply_header *header, strl__input *input, strl_error *err)
{
    if (header->element_count == STRL__PLY_ELEMENTS_MAX)
        return strl__text_expected(input, "at most 64 elements", err);
    strl__ply_element *element = &header->elements[header->element_count];
    *element = (strl__ply_element){.properties = header->properties + header->property_count};
    size_t length = strl__text_token(input);
    if (length == 0)
        return strl__text_expected(input, "the name of an element", err);
    for (size_t i = 0; i < length && i + 1 < sizeof element->name; i++)
        element->name[i] = input->at[i] >= 0x20 && input->at[i] < 0x7f ? input->at[i] : '?';
    element->kind = (strl__ply_kind)value_of_token(input, element_names, COUNT_OF(element_names), STRL__PLY_UNKNOWN);
    for (uint32_t i = 0; i < header->element_count; i++)
        if (element->kind == STRL__PLY_VERTEX && header->elements[i].kind == STRL__PLY_VERTEX)
            return strl__text_expected(input, "one element 'vertex' only", err);
    pass_token(input);
    int64_t count;
    const char *after = strl__integer_parse(input->at, &count);
    if (!after || count < 0 || !strl__is_token_end(input, after))
        return strl__text_expected(input, "a count of records", err);
    element->count = (uint64_t)count;
    header->element_count++;
    return STRL_OK;
}

static strl_status read_type(strl__input *input, strl__scalar *type, strl_error *err)
{
    int value = value_of_token(input, scalar_names, COUNT_OF(scalar_names), -1);
    if (value < 0)
        return strl__text_expected(input, "a type such as 'float' or 'uchar'", err);
    *type = (strl__scalar)value;
    pass_token(input);
    return STRL_OK;
}

static strl_status read_property(strl__ply_header *header, strl__input *input, strl_error *err)
{
    if (header->element_count == 0)
        return strl__text_expected(input, "an element before its properties", err);
    if (header->property_count == STRL__PLY_PROPERTIES_MAX)
        return strl__text_expected(input, "at most 512 properties", err);
    strl__ply_element *element = &header->elements[header->element_count - 1];
    strl__ply_property *property = &header->properties[header->property_count];
    *property = (strl__ply_property){.offset = element->stride};
    property->is_list = strl__text_token_is(input, "list");
    if (property->is_list) {
        pass_token(input);
        strl_status status = read_type(input, &property->count_type, err);
        if (status)
            return status;
        if (property->count_type == STRL__F32 || property->count_type == STRL__F64)
            return strl__text_expected(input, "an integer type for the count of a list", err);
    }
    strl_status status = read_type(input, &property->type, err);
    if (status)
        return status;
    if (strl__text_token(input) == 0)
        return strl__text_expected(input, "the name of a property", err);
    strl__ply_role role = (strl__ply_role)value_of_token(input, role_names, COUNT_OF(role_names), STRL__PLY_OTHER);
    if (property->is_list != (role == STRL__PLY_INDICES) || (element->roles & 1u << role))
        role = STRL__PLY_OTHER; /* the first of two names for one thing counts */
    property->role = role;
    element->roles |= 1u << role;
    element->has_list = element->has_list || property->is_list;
    element->stride += strl__scalar_bytes(property->is_list ? property->count_type : property->type);
    element->property_count++;
    header->property_count++;
    return STRL_OK;
}

/* The least bytes that the announced records can take must be there: a count that lies is found
 * before any work. */
static strl_status check_counts(const strl__ply_header *header, const strl__input *input, strl_error *err)
{
    uint64_t left = strl__input_left(input) + 1; /* the last number in a text needs no blank after it */
    for (uint32_t i = 0; i < header->element_count; i++) {
        const strl__ply_element *element = &header->elements[i];
        uint64_t record = header->ascii ? 2 * (uint64_t)element->property_count : element->stride;
        uint64_t needed;
        if (__builtin_mul_overflow(element->count, record, &needed) || needed > left)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "%s: element '%s' announces %" PRIu64 " records of at least %" PRIu64
                              " bytes, but at most %" PRIu64 " bytes are left of the file's %" PRIu64,
                              input->name, element->name, element->count, record, left - 1, input->file_bytes);
        left -= needed;
    }
    return STRL_OK;
}

/* Ends the header's last line as its first one ended: in a binary file, the byte after a lone \r
 * may be data. */
static void end_header(strl__input *input, char first_line_end)
{
    strl__text_skip_blanks(input);
    strl__input_want(input, 2);
    if (first_line_end == '\r' && *input->at == '\r')
        input->at++, input->line++;
    else
        strl__text_end_line(input);
}

static strl_status read_statement(strl__ply_header *header, strl__input *input, bool *has_format, strl_error *err)
{
    if (strl__text_token(input) == 0 || strl__text_token_is(input, "comment") || strl__text_token_is(input, "obj_info"))
        return STRL_OK;
    if (strl__text_token_is(input, "format")) {
        *has_format = true;
        pass_token(input);
        return read_format(header, input, err);
    }
    if (strl__text_token_is(input, "element")) {
        pass_token(input);
        return read_element(header, input, err);
    }
    if (strl__text_token_is(input, "property")) {
        pass_token(input);
        return read_property(header, input, err);
    }
    /* Some programs sign their files without the word: before the first element no property can be lost by it. */
    if (header->element_count == 0 && *has_format)
        return STRL_OK;
    return strl__text_expected(input, "'element', 'property', 'comment' or 'end_header'", err);
}

strl_status strl__ply_header_read(strl__ply_header *header, strl__input *input, strl_error *err)
{
    *header = (strl__ply_header){0};
    bool has_format = false;
    strl__text_skip_blanks(input);
    if (!strl__text_token_is(input, "ply"))
        return strl__text_expected(input, "'ply'", err);
    input->at += 3;
    strl__text_skip_blanks(input);
    char first_line_end = input->at[0] == '\r' && input->at[1] == '\n' ? '\n' : *input->at;
    for (;;) {
        strl__text_skip_line(input);
        strl__text_skip_blanks(input);
        if (strl__text_token_is(input, "end_header"))
            break;
        if (input->at == input->end)
            return strl__text_expected(input, "'end_header'", err);
        strl_status status = read_statement(header, input, &has_format, err);
        if (status)
            return status;
    }
    if (!has_format)
        return strl__text_expected(input, "a line 'format'", err);
    input->at += strlen("end_header");
    end_header(input, first_line_end);
    header->data_offset = strl__input_offset(input);
    header->data_line = input->line;
    strl_status failed = strl__input_status(input, err);
    return failed ? failed : check_counts(header, input, err);
}
