/* Reading the stream of triangles that a program writes in the protocol of import_protocol.h, from a
 * file that holds it. The file is hostile: whoever wrote it has read a hostile file.
 *
 * Call order: init -> scan -> (format's prepare -> start -> fill*)* -> deinit. */
#ifndef STRL_READERS_IMPORT_STREAM_H
#define STRL_READERS_IMPORT_STREAM_H

#include "readers/import_protocol.h"
#include "readers/internal.h"

/* The beginning of a stream: magic, and the record of facts. */
#define STRL__IMPORT_START_BYTES (STRL_IMPORT_MAGIC_BYTES + STRL_IMPORT_RECORD_HEAD + STRL_IMPORT_FACTS_BYTES)

typedef struct strl__import_facts {
    strl_axis up;
    double unit_metres;   /* 0 = unknown */
    uint64_t triangles;   /* announced */
    uint64_t stream_most; /* bytes, announced */
    char format[STRL_IMPORT_FORMAT_BYTES + 1];
} strl__import_facts;

/* The state of the formats that read a stream. */
typedef struct strl__import {
    strl_file *spool; /* holds the stream; owned unless it is the reader's own file */
    bool owns_spool;
    strl__input input; /* over the spool */
    strl__import_facts facts;
    uint32_t *materials; /* from the stream's numbers to the reader's; owned */
    size_t material_count, material_capacity;
    uint32_t part, plain; /* indices of the current part, and of the material of blocks without one */
    bool part_known, plain_known;
    bool error_told;                      /* the stream ends in the importer's own words */
    char told[STRL_IMPORT_TEXT_MOST + 1]; /* which are these */
    uint64_t record_at;                   /* where the record being read begins */
    uint64_t triangles;                   /* of this pass so far */
    uint64_t checksum;                    /* of this pass so far */
} strl__import;

/* From the first STRL__IMPORT_START_BYTES bytes of a stream; false where they are not facts. */
bool strl__import_facts_parse(const uint8_t *start, strl__import_facts *facts);
/* Opens the window on state->spool, which is whole, and goes through it once, looking at the frames
 * of the records alone: every stream that is cut off, and every error that it tells, is found
 * before the first triangle. Sets state->facts. */
strl_status strl__import_scan(strl_reader *reader, strl_error *err);

/* Tells the reader what the facts say. */
void strl__import_note_facts(strl_reader *reader);

/* Of a strl__format whose state is a strl__import. */
strl_status strl__import_prepare(strl_reader *reader, strl_error *err);
strl_status strl__import_start(strl_reader *reader, strl_error *err);
strl_status strl__import_fill(strl_reader *reader, strl_error *err);
uint64_t strl__import_bytes_done(const strl_reader *reader);
void strl__import_close(strl_reader *reader);

/* A file that is a stream; for tests and fuzzers, never recognised. */
extern const strl__format strl__format_import;

#endif
