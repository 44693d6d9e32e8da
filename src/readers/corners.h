/* A batch of faces on their way from a file to triangles. A format appends faces: either with
 * corners it knows already, or with indices into tables of vertices and normals, which are then
 * resolved for the whole batch at once: sorted by index where the tables do not fit their windows,
 * so that each is swept forward and no corner costs a seek.
 *
 * Call order: init -> (reset -> add* -> resolve -> emit until it gives 0)* -> deinit. */
#ifndef STRL_READERS_CORNERS_H
#define STRL_READERS_CORNERS_H

#include "readers/polygon.h"
#include "readers/reader.h"
#include "readers/record.h"
#include "readers/table.h"

#define STRL__NO_INDEX UINT64_MAX

typedef struct strl__face {
    uint32_t corner_count; /* at least 3 */
    uint32_t part;
    uint32_t material;
    uint32_t colour; /* of the whole face, where the batch has face colours and no corner colours */
} strl__face;

typedef struct strl__batch_desc {
    bool indexed;           /* corners are indices into a table of vertices */
    bool indexed_normals;   /* and into a table of normals */
    bool indexed_texcoords; /* and into a table of texture coordinates */
    bool sorted;            /* a table does not fit its window */
    size_t bytes;           /* budget; enough for one polygon of the largest size is taken in any case */
} strl__batch_desc;

typedef struct strl__batch {
    strl__face *faces; /* owned, as are the arrays below */
    strl__corner *corners;
    uint64_t *vertex;   /* index of each corner; NULL unless indexed */
    uint64_t *normal;   /* or STRL__NO_INDEX; NULL unless indexed_normals */
    uint64_t *texcoord; /* or STRL__NO_INDEX; NULL unless indexed_texcoords */
    uint64_t *keys[2];  /* scratch of the sort; NULL unless sorted */
    size_t face_count, face_capacity;
    size_t corner_count, corner_capacity;
    size_t corner_goal; /* a format stops filling here; a whole polygon still fits then */
    bool has_corner_colour, has_face_colour;
    bool has_texcoord;             /* of a corner without one, the first number is none */
    size_t next_face, next_corner; /* what emit takes next */
    uint32_t next_triangle;        /* of the polygon begun, if > 0 */
    strl__polygon polygon;
} strl__batch;

strl_status strl__batch_init(strl__batch *batch, const strl__batch_desc *desc, strl_error *err);
void strl__batch_deinit(strl__batch *batch);
void strl__batch_reset(strl__batch *batch);

static inline bool strl__batch_is_full(const strl__batch *batch)
{
    return batch->corner_count >= batch->corner_goal;
}

/* Ends a face whose corners the format has put at index corner_count and after (at most
 * STRL__POLYGON_CORNERS_MAX). */
static inline void strl__batch_add(strl__batch *batch, const strl__face *face)
{
    batch->faces[batch->face_count++] = *face;
    batch->corner_count += face->corner_count;
}

/* Indices must be below the counts of the tables. normals may be NULL. */
strl_status strl__batch_resolve(strl__batch *batch, strl__table *vertices, strl__table *normals, strl_error *err);
/* The texture coordinates alone; before or after the others. */
strl_status strl__batch_resolve_texcoords(strl__batch *batch, strl__table *texcoords, strl_error *err);
/* Up to capacity triangles; *count 0 = the batch is empty. Counts what has to be dropped. */
strl_status strl__batch_emit(strl__batch *batch, strl_triangle *triangles, size_t capacity, size_t *count,
                             strl_reader_drops *drops, strl_error *err);

#endif
