#include "viewer/part_tree.h"

#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

#define DEFAULT_MEMORY_BYTES ((uint64_t)512 << 20)
#define MOST_NAME 4096u
#define MOST_DEPTH 255u

/* ---- names */

static strl_status load_names(strl_part_tree *tree, uint64_t most_bytes, strl_part_name_fn name, void *context,
                              strl_error *err)
{
    size_t capacity = 0;
    char text[MOST_NAME];
    for (uint32_t part = 0; part < tree->part_count; part++) {
        strl_status status = name(context, part, text, sizeof text, err);
        if (status != STRL_OK)
            return status;
        size_t bytes = strlen(text) + 1;
        if (tree->text_bytes + bytes > most_bytes) /* no name: the end alone */
            bytes = 1;
        text[bytes - 1] = 0;
        if (tree->text_bytes + bytes > UINT32_MAX || !strl__grow(&tree->text, &capacity, tree->text_bytes + bytes, 1))
            return strl__fail(err, STRL_ERR_MEMORY, "no memory for the names of %u parts", tree->part_count);
        tree->names[part] = (uint32_t)tree->text_bytes;
        memcpy(tree->text + tree->text_bytes, text, bytes);
        tree->text_bytes += bytes;
    }
    return STRL_OK;
}

/* By path: '/' before every other letter, so that what lies below a step stands together right after it. */
static int compare_paths(const char *a, const char *b)
{
    while (*a && *a == *b)
        a++, b++;
    int x = *a == '/' ? 1 : *a ? (unsigned char)*a + 1 : 0, y = *b == '/' ? 1 : *b ? (unsigned char)*b + 1 : 0;
    return x - y;
}

static int compare_parts(const void *a, const void *b, void *context)
{
    const strl_part_tree *tree = context;
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    int order = compare_paths(tree->text + tree->names[x], tree->text + tree->names[y]);
    return order ? order : x < y ? -1 : 1;
}

/* ---- nodes */

/* Nodes under construction: the open ones from the root to the last part. */
typedef struct growth {
    strl_part_tree *tree;
    size_t capacity;
    uint64_t most_nodes; /* by splitting; each part has one in any case */
    uint32_t open[MOST_DEPTH + 1];
    uint32_t depth; /* of the open ones */
} growth;

static void close_to(growth *g, uint32_t depth, uint32_t parts_done)
{
    while (g->depth > depth) {
        strl_part_node *node = &g->tree->nodes[g->open[--g->depth]];
        node->part_count = parts_done - node->first_part;
        node->end = g->tree->node_count;
    }
}

static bool add_node(growth *g, const char *piece, size_t bytes, uint32_t first_part)
{
    strl_part_tree *tree = g->tree;
    if (!strl__grow(&tree->nodes, &g->capacity, (size_t)tree->node_count + 1, sizeof *tree->nodes))
        return false;
    tree->nodes[tree->node_count] = (strl_part_node){.name = (uint32_t)(piece - tree->text),
                                                     .name_bytes = (uint32_t)bytes,
                                                     .first_part = first_part,
                                                     .depth = (uint16_t)g->depth};
    g->open[g->depth++] = tree->node_count++;
    return true;
}

/* Steps that the path shares with the part before stay open; the others are closed and the path's own made. Steps
 * beyond the greatest depth or the nodes' bound stay in one piece. */
static bool add_part(growth *g, uint32_t at)
{
    strl_part_tree *tree = g->tree;
    const char *name = tree->text + tree->names[tree->order[at]], *piece = name;
    uint32_t depth = 0;
    bool same = true;
    for (;;) {
        size_t bytes = depth + 1 < MOST_DEPTH && tree->node_count < g->most_nodes ? strcspn(piece, "/") : strlen(piece);
        bool last = piece[bytes] == 0;
        strl_part_node *open = depth < g->depth ? &tree->nodes[g->open[depth]] : NULL;
        /* Parts of one name are rows of their own. */
        same = same && open && open->name_bytes == bytes && !memcmp(tree->text + open->name, piece, bytes) &&
               !(last && open->is_part);
        if (!same) {
            close_to(g, depth, at);
            if (!add_node(g, piece, bytes, at))
                return false;
        }
        if (last)
            break;
        piece += bytes + 1;
        depth++;
    }
    tree->nodes[g->open[depth]].is_part = true; /* sorted before what lies below it, so it is the node's first */
    return true;
}

static bool grow_tree(strl_part_tree *tree, uint64_t most_nodes)
{
    growth g = {.tree = tree, .most_nodes = most_nodes};
    for (uint32_t at = 0; at < tree->part_count; at++)
        if (!add_part(&g, at))
            return false;
    close_to(&g, 0, tree->part_count);
    return true;
}

/* ---- rows */

/* One look at each part, whatever its depth. */
static void mark_found(strl_part_tree *tree)
{
    for (uint32_t place = 0; place < tree->part_count; place++) {
        bool found = tree->search[0] && strcasestr(strl_part_tree_name(tree, tree->order[place]), tree->search);
        tree->found_before[place + 1] = tree->found_before[place] + found;
    }
}

/* A search shows what it finds whether it was open or not. */
static void find_rows(strl_part_tree *tree)
{
    tree->row_count = 0;
    for (uint32_t n = 0; n < tree->node_count;) {
        const strl_part_node *node = &tree->nodes[n];
        bool searching = tree->search[0] != 0;
        if (searching && strl_part_tree_found_in(tree, node->first_part, node->part_count) == 0) {
            n = node->end;
            continue;
        }
        tree->rows[tree->row_count++] = n;
        n = node->open || searching ? n + 1 : node->end;
    }
}

void strl_part_tree_toggle(strl_part_tree *tree, uint32_t node)
{
    if (node >= tree->node_count)
        return;
    tree->nodes[node].open = !tree->nodes[node].open;
    find_rows(tree);
}

void strl_part_tree_search(strl_part_tree *tree, const char *text)
{
    size_t bytes = strnlen(text, sizeof tree->search - 1);
    memcpy(tree->search, text, bytes);
    tree->search[bytes] = 0;
    mark_found(tree);
    find_rows(tree);
}

uint32_t strl_part_tree_found_in(const strl_part_tree *tree, uint32_t first, uint32_t count)
{
    return tree->found_before[first + count] - tree->found_before[first];
}

uint32_t strl_part_tree_reveal(strl_part_tree *tree, uint32_t part)
{
    uint32_t place = part < tree->part_count ? tree->places[part] : UINT32_MAX, row = UINT32_MAX;
    for (uint32_t n = 0; n < tree->node_count;) {
        strl_part_node *node = &tree->nodes[n];
        bool holds = place >= node->first_part && place - node->first_part < node->part_count;
        node->open = node->open || (holds && n + 1 < node->end);
        n = holds ? n + 1 : node->end;
    }
    find_rows(tree);
    for (uint32_t r = 0; r < tree->row_count; r++) {
        const strl_part_node *node = &tree->nodes[tree->rows[r]];
        if (node->is_part && node->first_part == place)
            row = r;
    }
    return row;
}

/* ---- life */

strl_status strl_part_tree_init(strl_part_tree *tree, uint32_t part_count, uint64_t memory_bytes,
                                strl_part_name_fn name, void *context, strl_error *err)
{
    uint64_t half = (memory_bytes ? memory_bytes : DEFAULT_MEMORY_BYTES) / 2;
    *tree = (strl_part_tree){.part_count = part_count};
    tree->names = strl__alloc_zero(part_count, sizeof *tree->names);
    tree->order = strl__alloc_zero(part_count, sizeof *tree->order);
    tree->places = strl__alloc_zero(part_count, sizeof *tree->places);
    tree->found_before = strl__alloc_zero((size_t)part_count + 1, sizeof *tree->found_before);
    strl_status status = tree->names && tree->order && tree->places && tree->found_before
                             ? load_names(tree, half, name, context, err)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u parts", part_count);
    if (status == STRL_OK) {
        for (uint32_t part = 0; part < part_count; part++)
            tree->order[part] = part;
        qsort_r(tree->order, part_count, sizeof *tree->order, compare_parts, tree);
        for (uint32_t place = 0; place < part_count; place++)
            tree->places[tree->order[place]] = place;
        bool whole = grow_tree(tree, half / sizeof *tree->nodes);
        tree->rows = whole ? strl__alloc(tree->node_count, sizeof *tree->rows) : NULL;
        if (!tree->rows)
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a tree of %u parts", part_count);
    }
    if (status != STRL_OK) {
        strl_part_tree_deinit(tree);
        return status;
    }
    /* One folder at the top is no choice: it is shown open. */
    if (tree->node_count > 1 && tree->nodes[0].end == tree->node_count)
        tree->nodes[0].open = true;
    find_rows(tree);
    return STRL_OK;
}

void strl_part_tree_deinit(strl_part_tree *tree)
{
    strl__free(tree->text);
    strl__free(tree->names);
    strl__free(tree->order);
    strl__free(tree->places);
    strl__free(tree->found_before);
    strl__free(tree->nodes);
    strl__free(tree->rows);
    *tree = (strl_part_tree){0};
}

const char *strl_part_tree_name(const strl_part_tree *tree, uint32_t part)
{
    return part < tree->part_count ? tree->text + tree->names[part] : "";
}
