/* The body of an answer: bytes in memory, then pieces of a file, read as they go out. Internal. */
#ifndef STRL_SERVE_BODY_H
#define STRL_SERVE_BODY_H

#include "platform/file.h"

#define STRL__FRAME_BYTES 12u

typedef struct strl__piece {
    uint64_t offset, bytes;
} strl__piece;

typedef struct strl__body {
    uint8_t *head; /* [head_bytes], owned; may be NULL */
    size_t head_bytes;
    strl_file *file;     /* owned; NULL = no pieces */
    strl_file_info info; /* of the file when it was opened: what changes under way is not sent */
    strl__piece *pieces; /* [piece_count], owned */
    size_t piece_count;
    bool framed; /* before each piece: u64 offset, u32 bytes */

    uint64_t done; /* bytes read so far */
    size_t piece;  /* the one at work */
    uint64_t at;   /* bytes of it read, its frame included */
} strl__body;

/* Zeroed; NULL without memory. */
strl__body *strl__body_create(void);
void strl__body_destroy(strl__body *body); /* NULL is legal */
uint64_t strl__body_bytes(const strl__body *body);
/* Of memory, as long as it is not destroyed. */
uint64_t strl__body_memory(const strl__body *body);
/* The next bytes, at most size; *got 0 = the end. Fails where the file is not any more what it was. */
strl_status strl__body_read(strl__body *body, void *data, size_t size, size_t *got, strl_error *err);

#endif
