/* Tokens and lines over strl__input. Line ends are \n, \r\n and \r. */
#ifndef STRL_READERS_TEXT_H
#define STRL_READERS_TEXT_H

#include "readers/input.h"
#include "readers/number.h"

static inline bool strl__is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

static inline bool strl__is_line_end(char c)
{
    return c == '\n' || c == '\r';
}

/* True where a token may end: blank, line end, end of the file. */
static inline bool strl__is_token_end(const strl__input *input, const char *at)
{
    return strl__is_blank(*at) || strl__is_line_end(*at) ||
           (at == input->end && input->end_offset == input->file_bytes);
}

/* At the end of a line or of the file. Valid after strl__text_skip_blanks. */
static inline bool strl__text_at_line_end(const strl__input *input)
{
    return strl__is_line_end(*input->at) || input->at == input->end;
}

void strl__text_skip_blanks_slowly(strl__input *input);

/* Passes over blanks inside a line, and over a backslash that continues it. A whole token can be
 * looked at then. */
static inline void strl__text_skip_blanks(strl__input *input)
{
    while (*input->at == ' ' || *input->at == '\t')
        input->at++;
    if (__builtin_expect((size_t)(input->end - input->at) < STRL__TOKEN_BYTES, 0) || strl__is_blank(*input->at) ||
        *input->at == '\\')
        strl__text_skip_blanks_slowly(input);
}

void strl__text_skip_byte_order_mark(strl__input *input); /* at the start of a file: of UTF-8 */
void strl__text_skip_space(strl__input *input);    /* blanks and line ends; a whole token can be looked at then */
void strl__text_skip_line(strl__input *input);     /* to the start of the next line */
void strl__text_end_line(strl__input *input);      /* over the line end at `at`, if there is one */
size_t strl__text_token(const strl__input *input); /* bytes of the token at `at`; 0 at the end of a line */
bool strl__text_token_is(const strl__input *input, const char *word);           /* the token at `at` is this word */
bool strl__text_token_is_caseless(const strl__input *input, const char *lower); /* the same for letters of any case */
/* The rest of the line without blanks at its end, up to STRL__TOKEN_BYTES - 1 bytes; consumes
 * nothing. */
size_t strl__text_rest_of_line(const strl__input *input);

/* The number at `at`, which must be a whole token; else false and nothing is consumed. */
static inline bool strl__text_number(strl__input *input, double *value)
{
    const char *after = strl__number_parse(input->at, value);
    if (!after || !strl__is_token_end(input, after))
        return false;
    input->at = after;
    return true;
}

/* "PATH, line N: expected WHAT, found 'TOKEN'", or the failed read. */
strl_status strl__text_expected(const strl__input *input, const char *what, strl_error *err);

#endif
