/* Parts as glTF 2.0: NAME.gltf and as many NAME_000.bin, NAME_001.bin as it takes (a GLB ends at 4 GiB).
 *
 * Every part is a mesh of its own under a node of its own, in local coordinates. JSON wants all nodes in one array, all
 * accessors in another: each array grows in a file without a name and is put in its place at the end, so that no list
 * of parts is ever in memory. A node comes after its children, hence an open group holds the numbers of its children,
 * except for the outermost one, whose children wait in a file too. Vertices and indices are collected to batches of
 * some megabytes; each kind of a batch is one bufferView, which keeps the JSON short. Copies of a part are one node
 * with EXT_mesh_gpu_instancing. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "scenes/parts/gltf_json.h"
#include "scenes/parts/writer.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "vertices and indices are copied as they lie in memory");

enum {
    ENDING = 5,              /* .gltf */
    BATCH_BYTES = 4u << 20,  /* of vertices; one part may have more */
    SHORT_VERTICES = 0xffff, /* most vertices of a part with 16-bit indices: 65535 itself is no index */
    FLOAT = 5126,
    FLOATS = -FLOAT, /* four of them */
    UNSIGNED_SHORT = 5123,
    UNSIGNED_INT = 5125,
    COPIED_MOST = 64 /* meshes with copies */
};

/* In the first bytes of each file. */
#define GENERATOR "\"generator\":\"stroll scene\""
enum { OWN_HEAD_BYTES = 256 };

/* JSON arrays that are written beside each other. */
enum { NODES, MESHES, ACCESSORS, VIEWS, BUFFERS, ROOTS, ARRAYS };

enum { VERTICES, SHORTS, INTS, COPIES, KINDS };

/* What one bufferView of the batch will hold. */
typedef struct batch_kind {
    uint8_t *data; /* owned */
    size_t capacity, used;
    uint64_t view; /* its number, where `used` is not 0 */
} batch_kind;

typedef struct open_node {
    char name[STRL__PART_NAME_BYTES];
    strl__affine place;
    uint64_t *children; /* numbers of nodes; owned, kept for the next group of this depth */
    size_t capacity, count;
} open_node;

/* A mesh that is written already. */
typedef struct copied_mesh {
    const strl__part_mesh *mesh; /* borrowed, only compared */
    uint64_t number;
} copied_mesh;

typedef struct gltf_writer {
    strl__parts_writer base;
    strl__parts_desc desc;
    bool replaces_own; /* an older model of this writer's has the name */
    strl_output *gltf;
    strl_output **bins; /* owned; the last one is being written */
    size_t bin_capacity, bin_count;
    strl__stream bin;
    strl__stream arrays[ARRAYS];
    uint64_t counts[ARRAYS]; /* of their elements */
    batch_kind batch[KINDS];
    open_node groups[STRL__GROUP_DEPTH_MOST];
    int depth;
    copied_mesh copied[COPIED_MOST];
    int copied_count;
} gltf_writer;

/* ---- buffers ---- */

/* NAME_007.bin, owned; NULL without memory. */
static char *bin_path(const gltf_writer *self, uint64_t number)
{
    char ending[32];
    snprintf(ending, sizeof ending, "_%03" PRIu64 ".bin", number);
    return strl__path_sibling(self->desc.path, ENDING, ending);
}

static strl_status end_bin(gltf_writer *self, strl_error *err)
{
    strl__stream *json = &self->arrays[BUFFERS];
    if (self->bin_count == 0)
        return STRL_OK;
    char *path = bin_path(self, self->bin_count - 1);
    strl_status status = path ? strl__stream_flush(&self->bin, err)
                              : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", self->desc.path);
    if (status == STRL_OK)
        status = strl__json_print(json, err, "%s\n{\"uri\":\"", self->counts[BUFFERS] ? "," : "");
    if (status == STRL_OK)
        status = strl__json_uri(json, strl__path_name(path), err);
    if (status == STRL_OK)
        status = strl__json_print(json, err, "\",\"byteLength\":%" PRIu64 "}", self->bin.offset);
    strl__free(path);
    self->counts[BUFFERS]++;
    return status;
}

static strl_status begin_bin(gltf_writer *self, strl_error *err)
{
    strl_status status = end_bin(self, err);
    if (status != STRL_OK)
        return status;
    if (self->bin_count + 1 > self->bin_capacity &&
        !strl__grow(&self->bins, &self->bin_capacity, self->bin_count + 1, sizeof *self->bins))
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a list of buffers", self->desc.path);
    char *path = bin_path(self, self->bin_count);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", self->desc.path);
    status = strl_output_open(path, NULL, &self->bins[self->bin_count], err);
    strl__free(path);
    if (status != STRL_OK)
        return status;
    self->bin.file = strl_output_file(self->bins[self->bin_count++]);
    self->bin.offset = 0;
    return STRL_OK;
}

/* ---- batches ---- */

static strl_status put_view(gltf_writer *self, int kind, strl_error *err)
{
    const batch_kind *from = &self->batch[kind];
    strl__stream *json = &self->arrays[VIEWS];
    static const uint8_t zeros[4] = {0};
    uint64_t offset = self->bin.offset + self->bin.used;
    strl_status status = strl__stream_write(&self->bin, from->data, from->used, err);
    if (status == STRL_OK)
        status = strl__stream_write(&self->bin, zeros, (4 - from->used % 4) % 4, err);
    if (status == STRL_OK)
        status = strl__json_print(json, err, "%s\n{\"buffer\":%zu,\"byteOffset\":%" PRIu64 ",\"byteLength\":%zu",
                                  from->view ? "," : "", self->bin_count - 1, offset, from->used);
    if (status == STRL_OK && kind == VERTICES)
        status = strl__json_print(json, err, ",\"byteStride\":%d,\"target\":34962}", self->desc.no_normals ? 12 : 24);
    else if (status == STRL_OK)
        status = strl__json_print(json, err, kind == COPIES ? "}" : ",\"target\":34963}");
    return status;
}

static strl_status flush_batch(gltf_writer *self, strl_error *err)
{
    uint64_t total = 0;
    for (int kind = 0; kind < KINDS; kind++)
        total += (self->batch[kind].used + 3) / 4 * 4;
    strl_status status = STRL_OK;
    uint64_t written = self->bin.offset + self->bin.used;
    if (total && written && written + total > self->desc.buffer_bytes)
        status = begin_bin(self, err);
    for (uint64_t view = self->counts[VIEWS] > KINDS ? self->counts[VIEWS] - KINDS : 0; view < self->counts[VIEWS];
         view++)
        for (int kind = 0; kind < KINDS && status == STRL_OK; kind++) /* in the order of their numbers */
            if (self->batch[kind].used && self->batch[kind].view == view)
                status = put_view(self, kind, err);
    for (int kind = 0; kind < KINDS; kind++)
        self->batch[kind].used = 0;
    return status;
}

/* Room for `bytes` more of a kind; NULL without memory. */
static uint8_t *extend_batch(gltf_writer *self, int kind, size_t bytes)
{
    batch_kind *to = &self->batch[kind];
    if (to->used + bytes > to->capacity && !strl__grow(&to->data, &to->capacity, to->used + bytes, 1))
        return NULL;
    if (to->used == 0)
        to->view = self->counts[VIEWS]++;
    to->used += bytes;
    return to->data + to->used - bytes;
}

static void copy_indices(const strl__part_mesh *mesh, int kind, uint8_t *to)
{
    size_t count = 3 * (size_t)mesh->triangle_count;
    if (kind == INTS)
        memcpy(to, mesh->corners, count * sizeof *mesh->corners);
    for (size_t i = 0; i < count && kind == SHORTS; i++) {
        uint16_t corner = (uint16_t)mesh->corners[i];
        memcpy(to + 2 * i, &corner, sizeof corner);
    }
}

static strl_status put_mesh(gltf_writer *self, const strl__part_mesh *mesh, int kind, strl_error *err)
{
    size_t vertex_bytes = self->desc.no_normals ? 12 : 24;
    size_t bytes = mesh->vertex_count * vertex_bytes;
    strl_status status = STRL_OK;
    if (self->batch[VERTICES].used && self->batch[VERTICES].used + bytes > BATCH_BYTES)
        status = flush_batch(self, err);
    if (status != STRL_OK)
        return status;
    uint8_t *vertices = extend_batch(self, VERTICES, bytes);
    uint8_t *indices = extend_batch(self, kind, (size_t)mesh->triangle_count * (kind == SHORTS ? 6 : 12));
    if (!vertices || !indices)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a batch of vertices", self->desc.path);
    for (size_t i = 0; i < mesh->vertex_count; i++)
        memcpy(vertices + i * vertex_bytes, mesh->vertices + i * STRL__PART_VERTEX_FLOATS, vertex_bytes);
    copy_indices(mesh, kind, indices);
    return STRL_OK;
}

/* ---- elements of the JSON arrays ---- */

static strl_status begin_element(gltf_writer *self, int array, strl_error *err)
{
    return strl__json_print(&self->arrays[array], err, "%s\n", self->counts[array]++ ? "," : "");
}

static strl_status put_accessor(gltf_writer *self, const batch_kind *kind, size_t bytes, int type, uint32_t count,
                                strl_error *err)
{
    strl_status status = begin_element(self, ACCESSORS, err);
    if (status == STRL_OK)
        status = strl__json_print(&self->arrays[ACCESSORS], err,
                                  "{\"bufferView\":%" PRIu64
                                  ",\"byteOffset\":%zu,\"componentType\":%d,\"count\":%" PRIu32 ",\"type\":\"%s\"",
                                  kind->view, kind->used - bytes, type == FLOATS ? FLOAT : type, count,
                                  type == FLOAT    ? "VEC3"
                                  : type == FLOATS ? "VEC4"
                                                   : "SCALAR");
    return status;
}

/* Exactly as the floats are: validators compare. */
static strl_status put_bounds(gltf_writer *self, const strl__part_mesh *mesh, strl_error *err)
{
    float low[3] = {0}, high[3] = {0};
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        for (int k = 0; k < 3; k++) {
            float value = mesh->vertices[(size_t)i * STRL__PART_VERTEX_FLOATS + (size_t)k];
            low[k] = i == 0 || value < low[k] ? value : low[k];
            high[k] = i == 0 || value > high[k] ? value : high[k];
        }
    strl_status status = strl__json_floats(&self->arrays[ACCESSORS], "min", low, 3, err);
    if (status == STRL_OK)
        status = strl__json_floats(&self->arrays[ACCESSORS], "max", high, 3, err);
    return status == STRL_OK ? strl__json_print(&self->arrays[ACCESSORS], err, "}") : status;
}

static strl_status put_accessors(gltf_writer *self, const strl__part_mesh *mesh, int kind, strl_error *err)
{
    size_t vertex_bytes = self->desc.no_normals ? 12 : 24, bytes = mesh->vertex_count * vertex_bytes;
    strl_status status = put_accessor(self, &self->batch[VERTICES], bytes, FLOAT, mesh->vertex_count, err);
    if (status == STRL_OK)
        status = put_bounds(self, mesh, err);
    if (status == STRL_OK && !self->desc.no_normals)
        status = put_accessor(self, &self->batch[VERTICES], bytes - 12, FLOAT, mesh->vertex_count, err);
    if (status == STRL_OK && !self->desc.no_normals)
        status = strl__json_print(&self->arrays[ACCESSORS], err, "}");
    size_t index_bytes = (size_t)mesh->triangle_count * (kind == SHORTS ? 6 : 12);
    if (status == STRL_OK)
        status = put_accessor(self, &self->batch[kind], index_bytes, kind == SHORTS ? UNSIGNED_SHORT : UNSIGNED_INT,
                              3 * mesh->triangle_count, err);
    return status == STRL_OK ? strl__json_print(&self->arrays[ACCESSORS], err, "}") : status;
}

static strl_status put_mesh_element(gltf_writer *self, const strl__part *part, uint64_t first, strl_error *err)
{
    bool normals = !self->desc.no_normals;
    char normal[40] = "";
    if (normals)
        snprintf(normal, sizeof normal, ",\"NORMAL\":%" PRIu64, first + 1);
    strl_status status = begin_element(self, MESHES, err);
    if (status == STRL_OK)
        status = strl__json_print(&self->arrays[MESHES], err,
                                  "{\"primitives\":[{\"attributes\":{\"POSITION\":%" PRIu64 "%s},\"indices\":%" PRIu64
                                  ",\"material\":%u}]}",
                                  first, normal, first + 1 + normals, part->material);
    return status;
}

/* The last node written becomes a child of the innermost open group. */
static strl_status adopt_node(gltf_writer *self, strl_error *err)
{
    uint64_t node = self->counts[NODES] - 1;
    open_node *parent = &self->groups[self->depth - 1];
    if (self->depth == 1) {
        parent->count++;
        return strl__json_print(&self->arrays[ROOTS], err, "%s%" PRIu64, parent->count > 1 ? "," : "", node);
    }
    if (parent->count + 1 > parent->capacity &&
        !strl__grow(&parent->children, &parent->capacity, parent->count + 1, sizeof *parent->children))
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the parts of %s", self->desc.path, parent->name);
    parent->children[parent->count++] = node;
    return STRL_OK;
}

/* Vertices, indices, accessors and the element. */
static strl_status write_mesh(gltf_writer *self, const strl__part *part, strl_error *err)
{
    const strl__part_mesh *mesh = part->mesh;
    int kind = mesh->vertex_count <= SHORT_VERTICES ? SHORTS : INTS;
    uint64_t first = self->counts[ACCESSORS];
    strl_status status = put_mesh(self, mesh, kind, err);
    if (status == STRL_OK)
        status = put_accessors(self, mesh, kind, err);
    return status == STRL_OK ? put_mesh_element(self, part, first, err) : status;
}

static strl_status put_part(strl__parts_writer *base, const strl__part *part, strl_error *err)
{
    gltf_writer *self = (gltf_writer *)base;
    const strl__part_mesh *mesh = part->mesh;
    strl__stream *nodes = &self->arrays[NODES];
    strl_status status = write_mesh(self, part, err);
    if (status == STRL_OK)
        status = begin_element(self, NODES, err);
    if (status == STRL_OK)
        status =
            strl__json_print(nodes, err, "{\"name\":\"%s\",\"mesh\":%" PRIu64, part->name, self->counts[MESHES] - 1);
    if (status == STRL_OK)
        status = strl__json_place(nodes, &part->place, false, err);
    if (status == STRL_OK)
        status = strl__json_print(nodes, err, "}");
    base->vertices += mesh->vertex_count;
    base->triangles += mesh->triangle_count;
    base->parts++;
    return status == STRL_OK ? adopt_node(self, err) : status;
}

static strl_status find_copied(gltf_writer *self, const strl__part *part, uint64_t *number, strl_error *err)
{
    for (int i = 0; i < self->copied_count; i++)
        if (self->copied[i].mesh == part->mesh) {
            *number = self->copied[i].number;
            return STRL_OK;
        }
    if (self->copied_count == COPIED_MOST)
        return strl__fail(err, STRL_ERR_INTERNAL, "part %s: more than %d meshes have copies", part->name, COPIED_MOST);
    strl_status status = write_mesh(self, part, err);
    *number = self->counts[MESHES] - 1;
    self->copied[self->copied_count++] = (copied_mesh){part->mesh, *number};
    return status;
}

/* Moves, then turns, then scales. */
static strl_status put_places(gltf_writer *self, const strl__copy *copies, uint32_t count, strl_error *err)
{
    static const int types[] = {FLOAT, FLOATS, FLOAT};
    strl_status status = STRL_OK;
    if (self->batch[COPIES].used && self->batch[COPIES].used + count * sizeof *copies > BATCH_BYTES)
        status = flush_batch(self, err);
    for (int i = 0; i < 3 && status == STRL_OK; i++) {
        const size_t each = (types[i] == FLOAT ? 3 : 4) * sizeof(float);
        uint8_t *to = extend_batch(self, COPIES, count * each);
        if (!to)
            return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for %" PRIu32 " copies", self->desc.path, count);
        for (uint32_t k = 0; k < count; k++, to += each) {
            const float scale[3] = {copies[k].scale, copies[k].scale, copies[k].scale};
            memcpy(to, i == 0 ? copies[k].move : i == 1 ? copies[k].turn : scale, each);
        }
        status = put_accessor(self, &self->batch[COPIES], count * each, types[i], count, err);
        if (status == STRL_OK)
            status = strl__json_print(&self->arrays[ACCESSORS], err, "}");
    }
    return status;
}

static strl_status put_copies(strl__parts_writer *base, const strl__part *part, const strl__copy *copies,
                              uint32_t count, strl_error *err)
{
    gltf_writer *self = (gltf_writer *)base;
    uint64_t mesh = 0;
    strl_status status = find_copied(self, part, &mesh, err);
    const uint64_t first = self->counts[ACCESSORS];
    if (status == STRL_OK)
        status = put_places(self, copies, count, err);
    if (status == STRL_OK)
        status = begin_element(self, NODES, err);
    if (status == STRL_OK)
        status = strl__json_print(&self->arrays[NODES], err,
                                  "{\"name\":\"%s\",\"mesh\":%" PRIu64
                                  ",\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":"
                                  "{\"TRANSLATION\":%" PRIu64 ",\"ROTATION\":%" PRIu64 ",\"SCALE\":%" PRIu64 "}}}}",
                                  part->name, mesh, first, first + 1, first + 2);
    base->vertices += (uint64_t)count * part->mesh->vertex_count;
    base->triangles += (uint64_t)count * part->mesh->triangle_count;
    base->parts += count;
    return status == STRL_OK ? adopt_node(self, err) : status;
}

static strl_status open_group(strl__parts_writer *base, const char *name, const strl__affine *place, strl_error *err)
{
    gltf_writer *self = (gltf_writer *)base;
    if (self->depth == STRL__GROUP_DEPTH_MOST)
        return strl__fail(err, STRL_ERR_INTERNAL, "group %s lies in more than %d others", name, STRL__GROUP_DEPTH_MOST);
    open_node *group = &self->groups[self->depth++];
    snprintf(group->name, sizeof group->name, "%s", name);
    group->place = *place;
    group->count = 0;
    return STRL_OK;
}

/* glTF allows no empty list of children. */
static strl_status close_group(strl__parts_writer *base, strl_error *err)
{
    gltf_writer *self = (gltf_writer *)base;
    const open_node *group = &self->groups[--self->depth];
    strl__stream *nodes = &self->arrays[NODES];
    if (self->depth == 0)
        return STRL_OK; /* its node is written last, when its children are moved to their place */
    strl_status status = begin_element(self, NODES, err);
    if (status == STRL_OK)
        status = strl__json_print(nodes, err, "{\"name\":\"%s\"", group->name);
    if (status == STRL_OK)
        status = strl__json_place(nodes, &group->place, true, err);
    for (size_t i = 0; status == STRL_OK && i < group->count; i++)
        status = strl__json_print(nodes, err, "%s%" PRIu64, i ? "," : ",\"children\":[", group->children[i]);
    if (status == STRL_OK)
        status = strl__json_print(nodes, err, group->count ? "]}" : "}");
    return status == STRL_OK ? adopt_node(self, err) : status;
}

/* ---- the whole ---- */

/* Text goes through the bin's stream, which is free by then. */
static strl_status append_array(gltf_writer *self, const char *head, int array, strl_output_report report,
                                void *context, strl_error *err)
{
    strl_status status = strl__json_print(&self->bin, err, "%s", head);
    if (status == STRL_OK)
        status = strl__stream_flush(&self->bin, err);
    if (status == STRL_OK)
        status = strl__stream_flush(&self->arrays[array], err);
    if (status == STRL_OK)
        status = strl_output_append(self->gltf, self->arrays[array].file, report, context, err);
    self->bin.offset = strl_file_bytes(self->bin.file);
    return status;
}

static strl_status write_head(gltf_writer *self, strl_error *err)
{
    strl__stream *text = &self->bin;
    strl_status status = strl__json_print(text, err,
                                          "{\"asset\":{\"version\":\"2.0\"," GENERATOR "},%s\"scene\":0,\"scenes\":"
                                          "[{\"nodes\":[%" PRIu64 "]}],\n\"materials\":[",
                                          self->copied_count ? "\"extensionsUsed\":[\"EXT_mesh_gpu_instancing\"]," : "",
                                          self->counts[NODES]);
    for (unsigned i = 0; status == STRL_OK && i < self->desc.material_count; i++) {
        status = strl__json_print(text, err, "%s\n", i ? "," : "");
        if (status == STRL_OK)
            status = strl__json_material(text, &self->desc.materials[i], err);
    }
    return status == STRL_OK ? strl__json_print(text, err, "],\n") : status;
}

static strl_status write_gltf(gltf_writer *self, strl_output_report report, void *context, strl_error *err)
{
    static const char *const heads[] = {"\"buffers\":[", "],\n\"bufferViews\":[", "],\n\"accessors\":[",
                                        "],\n\"meshes\":[", "],\n\"nodes\":["};
    static const int arrays[] = {BUFFERS, VIEWS, ACCESSORS, MESHES, NODES};
    const open_node *root = &self->groups[0];
    self->bin.file = strl_output_file(self->gltf);
    self->bin.offset = 0;
    strl_status status = write_head(self, err);
    for (int i = 0; status == STRL_OK && i < 5; i++)
        status = append_array(self, heads[i], arrays[i], report, context, err);
    if (status == STRL_OK)
        status = strl__json_print(&self->bin, err, ",\n{\"name\":\"%s\"", root->name);
    if (status == STRL_OK)
        status = strl__json_place(&self->bin, &root->place, true, err);
    if (status == STRL_OK)
        status = append_array(self, ",\"children\":[", ROOTS, report, context, err);
    if (status == STRL_OK)
        status = strl__json_print(&self->bin, err, "]}]}\n");
    return status == STRL_OK ? strl__stream_flush(&self->bin, err) : status;
}

/* Whether a file of this name is there that this program has made: then the buffers beside it are its own, too. */
static bool is_own_model(const char *path)
{
    char head[OWN_HEAD_BYTES] = "";
    strl_file *file = NULL;
    size_t got = 0;
    const bool read = strl_file_open(path, &file, NULL) == STRL_OK &&
                      strl_file_read_some(file, 0, head, sizeof head, &got, NULL) == STRL_OK;
    strl_file_close(file, NULL);
    return read && memmem(head, got, GENERATOR, strlen(GENERATOR)) != NULL;
}

/* Of an older model that had more buffers than the new one. */
static strl_status remove_older_bins(const gltf_writer *self, strl_error *err)
{
    bool there = self->replaces_own;
    strl_status status = STRL_OK;
    for (uint64_t number = self->bin_count; there && status == STRL_OK; number++) {
        char *path = bin_path(self, number);
        if (!path)
            return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", self->desc.path);
        there = strl_path_exists(path);
        status = there ? strl_path_remove(path, err) : STRL_OK;
        strl__free(path);
    }
    return status;
}

/* The .gltf gets its name last: who sees it finds its buffers. */
static strl_status finish(strl__parts_writer *base, strl_output_report report, void *context, strl_error *err)
{
    gltf_writer *self = (gltf_writer *)base;
    strl_status status = flush_batch(self, err);
    if (status == STRL_OK)
        status = end_bin(self, err);
    if (status == STRL_OK)
        status = write_gltf(self, report, context, err);
    if (status == STRL_OK)
        base->bytes = strl_file_bytes(strl_output_file(self->gltf));
    for (size_t i = 0; status == STRL_OK && i < self->bin_count; i++)
        base->bytes += strl_file_bytes(strl_output_file(self->bins[i]));
    for (size_t i = 0; status == STRL_OK && i < self->bin_count; i++)
        status = strl_output_finish(self->bins[i], false, err);
    if (status == STRL_OK)
        status = strl_output_finish(self->gltf, false, err);
    return status == STRL_OK ? remove_older_bins(self, err) : status;
}

static void destroy(strl__parts_writer *base)
{
    gltf_writer *self = (gltf_writer *)base;
    strl_output_close(self->gltf);
    for (size_t i = 0; i < self->bin_count; i++)
        strl_output_close(self->bins[i]);
    for (int i = 0; i < ARRAYS; i++) {
        strl_file_close(self->arrays[i].file, NULL);
        strl__stream_deinit(&self->arrays[i]);
    }
    for (int i = 0; i < STRL__GROUP_DEPTH_MOST; i++)
        strl__free(self->groups[i].children);
    for (int i = 0; i < KINDS; i++)
        strl__free(self->batch[i].data);
    strl__stream_deinit(&self->bin);
    strl__free(self->bins);
    strl__free(self);
}

static strl_status open_files(gltf_writer *self, strl_error *err)
{
    strl_status status = strl_output_open(self->desc.path, NULL, &self->gltf, err);
    for (int i = 0; status == STRL_OK && i < ARRAYS; i++) {
        status = strl__stream_init(&self->arrays[i], self->desc.path, err);
        if (status == STRL_OK)
            status = strl_output_spill(self->gltf, &self->arrays[i].file, err);
    }
    if (status == STRL_OK)
        status = strl__stream_init(&self->bin, self->desc.path, err);
    return status == STRL_OK ? begin_bin(self, err) : status;
}

strl_status strl__gltf_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err)
{
    *writer = NULL;
    gltf_writer *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the writer", desc->path);
    self->base = (strl__parts_writer){open_group, put_part, close_group, put_copies, finish, destroy, 0, 0, 0, 0};
    self->desc = *desc;
    self->replaces_own = is_own_model(desc->path);
    strl_status status = open_files(self, err);
    if (status != STRL_OK) {
        destroy(&self->base);
        return status;
    }
    *writer = &self->base;
    return STRL_OK;
}
