/* Writes a tree of named parts, one after the other, to one of several formats: glTF and OBJ keep names, materials and
 * (glTF) placements; PLY and STL keep the triangles, in the world's place. Order of calls: the outermost group is
 * opened, holds groups and parts, and is closed; then finish. destroy always; without finish it removes everything. */
#ifndef STRL_SCENES_PARTS_WRITER_H
#define STRL_SCENES_PARTS_WRITER_H

#include <stdbool.h>
#include <stdint.h>

#include "platform/output.h"
#include "scenes/parts/part_mesh.h"

enum { STRL__GROUP_DEPTH_MOST = 6, STRL__PART_NAME_BYTES = 48 };

/* linear is srgb in linear light. */
typedef struct strl__material {
    const char *name;
    uint8_t srgb[3];
    double linear[3];
    double alpha, metallic, roughness;
} strl__material;

typedef struct strl__part {
    const char *name; /* letters, digits, - and _; below STRL__PART_NAME_BYTES */
    unsigned material;
    strl__affine place; /* in its group */
    const strl__part_mesh *mesh;
} strl__part;

/* Where a copy of a part is: turned by a quaternion, stretched alike in all directions, moved. As floats, which is how
 * glTF has them: files that write copies out have them in the same place. */
typedef struct strl__copy {
    float move[3], turn[4], scale;
} strl__copy;

strl__affine strl__copy_place(const strl__copy *copy);
/* About the axis z of the group, by a part of a full turn. */
strl__copy strl__copy_upright(const double move[3], double turns, double scale);

typedef struct strl__parts_desc {
    const char *path;                /* borrowed, must stay */
    const strl__material *materials; /* borrowed, must stay */
    unsigned material_count;
    bool no_normals;
    bool shuffle; /* PLY and STL alone */
    uint64_t seed;
    uint64_t memory_bytes; /* of shuffling */
    uint64_t buffer_bytes; /* most bytes of one .bin of glTF */
} strl__parts_desc;

typedef struct strl__parts_writer strl__parts_writer;
struct strl__parts_writer {
    /* The place of the outermost group turns z up into y up; formats that are z up leave it out. */
    strl_status (*open_group)(strl__parts_writer *self, const char *name, const strl__affine *place, strl_error *err);
    strl_status (*put_part)(strl__parts_writer *self, const strl__part *part, strl_error *err);
    strl_status (*close_group)(strl__parts_writer *self, strl_error *err);
    /* The part as often as there are copies; its own place counts for nothing. glTF gets the mesh once, however many
     * calls there are for it: it must stay as it is until finish. Others write copies out. */
    strl_status (*put_copies)(strl__parts_writer *self, const strl__part *part, const strl__copy *copies,
                              uint32_t count, strl_error *err);
    strl_status (*finish)(strl__parts_writer *self, strl_output_report report, void *context, strl_error *err);
    void (*destroy)(strl__parts_writer *self);
    uint64_t vertices, triangles, parts; /* each copy counts */
    uint64_t bytes;                      /* of all files, once finished */
};

/* put_copies of formats without it. */
strl_status strl__parts_write_out(strl__parts_writer *self, const strl__part *part, const strl__copy *copies,
                                  uint32_t count, strl_error *err);

/* By the path's ending: .gltf, .obj, .ply or .stl. */
strl_status strl__parts_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err);
/* One each, of a path with the right ending. */
strl_status strl__gltf_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err);
strl_status strl__obj_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err);
strl_status strl__plain_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err);

bool strl__path_ends_in(const char *path, const char *ending); /* and is longer; in any case of letters */
/* path with its last `cut` characters replaced by the ending; owned (strl__free), NULL without memory. */
char *strl__path_sibling(const char *path, size_t cut, const char *ending);
const char *strl__path_name(const char *path); /* behind the last slash; borrowed */

/* Groups that are open, for formats that know the world alone. Depth 0 is the outermost. */
typedef struct strl__group_stack {
    int depth;
    strl__affine world[STRL__GROUP_DEPTH_MOST];
    char names[STRL__GROUP_DEPTH_MOST][STRL__PART_NAME_BYTES];
} strl__group_stack;

strl_status strl__group_stack_push(strl__group_stack *stack, const char *name, const strl__affine *place,
                                   strl_error *err);
void strl__group_stack_pop(strl__group_stack *stack);

#endif
