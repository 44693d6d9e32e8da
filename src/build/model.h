/* The trees of one model. What a model uses once is one tree, as it is; what it uses again and again is a tree of its
 * own in its own coordinates, with placements (readers/reader.h). Trees are built one after another, by the stages of
 * one builder, into one container:
 *
 *   strl__model_run -> for each tree: context->run
 *     ingest           -> strl__model_open (the first), strl__model_reads, strl__model_rewind, ...
 *     the builder      -> strl__model_writer -> its tree, or strl__model_empty_tree -> strl__model_end_tree
 *
 * A resumed build has one tree and opens no reader. */
#ifndef STRL_BUILD_MODEL_H
#define STRL_BUILD_MODEL_H

#include "build/container_facts.h"

#define STRL_EVERY_INPUT UINT32_MAX
/* What a walk can tell apart. */
#define STRL_MOST_PLACEMENTS ((uint64_t)1 << 24)

typedef struct strl_model_tree {
    uint32_t input;      /* or STRL_EVERY_INPUT: of each its piece 0 */
    uint32_t piece;      /* of the input */
    uint64_t announced;  /* triangles */
    uint64_t triangles;  /* kept, once it is built */
    uint64_t placements; /* that are finite */
    double scale;        /* the most by which a placement stretches */
    double centre[3];    /* of its triangles' box, once it is built */
    double size;         /* of the same, its longest side */
} strl_model_tree;

typedef struct strl_build_model {
    strl_reader **readers; /* [input_count], owned; NULL until they are opened */
    strl_axis up;          /* of the inputs, which agree */
    char unit[16];
    strl_model_tree *trees;               /* [tree_count], owned; NULL until the readers are opened: there is one */
    uint32_t tree_count, tree;            /* tree: the one that is built */
    uint32_t *first_tree;                 /* [input_count] tree of the input's piece 1, owned; NULL as trees */
    uint64_t announced, announced_before; /* triangles of all trees; of those before this one */
    strl_container_writer *writer;        /* owned; NULL before the first tree */
    bool has_colour;
} strl_build_model;

strl_status strl__model_run(strl_build_context *context, strl_error *err);

/* ---- for ingest (model_inputs.c) */
/* Opens the inputs, lists the trees, tells the estimate, refuses what cannot be built. Once. */
strl_status strl__model_open(strl_build_context *context, strl_error *err);
/* One tree, of all that the inputs have, once. Only of such a model are finished stages kept. */
bool strl__model_is_plain(const strl_build_context *context);
/* Whether the tree is one that placements put into the model's coordinates. */
bool strl__model_has_placements(const strl_build_context *context);
bool strl__model_is_last_tree(const strl_build_context *context);
/* Whether the tree is made of this input. */
bool strl__model_reads(const strl_build_context *context, uint32_t input);
/* To the first triangle of the tree's piece. */
strl_status strl__model_rewind(const strl_build_context *context, uint32_t input, strl_error *err);
/* --grid in the tree's own coordinates; 0 = chosen. */
double strl__model_grid(const strl_build_context *context);
/* The tree's triangles have been read for the last time. Readers of a plain model are closed, others rest. */
strl_status strl__model_rest(strl_build_context *context, strl_error *err);
void strl__model_close_readers(strl_build_context *context);
/* Fails where the scratch of so many triangles does not fit the disk. */
strl_status strl__model_check_disk(const strl_build_context *context, uint64_t triangles, bool has_texcoords,
                                   strl_error *err);

/* ---- for builders */
/* The container, for one more tree; borrowed. */
strl_status strl__model_writer(strl_build_context *context, const strl_ingest *ingest, strl_container_writer **writer,
                               strl_error *err);
/* In place of a tree where no triangle is left. */
strl_status strl__model_empty_tree(strl_build_context *context, const strl_ingest *ingest, strl_structure structure,
                                   strl_error *err);
/* After each tree. After the last one also placements and names, and the container gets its name. */
strl_status strl__model_end_tree(strl_build_context *context, const strl_ingest *ingest, strl_error *err);

/* ---- place.c */
/* The placements of all trees into the container, those that are near each other together. */
strl_status strl__model_place(strl_build_context *context, strl_error *err);

#endif
