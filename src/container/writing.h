/* A container that is being written, as the writer's own files see it. Internal. */
#ifndef STRL_CONTAINER_WRITING_H
#define STRL_CONTAINER_WRITING_H

#include "container/record.h"
#include "container/table.h"
#include "container/writer.h"
#include "platform/output.h"

typedef struct strl__written_tree {
    strl_tree facts;
    strl_treelet_ref root;
    bool has_far;
    strl_far far; /* of the root, read back when the first run needs it */
} strl__written_tree;

struct strl_container_writer {
    char *path;          /* owned */
    strl_output *output; /* owned; the sink's file is its */
    strl__sink sink;
    strl_file *spill; /* node records of the tree at hand, by id; owned */
    strl__header header;
    strl__page_table_writer *placements, *parts, *materials, *images, *runs;
    strl_placement run[STRL_RUN_PLACEMENTS]; /* the last ones, of a page that has not ended */
    uint32_t run_count;
    strl__name last_part, last_material; /* what was added last */
    strl__written_tree *trees;           /* [tree_count], owned, up to STRL__MAX_TREES */
    size_t tree_capacity;
    bool bounds_begun;
    bool in_tree; /* the tree at hand is trees[tree_count], not counted yet */
    bool renamed; /* the file has its name */
    bool failed;  /* some call has failed: the file must not be finished */
    /* Of the tree at hand. */
    uint32_t next_id;
    uint64_t next_child; /* first child that the next node with children must have */
    uint32_t last_level, last_parent;
    strl_writer page; /* payloads of the pending nodes */
    uint32_t pending_count;
    uint32_t pending_decoded_bytes;
    strl_node pending[STRL__MAX_PAGE_NODES];
};

/* Writes the pending page and spills its records. */
strl_status strl__writing_close_page(strl_container_writer *writer, strl_error *err);
/* Reads the spilled records back and writes the treelets, last to first; root: the first one's place. */
strl_status strl__writing_treelets(strl_container_writer *writer, uint32_t node_count, strl_treelet_ref *root,
                                   strl_error *err);

/* Ends the page of placements and notes what its run looks like. */
strl_status strl__writing_end_run(strl_container_writer *writer, strl_error *err);

#endif
