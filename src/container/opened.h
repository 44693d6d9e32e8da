/* An opened container, as its own files see it. Internal. */
#ifndef STRL_CONTAINER_OPENED_H
#define STRL_CONTAINER_OPENED_H

#include "container/record.h"
#include "container/table.h"

#define STRL__CACHED_TREELETS 16u

typedef struct strl__opened_tree {
    strl_tree facts;
    strl_treelet_ref root;
    strl_treelet_ref *refs; /* [treelets], owned, made at first need; bytes 0 = not yet known */
    uint32_t scanned;       /* treelets below this one have been read, so that all they name are known */
} strl__opened_tree;

typedef struct strl__cached_treelet {
    uint32_t tree, index;
    uint64_t last_use;     /* 0 = empty */
    strl_treelet *treelet; /* owned */
} strl__cached_treelet;

/* A mesh by which others are decoded. */
typedef struct strl__kept_mesh {
    bool is_whole;
    uint32_t tree, node;
    strl_node record;
    strl_arena arena;
    strl_pm mesh;
} strl__kept_mesh;

struct strl_container {
    strl_source *source; /* owned */
    strl__header header;
    strl__opened_tree *trees; /* [tree_count], owned */
    strl__table placements, parts, materials, images, runs;
    strl__cached_treelet cache[STRL__CACHED_TREELETS];
    uint64_t uses;
    uint8_t *page; /* the last page read, owned */
    size_t page_capacity;
    strl_page_ref page_ref;                  /* bytes 0 = none */
    strl__kept_mesh kept[STRL_DECODE_CHAIN]; /* by their depth in a chain */
};

void strl__opened_forget_nodes(strl_container *container);
void strl__opened_forget_meshes(strl_container *container);

#endif
