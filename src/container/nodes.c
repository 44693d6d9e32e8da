/* Node records for tools that may wait: a few treelets are kept. A treelet is found through the one
 * that names it; a tool that asks for a node whose treelet no treelet read so far has named pays for a scan from the
 * root. */
#include <inttypes.h>

#include "base/fail.h"
#include "container/opened.h"

static uint32_t treelet_count(const strl__opened_tree *tree)
{
    return (tree->facts.node_count - 1) / STRL_TREELET_NODES + 1;
}

void strl__opened_forget_nodes(strl_container *container)
{
    for (unsigned i = 0; i < STRL__CACHED_TREELETS; i++) {
        if (container->cache[i].treelet)
            strl_treelet_deinit(container->cache[i].treelet);
        strl__free(container->cache[i].treelet);
        container->cache[i] = (strl__cached_treelet){0};
    }
    for (uint32_t i = 0; container->trees && i < container->header.info.tree_count; i++)
        strl__free(container->trees[i].refs);
}

/* The slot of the treelet where it is held, else the one to reuse. */
static strl__cached_treelet *find_slot(strl_container *container, uint32_t tree, uint32_t index, bool *held)
{
    strl__cached_treelet *oldest = &container->cache[0];
    for (unsigned i = 0; i < STRL__CACHED_TREELETS; i++) {
        strl__cached_treelet *slot = &container->cache[i];
        *held = slot->last_use && slot->tree == tree && slot->index == index;
        if (*held)
            return slot;
        if (slot->last_use < oldest->last_use)
            oldest = slot;
    }
    return oldest;
}

static strl_status read_treelet(strl_container *container, uint32_t tree, uint32_t index, strl_treelet *treelet,
                                strl_error *err)
{
    const strl_treelet_ref *ref = &container->trees[tree].refs[index];
    uint8_t *bytes = strl__alloc(ref->bytes, 1); /* at most STRL__MAX_TREELET_BYTES, checked where it was read */
    if (!bytes)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for treelet %" PRIu32, index);
    const strl_source_span span = {ref->offset, ref->bytes, bytes, ref->checksum};
    strl_status status = strl_source_read_known(container->source, &span, err);
    if (status == STRL_OK)
        status = strl_treelet_decode(container, tree, index, ref, bytes, ref->bytes, treelet, err);
    if (status == STRL_ERR_FORMAT)
        strl_source_doubt(container->source, ref->offset, ref->bytes);
    strl__free(bytes);
    return status;
}

static strl_status learn_refs(strl__opened_tree *tree, uint32_t index, const strl_treelet *treelet, strl_error *err)
{
    for (uint32_t i = 0; i < treelet->child_ref_count; i++) {
        strl_treelet_ref *known = &tree->refs[treelet->first_child_treelet + i]; /* decode has checked the range */
        const strl_treelet_ref *found = &treelet->child_refs[i];
        if (known->bytes &&
            (known->offset != found->offset || known->bytes != found->bytes || known->checksum != found->checksum))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "treelet %" PRIu32 ": names treelet %" PRIu32 " otherwise than a treelet before it",
                              index, treelet->first_child_treelet + i);
        *known = *found;
    }
    return STRL_OK;
}

/* The treelet, whose reference is known. */
static strl_status get_known(strl_container *container, uint32_t tree, uint32_t index, strl_treelet **treelet,
                             strl_error *err)
{
    bool held;
    strl__cached_treelet *slot = find_slot(container, tree, index, &held);
    if (!held) {
        slot->last_use = 0;
        if (slot->treelet)
            strl_treelet_deinit(slot->treelet);
        else if (!(slot->treelet = strl__alloc_zero(1, sizeof *slot->treelet)))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for treelet %" PRIu32, index);
        strl_status status = read_treelet(container, tree, index, slot->treelet, err);
        if (status == STRL_OK)
            status = learn_refs(&container->trees[tree], index, slot->treelet, err);
        if (status != STRL_OK)
            return status;
        slot->tree = tree;
        slot->index = index;
    }
    slot->last_use = ++container->uses;
    *treelet = slot->treelet;
    return STRL_OK;
}

static strl_status get_treelet(strl_container *container, uint32_t tree, uint32_t index, strl_treelet **treelet,
                               strl_error *err)
{
    strl__opened_tree *opened = &container->trees[tree];
    if (!opened->refs) {
        /* The header's check bounds node_count by the size of the file. */
        opened->refs = strl__alloc_zero(treelet_count(opened), sizeof *opened->refs);
        if (!opened->refs)
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for the places of %" PRIu32 " treelets",
                              treelet_count(opened));
        opened->refs[0] = opened->root;
    }
    while (!opened->refs[index].bytes) {
        uint32_t next = opened->scanned;
        if (next >= index || !opened->refs[next].bytes)
            return strl__fail(err, STRL_ERR_FORMAT, "tree %" PRIu32 ": no treelet before treelet %" PRIu32 " names it",
                              tree, next >= index ? index : next);
        strl_status status = get_known(container, tree, next, treelet, err);
        if (status != STRL_OK)
            return status;
        opened->scanned = next + 1;
    }
    return get_known(container, tree, index, treelet, err);
}

static strl_status get_treelet_of(strl_container *container, uint32_t tree, uint32_t node, strl_treelet **treelet,
                                  strl_error *err)
{
    const strl_tree *facts = strl_container_tree(container, tree);
    if (!facts || node >= facts->node_count)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no node %" PRIu32 " in tree %" PRIu32, node, tree);
    return get_treelet(container, tree, node / STRL_TREELET_NODES, treelet, err);
}

strl_status strl_container_node(strl_container *container, uint32_t tree, uint32_t node, strl_node *record,
                                strl_error *err)
{
    *record = (strl_node){0};
    strl_treelet *treelet = NULL;
    strl_status status = get_treelet_of(container, tree, node, &treelet, err);
    if (status == STRL_OK)
        *record = treelet->nodes[node % STRL_TREELET_NODES];
    return strl_source_fail(container->source, status, err);
}

strl_status strl_container_treelet_of(strl_container *container, uint32_t tree, uint32_t node,
                                      strl_treelet_place *place, strl_error *err)
{
    *place = (strl_treelet_place){0};
    strl_treelet *treelet = NULL;
    strl_status status = get_treelet_of(container, tree, node, &treelet, err);
    if (status == STRL_OK) {
        const strl_treelet_ref *ref = &container->trees[tree].refs[node / STRL_TREELET_NODES];
        *place = (strl_treelet_place){ref->offset, ref->bytes};
    }
    return strl_source_fail(container->source, status, err);
}

uint64_t strl_container_lookup_bytes(const strl_container *container)
{
    uint64_t bytes = sizeof *container + STRL__CACHED_TREELETS * sizeof(strl_treelet);
    for (uint32_t i = 0; i < container->header.info.tree_count; i++)
        bytes += sizeof *container->trees + treelet_count(&container->trees[i]) * (uint64_t)sizeof(strl_treelet_ref);
    return bytes;
}
