/* The nodes: a forest, walked without recursion. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/affine.h"
#include "base/fail.h"
#include "readers/gltf.h"

#define DEPTH_UNKNOWN UINT32_MAX
#define OWN_NAME_BYTES_MAX 500u
#define NUMBER_BYTES_MAX 48u /* " (material 4294967295, 4294967295)" */

/* ---- linking */

static strl_status link_children(strl__gltf *gltf, uint32_t parent, strl_error *err)
{
    const strl__gltf_node *node = &gltf->nodes[parent];
    for (uint32_t i = 0; i < node->child_count; i++) {
        uint32_t child = gltf->children[node->first_child + i];
        if (child >= gltf->node_count) {
            char where[40];
            snprintf(where, sizeof where, ", nodes[%u].children", parent);
            return strl__gltf_fail_index(gltf, where, "nodes", gltf->node_count, child, err);
        }
        if (gltf->nodes[child].parent != STRL__NO_ITEM)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "%s: nodes %u and %u both have node %u as a child: expected one "
                              "parent at most",
                              gltf->reader->path, gltf->nodes[child].parent, parent, child);
        gltf->nodes[child].parent = parent;
        gltf->nodes[child].sibling = i;
    }
    return STRL_OK;
}

/* Of a node and all above it. Every node is passed twice at most, whatever the order. */
static strl_status find_depth(strl__gltf *gltf, uint32_t start, uint32_t *deepest, strl_error *err)
{
    uint64_t steps = 0;
    uint32_t at = start;
    while (gltf->nodes[at].depth == DEPTH_UNKNOWN && gltf->nodes[at].parent != STRL__NO_ITEM) {
        at = gltf->nodes[at].parent;
        if (++steps > gltf->node_count)
            return strl__fail(err, STRL_ERR_FORMAT, "%s: node %u is below itself: expected no cycle of nodes",
                              gltf->reader->path, at);
    }
    if (gltf->nodes[at].depth == DEPTH_UNKNOWN)
        gltf->nodes[at].depth = 0;
    const uint64_t depth = gltf->nodes[at].depth + steps;
    if (depth >= STRL__GLTF_DEPTH_MAX)
        return strl__fail(err, STRL_ERR_LIMIT, "%s: node %u has %" PRIu64 " nodes above it, expected fewer than %u",
                          gltf->reader->path, start, depth, STRL__GLTF_DEPTH_MAX);
    *deepest = depth > *deepest ? (uint32_t)depth : *deepest;
    at = start;
    for (uint64_t i = 0; i < steps; i++, at = gltf->nodes[at].parent)
        gltf->nodes[at].depth = (uint32_t)(depth - i);
    return STRL_OK;
}

/* A file without scenes is drawn whole. */
static strl_status list_roots(strl__gltf *gltf, strl_error *err)
{
    strl__gltf_scene scene = {.first_root = (uint32_t)gltf->root_count};
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < gltf->node_count && !status; i++) {
        if (gltf->nodes[i].parent != STRL__NO_ITEM)
            continue;
        status = strl__gltf_add(gltf, &gltf->roots, &gltf->root_count, &gltf->root_capacity, sizeof *gltf->roots, err);
        if (!status)
            gltf->roots[gltf->root_count - 1] = i;
    }
    scene.root_count = (uint32_t)gltf->root_count - scene.first_root;
    if (!status)
        status = strl__gltf_add(gltf, &gltf->scenes, &gltf->scene_count, &gltf->scene_capacity, sizeof scene, err);
    if (!status)
        gltf->scenes[gltf->scene_count - 1] = scene;
    return status;
}

static strl_status check_roots(strl__gltf *gltf, strl_error *err)
{
    if (gltf->scene == STRL__NO_ITEM)
        gltf->scene = 0;
    if (gltf->scene >= gltf->scene_count)
        return strl__gltf_fail_index(gltf, ", scene", "scenes", gltf->scene_count, gltf->scene, err);
    const strl__gltf_scene *scene = &gltf->scenes[gltf->scene];
    for (uint32_t i = 0; i < scene->root_count; i++) {
        uint32_t root = gltf->roots[scene->first_root + i];
        if (root >= gltf->node_count) {
            char where[40];
            snprintf(where, sizeof where, ", scenes[%u].nodes", gltf->scene);
            return strl__gltf_fail_index(gltf, where, "nodes", gltf->node_count, root, err);
        }
        if (gltf->nodes[root].parent != STRL__NO_ITEM || gltf->nodes[root].is_drawn_root)
            return strl__fail(err, STRL_ERR_FORMAT,
                              "%s, scenes[%u].nodes: expected roots, each once, found node %u, "
                              "which is %s",
                              gltf->reader->path, gltf->scene, root,
                              gltf->nodes[root].is_drawn_root ? "there twice" : "the child of another");
        gltf->nodes[root].is_drawn_root = true;
    }
    return STRL_OK;
}

strl_status strl__gltf_link(strl__gltf *gltf, strl_error *err)
{
    strl_status status = STRL_OK;
    uint32_t deepest = 0;
    for (uint32_t i = 0; i < gltf->node_count && !status; i++) {
        gltf->nodes[i].depth = DEPTH_UNKNOWN;
        if (gltf->nodes[i].mesh != STRL__NO_ITEM && gltf->nodes[i].mesh >= gltf->mesh_count) {
            char where[40];
            snprintf(where, sizeof where, ", nodes[%u].mesh", i);
            return strl__gltf_fail_index(gltf, where, "meshes", gltf->mesh_count, gltf->nodes[i].mesh, err);
        }
        status = link_children(gltf, i, err);
    }
    for (uint32_t i = 0; i < gltf->node_count && !status; i++)
        status = find_depth(gltf, i, &deepest, err);
    if (!status && gltf->scene_count == 0)
        status = list_roots(gltf, err);
    if (!status)
        status = check_roots(gltf, err);
    if (status)
        return status;
    gltf->world = strl__alloc(deepest + 1, sizeof *gltf->world);
    return gltf->world
               ? STRL_OK
               : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for %u matrices", gltf->reader->path, deepest + 1);
}

/* ---- walking */

static void enter(strl__gltf *gltf, uint32_t index)
{
    const strl__gltf_node *node = &gltf->nodes[index];
    strl__gltf_matrix *world = gltf->world + node->depth;
    *world = node->depth ? strl__gltf_multiply(world - 1, &node->local) : node->local;
    gltf->pass.node = index;
    gltf->pass.has_node = true;
}

static bool enter_root(strl__gltf *gltf)
{
    const strl__gltf_scene *scene = &gltf->scenes[gltf->scene];
    if (gltf->pass.root >= scene->root_count)
        return false;
    enter(gltf, gltf->roots[scene->first_root + gltf->pass.root]);
    return true;
}

bool strl__gltf_next_node(strl__gltf *gltf)
{
    if (!gltf->pass.has_node)
        return enter_root(gltf);
    uint32_t at = gltf->pass.node;
    if (gltf->nodes[at].child_count > 0) {
        enter(gltf, gltf->children[gltf->nodes[at].first_child]);
        return true;
    }
    for (; gltf->nodes[at].parent != STRL__NO_ITEM; at = gltf->nodes[at].parent) {
        const strl__gltf_node *parent = &gltf->nodes[gltf->nodes[at].parent];
        uint32_t next = gltf->nodes[at].sibling + 1;
        if (next < parent->child_count) {
            enter(gltf, gltf->children[parent->first_child + next]);
            return true;
        }
    }
    gltf->pass.root++;
    gltf->pass.has_node = false;
    return enter_root(gltf);
}

void strl__gltf_rewind(strl__gltf *gltf)
{
    gltf->pass = (strl__gltf_pass){0};
}

const strl__gltf_matrix *strl__gltf_world(const strl__gltf *gltf)
{
    return &gltf->world[gltf->nodes[gltf->pass.node].depth];
}

/* ---- matrices */

strl__gltf_matrix strl__gltf_multiply(const strl__gltf_matrix *a, const strl__gltf_matrix *b)
{
    strl__gltf_matrix product;
    for (unsigned row = 0; row < 3; row++)
        for (unsigned column = 0; column < 4; column++) {
            double sum = column == 3 ? a->m[4 * row + 3] : 0;
            for (unsigned k = 0; k < 3; k++)
                sum += a->m[4 * row + k] * b->m[4 * k + column];
            product.m[4 * row + column] = sum;
        }
    return product;
}

strl__gltf_matrix strl__gltf_compose(const double translation[3], const double rotation[4], const double scale[3])
{
    double length2 = 0;
    for (unsigned i = 0; i < 4; i++)
        length2 += rotation[i] * rotation[i];
    const double s = length2 > 0 ? 2 / length2 : 0; /* no length: no rotation */
    const double x = rotation[0], y = rotation[1], z = rotation[2], w = rotation[3];
    const double turn[9] = {
        1 - s * (y * y + z * z), s * (x * y - z * w),     s * (x * z + y * w),
        s * (x * y + z * w),     1 - s * (x * x + z * z), s * (y * z - x * w),
        s * (x * z - y * w),     s * (y * z + x * w),     1 - s * (x * x + y * y),
    };
    strl__gltf_matrix matrix;
    for (unsigned row = 0; row < 3; row++) {
        for (unsigned column = 0; column < 3; column++)
            matrix.m[4 * row + column] = turn[3 * row + column] * scale[column];
        matrix.m[4 * row + 3] = translation[row];
    }
    return matrix;
}

/* The cofactors are the inverse transpose but for a factor, the determinant, whose sign matters. */
void strl__gltf_derive(strl__gltf_pass *pass)
{
    pass->flips = strl_affine_cofactors(pass->placement.m, pass->normal_matrix) < 0;
    for (unsigned i = 0; i < 9 && pass->flips; i++)
        pass->normal_matrix[i] = -pass->normal_matrix[i];
}

/* ---- names */

/* A node's own name: else its mesh's, else its number. */
static const char *own_name(const strl__gltf *gltf, uint32_t index, char number[24])
{
    const strl__gltf_node *node = &gltf->nodes[index];
    if (node->name && *node->name)
        return node->name;
    if (node->mesh != STRL__NO_ITEM && gltf->meshes[node->mesh].name && *gltf->meshes[node->mesh].name)
        return gltf->meshes[node->mesh].name;
    snprintf(number, 24, "node %u", index);
    return number;
}

/* Its length up to `most` bytes, without half a character of UTF-8 at its end. */
static size_t cut_length(const char *name, size_t most)
{
    size_t length = strnlen(name, most + 1);
    if (length <= most)
        return length;
    for (length = most; length > most - 3 && ((unsigned char)name[length] & 0xc0) == 0x80;)
        length--;
    return length;
}

/* From the root, joined with slashes; what is too long loses its beginning. Returns where in text
 * it starts. */
static char *path_of(const strl__gltf *gltf, uint32_t node, char *text, size_t size)
{
    char *start = text + size - 1;
    *start = 0;
    for (uint32_t at = node; at != STRL__NO_ITEM; at = gltf->nodes[at].parent) {
        char number[24];
        const char *name = own_name(gltf, at, number);
        size_t room = (size_t)(start - text), slash = at != node;
        size_t length = cut_length(name, OWN_NAME_BYTES_MAX);
        if (length + slash + 4 > room) {
            start -= 4;
            memcpy(start, ".../", 4);
            break;
        }
        start -= slash;
        if (slash)
            *start = '/';
        start -= length;
        memcpy(start, name, length);
    }
    return start;
}

/* Adds a name; where it is taken, with a number that makes it one of its own. */
static strl_status add_name(strl__gltf *gltf, strl__names *names, const char *name, const char *what, uint32_t number,
                            uint32_t *index, strl_error *err)
{
    char text[STRL__NAME_BYTES_MAX + 1];
    const size_t own = cut_length(name, sizeof text - 1 - NUMBER_BYTES_MAX);
    size_t length = own;
    memcpy(text, name, own);
    for (size_t again = 1; again <= names->count && strl__names_find(names, text, length) != UINT32_MAX; again++)
        length =
            own + (size_t)(again == 1 ? snprintf(text + own, NUMBER_BYTES_MAX, " (%s %u)", what, number)
                                      : snprintf(text + own, NUMBER_BYTES_MAX, " (%s %u, %zu)", what, number, again));
    strl_status status = strl__names_add(names, text, length, index, err);
    return status ? strl__fail_context(err, status, "%s, %s %u", gltf->reader->path, what, number) : STRL_OK;
}

strl_status strl__gltf_name_part(strl__gltf *gltf, uint32_t node, uint32_t *part, strl_error *err)
{
    char text[STRL__NAME_BYTES_MAX - 64];
    strl_status status = STRL_OK;
    if (gltf->nodes[node].part == STRL__NO_ITEM)
        status = add_name(gltf, &gltf->reader->parts, path_of(gltf, node, text, sizeof text), "node", node,
                          &gltf->nodes[node].part, err);
    *part = gltf->nodes[node].part;
    return status;
}

strl_status strl__gltf_name_piece(strl__gltf *gltf, uint32_t index, uint32_t *part, strl_error *err)
{
    strl__gltf_mesh *mesh = &gltf->meshes[index];
    strl_status status = STRL_OK;
    if (mesh->part == STRL__NO_ITEM) {
        char number[24];
        snprintf(number, sizeof number, "mesh %u", index);
        status = add_name(gltf, &gltf->reader->parts, mesh->name && *mesh->name ? mesh->name : number, "mesh", index,
                          &mesh->part, err);
    }
    *part = mesh->part;
    return status;
}

strl_status strl__gltf_list_material(strl__gltf *gltf, uint32_t index, uint32_t *listed, strl_error *err)
{
    strl__names *names = &gltf->reader->materials;
    if (index == STRL__NO_ITEM) /* the default one, white */
        return strl__names_add(names, "", 0, listed, err);
    strl__gltf_material *material = &gltf->materials[index];
    strl_status status = STRL_OK;
    if (material->listed == STRL__NO_ITEM) {
        char number[24];
        snprintf(number, sizeof number, "material %u", index);
        const char *name = material->name && *material->name ? material->name : number;
        status = add_name(gltf, names, name, "material", index, &material->listed, err);
        if (!status) {
            names->items[material->listed].rgba = material->rgba;
            names->items[material->listed].texture = material->texture;
        }
    }
    *listed = material->listed;
    return status;
}
