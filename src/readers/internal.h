/* What reader.c and the formats share. */
#ifndef STRL_READERS_INTERNAL_H
#define STRL_READERS_INTERNAL_H

#include "readers/corners.h"
#include "readers/input.h"
#include "readers/names.h"
#include "readers/reader.h"
#include "readers/table.h"
#include "readers/texture.h"

#define STRL__READER_MEMORY_LEAST ((uint64_t)8 << 20)

/* One file format. Every function may be called again after it failed. */
typedef struct strl__format {
    const char *name;
    strl_axis default_up;
    const char *default_unit; /* NULL: the format does not say */
    size_t state_bytes;       /* zeroed, in reader->state */
    bool weak;                /* its beginning may be another format's: a name's ending says more */
    bool (*recognises)(const strl__input *input, uint64_t file_bytes); /* by the first bytes, which are in the input */
    strl_status (*open)(strl_reader *reader, strl_error *err);         /* the header; sets reader->triangles_hint */
    strl_status (*prepare)(strl_reader *reader, strl_error *err); /* before the first triangle: tables and the batch */
    strl_status (*start)(strl_reader *reader, strl_error *err);   /* to the first face */
    strl_status (*fill)(strl_reader *reader, strl_error *err);    /* adds faces to the batch; sets reader->ended */
    strl_status (*paint)(strl_reader *reader, strl_error *err);   /* colours of a resolved batch; may be NULL */
    uint64_t (*bytes_done)(const strl_reader *reader);            /* NULL: where the input stands */
    strl_status (*check_unchanged)(const strl_reader *reader, strl_error *err); /* files beside this one; may be NULL */
    void (*rest)(strl_reader *reader);  /* gives back what reading takes; may be NULL */
    void (*close)(strl_reader *reader); /* what the state owns; may be NULL */
    /* Of formats with pieces; may be NULL. start goes to the first face of reader->piece. */
    void (*piece_get)(const strl_reader *reader, uint32_t piece, strl_reader_piece *facts);
    strl_status (*start_placements)(strl_reader *reader, strl_error *err);
    strl_status (*next_placement)(strl_reader *reader, strl_reader_placement *placement, bool *found, strl_error *err);
} strl__format;

extern const strl__format strl__format_ply;
extern const strl__format strl__format_stl;
extern const strl__format strl__format_obj;
extern const strl__format strl__format_gltf;
extern const strl__format strl__format_glb;
/* Not among those that are recognised: the last resort, by the name's ending alone. */
extern const strl__format strl__format_assimp;

/* Whether the name ends in a dot and this, in letters of either case. */
bool strl__has_extension(const char *path, const char *extension);
/* The ending of a name that tells of a format which assimp reads and Stroll does not; NULL = none. */
const char *strl__assimp_extension(const char *path);
/* Whether a file begins as one of those formats; asked where the name says nothing. */
bool strl__assimp_recognises(const strl__input *input);

/* A file that was read for this one. */
typedef struct strl__beside {
    uint64_t key; /* hash of its path */
    char *path;   /* owned */
    strl_file_info info;
} strl__beside;

struct strl_reader {
    const strl__format *format;
    void *state;                        /* of the format; owned */
    char *path;                         /* owned */
    char *scratch_dir;                  /* owned; NULL where none was given */
    uint64_t memory_bytes, whole_bytes; /* whole: 0 = unknown */
    uint32_t most_pieces;
    uint32_t piece_count;    /* besides piece 0 */
    uint32_t piece;          /* the one that is read */
    strl_reader_child child; /* borrowed, during open */
    strl_axis default_up;
    const char *default_unit; /* static; NULL = unknown */
    strl_file *file;          /* owned */
    strl_file *decoded;       /* its text in UTF-8, where it was in UTF-16: then the input's; owned, may be NULL */
    strl_file_info opened;    /* as it was at opening */
    uint64_t all_bytes;       /* with the files that this one names, where they count; else 0 */
    uint64_t triangles_hint;
    bool hint_is_exact;
    bool is_foreign; /* set by an open that fails: it is an older version of the format, which the importer reads */
    bool is_certain; /* not its name alone says what the file is */
    uint64_t listed_vertices; /* where the table of vertices does not hold them all, or was given back; else 0 */
    strl__input input;
    strl__table vertices, normals, texcoords;
    strl__batch batch;
    strl__names parts, materials;
    strl__names missing;  /* sentences: why files that this one names could not be read */
    strl__beside *beside; /* owned */
    size_t beside_count, beside_capacity;
    uint64_t beside_bytes;   /* of their paths */
    strl__textures textures; /* of formats that have any */
    strl_reader_drops drops;
    strl_reader_costs costs;
    bool prepared; /* tables and batch are there */
    bool started;  /* the input stands at a face */
    bool ended;    /* the format has no more faces */
    bool rests;    /* until rewind: nothing is held, and nothing is read */
    bool failed;   /* this pass ended with `failure` */
    strl_error failure;
};

/* Opens a file as a given format instead of guessing; for tests and fuzzers. NULL guesses. */
strl_status strl__reader_open_as(const strl_reader_desc *desc, const strl__format *format, strl_reader **reader,
                                 strl_error *err);

#define STRL__ADVICE_BYTES 80u

/* How much memory would do where `needed` bytes do not fit a part of the budget of which there are
 * `limit` bytes now: by --memory, where the reader knows of what it is a share. */
void strl__reader_advise(const strl_reader *reader, uint64_t needed, uint64_t limit, char advice[STRL__ADVICE_BYTES]);

/* Where nobody knows how much would do; static. */
const char *strl__reader_advise_more(const strl_reader *reader);

/* Fails where an open file is not as it was. */
strl_status strl__reader_check_unchanged(strl_file *file, const strl_file_info *opened, strl_error *err);

/* Lists a file beside this one, once, however often it is noted. info NULL: as it is now. */
strl_status strl__reader_note_beside(strl_reader *reader, const char *path, const strl_file_info *info,
                                     strl_error *err);

/* Allocates the batch for the reader's tables, which must be complete. */
strl_status strl__reader_init_batch(strl_reader *reader, bool indexed, strl_error *err);

#endif
