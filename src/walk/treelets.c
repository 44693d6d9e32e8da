/* The map of treelets in memory: open addressing, linear probing, removal by shifting back. */
#include "walk/internal.h"

#include "base/hash.h"

static size_t home(const strl__treelets *treelets, uint32_t tree, uint32_t index)
{
    return (size_t)strl__mix64((uint64_t)tree << 32 | index) & (treelets->capacity - 1);
}

strl__treelet *strl__treelets_find(const strl__treelets *treelets, uint32_t tree, uint32_t index)
{
    if (treelets->capacity == 0)
        return NULL;
    for (size_t slot = home(treelets, tree, index);; slot = (slot + 1) & (treelets->capacity - 1)) {
        strl__treelet *treelet = treelets->slots[slot];
        if (!treelet || (treelet->tree == tree && treelet->index == index))
            return treelet;
    }
}

static void place(strl__treelets *treelets, strl__treelet *treelet)
{
    size_t slot = home(treelets, treelet->tree, treelet->index);
    while (treelets->slots[slot])
        slot = (slot + 1) & (treelets->capacity - 1);
    treelets->slots[slot] = treelet;
}

bool strl__treelets_insert(strl__treelets *treelets, strl__treelet *treelet)
{
    if (2 * (treelets->count + 1) > treelets->capacity) {
        strl__treelets larger = {NULL, treelets->capacity ? 2 * treelets->capacity : 64, treelets->count};
        larger.slots = strl__alloc_zero(larger.capacity, sizeof *larger.slots);
        if (!larger.slots)
            return false;
        for (size_t slot = 0; slot < treelets->capacity; slot++)
            if (treelets->slots[slot])
                place(&larger, treelets->slots[slot]);
        strl__free(treelets->slots);
        *treelets = larger;
    }
    place(treelets, treelet);
    treelets->count++;
    return true;
}

static void destroy(strl__treelet *treelet)
{
    strl_treelet_deinit(&treelet->data);
    strl__free(treelet);
}

void strl__treelets_remove(strl__treelets *treelets, strl__treelet *treelet)
{
    size_t mask = treelets->capacity - 1;
    size_t hole = home(treelets, treelet->tree, treelet->index);
    while (treelets->slots[hole] != treelet)
        hole = (hole + 1) & mask;
    for (size_t slot = (hole + 1) & mask; treelets->slots[slot]; slot = (slot + 1) & mask) {
        size_t wanted = home(treelets, treelets->slots[slot]->tree, treelets->slots[slot]->index);
        if (((slot - wanted) & mask) >= ((slot - hole) & mask)) {
            treelets->slots[hole] = treelets->slots[slot];
            hole = slot;
        }
    }
    treelets->slots[hole] = NULL;
    treelets->count--;
    destroy(treelet);
}

void strl__treelets_deinit(strl__treelets *treelets)
{
    for (size_t slot = 0; slot < treelets->capacity; slot++) {
        strl__treelet *treelet = treelets->slots[slot];
        if (!treelet)
            continue;
        for (uint32_t i = 0; i < STRL_TREELET_NODES; i++)
            strl__mesh_deinit(&treelet->nodes[i].mesh);
        destroy(treelet);
    }
    strl__free(treelets->slots);
    *treelets = (strl__treelets){0};
}
