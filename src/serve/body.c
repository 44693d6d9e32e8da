#include "serve/body.h"

#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/memory.h"

strl__body *strl__body_create(void)
{
    return strl__alloc_zero(1, sizeof(strl__body));
}

void strl__body_destroy(strl__body *body)
{
    if (!body)
        return;
    strl_file_close(body->file, NULL);
    strl__free(body->head);
    strl__free(body->pieces);
    strl__free(body);
}

static uint64_t frame_bytes(const strl__body *body)
{
    return body->framed ? STRL__FRAME_BYTES : 0;
}

uint64_t strl__body_bytes(const strl__body *body)
{
    uint64_t bytes = body->head_bytes;
    for (size_t i = 0; i < body->piece_count; i++)
        bytes += frame_bytes(body) + body->pieces[i].bytes;
    return bytes;
}

uint64_t strl__body_memory(const strl__body *body)
{
    return sizeof *body + body->head_bytes + body->piece_count * sizeof *body->pieces;
}

static size_t copy_some(const uint8_t *from, uint64_t from_bytes, uint64_t at, uint8_t *to, size_t size)
{
    uint64_t left = from_bytes - at;
    size_t count = left < size ? (size_t)left : size;
    memcpy(to, from + at, count);
    return count;
}

static size_t read_frame(strl__body *body, uint8_t *data, size_t size)
{
    uint8_t frame[STRL__FRAME_BYTES];
    strl__store_le(frame, 8, body->pieces[body->piece].offset);
    strl__store_le(frame + 8, 4, body->pieces[body->piece].bytes);
    size_t count = copy_some(frame, sizeof frame, body->at, data, size);
    body->at += count;
    return count;
}

static strl_status read_piece(strl__body *body, uint8_t *data, size_t size, size_t *got, strl_error *err)
{
    const strl__piece *piece = &body->pieces[body->piece];
    uint64_t at = body->at - frame_bytes(body), left = piece->bytes - at;
    size_t count = left < size ? (size_t)left : size;
    strl_status status = strl_file_read(body->file, piece->offset + at, data, count, err);
    *got = status == STRL_OK ? count : 0;
    body->at += *got;
    if (body->at == frame_bytes(body) + piece->bytes) {
        body->piece++;
        body->at = 0;
    }
    return status;
}

/* After the bytes were read: what they were read from is what was announced. */
static strl_status check_unchanged(const strl__body *body, strl_error *err)
{
    strl_file_info now;
    strl_status status = strl_file_stat(body->file, &now, err);
    if (status == STRL_OK && (now.bytes != body->info.bytes || now.modified_ns != body->info.modified_ns))
        status = strl__fail(err, STRL_ERR_IO, "%.300s was changed while it was sent", strl_file_path(body->file));
    return status;
}

strl_status strl__body_read(strl__body *body, void *data, size_t size, size_t *got, strl_error *err)
{
    uint8_t *to = data;
    strl_status status = STRL_OK;
    bool from_file = false;
    *got = 0;
    if (body->done < body->head_bytes)
        *got = copy_some(body->head, body->head_bytes, body->done, to, size);
    while (status == STRL_OK && *got < size && body->piece < body->piece_count) {
        size_t moved = 0;
        if (body->at < frame_bytes(body)) {
            moved = read_frame(body, to + *got, size - *got);
        } else {
            status = read_piece(body, to + *got, size - *got, &moved, err);
            from_file = true;
        }
        *got += moved;
    }
    if (status == STRL_OK && from_file)
        status = check_unchanged(body, err);
    body->done += *got;
    return status;
}
