/* The parts of a model as a tree of their names, split at '/', and the rows of it that a list shows. Rows are found
 * anew only when the tree is opened, closed or searched: a list of many thousand costs what is on the screen. */
#ifndef STRL_VIEWER_PART_TREE_H
#define STRL_VIEWER_PART_TREE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

#ifdef __cplusplus
extern "C" {
#endif

#define STRL_PART_TREE_SEARCH 64u

/* A step of a path. The parts below it are order[first_part ... + part_count] of the tree. */
typedef struct strl_part_node {
    uint32_t name; /* byte in the tree's text: of the last piece of the path, ended by end */
    uint32_t name_bytes;
    uint32_t first_part, part_count;
    uint32_t end; /* the node after all that is below this one; its first child, if any, is the next node */
    uint16_t depth;
    bool open;
    bool is_part; /* the path is a part's whole name: order[first_part] is that part */
} strl_part_node;

typedef struct strl_part_tree {
    char *text; /* owned: all names, each ended by 0 */
    size_t text_bytes;
    uint32_t *names;  /* [part_count]: where each part's name begins in text */
    uint32_t *order;  /* [part_count]: parts sorted by path */
    uint32_t *places; /* [part_count]: where each part stands in order */
    uint32_t part_count;
    strl_part_node *nodes; /* depth first */
    uint32_t node_count;
    uint32_t *rows; /* nodes that a list shows */
    uint32_t row_count;
    char search[STRL_PART_TREE_SEARCH]; /* what the rows were found with */
    uint32_t *found_before; /* [part_count + 1]: how many of the places before each one the search has found */
} strl_part_tree;

/* name(context, part, ...) tells each name (UTF-8, cut to fit). memory_bytes bounds names and nodes, but for the least
 * of both that each part needs, some 64 bytes; 0 = 512 MiB. Beyond it parts have no name, and paths are not split: a
 * model with many opens all the same. The tree is empty on failure. */
typedef strl_status (*strl_part_name_fn)(void *context, uint32_t part, char *name, size_t size, strl_error *err);
strl_status strl_part_tree_init(strl_part_tree *tree, uint32_t part_count, uint64_t memory_bytes,
                                strl_part_name_fn name, void *context, strl_error *err);
void strl_part_tree_deinit(strl_part_tree *tree);

/* The whole name of a part; "" where there is no such part. Borrowed. */
const char *strl_part_tree_name(const strl_part_tree *tree, uint32_t part);
/* Opens or closes a node. */
void strl_part_tree_toggle(strl_part_tree *tree, uint32_t node);
/* Shows only parts whose path contains `text`, letters of ASCII in either case, with all steps above them; "" = all. */
void strl_part_tree_search(strl_part_tree *tree, const char *text);
/* How many of a range of places the search has found, at once; 0 where none is on. */
uint32_t strl_part_tree_found_in(const strl_part_tree *tree, uint32_t first, uint32_t count);
/* Opens everything above a part. Returns its row; UINT32_MAX where a search hides it. */
uint32_t strl_part_tree_reveal(strl_part_tree *tree, uint32_t part);

#ifdef __cplusplus
}
#endif
#endif
