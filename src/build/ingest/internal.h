/* Internal to build/ingest. */
#ifndef STRL_BUILD_INGEST_INTERNAL_H
#define STRL_BUILD_INGEST_INTERNAL_H

#include "build/ingest/buckets.h"

#define MAX_BUCKETS 384u

typedef struct survey_sample {
    double position[3][3];
    uint64_t index; /* of all triangles */
} survey_sample;

/* First pass: what must be known before a single position can be put on the lattice. */
typedef struct model_survey {
    double min[3], max[3];
    uint64_t triangles; /* as the readers gave them */
    bool any_normal, any_colour, any_texcoord;
    uint64_t *edge_histogram; /* [EDGE_BINS] of squared edge lengths */
    survey_sample *sample;    /* [SAMPLE_CAPACITY] one of sample_stride triangles */
    uint32_t sample_count;
    bool is_scattered; /* no pattern in the order of the input hides anything from the sample */
    uint64_t sample_stride;
} model_survey;

/* octree: buckets will be made as strl_ingest_begin says. */
strl_status strl__survey_run(strl_build_context *context, strl_reader *const *readers, bool octree,
                             model_survey *survey, strl_error *err);
void strl__survey_deinit(model_survey *survey);
/* Sets origin, step and what is said about it, curve_shift, leaf_error. */
strl_status strl__survey_choose_lattice(const strl_build_context *context, const model_survey *survey,
                                        strl_ingest *ingest, strl_error *err);

/* Sentences (report.c). Long enough for most; what is longer is cut. */
#define STRL_INPUTS_NAME_BYTES 200u
/* "a.ply", or "a.ply and 2 more". */
void strl__ingest_name_inputs(const strl_build_desc *desc, char *text, size_t size);
/* Refuses more triangles than the budget has room for nodes and cells of: their leaves would outgrow what a worker may
 * hold. */
strl_status strl__ingest_check_memory(const strl_build_context *context, uint64_t triangles, strl_error *err);
/* No triangle is left of what was read: a warning with what was found, by kind; a refusal where triangles were lost,
 * or nothing but the names of the inputs says that they are models at all. The result has the drops. */
strl_status strl__ingest_check_empty(strl_build_context *context, strl_reader *const *readers, strl_error *err);
/* All `collapsed` triangles that were read have two corners in one lattice cell. */
strl_status strl__ingest_refuse_collapsed(const strl_build_context *context, const strl_ingest *ingest,
                                          uint64_t collapsed, strl_error *err);
/* Tells and counts what is built although something is amiss. */
void strl__ingest_warn(strl_build_context *context, strl_reader *const *readers, const strl_ingest *ingest);

/* The image of a material, in order of the materials; a copy is taken. Then, when all materials are there, images has a
 * place for each. False without memory. */
bool strl__ingest_add_image(strl_names *materials, size_t material, const strl_material_image *image);
bool strl__ingest_fill_images(strl_names *materials);

void strl__soup_pack(const strl_ingest *ingest, const strl_soup_triangle *triangle, uint8_t *bytes);
void strl__soup_set_palette(const strl_ingest *ingest, uint32_t palette, uint8_t *bytes);

/* Parts, materials and images of all inputs, whichever the tree is made of. They are known after the first survey. */
strl_status strl__ingest_add_names(strl_build_context *context, strl_ingest *ingest, strl_error *err);
/* Triangles to buckets by curve range. Uses up the survey's sample. */
strl_status strl__distribute(strl_build_context *context, strl_reader *const *readers, model_survey *survey,
                             bool octree, strl_ingest *ingest, strl_buckets *buckets, strl_error *err);

/* A lattice position and the cell that has it. */
typedef struct pair {
    uint32_t position[3];
    uint32_t cell;
} pair;

/* One of the streams that pairs go to by hash of position: packed differences, because the cells come
 * in order and their positions lie near each other. */
typedef struct pair_spill {
    strl_spill *spill;
    uint64_t count;               /* pairs */
    struct pair_packing *packing; /* owned; NULL when the stream has ended */
} pair_spill;

typedef struct pair_spills {
    uint32_t count; /* a power of two */
    pair_spill *stream;
} pair_spills;

strl_status strl__pair_spills_open(strl_build_context *context, uint64_t triangles, pair_spills *pairs,
                                   strl_error *err);
/* Cells must not descend. */
strl_status strl__pair_spills_append(pair_spills *pairs, const pair *added, strl_error *err);
/* Nothing is appended any more. */
strl_status strl__pair_spills_flush(pair_spills *pairs, strl_error *err);
/* All pairs of one stream, in the order in which they were appended, for the caller to free. */
strl_status strl__pair_spills_read(const pair_spills *pairs, uint32_t index, pair **read, size_t *count,
                                   strl_error *err);
strl_status strl__pair_spills_delete(pair_spills *pairs, uint32_t index, strl_error *err);
void strl__pair_spills_deinit(pair_spills *pairs);

/* Buckets to soup, cells and position pairs. */
strl_status strl__sort_buckets(strl_build_context *context, strl_ingest *ingest, strl_buckets *buckets,
                               pair_spills *pairs, strl_error *err);
/* Pairs to edges and shared positions. */
strl_status strl__connect_cells(strl_build_context *context, strl_ingest *ingest, pair_spills *pairs, strl_error *err);

/* The stream "ingest" of a checkpoint: all that is neither graph nor triangles. with_cells: they have been cut. */
strl_status strl__ingest_save_facts(strl_build_context *context, const strl_ingest *ingest, strl_error *err);
strl_status strl__ingest_restore_facts(strl_build_context *context, bool with_cells, strl_ingest *ingest,
                                       strl_error *err);

/* Bytes that one bucket or pair spill may take, so that every worker can hold one and its sort; the same for any number
 * of workers. */
uint64_t strl__bucket_bytes(const strl_build_context *context);

#endif
