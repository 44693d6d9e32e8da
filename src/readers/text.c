#include "readers/text.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"

void strl__text_skip_blanks_slowly(strl__input *input)
{
    for (;;) {
        strl__input_want(input, STRL__TOKEN_BYTES);
        if (strl__is_blank(*input->at)) {
            input->at++;
        } else if (*input->at == '\\' && strl__is_line_end(input->at[1])) {
            input->at++;
            strl__text_end_line(input);
        } else {
            return;
        }
    }
}

void strl__text_skip_byte_order_mark(strl__input *input)
{
    if (strl__input_want(input, 3) && memcmp(input->at, "\xef\xbb\xbf", 3) == 0)
        input->at += 3;
}

void strl__text_end_line(strl__input *input)
{
    strl__input_want(input, 2);
    if (!strl__is_line_end(*input->at))
        return;
    input->at += input->at[0] == '\r' && input->at[1] == '\n' ? 2 : 1;
    input->line++;
}

void strl__text_skip_space(strl__input *input)
{
    for (;;) {
        while (strl__is_blank(*input->at))
            input->at++;
        if (strl__is_line_end(*input->at))
            strl__text_end_line(input);
        else if (input->at != input->end || !strl__input_want(input, 1))
            break;
    }
    strl__input_want(input, STRL__TOKEN_BYTES);
}

/* Eight bytes at a time: does one of them equal `byte`? */
static bool has_byte(uint64_t word, uint8_t byte)
{
    uint64_t difference = word ^ (0x0101010101010101u * byte);
    return ((difference - 0x0101010101010101u) & ~difference & 0x8080808080808080u) != 0;
}

static const char *find_line_end(const char *at, const char *end)
{
    while (end - at >= 8) {
        uint64_t word;
        memcpy(&word, at, sizeof word);
        if (has_byte(word, '\n') || has_byte(word, '\r'))
            break;
        at += 8;
    }
    while (at < end && !strl__is_line_end(*at))
        at++;
    return at;
}

void strl__text_skip_line(strl__input *input)
{
    do
        input->at = find_line_end(input->at, input->end);
    while (input->at == input->end && strl__input_want(input, 1));
    strl__text_end_line(input);
}

size_t strl__text_token(const strl__input *input)
{
    const char *at = input->at;
    while (at < input->end && !strl__is_blank(*at) && !strl__is_line_end(*at))
        at++;
    return (size_t)(at - input->at);
}

static bool ends_token(const strl__input *input, const char *at)
{
    return strl__is_blank(*at) || strl__is_line_end(*at) || at == input->end;
}

/* The zero at the end of the buffer ends the comparisons. */
bool strl__text_token_is(const strl__input *input, const char *word)
{
    const char *at = input->at;
    for (; *word; at++, word++)
        if (*at != *word)
            return false;
    return ends_token(input, at);
}

bool strl__text_token_is_caseless(const strl__input *input, const char *lower)
{
    const char *at = input->at;
    for (; *lower; at++, lower++)
        if ((*at | 0x20) != *lower)
            return false;
    return ends_token(input, at);
}

size_t strl__text_rest_of_line(const strl__input *input)
{
    const char *limit =
        (size_t)(input->end - input->at) < STRL__TOKEN_BYTES ? input->end : input->at + STRL__TOKEN_BYTES - 1;
    const char *last = find_line_end(input->at, limit);
    while (last > input->at && strl__is_blank(last[-1]))
        last--;
    return (size_t)(last - input->at);
}

strl_status strl__text_expected(const strl__input *input, const char *what, strl_error *err)
{
    strl_status failed = strl__input_status(input, err);
    if (failed)
        return failed;
    char found[48] = "the end of the file";
    size_t length = strl__text_token(input);
    if (length > 0) {
        size_t shown = length < 32 ? length : 32;
        char token[33];
        for (size_t i = 0; i < shown; i++)
            token[i] = input->at[i] >= 0x20 && input->at[i] < 0x7f ? input->at[i] : '?';
        token[shown] = 0;
        snprintf(found, sizeof found, "'%s'%s", token, length > shown ? "..." : "");
    } else if (input->at != input->end) {
        snprintf(found, sizeof found, "the end of the line");
    }
    return strl__fail(err, STRL_ERR_FORMAT, "%s, line %" PRIu64 ": expected %s, found %s", input->name, input->line,
                      what, found);
}
