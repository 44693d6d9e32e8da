/* Sizes and positions of format version 1: the tables of docs/format.md as constants. Internal. */
#ifndef STRL_CONTAINER_LAYOUT_H
#define STRL_CONTAINER_LAYOUT_H

#include <stdint.h>

#define STRL__MAGIC "STROLL\x1a\n" /* 8 bytes, without the terminator */
#define STRL__VERSION 1u
#define STRL__ALIGNMENT 64u
#define STRL__LATTICE_LIMIT ((int64_t)1 << 62)

#define STRL__HEADER_BYTES 4096u
enum strl__header_at {
    STRL__AT_MAGIC = 0,
    STRL__AT_VERSION = 8,
    STRL__AT_MODEL_ID = 16,
    STRL__AT_CHECKSUM = 32,
    STRL__AT_FILE_BYTES = 40,
    STRL__AT_SECTIONS = 168,
};
#define STRL__FLAG_COLOUR 1u
#define STRL__FLAG_CLOSED 2u

#define STRL__SECTION_BYTES 40u
#define STRL__MAX_SECTIONS 64u
#define STRL__SECTION_OPTIONAL 0x80000000u
enum strl__section_kind {
    STRL__SECTION_TREES = 1,
    STRL__SECTION_PLACEMENTS = 2,
    STRL__SECTION_PARTS = 3,
    STRL__SECTION_MATERIALS = 4,
    STRL__SECTION_IMAGES = 5, /* only where a material has one */
    STRL__SECTION_RUNS = 6,   /* only where there are more placements than a run holds */
};
#define STRL__REQUIRED_SECTIONS 4u
#define STRL__KNOWN_SECTIONS 6u

#define STRL__TREE_BYTES 144u
#define STRL__MAX_TREES 512u
#define STRL__MAX_LEVELS 65535u
#define STRL__MAX_STEP_EXPONENT 512

#define STRL__NODE_BYTES 240u
#define STRL__TREELET_HEAD_BYTES 16u
#define STRL__CHILD_REF_BYTES 24u
/* 128 nodes have at most 1024 children, which touch at most 9 treelets. */
#define STRL__MAX_CHILD_REFS 9u
#define STRL__MIN_TREELET_BYTES (STRL__TREELET_HEAD_BYTES + STRL__NODE_BYTES)
#define STRL__MAX_TREELET_BYTES                                                                                        \
    (STRL__TREELET_HEAD_BYTES + 128u * STRL__NODE_BYTES + STRL__MAX_CHILD_REFS * STRL__CHILD_REF_BYTES)

#define STRL__MAX_PAGE_BYTES (16u << 20)
#define STRL__MAX_PAGE_NODES 1024u
#define STRL__PAGE_DECODED_BYTES (64u << 20) /* the writer closes a page that has reached this */

#define STRL__TABLE_PAGE_BYTES 65536u
#define STRL__TABLE_MAX_DEPTH 3u
#define STRL__TABLE_REF_BYTES 32u
#define STRL__TABLE_MAX_REFS 2040u
#define STRL__INDEX_HEAD_BYTES 8u
#define STRL__PLACEMENT_BYTES 104u
#define STRL__RUN_BYTES 80u
#define STRL__RUN_SPREAD_SHIFT 10 /* in the first number of a run's normal */
#define STRL__MATERIAL_HEAD_BYTES 4u
#define STRL__IMAGE_HEAD_BYTES 20u
#define STRL__MAX_NAME_BYTES 32000u

#endif
