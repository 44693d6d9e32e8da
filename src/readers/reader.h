/* Readers turn a mesh file into one stream of triangles with resolved corners, in file order, within a memory budget,
 * whatever the size of the file. A stream can be rewound and read again: it then gives the same triangles.
 *
 * Call order: open -> (next)* until count 0 -> [rewind -> (next)*]* -> close. One thread at a time.
 *
 * A model whose parts are used again and again is a stream of all copies, or, where pieces are asked for, some streams:
 * piece 0 is what is used once, in the model's coordinates; each other piece is a mesh in its own, with placements of
 * it. select in place of rewind goes to a piece. Which meshes are pieces: docs/architecture.md, "Pieces and
 * placements". */
#ifndef STRL_READERS_READER_H
#define STRL_READERS_READER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "platform/file.h"
#include "readers/image.h"
#include "stroll/error.h"

typedef struct strl_reader strl_reader;

/* What was read but cannot become a triangle, counted apart by kind. Of one whole pass. */
typedef struct strl_reader_drops {
    uint64_t nonfinite;        /* triangles with a corner that is not finite */
    uint64_t degenerate_faces; /* faces with fewer than three corners */
    uint64_t lines;            /* line elements */
    uint64_t points;           /* point elements; not unused vertices */
    uint64_t unread_bytes;     /* behind what the file announces */
} strl_reader_drops;

#define STRL_TRIANGLE_HAS_NORMAL 1u
#define STRL_TRIANGLE_HAS_COLOUR 2u
#define STRL_TRIANGLE_HAS_TEXCOORD 4u /* only where the material names an image */

/* One triangle as read. 3 corners. */
typedef struct strl_triangle {
    double position[3][3]; /* model units, the file's own axes; finite */
    float normal[3][3];    /* as read, not normalised; zero where absent; see flags */
    uint32_t colour[3];    /* sRGB-encoded RGBA8, R in the lowest byte; 0xffffffff where absent */
    uint32_t part;         /* index into the reader's parts */
    uint32_t material;     /* index into the reader's materials */
    uint32_t flags;        /* STRL_TRIANGLE_HAS_... : for all three corners */
    /* in the image of the material, u to the right, v down, 1 = all of it; finite; 0 where absent */
    float texcoord[3][2];
} strl_triangle;

/* What a child process may take that reads what Stroll does not read itself. Zero = defaults. */
typedef struct strl_reader_child {
    /* its program; NULL = stroll-import beside the running program, or in its libexec folder */
    const char *importer;
    uint64_t memory_bytes;        /* of address space, all in all; 0 = 1 GiB */
    uint64_t cpu_seconds;         /* of processor time, and four times as much of any; 0 = by the size of the file */
    bool (*go_on)(void *context); /* asked on the caller's thread, some times a second; false cancels; may be NULL */
    void *context;
} strl_reader_child;

typedef struct strl_reader_desc {
    const char *path;        /* UTF-8; borrowed during the call of open */
    const char *scratch_dir; /* an existing folder for spill files, which close removes; borrowed during open */
    uint64_t memory_bytes;   /* budget of all the reader holds but names; 0 = 256 MiB; the least is 8 MiB */
    uint64_t whole_bytes;    /* --memory, of which memory_bytes is a share: what sentences advise; 0 = unknown */
    /* budget of the names of parts; those of materials have half as much; 0 = an eighth of memory_bytes */
    uint64_t names_bytes;
    strl_reader_child child; /* borrowed during open: the child has ended before open returns */
    uint32_t most_pieces;    /* besides piece 0; 0 = none: all copies are read as triangles */
} strl_reader_desc;

/* Of one file, besides piece 0. A container has 512 trees at most. */
#define STRL_READER_MOST_PIECES 500u

typedef enum strl_axis { STRL_AXIS_X, STRL_AXIS_Y, STRL_AXIS_Z } strl_axis;

/* Facts known at opening. */
typedef struct strl_reader_info {
    const char *format;       /* "ply", "stl", "obj", "gltf", "glb", "assimp" (all others); static */
    strl_axis default_up;     /* y for OBJ and glTF, z for PLY and STL; what assimp makes of the others, mostly y */
    const char *default_unit; /* "m" for glTF, what assimp tells of FBX, COLLADA and IFC; NULL = unknown; static */
    uint64_t triangles_hint;  /* a guess for progress bars (faces announced, or from the file's size); 0 = unknown */
    /* no more triangles than that will be read (glTF: all placements, checked); it may be far more than the file has
     * bytes */
    bool hint_is_exact;
    /* more than its name says that the file is of this format; after the first call of next */
    bool is_certain;
    uint64_t file_bytes; /* with the files that hold what this one names (glTF's buffers) */
} strl_reader_info;

/* What a file took beyond the memory budget. */
typedef struct strl_reader_costs {
    uint64_t scratch_bytes; /* of the stream that a child wrote, until close */
    /* peak resident set of the child and of this process meanwhile, together; 0 = no child */
    uint64_t child_rss_bytes;
} strl_reader_costs;

/* Recognises the format by content, then by name; what Stroll does not read itself goes to a child process that links
 * assimp, which is run during open. Fails with one sentence that names file, place, expected and found. */
strl_status strl_reader_open(const strl_reader_desc *desc, strl_reader **reader, strl_error *err);
void strl_reader_info_get(const strl_reader *reader, strl_reader_info *info);
/* Up to `capacity` next triangles into `triangles`; *count 0 = the end. A broken file fails here: nothing after is
 * read. */
strl_status strl_reader_next(strl_reader *reader, strl_triangle *triangles, size_t capacity, size_t *count,
                             strl_error *err);
/* Back to the first triangle. Fails where the file, or a buffer's file beside it, has changed (size or time of
 * change). */
strl_status strl_reader_rewind(strl_reader *reader, strl_error *err);

/* ---- pieces */
typedef struct strl_reader_piece {
    uint64_t triangles;  /* once, as announced; of piece 0 a guess where the hint is */
    uint64_t placements; /* 1 of piece 0 */
    /* nothing is in it, not even a line: piece 0 of a file that uses all it has more than once */
    bool is_empty;
} strl_reader_piece;

/* A placement of a piece other than 0: rows of three and the translation, from the piece's coordinates to the model's.
 */
typedef struct strl_reader_placement {
    uint32_t piece;
    uint32_t part;        /* its own name, among the reader's parts */
    double transform[12]; /* finite */
} strl_reader_placement;

uint32_t strl_reader_piece_count(const strl_reader *reader); /* with piece 0, at least 1 */
void strl_reader_piece_get(const strl_reader *reader, uint32_t piece, strl_reader_piece *facts);
/* Parts and materials of the pieces other than 0 are known from opening on. */
/* To the first triangle of a piece, as rewind. Drops are then those of a pass over the piece. */
strl_status strl_reader_select(strl_reader *reader, uint32_t piece, strl_error *err);
/* The placements of all pieces in the order of the file, as a stream: begin -> (next)* until *found is false. Then
 * select or rewind before triangles are read. Those that are not finite are left out; each counts as its piece's
 * triangles among the drops. */
strl_status strl_reader_begin_placements(strl_reader *reader, strl_error *err);
strl_status strl_reader_next_placement(strl_reader *reader, strl_reader_placement *placement, bool *found,
                                       strl_error *err);

/* Gives back what reading takes, tables and windows, until rewind: of many files that are open one is read. Facts,
 * drops and names stay; next gives nothing. */
void strl_reader_rest(strl_reader *reader);
/* Of the pass so far; complete after the end was reached. */
void strl_reader_drops_get(const strl_reader *reader, strl_reader_drops *drops);
/* Vertices that the file lists, used or not, after the first call of next; 0 where the format has no such list (STL).
 */
uint64_t strl_reader_vertex_count(const strl_reader *reader);
/* Files that this one names and that could not be read (an OBJ's material libraries), each once, after the first call
 * of next: what they would bring is as if absent. index < count; why, a sentence that names the file; borrowed until
 * close. */
uint32_t strl_reader_missing_count(const strl_reader *reader);
const char *strl_reader_missing(const strl_reader *reader, uint32_t index);
/* Files beside this one that were read for it (glTF's buffers, OBJ's material libraries, images; not what an importer
 * opens on its own), each once, with their facts of then; all of them after a whole pass. index < count; borrowed until
 * close. */
uint32_t strl_reader_beside_count(const strl_reader *reader);
const char *strl_reader_beside(const strl_reader *reader, uint32_t index, strl_file_info *info);
/* Images that materials name and triangles show, and that could not be used (missing, of a kind that is not read,
 * damaged, too large), each once, after a whole pass: their materials have their colours alone. Of the first a sentence
 * that names it and says why; borrowed until close. */
uint32_t strl_reader_missing_image_count(const strl_reader *reader);
const char *strl_reader_missing_image(const strl_reader *reader);
/* Bytes of the file consumed so far in this pass, for progress. */
uint64_t strl_reader_bytes_done(const strl_reader *reader);

void strl_reader_costs_get(const strl_reader *reader, strl_reader_costs *costs);

/* Parts (OBJ o/g, STL solids, glTF nodes with a mesh, and each piece other than 0 with the name of its mesh, of foreign
 * formats the path of node names; a file without any has one, unnamed) and materials (one default, white, where absent)
 * as known after a whole pass; indices are stable over passes. Names are borrowed UTF-8 until close. */
uint32_t strl_reader_part_count(const strl_reader *reader);
const char *strl_reader_part_name(const strl_reader *reader, uint32_t part);
uint32_t strl_reader_material_count(const strl_reader *reader);
/* rgba: sRGB-encoded RGBA8, R in the lowest byte. */
const char *strl_reader_material(const strl_reader *reader, uint32_t material, uint32_t *rgba);

/* The image of a material, usable or not. */
typedef struct strl_reader_image {
    /* as the model names it: a file beside it, or "images[3] (name)" of its own; borrowed until close */
    const char *reference;
    strl__wrap wrap[2];                     /* of u, of v */
    float texcoord_min[2], texcoord_max[2]; /* of its triangles so far; min > max: there were none */
} strl_reader_image;

/* False where the material names none. */
bool strl_reader_material_image(const strl_reader *reader, uint32_t material, strl_reader_image *image);

void strl_reader_close(strl_reader *reader); /* NULL is legal; removes its spill files */

#endif
