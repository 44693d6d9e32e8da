/* What the files of the glTF 2.0 reader share: https://registry.khronos.org/glTF/specs/2.0/ and the
 * extensions KHR_mesh_quantization, KHR_draco_mesh_compression, EXT_meshopt_compression,
 * EXT_mesh_gpu_instancing and KHR_materials_pbrSpecularGlossiness.
 *
 * Opening reads the JSON into tables, follows the drawn nodes and checks whatever they use against
 * the bytes that are there. Reading then goes from node to node, primitive to primitive, placement
 * to placement; of the buffers only windows are in memory. Poses of skins and morph targets are not
 * applied.
 *
 * Of the reader's budget at most seven sixteenths are for tables, half less those for what is
 * decompressed and for images, which take a quarter at most, an eighth for buffers that stand in
 * the JSON as text, an eighth for the vertices of a primitive; a 16th for measuring these under an
 * image. */
#ifndef STRL_READERS_GLTF_H
#define STRL_READERS_GLTF_H

#include "base/memory.h"
#include "readers/gltf_draco.h"
#include "readers/gltf_fields.h"
#include "readers/internal.h"
#include "readers/texture.h"

#define STRL__GLTF_DEPTH_MAX 1024u /* of nodes */

#define STRL__GLTF_SETS 4u /* of texture coordinates */

/* Numbers that follow each other in a buffer view. */
typedef struct strl__gltf_column {
    uint64_t offset; /* bytes from the view's start */
    uint32_t view;   /* STRL__NO_ITEM: all zeros */
    uint8_t type;    /* strl__scalar; a file may have millions of these */
    uint8_t components;
    bool normalized; /* integers stand for 0..1 or -1..1 */
} strl__gltf_column;

/* Elements of an accessor that are not those of its view. */
typedef struct strl__gltf_sparse {
    uint64_t count;
    strl__gltf_column indices, values;
} strl__gltf_sparse;

typedef struct strl__gltf_accessor {
    strl__gltf_column values;
    uint64_t count;
    strl__gltf_sparse *sparse; /* in the arena; NULL: none */
    bool is_checked;           /* against the bytes that are there */
} strl__gltf_accessor;

typedef enum strl__meshopt_mode {
    STRL__MESHOPT_ATTRIBUTES,
    STRL__MESHOPT_TRIANGLES,
    STRL__MESHOPT_INDICES
} strl__meshopt_mode;

typedef enum strl__meshopt_filter {
    STRL__MESHOPT_NONE,
    STRL__MESHOPT_OCTAHEDRAL,
    STRL__MESHOPT_QUATERNION,
    STRL__MESHOPT_EXPONENTIAL
} strl__meshopt_filter;

/* Where the compressed bytes of a view are, and what they become: count times stride bytes. */
typedef struct strl__gltf_meshopt {
    uint64_t offset, bytes, count;
    uint32_t buffer, stride;
    strl__meshopt_mode mode;
    strl__meshopt_filter filter;
} strl__gltf_meshopt;

typedef struct strl__gltf_view {
    uint64_t offset, bytes;
    uint32_t buffer;
    uint32_t stride;             /* 0: elements follow each other closely */
    strl__gltf_meshopt *meshopt; /* in the arena; NULL: the bytes are as they are */
    bool is_checked, is_stored;
    uint64_t stored_at; /* where it is decompressed in the file of stored views */
} strl__gltf_view;

typedef struct strl__gltf_buffer {
    uint64_t bytes; /* announced */
    char *uri;      /* in the arena; NULL: the GLB's second chunk */
    bool is_open;
    strl_file *file;           /* where the bytes are; owned where owns_file */
    bool owns_file, is_beside; /* is_beside: a file that the user gave, not one of our own */
    strl_file_info opened;     /* of a file beside the model */
    uint64_t file_offset;
    uint8_t *memory; /* owned; where the bytes are instead of file */
    uint64_t memory_bytes;
    bool is_loose; /* an image: its bytes are as many as there are */
} strl__gltf_buffer;

typedef struct strl__gltf_draco_use {
    uint32_t view;
    /* unique ids in the compressed mesh, or STRL__NO_ITEM */
    uint32_t position, normal, colour, texcoord[STRL__GLTF_SETS];
} strl__gltf_draco_use;

typedef struct strl__gltf_primitive {
    uint8_t mode;               /* as in the file: 0 points, 1..3 lines, 4 triangles, 5 strip, 6 fan */
    bool has_range;             /* lowest and highest are known */
    uint32_t indices, material; /* or STRL__NO_ITEM, as all below */
    uint32_t position, normal, colour, texcoord[STRL__GLTF_SETS]; /* accessors */
    strl__gltf_draco_use *draco;                                  /* in the arena; NULL: not compressed */
    uint32_t lowest, highest;                                     /* of its indices; beyond its vertices perhaps */
} strl__gltf_primitive;

typedef struct strl__gltf_mesh {
    char *name; /* in the arena; may be NULL */
    uint32_t first_primitive, primitive_count;
    bool is_checked;
    uint64_t triangles, vertices; /* once checked */
    uint64_t uses;                /* by nodes that are drawn and their instances */
    uint32_t piece;               /* 0: it is read with all others, each copy for itself */
    uint32_t part;                /* among the reader's, once it has one: of a piece */
} strl__gltf_mesh;

typedef struct strl__gltf_instances {
    uint64_t count;
    uint32_t translation, rotation, scale; /* accessors or STRL__NO_ITEM */
} strl__gltf_instances;

/* Rows of three, and the translation: y[r] = sum m[4 r + c] x[c] + m[4 r + 3]. */
typedef struct strl__gltf_matrix {
    double m[12];
} strl__gltf_matrix;

typedef struct strl__gltf_node {
    char *name; /* in the arena; may be NULL */
    uint32_t mesh, parent;
    uint32_t first_child, child_count; /* in children */
    uint32_t sibling;                  /* its place among its parent's children */
    uint32_t depth;                    /* a root's is 0 */
    bool is_drawn_root;                /* of the scene */
    uint32_t part;                     /* among the reader's, once it has one */
    strl__gltf_matrix local;
    strl__gltf_instances *instances; /* in the arena; NULL: one */
} strl__gltf_node;

typedef struct strl__gltf_material {
    char *name;          /* in the arena; may be NULL */
    uint32_t rgba;       /* sRGB-encoded; what the reader tells of it */
    double alpha;        /* factor, linear */
    double cutoff;       /* of a mask, else negative */
    bool is_opaque;      /* alpha counts for nothing */
    uint32_t listed;     /* among the reader's, once it is */
    uint32_t map;        /* a texture of the file's, or STRL__NO_ITEM */
    uint32_t set;        /* of texture coordinates */
    double transform[6]; /* of them: rows of u and v */
    uint32_t texture;    /* among the reader's, or STRL__NO_TEXTURE */
} strl__gltf_material;

typedef struct strl__gltf_map {
    uint32_t image, sampler; /* or STRL__NO_ITEM */
} strl__gltf_map;

typedef struct strl__gltf_sampler {
    strl__wrap wrap[2];
} strl__gltf_sampler;

typedef struct strl__gltf_image {
    char *uri, *name; /* in the arena; may be NULL */
    uint32_t view;    /* or STRL__NO_ITEM */
} strl__gltf_image;

typedef struct strl__gltf_scene {
    uint32_t first_root, root_count; /* in roots */
} strl__gltf_scene;

/* A decompressed view, kept while there is room. */
typedef struct strl__gltf_decoded {
    uint32_t view;
    uint8_t *bytes; /* owned */
    uint64_t size;
    uint64_t used_at; /* a clock's tick */
} strl__gltf_decoded;

#define STRL__GLTF_DECODED_MAX 8u

/* The placement that is read. */
typedef struct strl__gltf_pass {
    bool has_node, has_placement; /* stands at one */
    bool is_alone;                /* at a piece's mesh, without a node; has_node is false */
    uint32_t mesh;                /* that is read */
    uint32_t root;                /* of the scene: the one under which node is */
    uint32_t node;
    uint32_t primitive; /* of the node's mesh */
    uint64_t instance;
    uint64_t triangle, triangle_count;
    uint64_t vertex_count;
    uint64_t first_loaded, loaded_count; /* vertices that are in the reader's table, where there are indices */
    bool is_scattered;                   /* none are: each corner is looked up by itself */
    uint64_t done;                       /* triangles, of all placements so far */
    uint32_t part, material;
    strl__gltf_matrix placement;
    double normal_matrix[9];
    bool flips;
} strl__gltf_pass;

/* The image of the primitive that is read. */
typedef struct strl__gltf_paint {
    const strl__image *image; /* borrowed for the placement; NULL: none that can be used */
    uint32_t texture, draco_id;
    uint32_t texcoord;           /* an accessor, or STRL__NO_ITEM: there is no image */
    uint32_t measured;           /* the primitive to which what follows belongs, or STRL__NO_ITEM */
    uint64_t first, count;       /* vertices that were loaded when it was measured */
    strl__footprint *footprints; /* owned; of these; NULL: all have the same */
    double footprint;
} strl__gltf_paint;

#define STRL__GLTF_CHUNK 1024u /* elements read at once */
#define STRL__GLTF_INSTANCES 256u

/* Instances that were read at once. */
typedef struct strl__gltf_window {
    const strl__gltf_instances *of; /* NULL: none */
    uint64_t first, count;
    double translation[STRL__GLTF_INSTANCES][3], rotation[STRL__GLTF_INSTANCES][4], scale[STRL__GLTF_INSTANCES][3];
} strl__gltf_window;

typedef struct strl__gltf {
    strl_reader *reader;
    strl_arena arena; /* names and rare things */
    uint64_t table_bytes, table_limit;
    bool is_counting; /* the tables are full: what follows is counted, for a sentence */
    uint64_t counted_bytes;
    strl__gltf_accessor *accessors;
    strl__gltf_view *views;
    strl__gltf_buffer *buffers;
    strl__gltf_mesh *meshes;
    strl__gltf_primitive *primitives;
    strl__gltf_node *nodes;
    strl__gltf_material *materials;
    strl__gltf_scene *scenes;
    strl__gltf_map *maps;
    strl__gltf_sampler *samplers;
    strl__gltf_image *images;
    uint32_t *children, *roots;
    size_t accessor_count, view_count, buffer_count, mesh_count, primitive_count, node_count;
    size_t material_count, scene_count, child_count, root_count, map_count, sampler_count;
    size_t image_count;
    size_t accessor_capacity, view_capacity, buffer_capacity, mesh_capacity, primitive_capacity;
    size_t node_capacity, material_capacity, scene_capacity, child_capacity, root_capacity;
    size_t map_capacity, sampler_capacity, image_capacity;
    bool has_asset;
    uint32_t scene;                       /* as the file says, or STRL__NO_ITEM */
    uint64_t seen;                        /* top-level members, one bit each */
    uint64_t binary_offset, binary_bytes; /* the GLB's second chunk */
    bool has_binary;
    uint64_t text_bytes; /* of buffers that are in memory */
    strl__gltf_decoded decoded[STRL__GLTF_DECODED_MAX];
    uint64_t decoded_bytes, clock;
    strl_file *stored; /* scratch; what was decoded and had to make room; owned, may be NULL */
    uint64_t stored_bytes;
    strl__draco *draco; /* the primitive decompressed last; owned */
    uint32_t draco_primitive;
    uint64_t draco_bytes;
    uint64_t triangles, vertices; /* of all placements, but of a piece once; of all meshes */
    uint64_t rest_triangles;      /* of them those of piece 0 */
    bool rest_is_empty;           /* nothing is in piece 0 */
    uint64_t image_changes;       /* how often a pass over all comes from one image to another */
    uint32_t last_picture;        /* while they are counted */
    uint32_t *pieces;             /* owned; the mesh of piece i + 1 */
    strl__gltf_window instances;
    strl__gltf_matrix *world; /* owned; of node's ancestors and itself, by depth */
    strl__gltf_pass pass;
    strl__gltf_paint paint;
    uint8_t *window; /* owned */
    double values[STRL__GLTF_CHUNK * 4];
    double tints[STRL__GLTF_CHUNK * 4]; /* linear R, G, B, and A, of vertices under an image */
    strl__corner corners[STRL__GLTF_CHUNK];
    uint32_t elements[STRL__GLTF_CHUNK];
    strl__corner first_corner; /* of a fan */
    uint32_t first_element;
} strl__gltf;

/* A window holds so many bytes, and one element more where elements overlap. */
#define STRL__GLTF_WINDOW_BYTES ((size_t)64 << 10)
#define STRL__GLTF_ELEMENT_BYTES_MAX 64u

static inline strl__gltf *strl__gltf_of(const strl_reader *reader)
{
    return reader->state;
}

/* Of the reader's table of vertices. */
static inline size_t strl__gltf_table_bytes(const strl_reader *reader)
{
    return (size_t)(reader->memory_bytes / 8);
}

/* ---- gltf_tables.c: memory for what the JSON describes */
/* Room for one more item in a table; counts against the tables' share. */
strl_status strl__gltf_add(strl__gltf *gltf, void *items_pointer, size_t *count, size_t *capacity, size_t item_bytes,
                           strl_error *err);
void *strl__gltf_keep(strl__gltf *gltf, size_t bytes, strl_error *err); /* zeroed, in the arena */
/* Once all is counted that did not fit: how much memory would do. */
strl_status strl__gltf_refuse_tables(const strl__gltf *gltf, strl_error *err);

/* ---- gltf_parse.c, gltf_material.c: the JSON's elements into tables */
strl_status strl__gltf_parse(strl__gltf *gltf, strl_error *err);
strl_status strl__gltf_parse_material(strl__gltf *gltf, strl__fields *fields, const json_t *value);
char *strl__gltf_keep_text(strl__gltf *gltf, strl__fields *fields, const json_t *value,
                           const char *key); /* in the arena; NULL where absent */
/* The alpha of a vertex under a material; STRL__NO_ITEM is the default one. */
uint8_t strl__gltf_alpha(const strl__gltf *gltf, uint32_t material, double alpha);

/* ---- gltf_graph.c: nodes */
strl_status strl__gltf_link(strl__gltf *gltf, strl_error *err); /* after parsing */
/* The next node of the scene, each before its children, into pass.node; its matrix is the last of
 * world. False at the end. */
bool strl__gltf_next_node(strl__gltf *gltf);
void strl__gltf_rewind(strl__gltf *gltf);
const strl__gltf_matrix *strl__gltf_world(const strl__gltf *gltf); /* of pass.node */
strl__gltf_matrix strl__gltf_multiply(const strl__gltf_matrix *a, const strl__gltf_matrix *b);
/* From translation, rotation (a quaternion of any length, x y z w) and scale. */
strl__gltf_matrix strl__gltf_compose(const double translation[3], const double rotation[4], const double scale[3]);
/* Sets normal_matrix and flips from placement. */
void strl__gltf_derive(strl__gltf_pass *pass);
/* A name of its own for the part of a node. */
strl_status strl__gltf_name_part(strl__gltf *gltf, uint32_t node, uint32_t *part, strl_error *err);
strl_status strl__gltf_name_piece(strl__gltf *gltf, uint32_t mesh, uint32_t *part, strl_error *err);
strl_status strl__gltf_list_material(strl__gltf *gltf, uint32_t material, uint32_t *listed, strl_error *err);

/* ---- gltf_pieces.c: meshes that are used again and again */
/* Chooses them; after checking. */
strl_status strl__gltf_find_pieces(strl__gltf *gltf, strl_error *err);
void strl__gltf_piece_get(const strl_reader *reader, uint32_t piece, strl_reader_piece *facts);
strl_status strl__gltf_start_placements(strl_reader *reader, strl_error *err);
strl_status strl__gltf_next_placement(strl_reader *reader, strl_reader_placement *placement, bool *found,
                                      strl_error *err);
uint64_t strl__gltf_instance_count(const strl__gltf_node *node);
/* Of pass.node, an instance of it where it has any. */
strl_status strl__gltf_place_node(strl__gltf *gltf, strl__gltf_matrix *placement, strl_error *err);

/* ---- gltf_check.c */
/* where: what names it, with a comma before it, may be empty; list: the JSON's member. */
strl_status strl__gltf_fail_index(const strl__gltf *gltf, const char *where, const char *list, size_t count,
                                  uint32_t found, strl_error *err);

/* ---- gltf_buffer.c: where bytes are */
strl_status strl__gltf_open_buffer(strl__gltf *gltf, uint32_t index, strl_error *err);
/* Whether the files beside the model are as they were. */
strl_status strl__gltf_check_unchanged(const strl__gltf *gltf, strl_error *err);
void strl__gltf_rest_buffers(strl__gltf *gltf); /* gives back memory, by scratch or by decoding again later */
void strl__gltf_close_buffers(strl__gltf *gltf);
/* Size bytes of a view; inside it, which the caller has checked. */
strl_status strl__gltf_read_view(strl__gltf *gltf, uint32_t view, uint64_t offset, void *data, size_t size,
                                 strl_error *err);
strl_status strl__gltf_read_buffer(strl__gltf *gltf, uint32_t buffer, uint64_t offset, void *data, size_t size,
                                   strl_error *err);

/* Where an image's uri leads: its bytes become known by opening. */
strl_status strl__gltf_open_loose(strl__gltf *gltf, strl__gltf_buffer *buffer, uint32_t image, strl_error *err);
void strl__gltf_close_buffer(strl__gltf *gltf, strl__gltf_buffer *buffer);

/* ---- gltf_meshopt.c */
strl_status strl__gltf_check_meshopt(strl__gltf *gltf, uint32_t view, strl_error *err);
/* The decompressed bytes of a view; valid until the next call. */
strl_status strl__gltf_decode_view(strl__gltf *gltf, uint32_t view, const uint8_t **bytes, strl_error *err);
/* Makes room for so many decompressed bytes, or fails. */
strl_status strl__gltf_make_room(strl__gltf *gltf, uint64_t bytes, const char *what, strl_error *err);
/* Gives up all decompressed views, and tells how many bytes a Draco mesh may take. */
uint64_t strl__gltf_room(strl__gltf *gltf);
/* Into scratch, which holds it until the reader is closed; false where that has no place. */
bool strl__gltf_store(strl__gltf *gltf, const void *bytes, size_t size, uint64_t *at);
void strl__gltf_rest_decoded(strl__gltf *gltf); /* gives back memory, by scratch or by decoding again later */
void strl__gltf_close_decoded(strl__gltf *gltf);

/* ---- gltf_accessor.c: elements */
/* Against the bytes that are there; opens buffers. */
strl_status strl__gltf_check_view(strl__gltf *gltf, uint32_t view, strl_error *err);
strl_status strl__gltf_check_accessor(strl__gltf *gltf, uint32_t accessor, strl_error *err);
/* An integer as the part of 0..1 or -1..1 that it stands for. */
double strl__gltf_denormalize(strl__scalar type, double value);
/* Elements of a checked accessor, components after components; first + count <= its count. normalized: its integers are
 * parts of 0..1 or -1..1; some uses have them so whatever the accessor says. */
strl_status strl__gltf_read_numbers(strl__gltf *gltf, uint32_t accessor, bool normalized, uint64_t first, size_t count,
                                    double *numbers, strl_error *err);
strl_status strl__gltf_read_indices(strl__gltf *gltf, uint32_t accessor, uint64_t first, size_t count,
                                    uint32_t *indices, strl_error *err);

/* ---- gltf_check.c: what the drawn meshes use; sets triangles and vertices */
strl_status strl__gltf_check_scene(strl__gltf *gltf, strl_error *err);
/* Elements of a primitive: indices, or vertices where it has none. */
uint64_t strl__gltf_element_count(const strl__gltf *gltf, const strl__gltf_primitive *primitive);
uint64_t strl__gltf_triangle_count(unsigned mode, uint64_t elements);

/* ---- gltf_range.c */
/* Which of its vertices the placement that begins has to load: those from its lowest to its highest
 * index, unless that is far more than it has corners. So the work is in proportion to triangles,
 * whatever the accessor counts: many exporters give all primitives the vertices of the model. */
strl_status strl__gltf_find_range(strl__gltf *gltf, strl__gltf_primitive *primitive, uint64_t elements,
                                  strl_error *err);

/* ---- gltf_primitive.c: triangles */
/* Indices of the primitive's vertices, of a Draco mesh from `first`, a multiple of 3, as many. */
strl_status strl__gltf_read_elements(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t first,
                                     size_t count, uint32_t *elements, strl_error *err);
/* The reader's table of vertices, with its layout but no vertex. */
void strl__gltf_empty_table(strl_reader *reader);
/* Begins the placement that pass stands at. */
strl_status strl__gltf_begin_placement(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err);
/* Adds its triangles to the batch until that is full or there are no more. */
strl_status strl__gltf_add_triangles(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err);

unsigned strl__gltf_mode_of(const strl__gltf_primitive *primitive); /* as its elements stand */
/* Of a vertex attribute into gltf->values, count <= STRL__GLTF_CHUNK. */
strl_status strl__gltf_read_attribute(strl__gltf *gltf, uint32_t accessor, bool normalized, uint32_t draco_id,
                                      uint64_t first, size_t count, strl_error *err);
/* Where the corners of a triangle stand, from the one where it begins; a fan's first is apart. */
#define STRL__GLTF_FAN_CENTRE UINT32_MAX
void strl__gltf_corners_of(unsigned mode, uint64_t triangle, size_t at, uint32_t slots[3]);

/* ---- gltf_map.c: images, textures and samplers. What of them cannot be understood is as if the
 * image could not be used. */
strl_status strl__gltf_parse_map(strl__gltf *gltf, strl__fields *fields, const json_t *value);
strl_status strl__gltf_parse_sampler(strl__gltf *gltf, strl__fields *fields, const json_t *value);
strl_status strl__gltf_parse_image(strl__gltf *gltf, strl__fields *fields, const json_t *value);
/* The texture of a material, where it has one; info is its member in the JSON. */
void strl__gltf_parse_map_use(const char *path, strl__gltf_material *material, const json_t *info);
/* The materials' textures into the reader's; after parsing. */
strl_status strl__gltf_link_maps(strl__gltf *gltf, strl_error *err);
/* For the reader's textures; context: the strl__gltf. */
strl_status strl__gltf_open_picture(void *context, const strl__picture *picture, const char *ending,
                                    strl__picture_place *found, strl_error *err);
/* The accessor of the coordinates at which a primitive shows its material's image; STRL__NO_ITEM:
 * none. */
uint32_t strl__gltf_texcoord(const strl__gltf *gltf, const strl__gltf_primitive *primitive);

/* ---- gltf_paint.c: vertices under an image */
/* Sets paint for a placement that is about to be read: its image, and what each vertex stands for
 * of it. */
strl_status strl__gltf_begin_paint(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err);
void strl__gltf_end_paint(strl__gltf *gltf); /* gives back what it holds */
/* Texture coordinates and, where there is an image, it times gltf->tints, for vertices first.. into
 * corners. */
strl_status strl__gltf_paint_corners(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t first,
                                     size_t count, strl__corner *corners, strl_error *err);

#endif
