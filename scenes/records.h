/* A run of records of one size that can be read from its first to its last, made as it is read. */
#ifndef STRL_SCENES_RECORDS_H
#define STRL_SCENES_RECORDS_H

#include <stddef.h>
#include <stdint.h>

#include "platform/output.h"
#include "scenes/stream.h"

typedef struct strl__records {
    uint64_t count;
    size_t bytes; /* of one, at most STRL__RECORD_MOST */
    /* The next ones, from `first` on: every record once, in order. */
    strl_status (*read)(void *context, uint64_t first, size_t count, uint8_t *records, strl_error *err);
    void *context;
} strl__records;

enum { STRL__RECORD_MOST = 64, STRL__RECORD_BATCH = 4096 };

/* What is read of a spill, where records lie one after the other. The disk gets each range back. */
typedef struct strl__spilled {
    strl_file *file; /* borrowed */
    size_t bytes;
} strl__spilled;

/* A strl__records.read; the context is a strl__spilled. */
strl_status strl__spilled_read(void *context, uint64_t first, size_t count, uint8_t *records, strl_error *err);

/* Appends all of them as they come. report: of the bytes, may be NULL. */
strl_status strl__records_write(const strl__records *records, strl__stream *out, strl_output_report report,
                                void *context, strl_error *err);

#endif
