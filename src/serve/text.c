#include "serve/text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const char hex_digits[] = "0123456789abcdef";

void strl__put(strl_writer *out, const char *text)
{
    strl_writer_bytes(out, text, strlen(text));
}

void strl__put_format(strl_writer *out, const char *format, ...)
{
    char text[512]; /* numbers and short names; long text goes through the others */
    va_list values;
    va_start(values, format);
    int length = vsnprintf(text, sizeof text, format, values);
    va_end(values);
    if (length < 0 || (size_t)length >= sizeof text)
        out->failed = true;
    else
        strl_writer_bytes(out, text, (size_t)length);
}

void strl__put_html(strl_writer *out, const char *text)
{
    for (; *text; text++) {
        const char *entity = *text == '&'    ? "&amp;"
                             : *text == '<'  ? "&lt;"
                             : *text == '>'  ? "&gt;"
                             : *text == '"'  ? "&quot;"
                             : *text == '\'' ? "&#39;"
                                             : NULL;
        if (entity)
            strl__put(out, entity);
        else
            strl_writer_u8(out, (uint8_t)*text);
    }
}

void strl__put_json(strl_writer *out, const char *text)
{
    strl_writer_u8(out, '"');
    for (; *text; text++) {
        uint8_t c = (uint8_t)*text;
        if (c < 0x20 || c == 0x7f) {
            strl__put_format(out, "\\u%04x", c);
            continue;
        }
        if (c == '"' || c == '\\')
            strl_writer_u8(out, '\\');
        strl_writer_u8(out, c);
    }
    strl_writer_u8(out, '"');
}

static bool is_unreserved(uint8_t c)
{
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c && strchr("-._~", c));
}

void strl__put_url(strl_writer *out, const char *path)
{
    for (; *path; path++) {
        uint8_t c = (uint8_t)*path;
        if (is_unreserved(c) || c == '/') {
            strl_writer_u8(out, c);
        } else {
            strl_writer_u8(out, '%');
            strl_writer_u8(out, (uint8_t)hex_digits[c >> 4]);
            strl_writer_u8(out, (uint8_t)hex_digits[c & 15]);
        }
    }
}

static bool is_plain(uint8_t c)
{
    return c > 0x20 && c < 0x7f && c != '"' && c != '\\';
}

void strl__put_log(strl_writer *out, const char *text)
{
    if (!*text)
        strl_writer_u8(out, '-');
    for (; *text; text++) {
        uint8_t c = (uint8_t)*text;
        if (is_plain(c))
            strl_writer_u8(out, c);
        else
            strl__put_format(out, "\\x%02x", c);
    }
}

void strl__log_text(const char *text, char *out, size_t size)
{
    size_t used = 0;
    for (; *text && used + 5 <= size; text++) {
        uint8_t c = (uint8_t)*text;
        if (is_plain(c) || c == ' ') {
            out[used++] = (char)c;
        } else {
            out[used++] = '\\';
            out[used++] = 'x';
            out[used++] = hex_digits[c >> 4];
            out[used++] = hex_digits[c & 15];
        }
    }
    out[used] = 0;
}
