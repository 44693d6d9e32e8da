/* What a container (one .stroll file) says of its model: facts, names, placements. Every call here but
 * those that only look may wait for the source: for opening, for tools and for a click of the mouse, never
 * inside a frame. docs/format.md is the format. One thread at a time. */
#ifndef STROLL_CONTAINER_H
#define STROLL_CONTAINER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"
#include "stroll/source.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_container_info {
    uint32_t version;     /* of the format */
    uint8_t model_id[16]; /* from the content: equal for equal input and options */
    uint64_t file_bytes;
    char unit[16];    /* "m", "mm", ..., "" = unknown */
    uint32_t up_axis; /* 0 x, 1 y, 2 z; stored, never applied */
    bool has_colour;  /* some vertex or material is not white */
    bool has_images;  /* some material names an image; vertices then have texture coordinates */
    double bounds[6]; /* of all placements, world units: min xyz, max xyz, as the writer found them */
    uint32_t tree_count, part_count, material_count;
    uint64_t placement_count;
    uint64_t triangles_in; /* triangles that the readers announced */
    uint64_t dropped_nonfinite, dropped_degenerate, dropped_lines, dropped_points;
    uint64_t closed_hint; /* 1 where the input is watertight (every edge in an even number of triangles) */
} strl_container_info;

/* A tree in the world. */
typedef struct strl_placement {
    uint32_t tree;
    uint32_t own_part; /* part + 1 that all of it is, such as a pump among many; 0: parts are those of its vertices */
    double transform[12]; /* model to world, row-major affine 3x4 */
} strl_placement;

typedef enum strl_wrap { STRL_WRAP_REPEAT, STRL_WRAP_CLAMP, STRL_WRAP_MIRROR } strl_wrap;

#define STRL_TEXCOORD_MOST 65535 /* of a code */

/* The image of a material. Its colours are in the vertices already, as far as it could be read; who draws it instead
 * takes the material's colour in place of the vertices'. A vertex's coordinate is texcoord_min + code /
 * STRL_TEXCOORD_MOST * texcoord_extent: u to the right and v down from the image's upper left corner, 1 = all of it. */
typedef struct strl_material_image {
    /* as the model names it: a URI or path beside the model; "images[3] (NAME)" where it is inside of the model's
     * file; NULL = the material has none */
    const char *reference;
    strl_wrap wrap[2]; /* of u, of v */
    float texcoord_min[2], texcoord_extent[2];
} strl_material_image;

typedef struct strl_container strl_container;

/* Reads at most 128 KiB. Owns the source from then on, also on failure. Fails with STRL_ERR_FORMAT where it
 * is no container or a broken one, with STRL_ERR_UNSUPPORTED where its version is another. */
STRL_API strl_status strl_container_open(strl_source *source, strl_container **container, strl_error *err);
/* A path, opened as a file source with inline reads. */
STRL_API strl_status strl_container_open_path(const char *path, strl_container **container, strl_error *err);
STRL_API void strl_container_close(strl_container *container); /* NULL is legal */

STRL_API const strl_container_info *strl_container_get_info(const strl_container *container); /* borrowed */
/* Of the finest level, over all trees; each counts once, however often it is placed. */
STRL_API uint64_t strl_container_triangle_count(const strl_container *container);

/* index < placement_count; transforms are finite. */
STRL_API strl_status strl_container_placement(strl_container *container, uint64_t index, strl_placement *placement,
                                              strl_error *err);
/* Copies the name of part < part_count (cut to fit size >= 1 bytes, UTF-8, zero-terminated). */
STRL_API strl_status strl_container_part(strl_container *container, uint32_t part, char *name, size_t size,
                                         strl_error *err);
/* The same of material < material_count; *rgba: its colour, sRGB-encoded, R lowest byte. */
STRL_API strl_status strl_container_material(strl_container *container, uint32_t material, char *name, size_t size,
                                             uint32_t *rgba, strl_error *err);

/* The image of material < material_count. reference takes its name as above, cut to fit; image->reference is that, or
 * NULL. */
STRL_API strl_status strl_container_material_image(strl_container *container, uint32_t material, char *reference,
                                                   size_t size, strl_material_image *image, strl_error *err);

/* Which part and material each vertex of a draw item is of: placement, node and vertex_count are the
 * item's. parts and materials take vertex_count numbers each; NULL is legal. The three corners of a
 * triangle may be of different parts only where simplification has merged these; the first stands for it.
 * Reads and decodes the node anew, and those above it where it is told by them, in memory of the
 * container's own. */
STRL_API strl_status strl_container_vertex_parts(strl_container *container, uint32_t placement, uint32_t node,
                                                 uint32_t vertex_count, uint32_t *parts, uint32_t *materials,
                                                 strl_error *err);

/* In the same way the texture coordinates, as codes over the range of the image of the vertex's material; 0 where that
 * has none. */
STRL_API strl_status strl_container_vertex_texcoords(strl_container *container, uint32_t placement, uint32_t node,
                                                     uint32_t vertex_count, uint16_t (*texcoords)[2], strl_error *err);

#ifdef __cplusplus
}
#endif
#endif
