/* Nodes to pieces of the file. Ids are breadth first, so what a subtree has at one depth is one run of ids, and its
 * children are the run of the next depth. A query is a heap of such runs by their next id: taking the lowest always
 * gives all nodes asked for in the order of their ids, each once, however the subtrees overlap, in memory that depends
 * on the query alone. */
#include "serve/select.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/memory.h"

/* Of one subtree, what is left of one depth, and what is known of the next. */
typedef struct run {
    uint32_t next, end;
    uint32_t depth;                  /* how many more levels are wanted below */
    uint32_t child_first, child_end; /* equal: no child so far */
} run;

struct strl__selecting {
    strl_container *container; /* of the step */
    uint32_t tree;
    uint64_t most_bytes;
    strl__selection out;
    run *runs; /* [count], owned; a heap: the lowest next first */
    uint32_t count;
    /* offsets of the pieces that were added last; 0 = none, for there is the header */
    uint64_t last_treelet, last_page;
    uint32_t last_node; /* answered last; STRL_NONE = none */
};

typedef struct strl__selecting choice;

/* ---- the heap ---- */

static void sift_down(choice *self, uint32_t at)
{
    for (;;) {
        uint32_t least = at;
        for (uint32_t child = 2 * at + 1; child <= 2 * at + 2 && child < self->count; child++)
            if (self->runs[child].next < self->runs[least].next)
                least = child;
        if (least == at)
            return;
        run moved = self->runs[at];
        self->runs[at] = self->runs[least];
        self->runs[least] = moved;
        at = least;
    }
}

/* The first run has given its node: on to the next one, or to the next depth. */
static void advance(choice *self)
{
    run *first = &self->runs[0];
    if (++first->next == first->end) {
        if (first->child_first < first->child_end)
            *first = (run){.next = first->child_first, .end = first->child_end, .depth = first->depth - 1};
        else
            *first = self->runs[--self->count];
    }
    sift_down(self, 0);
}

static strl_status note_children(const choice *self, const strl_node *node, strl_error *err)
{
    run *first = &self->runs[0];
    if (first->depth == 0 || node->child_count == 0)
        return STRL_OK;
    bool is_first = first->child_first == first->child_end;
    if (node->first_child < first->end || (!is_first && node->first_child != first->child_end))
        return strl__fail(err, STRL_ERR_FORMAT,
                          "the children of node %" PRIu32 " are not in breadth-first order, they begin at %" PRIu32,
                          first->next, node->first_child);
    if (is_first)
        first->child_first = node->first_child;
    first->child_end = node->first_child + node->child_count; /* the record's check keeps it within the tree */
    return STRL_OK;
}

/* ---- pieces ---- */

static uint64_t cost_of(uint64_t last, uint64_t offset, uint32_t bytes)
{
    return offset == last ? 0 : (uint64_t)STRL__FRAME_BYTES + bytes;
}

static strl_status add_piece(choice *self, uint64_t *last, uint64_t offset, uint32_t bytes, strl_error *err)
{
    strl__selection *out = &self->out;
    if (offset == *last)
        return STRL_OK;
    if (!strl__grow(&out->pieces, &out->capacity, out->count + 1, sizeof *out->pieces))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the pieces of an answer");
    out->pieces[out->count++] = (strl__piece){offset, bytes};
    out->bytes += (uint64_t)STRL__FRAME_BYTES + bytes;
    *last = offset;
    return STRL_OK;
}

static void cut_before(choice *self, uint32_t node)
{
    self->out.cut = true;
    self->out.next_node = node;
}

static strl_status answer_node(choice *self, uint32_t id, const strl_node *node, strl_error *err)
{
    strl__selection *out = &self->out;
    strl_treelet_place place;
    strl_status status = strl_container_treelet_of(self->container, self->tree, id, &place, err);
    if (status != STRL_OK)
        return status;
    uint64_t cost = cost_of(self->last_treelet, place.offset, place.bytes) +
                    cost_of(self->last_page, node->page.offset, node->page.bytes);
    if (out->node_count > 0 &&
        (out->node_count == STRL__SELECTED_NODES || STRL__ANSWER_HEAD_BYTES + out->bytes + cost > self->most_bytes)) {
        cut_before(self, id);
        return STRL_OK;
    }
    status = add_piece(self, &self->last_treelet, place.offset, place.bytes, err);
    if (status == STRL_OK)
        status = add_piece(self, &self->last_page, node->page.offset, node->page.bytes, err);
    self->last_node = id;
    out->node_count++;
    return status;
}

static strl_status visit_lowest(choice *self, strl_error *err)
{
    uint32_t id = self->runs[0].next;
    bool is_new = self->last_node == STRL_NONE || id > self->last_node;
    strl_node node;
    strl_status status = strl_container_node(self->container, self->tree, id, &node, err);
    if (status == STRL_OK && is_new)
        status = answer_node(self, id, &node, err);
    if (status == STRL_OK && !self->out.cut)
        status = note_children(self, &node, err);
    if (status == STRL_OK && !self->out.cut)
        advance(self);
    return status;
}

bool strl__selecting_cut(strl__selecting *self)
{
    if (self->out.node_count == 0)
        return false;
    uint32_t id = self->runs[0].next;
    cut_before(self, id > self->last_node ? id : self->last_node + 1);
    return true;
}

/* What is too much work is cut like what is too many bytes. */
strl_status strl__selecting_step(strl__selecting *self, strl_container *container, uint32_t most_visits, bool *is_done,
                                 strl_error *err)
{
    strl_status status = STRL_OK;
    self->container = container;
    for (uint32_t i = 0; status == STRL_OK && i < most_visits && self->count > 0 && !self->out.cut; i++) {
        if (self->out.visited == STRL__VISITED_NODES) {
            strl__selecting_cut(self); /* the first node is answered by then */
            break;
        }
        status = visit_lowest(self, err);
        self->out.visited += status == STRL_OK;
    }
    *is_done = status == STRL_OK && (self->count == 0 || self->out.cut);
    return status;
}

/* ---- all of it ---- */

static int compare_pieces(const void *left, const void *right)
{
    const strl__piece *a = left, *b = right;
    if (a->offset != b->offset)
        return a->offset < b->offset ? -1 : 1;
    return a->bytes < b->bytes ? -1 : a->bytes > b->bytes;
}

/* Only a container that lies names a piece twice, but what is told in the head must hold all the same. */
static void order_pieces(strl__selection *out)
{
    size_t kept = 0;
    if (out->count > 0)
        qsort(out->pieces, out->count, sizeof *out->pieces, compare_pieces);
    for (size_t i = 0; i < out->count; i++) {
        if (i > 0 && compare_pieces(&out->pieces[i], &out->pieces[kept - 1]) == 0) {
            out->bytes -= STRL__FRAME_BYTES + out->pieces[i].bytes;
            continue;
        }
        out->pieces[kept++] = out->pieces[i];
    }
    out->count = kept;
    /* They are held until the last byte is sent. */
    strl__piece *fitting = kept > 0 ? strl__realloc(out->pieces, kept, sizeof *out->pieces) : NULL;
    if (fitting) {
        out->pieces = fitting;
        out->capacity = kept;
    }
}

static strl_status check_query(const strl_container *container, const strl__query *query, strl_error *err)
{
    const strl_tree *tree = strl_container_tree(container, query->tree);
    if (!tree)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no tree %" PRIu32 ", expected less than %" PRIu32,
                          query->tree, strl_container_get_info(container)->tree_count);
    uint32_t last = query->items[query->count - 1].node; /* they increase */
    if (last >= tree->node_count)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "there is no node %" PRIu32 " in tree %" PRIu32 ", expected less than %" PRIu32, last,
                          query->tree, tree->node_count);
    return STRL_OK;
}

strl_status strl__selecting_create(const strl_container *container, const strl__query *query, uint64_t most_bytes,
                                   strl__selecting **selecting, strl_error *err)
{
    *selecting = NULL;
    strl_status status = check_query(container, query, err);
    if (status != STRL_OK)
        return status;
    strl__selecting *made = strl__alloc_zero(1, sizeof *made);
    if (made)
        made->runs = strl__alloc(query->count, sizeof *made->runs);
    if (!made || !made->runs) {
        strl__free(made);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu32 " subtrees", query->count);
    }
    made->tree = query->tree;
    made->most_bytes = most_bytes;
    made->out.next_node = made->last_node = STRL_NONE;
    made->count = query->count;
    for (uint32_t i = 0; i < query->count; i++) { /* in increasing order, so a heap already */
        const strl__query_item *item = &query->items[i];
        made->runs[i] = (run){.next = item->node, .end = item->node + 1, .depth = item->depth};
    }
    *selecting = made;
    return STRL_OK;
}

void strl__selecting_destroy(strl__selecting *self)
{
    if (!self)
        return;
    strl__selection_deinit(&self->out);
    strl__free(self->runs);
    strl__free(self);
}

uint32_t strl__selecting_visited(const strl__selecting *self)
{
    return self->out.visited;
}

void strl__selecting_take(strl__selecting *self, strl__selection *selection)
{
    order_pieces(&self->out);
    *selection = self->out;
    self->out = (strl__selection){.next_node = STRL_NONE};
}

void strl__selection_deinit(strl__selection *selection)
{
    strl__free(selection->pieces);
    *selection = (strl__selection){.next_node = STRL_NONE, .visited = selection->visited};
}

void strl__selection_head(const strl__selection *selection, const strl_container_info *info, uint32_t tree,
                          uint8_t head[STRL__ANSWER_HEAD_BYTES])
{
    static const uint8_t magic[8] = {'S', 'T', 'R', 'O', 'L', 'L', 'Q', '\n'};
    memset(head, 0, STRL__ANSWER_HEAD_BYTES);
    memcpy(head, magic, sizeof magic);
    strl__store_le(head + 8, 4, 1);
    strl__store_le(head + 12, 4, STRL__ANSWER_HEAD_BYTES);
    memcpy(head + 16, info->model_id, 16);
    strl__store_le(head + 32, 4, tree);
    strl__store_le(head + 36, 4, selection->cut);
    strl__store_le(head + 40, 4, selection->node_count);
    strl__store_le(head + 44, 4, selection->next_node);
    strl__store_le(head + 48, 4, selection->count);
    strl__store_le(head + 56, 8, STRL__ANSWER_HEAD_BYTES + selection->bytes);
}
