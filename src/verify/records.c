/* Treelets and node records: docs/format.md, "Treelets". Every range that one record, and its place among the
 * others, allows to check is checked here; later stages index with what is in the records without looking
 * again. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "base/memory.h"
#include "verify/model.h"

#define TREELET_NODES 128u
#define HEAD_BYTES 16u
#define RECORD_BYTES 240u
#define REF_BYTES 24u
#define MOST_REFS 9u
#define MOST_TREELET_BYTES (HEAD_BYTES + TREELET_NODES * RECORD_BYTES + MOST_REFS * REF_BYTES)
#define MOST_PAGE_BYTES (16u << 20)
#define LATTICE_LIMIT ((int64_t)1 << 62)
#define MOST_ERROR 0x1p64f

typedef struct treelets {
    strl__model *model;
    strl__vtree *tree;
    strl__place *places; /* [count]; bytes 0 = not named yet */
    uint32_t count;
    uint32_t next_child; /* id that the next node with children begins at */
    uint8_t bytes[MOST_TREELET_BYTES];
} treelets;

#define RECORD_RULE(self, condition, node, ...)                                                                        \
    do {                                                                                                               \
        if (!(condition))                                                                                              \
            strl__v_flaw((self)->model->checks, STRL_VERIFY_RECORDS, strl__key((self)->tree, (node)), __VA_ARGS__);    \
    } while (0)

static void read_vector(strl_cursor *cursor, int64_t out[3])
{
    for (unsigned k = 0; k < 3; k++)
        out[k] = strl_cursor_i64(cursor);
}

static bool decode_record(strl_cursor *cursor, strl__vnode *node)
{
    *node = (strl__vnode){.parent = strl_cursor_u32(cursor)};
    node->first_child = strl_cursor_u32(cursor);
    node->child_count = strl_cursor_u8(cursor);
    node->rung = strl_cursor_u8(cursor);
    node->level = strl_cursor_u16(cursor);
    node->group = strl_cursor_u32(cursor);
    node->group_size = strl_cursor_u32(cursor);
    uint32_t decode_parent = strl_cursor_u32(cursor);
    node->told_by_parent = decode_parent != STRL__NO_NODE;
    bool plain = !node->told_by_parent || decode_parent == node->parent;
    read_vector(cursor, node->anchor);
    read_vector(cursor, node->box[0]);
    read_vector(cursor, node->box[1]);
    read_vector(cursor, node->group_box[0]);
    read_vector(cursor, node->group_box[1]);
    node->geometric_min = strl_cursor_f32(cursor);
    node->geometric_max = strl_cursor_f32(cursor);
    node->appearance_min = strl_cursor_f32(cursor);
    node->appearance_max = strl_cursor_f32(cursor);
    node->group_geometric = strl_cursor_f32(cursor);
    node->group_appearance = strl_cursor_f32(cursor);
    node->vertex_count = strl_cursor_u32(cursor);
    node->base_vertex_count = strl_cursor_u32(cursor);
    node->triangle_count = strl_cursor_u32(cursor);
    node->base_triangle_count = strl_cursor_u32(cursor);
    node->step_count = strl_cursor_u32(cursor);
    node->boundary_steps = strl_cursor_u32(cursor);
    node->shared_vertices = strl_cursor_u32(cursor);
    node->payload_offset = strl_cursor_u32(cursor);
    node->payload_bytes = strl_cursor_u32(cursor);
    plain = strl_cursor_u32(cursor) == 0 && plain;
    node->page.offset = strl_cursor_u64(cursor);
    node->page.bytes = strl_cursor_u32(cursor);
    node->page_decoded = strl_cursor_u32(cursor);
    node->page.checksum = strl_cursor_u64(cursor);
    for (unsigned k = 0; k < 3; k++)
        node->cone_axis[k] = (int16_t)strl_cursor_u16(cursor);
    node->cone_cosine = strl_cursor_u16(cursor);
    return plain;
}

static bool error_range(float least, float most)
{
    return least >= 0 && least <= most && most <= MOST_ERROR;
}

static bool lattice_range(const strl__vnode *n)
{
    bool good = true;
    for (unsigned k = 0; k < 3; k++)
        good = good && n->box[0][k] <= n->box[1][k] && n->box[0][k] >= -LATTICE_LIMIT &&
               n->box[1][k] <= LATTICE_LIMIT && n->group_box[0][k] <= n->group_box[1][k] &&
               n->group_box[0][k] >= -LATTICE_LIMIT && n->group_box[1][k] <= LATTICE_LIMIT &&
               n->anchor[k] >= -LATTICE_LIMIT && n->anchor[k] <= LATTICE_LIMIT;
    return good;
}

static bool cone_range(const strl__vtree *tree, const strl__vnode *n)
{
    bool axis = n->cone_axis[0] != 0 || n->cone_axis[1] != 0 || n->cone_axis[2] != 0;
    return axis == (n->cone_cosine != 0) && (!axis || tree->structure == 3);
}

static void check_ranges(treelets *self, uint32_t id, strl__vnode *n)
{
    const strl__vtree *tree = self->tree;
    RECORD_RULE(self,
                (tree->structure == 3 ? n->rung == 4 && !n->told_by_parent : n->rung <= 3) &&
                    n->level < tree->level_count && n->group < tree->group_count && n->group_size >= 1 &&
                    n->group_size <= tree->node_count,
                id, "tree %u node %u: rung %u, level %u of %u, group %u of %u with %u members", tree->index, id,
                n->rung, n->level, tree->level_count, n->group, tree->group_count, n->group_size);
    RECORD_RULE(self, lattice_range(n), id, "tree %u node %u: a box is upside down or outside 2^62", tree->index, id);
    RECORD_RULE(self,
                error_range(n->geometric_min, n->geometric_max) && error_range(n->appearance_min, n->appearance_max) &&
                    error_range(0, n->group_geometric) && error_range(0, n->group_appearance),
                id, "tree %u node %u: errors %g to %g, %g to %g, of the group %g and %g", tree->index, id,
                (double)n->geometric_min, (double)n->geometric_max, (double)n->appearance_min,
                (double)n->appearance_max, (double)n->group_geometric, (double)n->group_appearance);
    RECORD_RULE(self,
                n->vertex_count <= 65535 && n->base_vertex_count <= n->vertex_count && n->triangle_count <= 131072 &&
                    n->base_triangle_count <= n->triangle_count &&
                    n->step_count <= n->vertex_count - n->base_vertex_count &&
                    n->shared_vertices <= n->base_vertex_count,
                id, "tree %u node %u: %u of %u vertices, %u of %u triangles, %u steps, %u shared vertices", tree->index,
                id, n->base_vertex_count, n->vertex_count, n->base_triangle_count, n->triangle_count, n->step_count,
                n->shared_vertices);
    RECORD_RULE(self, cone_range(tree, n), id, "tree %u node %u: a cone about %d %d %d of the cosine %u", tree->index,
                id, n->cone_axis[0], n->cone_axis[1], n->cone_axis[2], n->cone_cosine);
    RECORD_RULE(self,
                n->page.bytes <= MOST_PAGE_BYTES && n->payload_bytes >= 1 && n->payload_offset <= n->page.bytes &&
                    n->payload_bytes <= n->page.bytes - n->payload_offset,
                id, "tree %u node %u: bytes %u to %u of a page of %u", tree->index, id, n->payload_offset,
                n->payload_offset + n->payload_bytes, n->page.bytes);
    if (n->page.bytes && (id == 0 || tree->nodes[id - 1].page.offset != n->page.offset))
        strl__v_place_good(self->model, &n->page, "payload page", strl__key(tree, id));
}

/* The node's place among those before it: the parents of a breadth-first order never decrease, and children
 * follow each other. */
static void check_place(treelets *self, uint32_t id, const strl__vnode *n)
{
    const strl__vtree *tree = self->tree;
    uint32_t before = id > 1 ? tree->nodes[id - 1].parent : 0;
    bool rooted = id == 0 ? n->parent == STRL__NO_NODE && n->level == tree->level_count - 1
                          : n->parent < id && n->parent >= before;
    RECORD_RULE(self, rooted, id, "tree %u node %u: parent %u after %u, level %u of %u", tree->index, id, n->parent,
                before, n->level, tree->level_count);
    if (id > 0 && rooted) {
        const strl__vnode *p = &tree->nodes[n->parent];
        RECORD_RULE(self, p->child_count && id >= p->first_child && id - p->first_child < p->child_count, id,
                    "tree %u node %u: its parent %u has the children %u and %u more", tree->index, id, n->parent,
                    p->first_child, p->child_count);
        RECORD_RULE(self, p->level == n->level + 1, id, "tree %u node %u: level %u under a parent of level %u",
                    tree->index, id, n->level, p->level);
    }
    bool children = n->child_count == 0
                        ? n->first_child == STRL__NO_NODE
                        : n->child_count <= 8 && n->first_child == self->next_child && n->first_child > id &&
                              n->child_count <= tree->node_count - n->first_child && n->level >= 1;
    RECORD_RULE(self, children, id, "tree %u node %u: %u children from %u of %u nodes, expected from %u", tree->index,
                id, n->child_count, n->first_child, tree->node_count, self->next_child);
    if (n->child_count && children)
        self->next_child += n->child_count;
}

static void name_treelet(treelets *self, uint32_t by, uint32_t index, const strl__place *place)
{
    strl__place *known = &self->places[index];
    RECORD_RULE(self,
                known->bytes == 0 || (known->offset == place->offset && known->bytes == place->bytes &&
                                      known->checksum == place->checksum),
                by * TREELET_NODES, "tree %u treelet %u: treelet %u has another place than an earlier one said",
                self->tree->index, by, index);
    *known = *place;
}

static void read_references(treelets *self, uint32_t index, uint32_t children_from, strl_cursor *cursor, uint32_t first,
                            uint32_t count)
{
    uint32_t wanted_first = STRL__NO_NODE, wanted = 0;
    if (self->next_child > children_from && (self->next_child - 1) / TREELET_NODES > index) {
        uint32_t low = children_from / TREELET_NODES;
        wanted_first = low > index + 1 ? low : index + 1;
        wanted = (self->next_child - 1) / TREELET_NODES - wanted_first + 1;
    }
    bool good = count == wanted && first == wanted_first;
    RECORD_RULE(self, good, index * TREELET_NODES, "tree %u treelet %u: names %u treelets from %u, expected %u from %u",
                self->tree->index, index, count, first, wanted, wanted_first);
    for (uint32_t i = 0; good && i < count; i++) {
        strl__place place = {.offset = strl_cursor_u64(cursor)};
        place.bytes = strl_cursor_u32(cursor);
        uint32_t reserved = strl_cursor_u32(cursor);
        place.checksum = strl_cursor_u64(cursor);
        RECORD_RULE(self, reserved == 0, index * TREELET_NODES, "tree %u treelet %u: a reserved word is %u",
                    self->tree->index, index, reserved);
        if (first + i < self->count)
            name_treelet(self, index, first + i, &place);
    }
}

static void read_nodes(treelets *self, uint32_t index, size_t size)
{
    strl__vtree *tree = self->tree;
    strl_cursor cursor = strl_cursor_make(self->bytes, size);
    uint32_t first = strl_cursor_u32(&cursor), count = strl_cursor_u32(&cursor), first_ref = strl_cursor_u32(&cursor),
             refs = strl_cursor_u32(&cursor), base = index * TREELET_NODES;
    uint32_t wanted = tree->node_count - base < TREELET_NODES ? tree->node_count - base : TREELET_NODES;
    bool good = first == base && count == wanted && refs <= MOST_REFS &&
                size == HEAD_BYTES + (size_t)wanted * RECORD_BYTES + (size_t)refs * REF_BYTES;
    RECORD_RULE(self, good, base,
                "tree %u treelet %u: %zu bytes for %u nodes from %u and %u references, expected %u from %u",
                tree->index, index, size, count, first, refs, wanted, base);
    if (!good)
        return;
    uint32_t children_from = self->next_child;
    for (uint32_t id = base; id < base + count; id++) {
        strl__vnode *node = &tree->nodes[id];
        RECORD_RULE(self, decode_record(&cursor, node), id,
                    "tree %u node %u: a reserved word is not zero, or the payload needs another one", tree->index, id);
        check_ranges(self, id, node);
        check_place(self, id, node);
    }
    strl__v_checked(self->model->checks, STRL_VERIFY_RECORDS, count);
    read_references(self, index, children_from, &cursor, first_ref, refs);
}

static strl_status read_treelet(treelets *self, uint32_t index, bool *sound, strl_error *err)
{
    const strl__place *place = &self->places[index];
    uint64_t key = strl__key(self->tree, index * TREELET_NODES);
    bool good = place->bytes >= HEAD_BYTES + RECORD_BYTES && place->bytes <= MOST_TREELET_BYTES;
    RECORD_RULE(self, good, index * TREELET_NODES, "tree %u treelet %u: %s", self->tree->index, index,
                place->bytes ? "its size is out of range" : "no treelet before it names it");
    strl_status status = good ? strl__v_fetch(self->model, place, "treelet", key, self->bytes, &good, err) : STRL_OK;
    if (status == STRL_OK && good)
        read_nodes(self, index, place->bytes);
    *sound = good && !strl__v_flawed(self->model->checks, STRL_VERIFY_RECORDS) &&
             !strl__v_flawed(self->model->checks, STRL_VERIFY_REFERENCES);
    return status;
}

static strl_status reserve(treelets *self, strl_error *err)
{
    strl__vtree *tree = self->tree;
    self->count = (tree->node_count - 1) / TREELET_NODES + 1;
    uint64_t bytes = (uint64_t)tree->node_count * (sizeof *tree->nodes + 2 * sizeof *tree->page_first) +
                     (uint64_t)self->count * sizeof *self->places;
    if (bytes > self->model->memory_bytes / 2 - self->model->record_bytes)
        return strl__fail(err, STRL_ERR_MEMORY,
                          "the records of %u nodes take %" PRIu64 " bytes, more than half of --memory %" PRIu64,
                          tree->node_count, bytes, self->model->memory_bytes);
    self->model->record_bytes += bytes;
    tree->nodes = strl__alloc(tree->node_count, sizeof *tree->nodes);
    self->places = strl__alloc_zero(self->count, sizeof *self->places);
    return tree->nodes && self->places
               ? STRL_OK
               : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u node records", tree->node_count);
}

strl_status strl__v_read_records(strl__model *model, strl__vtree *tree, bool *sound, strl_error *err)
{
    treelets *self = strl__alloc_zero(1, sizeof *self);
    *sound = false;
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a treelet");
    *self = (treelets){.model = model, .tree = tree, .next_child = 1};
    strl_status status = reserve(self, err);
    if (status == STRL_OK)
        self->places[0] = tree->root;
    *sound = status == STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && *sound && i < self->count; i++)
        status = read_treelet(self, i, sound, err);
    if (status == STRL_OK && *sound && self->next_child != tree->node_count) {
        strl__v_flaw(model->checks, STRL_VERIFY_RECORDS, strl__key(tree, 0), "tree %u: %u of %u nodes have a parent",
                     tree->index, self->next_child - 1, tree->node_count - 1);
        *sound = false;
    }
    strl__free(self->places);
    strl__free(self);
    return status;
}
