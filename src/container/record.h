/* Encoding, decoding and checking of the format's records; shared by writer and reader, so that the writer never writes
 * what the reader would refuse. Pure functions; thread-safe. Internal. */
#ifndef STRL_CONTAINER_RECORD_H
#define STRL_CONTAINER_RECORD_H

#include "base/cursor.h"
#include "container/container.h"
#include "container/layout.h"
#include "container/treelet.h"

/* A section of the header, or the root of a paged table. */
typedef struct strl__section {
    uint32_t kind;
    uint32_t depth;
    uint64_t item_count;
    strl_treelet_ref ref;
} strl__section;

/* The whole header. sections of unknown optional kinds are left out. */
typedef struct strl__header {
    strl_container_info info;
    strl__section sections[STRL__KNOWN_SECTIONS]; /* by kind - 1 */
} strl__header;

/* Writes 4096 bytes, computes model id and checksum and returns the model id in header->info. */
void strl__header_encode(strl__header *header, uint8_t bytes[STRL__HEADER_BYTES]);
/* source_bytes: what there is of the file. */
strl_status strl__header_decode(const uint8_t bytes[STRL__HEADER_BYTES], uint64_t source_bytes, strl__header *header,
                                strl_error *err);

void strl__tree_encode(const strl_tree *tree, const strl_treelet_ref *root, uint8_t bytes[STRL__TREE_BYTES]);
strl_status strl__tree_decode(const uint8_t bytes[STRL__TREE_BYTES], uint32_t index, uint64_t file_bytes,
                              strl_tree *tree, strl_treelet_ref *root, strl_error *err);
/* Ranges only, file_bytes bounds the counts. */
strl_status strl__tree_check(const strl_tree *tree, uint32_t index, uint64_t file_bytes, strl_error *err);

void strl__node_encode(const strl_node *node, uint8_t bytes[STRL__NODE_BYTES]);
/* Ranges are checked by strl__node_check; this fails only where a reserved field is not zero. */
strl_status strl__node_decode(const uint8_t bytes[STRL__NODE_BYTES], uint32_t id, strl_node *node, strl_error *err);
/* Every range of the record; not its page reference. */
strl_status strl__node_check(const strl_node *node, uint32_t id, const strl_tree *tree, strl_error *err);

/* what: names the thing at ref in the sentence. Checks alignment and range; 0 bytes are refused. */
strl_status strl__ref_check(const strl_treelet_ref *ref, uint64_t file_bytes, const char *what, strl_error *err);

/* Treelets that treelet `index`, whose children have the ids [first, end), must name: *count from *first_treelet on.
 * first == end: none. */
void strl__child_treelets(uint32_t index, uint64_t first, uint64_t end, uint32_t *first_treelet, uint32_t *count);

#endif
