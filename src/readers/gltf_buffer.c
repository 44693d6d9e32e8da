/* Where a buffer's bytes are: in the GLB itself, in a file beside the model, or as base64 in the
 * JSON; these are decoded once, to memory while they fit an eighth of the budget, else to a scratch
 * file. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"
#include "readers/stranger.h"

#define TEXT_BYTES ((size_t)16 << 10) /* of base64 read at once */
#define HEADER_BYTES_MAX 256u         /* of a data URI, up to its comma */

/* ---- files */

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    c |= 0x20;
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* In place; false where a zero would end the path early. */
static bool decode_percent(char *text)
{
    char *out = text;
    for (const char *in = text; *in; in++) {
        int high = *in == '%' ? hex_digit(in[1]) : -1;
        int low = high >= 0 ? hex_digit(in[2]) : -1;
        *out = low >= 0 ? (char)(high << 4 | low) : *in;
        in += low >= 0 ? 2 : 0;
        if (*out++ == 0)
            return false;
    }
    *out = 0;
    return true;
}

/* A scheme, or a path from the root: files beside the model have neither. */
static bool is_relative(const char *uri)
{
    size_t letters = strspn(uri, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+-.");
    return uri[0] && uri[0] != '/' && uri[0] != '\\' && uri[letters] != ':';
}

/* The URI's path beside the model, as it is or decoded; owned by the caller, NULL without memory.
 */
static char *beside(const char *model, const char *uri, bool decode, bool *good)
{
    const char *slash = strrchr(model, '/');
    size_t folder = slash ? (size_t)(slash + 1 - model) : 0;
    char *path = strl__alloc(folder + strlen(uri) + 1, 1);
    *good = true;
    if (!path)
        return NULL;
    memcpy(path, model, folder);
    strcpy(path + folder, uri);
    if (decode)
        *good = decode_percent(path + folder);
    for (char *c = path + folder; *c; c++)
        *c = *c == '\\' ? '/' : *c;
    return path;
}

/* The member of the JSON that it stands in. */
static const char *list_of(const strl__gltf_buffer *buffer)
{
    return buffer->is_loose ? "images" : "buffers";
}

static strl_status fail_short(const strl__gltf *gltf, const strl__gltf_buffer *buffer, uint32_t index, strl_error *err)
{
    char start[STRL__POINTER_BYTES];
    const bool is_pointer = buffer->opened.bytes >= sizeof start &&
                            strl_file_read(buffer->file, 0, start, sizeof start, NULL) == STRL_OK &&
                            strl__stranger_is_pointer(start, sizeof start);
    return strl__fail(err, STRL_ERR_FORMAT, "%s, buffers[%u]: expected %" PRIu64 " bytes, found %" PRIu64 " in %s%s",
                      gltf->reader->path, index, buffer->bytes, buffer->opened.bytes, strl_file_path(buffer->file),
                      is_pointer ? ", which is a Git LFS pointer: " STRL__POINTER_ADVICE : "");
}

static strl_status open_file(strl__gltf *gltf, strl__gltf_buffer *buffer, uint32_t index, strl_error *err)
{
    const char *list = list_of(buffer);
    bool good, good_raw;
    if (!is_relative(buffer->uri))
        return strl__fail(err, STRL_ERR_UNSUPPORTED,
                          "%s, %s[%u]: expected the name of a file beside the model, found "
                          "'%.120s'",
                          gltf->reader->path, list, index, buffer->uri);
    char *path = beside(gltf->reader->path, buffer->uri, true, &good);
    char *raw = beside(gltf->reader->path, buffer->uri, false, &good_raw);
    strl_status status = STRL_OK;
    if (!path || !raw)
        status = strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", gltf->reader->path);
    else if (!good)
        status = strl__fail(err, STRL_ERR_FORMAT, "%s, %s[%u]: a zero ends the name '%.120s'", gltf->reader->path, list,
                            index, buffer->uri);
    else
        status = strl_file_open(!strl_path_exists(path) && strl_path_exists(raw) ? raw : path, &buffer->file, err);
    if (status && path && raw && good)
        status = strl__fail_context(err, status, "%s, %s[%u]", gltf->reader->path, list, index);
    buffer->owns_file = buffer->is_beside = !status;
    if (!status)
        status = strl_file_stat(buffer->file, &buffer->opened, err);
    if (!status && buffer->opened.bytes < buffer->bytes)
        status = fail_short(gltf, buffer, index, err);
    if (!status)
        status = strl__reader_note_beside(gltf->reader, strl_file_path(buffer->file), &buffer->opened, err);
    if (!status && buffer->is_loose)
        buffer->bytes = buffer->opened.bytes;
    strl__free(path);
    strl__free(raw);
    return status;
}

static strl_status open_binary(strl__gltf *gltf, uint32_t index, strl_error *err)
{
    strl__gltf_buffer *buffer = &gltf->buffers[index];
    if (!gltf->has_binary || index > 0)
        return strl__fail(err, STRL_ERR_FORMAT, "%s, buffers[%u]: expected a uri%s, found none", gltf->reader->path,
                          index, index ? "" : " or a binary chunk");
    if (gltf->binary_bytes < buffer->bytes)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, buffers[%u]: expected %" PRIu64 " bytes, found a binary chunk of %" PRIu64,
                          gltf->reader->path, index, buffer->bytes, gltf->binary_bytes);
    buffer->file = gltf->reader->file;
    buffer->file_offset = gltf->binary_offset;
    return STRL_OK;
}

/* ---- text */

/* A data URI under way: where it stands in the model's file, and what it became so far. */
typedef struct data_text {
    strl__gltf *gltf;
    strl__gltf_buffer *buffer;
    uint32_t index;
    strl_file *file;  /* the model's, or its text in UTF-8; borrowed */
    uint64_t at, end; /* in the file */
    uint64_t decoded; /* bytes so far */
    uint32_t bits, bit_count;
    uint32_t escape, code;   /* characters of JSON's escape that were read, and what it stands for so far */
    bool has_ended;          /* at '=' */
    uint8_t out[TEXT_BYTES]; /* that wait to be written */
    size_t waiting;
} data_text;

static strl_status text_fail(const data_text *text, const char *expected, strl_error *err)
{
    return strl__fail(err, STRL_ERR_FORMAT, "%s, byte %" PRIu64 ", %s[%u]: expected %s", text->gltf->reader->path,
                      text->at, list_of(text->buffer), text->index, expected);
}

static strl_status flush_decoded(data_text *text, strl_error *err)
{
    strl__gltf_buffer *buffer = text->buffer;
    uint64_t left = buffer->bytes - text->decoded;
    size_t size = text->waiting < left ? text->waiting : (size_t)left;
    strl_status status = STRL_OK;
    if (buffer->memory)
        memcpy(buffer->memory + text->decoded, text->out, size);
    else
        status = strl_file_write(buffer->file, text->decoded, text->out, size, err);
    text->decoded += size;
    text->waiting = 0;
    return status;
}

static int base64_digit(unsigned char c)
{
    if (c >= 'A' && c <= 'Z')
        return c - 'A';
    if (c >= 'a' && c <= 'z')
        return c - 'a' + 26;
    if (c >= '0' && c <= '9')
        return c - '0' + 52;
    return c == '+' || c == '-' ? 62 : c == '/' || c == '_' ? 63 : -1;
}

#define NOT_YET (-1)
#define NO_LETTER 0

/* The letter that the next character of JSON's text makes, NOT_YET within an escape. Of escapes those of a letter can
 * be base64: \/ and \uXXXX, as some programs write '+'. */
static int unescape(data_text *text, char c)
{
    if (text->escape == 0 && c != '\\')
        return (unsigned char)c;
    if (text->escape++ == 0) {
        text->code = 0;
        return NOT_YET;
    }
    if (text->escape == 2 && c == 'u')
        return NOT_YET;
    const int digit = text->escape > 2 ? hex_digit(c) : -1;
    text->code = text->code << 4 | (uint32_t)(digit < 0 ? 0 : digit);
    if (digit >= 0 && text->escape < 6)
        return NOT_YET;
    const bool is_slash = text->escape == 2 && c == '/';
    text->escape = 0;
    return is_slash ? '/' : digit >= 0 && text->code < 0x80 ? (int)text->code : NO_LETTER;
}

/* '=' ends the data. */
static strl_status decode_base64(data_text *text, const char *chars, size_t count, strl_error *err)
{
    for (size_t i = 0; i < count; i++, text->at++) {
        const int letter = unescape(text, chars[i]);
        if (letter == NOT_YET)
            continue;
        text->has_ended = letter == '=';
        if (text->has_ended)
            break;
        const int digit = base64_digit((unsigned char)letter);
        if (digit < 0)
            return text_fail(text, "base64", err);
        text->bits = text->bits << 6 | (unsigned)digit;
        text->bit_count += 6;
        if (text->bit_count >= 8) {
            text->bit_count -= 8;
            text->out[text->waiting++] = (uint8_t)(text->bits >> text->bit_count);
        }
        if (text->waiting == sizeof text->out) {
            strl_status status = flush_decoded(text, err);
            if (status)
                return status;
        }
    }
    return STRL_OK;
}

/* data:[type][;parameters];base64, */
static strl_status pass_header(data_text *text, strl_error *err)
{
    char header[HEADER_BYTES_MAX + 1];
    size_t size = text->end - text->at < HEADER_BYTES_MAX ? (size_t)(text->end - text->at) : HEADER_BYTES_MAX;
    strl_status status = strl_file_read(text->file, text->at, header, size, err);
    if (status)
        return status;
    header[size] = 0;
    /* The splitter's notation may be forged by an escape in its first letters. */
    if (strncmp(header, "data:", 5) != 0)
        return text_fail(text, "a data URI that begins with 'data:'", err);
    char *comma = strchr(header, ',');
    if (!comma)
        return text_fail(text, "a data URI with a comma", err);
    *comma = 0;
    if (!strstr(header, ";base64"))
        return text_fail(text, "a data URI in base64", err);
    text->at += (uint64_t)(comma + 1 - header);
    return STRL_OK;
}

static strl_status decode_text(data_text *text, strl_error *err)
{
    char chars[TEXT_BYTES];
    strl__gltf_buffer *buffer = text->buffer;
    strl_status status = pass_header(text, err);
    while (!status && text->at < text->end && !text->has_ended) {
        const uint64_t begin = text->at, left = text->end - begin;
        size_t size = left < sizeof chars ? (size_t)left : sizeof chars;
        status = strl_file_read(text->file, begin, chars, size, err);
        if (!status)
            status = decode_base64(text, chars, size, err);
    }
    if (!status)
        status = flush_decoded(text, err);
    if (!status && buffer->is_loose)
        buffer->bytes = text->decoded;
    if (!status && text->decoded < buffer->bytes)
        status = strl__fail(err, STRL_ERR_FORMAT,
                            "%s, buffers[%u]: expected %" PRIu64 " bytes, found a data URI of %" PRIu64,
                            text->gltf->reader->path, text->index, buffer->bytes, text->decoded);
    return status;
}

/* To memory or to scratch. */
static strl_status make_place(strl__gltf *gltf, strl__gltf_buffer *buffer, uint32_t index, strl_error *err)
{
    const uint64_t limit = gltf->reader->memory_bytes / 8;
    if (buffer->bytes <= limit - gltf->text_bytes) {
        buffer->memory = strl__alloc((size_t)buffer->bytes, 1);
        buffer->memory_bytes = buffer->memory ? buffer->bytes : 0;
        gltf->text_bytes += buffer->memory_bytes;
        return buffer->memory ? STRL_OK
                              : strl__fail(err, STRL_ERR_MEMORY, "%s, %s[%u]: no memory for %" PRIu64 " bytes",
                                           gltf->reader->path, list_of(buffer), index, buffer->bytes);
    }
    if (!gltf->reader->scratch_dir)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%s, %s[%u]: its %" PRIu64 " bytes do not fit the %" PRIu64
                          " of memory and no scratch folder was given",
                          gltf->reader->path, list_of(buffer), index, buffer->bytes, limit);
    strl_status status = strl_file_create_nameless(gltf->reader->scratch_dir, &buffer->file, err);
    buffer->owns_file = !status;
    return status;
}

/* uri is "data:@OFFSET+BYTES", as the JSON's splitter writes it. */
static strl_status open_text(strl__gltf *gltf, strl__gltf_buffer *buffer, uint32_t index, strl_error *err)
{
    data_text text = {.gltf = gltf, .buffer = buffer, .index = index, .file = gltf->reader->input.file};
    uint64_t bytes;
    if (sscanf(buffer->uri, "data:@%" SCNu64 "+%" SCNu64, &text.at, &bytes) != 2 ||
        text.at > gltf->reader->input.file_bytes || bytes > gltf->reader->input.file_bytes - text.at)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, %s[%u]: expected a data URI without escapes in its first letters, found '%.80s'",
                          gltf->reader->path, list_of(buffer), index, buffer->uri);
    text.end = text.at + bytes;
    if (buffer->is_loose)
        buffer->bytes = bytes / 4 * 3 + 3;
    if (!buffer->is_loose && buffer->bytes > bytes) /* before it sizes anything */
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, buffers[%u]: expected %" PRIu64 " bytes, found a data URI of %" PRIu64 " letters",
                          gltf->reader->path, index, buffer->bytes, bytes);
    strl_status status = make_place(gltf, buffer, index, err);
    return status ? status : decode_text(&text, err);
}

/* ---- for all */

strl_status strl__gltf_open_buffer(strl__gltf *gltf, uint32_t index, strl_error *err)
{
    strl__gltf_buffer *buffer = &gltf->buffers[index];
    strl_status status;
    if (buffer->is_open)
        return STRL_OK;
    if (!buffer->uri)
        status = open_binary(gltf, index, err);
    else if (strncmp(buffer->uri, "data:", 5) == 0)
        status = open_text(gltf, buffer, index, err);
    else
        status = open_file(gltf, buffer, index, err);
    buffer->is_open = !status;
    if (status) /* it may be tried again, for each image that is in it */
        strl__gltf_close_buffer(gltf, buffer);
    return status;
}

strl_status strl__gltf_open_loose(strl__gltf *gltf, strl__gltf_buffer *buffer, uint32_t image, strl_error *err)
{
    buffer->is_loose = true;
    strl_status status = strncmp(buffer->uri, "data:", 5) == 0 ? open_text(gltf, buffer, image, err)
                                                               : open_file(gltf, buffer, image, err);
    if (status)
        strl__gltf_close_buffer(gltf, buffer);
    return status;
}

void strl__gltf_close_buffer(strl__gltf *gltf, strl__gltf_buffer *buffer)
{
    if (buffer->owns_file)
        strl_file_close(buffer->file, NULL); /* read from, or scratch */
    strl__free(buffer->memory);
    gltf->text_bytes -= buffer->memory_bytes;
    buffer->file = NULL;
    buffer->memory = NULL;
    buffer->memory_bytes = 0;
    buffer->owns_file = buffer->is_beside = buffer->is_open = false;
}

strl_status strl__gltf_check_unchanged(const strl__gltf *gltf, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; i < gltf->buffer_count && !status; i++)
        if (gltf->buffers[i].is_beside)
            status = strl__reader_check_unchanged(gltf->buffers[i].file, &gltf->buffers[i].opened, err);
    return status;
}

void strl__gltf_rest_buffers(strl__gltf *gltf)
{
    for (size_t i = 0; i < gltf->buffer_count; i++) {
        strl__gltf_buffer *buffer = &gltf->buffers[i];
        uint64_t at;
        if (!buffer->memory)
            continue;
        const bool is_stored = strl__gltf_store(gltf, buffer->memory, (size_t)buffer->memory_bytes, &at);
        strl__gltf_close_buffer(gltf, buffer);
        if (is_stored) {
            buffer->file = gltf->stored;
            buffer->file_offset = at;
            buffer->is_open = true;
        }
    }
}

void strl__gltf_close_buffers(strl__gltf *gltf)
{
    for (size_t i = 0; i < gltf->buffer_count; i++)
        strl__gltf_close_buffer(gltf, &gltf->buffers[i]);
}

strl_status strl__gltf_read_buffer(strl__gltf *gltf, uint32_t index, uint64_t offset, void *data, size_t size,
                                   strl_error *err)
{
    const strl__gltf_buffer *buffer = &gltf->buffers[index];
    strl_status status = strl__gltf_open_buffer(gltf, index, err); /* it may have been given back */
    if (status)
        return status;
    if (!buffer->memory)
        return strl_file_read(buffer->file, buffer->file_offset + offset, data, size, err);
    memcpy(data, buffer->memory + offset, size);
    return STRL_OK;
}

strl_status strl__gltf_read_view(strl__gltf *gltf, uint32_t index, uint64_t offset, void *data, size_t size,
                                 strl_error *err)
{
    const strl__gltf_view *view = &gltf->views[index];
    const uint8_t *bytes;
    if (!view->meshopt)
        return strl__gltf_read_buffer(gltf, view->buffer, view->offset + offset, data, size, err);
    if (view->is_stored)
        return strl_file_read(gltf->stored, view->stored_at + offset, data, size, err);
    strl_status status = strl__gltf_decode_view(gltf, index, &bytes, err);
    if (!status)
        memcpy(data, bytes + offset, size);
    return status;
}
