/* What a walk and a renderer share: camera and draw list. Types only. */
#ifndef STROLL_FRAME_H
#define STROLL_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A pinhole camera (fov_y_deg > 0) or an orthographic one (fov_y_deg = 0, ortho_height > 0). World units. */
typedef struct strl_camera {
    double eye[3];
    double target[3];       /* looked at; differs from eye */
    double up[3];           /* not parallel to the view direction; need not be orthogonal or unit */
    double fov_y_deg;       /* full vertical angle, below 180 */
    double ortho_height;    /* world units over the height of the image */
    uint32_t width, height; /* pixels of the output: what a pixel error counts in */
} strl_camera;

/* How far the faces that a splat stands for differ in direction, in normal[0] of its vertex: 0 = they are parallel, to
 * STRL_SPREAD_MOST = any direction. Light falls on what is spread more evenly than on a face of the mean normal. */
#define STRL_SPREAD_SHIFT 10
#define STRL_SPREAD_MOST 63u

/* A vertex as the GPU reads it: 20 bytes. */
typedef struct strl_vertex {
    int32_t position[3]; /* lattice units from the item's anchor; see strl_positions */
    /* octahedral, 0..1023 each; of splats the bits of normal[0] above these ten are their spread */
    uint16_t normal[2];
    uint8_t rgba[4]; /* vertex colour x material colour, sRGB-encoded */
} strl_vertex;

/* What a vertex belongs to: indices into the container's tables of names. All corners of a triangle mostly agree. */
typedef struct strl_vertex_label {
    uint32_t part, material;
    uint16_t texcoord[2]; /* codes over the range of the material's image (stroll/container.h); 0 where it has none */
} strl_vertex_label;

/* Which faces are not to be seen. */
typedef enum strl_cull {
    STRL_CULL_NONE = 0, /* both sides of each face are drawn */
    STRL_CULL_BACK /* a face is drawn only where its corners come counter-clockwise as seen from the eye, as the input
                      has them; a placement that mirrors does not turn faces round. For models whose backs nobody sees:
                      closed ones */
} strl_cull;

/* What strl_vertex.position holds. A walk gives lattice positions only; floats are for triangles drawn as read. */
typedef enum strl_positions {
    STRL_POSITIONS_LATTICE = 0,
    /* the bits of three floats, model units from the item's origin; anchor, box and step are unused */
    STRL_POSITIONS_FLOAT
} strl_positions;

/* One active node of one placement. All pointers are borrowed from the walk until its next frame. */
typedef struct strl_draw_item {
    /* (node, load): equal keys have equal vertices, in one list also equal indices: all placements of a node share
     * what is on the GPU, and each draws its part of it */
    uint64_t key;
    uint32_t placement, node, level, group;
    uint32_t state; /* refinement step of the indices, which are a function of (key, state) */
    bool visible;   /* intersects the view frustum (and is not known to be hidden) */
    const strl_vertex *vertices;
    const strl_vertex_label *labels; /* [vertex_count]; NULL where the walk was not asked for them */
    /* part + 1 that the whole placement is; labels then say the part of what is placed; 0: labels alone do */
    uint32_t own_part;
    uint32_t vertex_count;
    const uint16_t *indices; /* [index_count] what belongs onto the GPU */
    uint32_t index_count;
    /* indices to draw, three a triangle: all of them, or, of a node that several placements draw, what this one
     * needs */
    uint32_t draw_first, draw_count;
    /* indices that may differ from the list of frame - 1, where key is in that one */
    uint32_t dirty_first, dirty_count;
    /* > 0: the vertices that indices name are drawn as squares of so many pixels of the output, which the alpha of
     * their colour thins out: splats. 0: triangles */
    float point_px;
    strl_positions positions;
    int64_t anchor[3];              /* lattice */
    int64_t box_min[3], box_max[3]; /* lattice */
    double origin[3], step;         /* lattice cell c is the model point origin + step * c */
    double transform[12];           /* model to world, row-major 3x4 */
    float error;                    /* claimed error of this state, model units */
    float error_px;                 /* the same in pixels */
} strl_draw_item;

typedef struct strl_draw_list {
    const strl_draw_item *items;
    uint32_t count;
    double near_distance, far_distance; /* of the visible boxes along the view direction; > 0 */
    strl_cull cull;                     /* to be obeyed: what the list leaves out may show nothing but backs */
    uint64_t frame; /* counts the lists of one walk from 1; 0 = unknown: dirty ranges are then not used */
} strl_draw_list;

#ifdef __cplusplus
}
#endif
#endif
