/* See writer.h. */
#include "scenes/parts/writer.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/fail.h"
#include "base/memory.h"

bool strl__path_ends_in(const char *path, const char *ending)
{
    size_t length = strlen(path), own = strlen(ending);
    return length > own && strcasecmp(path + length - own, ending) == 0;
}

char *strl__path_sibling(const char *path, size_t cut, const char *ending)
{
    size_t kept = strlen(path) - cut, own = strlen(ending);
    char *made = strl__alloc(kept + own + 1, 1);
    if (!made)
        return NULL;
    memcpy(made, path, kept);
    memcpy(made + kept, ending, own + 1);
    return made;
}

const char *strl__path_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

strl_status strl__parts_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err)
{
    *writer = NULL;
    bool gltf = strl__path_ends_in(desc->path, ".gltf"), obj = strl__path_ends_in(desc->path, ".obj");
    if ((gltf || obj) && desc->shuffle)
        return strl__fail(err, STRL_ERR_ARGUMENT,
                          "%s: only PLY and STL are written in a random order, parts keep their triangles", desc->path);
    if (gltf)
        return strl__gltf_writer_create(desc, writer, err);
    if (obj)
        return strl__obj_writer_create(desc, writer, err);
    if (strl__path_ends_in(desc->path, ".ply") || strl__path_ends_in(desc->path, ".stl"))
        return strl__plain_writer_create(desc, writer, err);
    strl_status status = strl_output_check(desc->path, err); /* no file at all is worse than a wrong ending */
    if (status != STRL_OK)
        return status;
    return strl__fail(err, STRL_ERR_ARGUMENT,
                      "%s: this scene is written as glTF, OBJ, PLY or STL, expected a name that ends in .gltf, .obj, "
                      ".ply or .stl",
                      desc->path);
}

strl__affine strl__copy_place(const strl__copy *copy)
{
    const double x = (double)copy->turn[0], y = (double)copy->turn[1], z = (double)copy->turn[2],
                 w = (double)copy->turn[3];
    const double s = 2 / (x * x + y * y + z * z + w * w), scale = (double)copy->scale;
    strl__affine place = {.axis = {{1 - s * (y * y + z * z), s * (x * y + z * w), s * (x * z - y * w)},
                                   {s * (x * y - z * w), 1 - s * (x * x + z * z), s * (y * z + x * w)},
                                   {s * (x * z + y * w), s * (y * z - x * w), 1 - s * (x * x + y * y)}}};
    for (int i = 0; i < 3; i++) {
        place.origin[i] = (double)copy->move[i];
        for (int k = 0; k < 3; k++)
            place.axis[i][k] *= scale;
    }
    return place;
}

strl__copy strl__copy_upright(const double move[3], double turns, double scale)
{
    double c, s;
    strl__circle(turns / 2, &c, &s);
    return (strl__copy){{(float)move[0], (float)move[1], (float)move[2]}, {0, 0, (float)s, (float)c}, (float)scale};
}

strl_status strl__parts_write_out(strl__parts_writer *self, const strl__part *part, const strl__copy *copies,
                                  uint32_t count, strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; i < count && status == STRL_OK; i++) {
        strl__part one = *part;
        one.place = strl__copy_place(&copies[i]);
        status = self->put_part(self, &one, err);
    }
    return status;
}

strl_status strl__group_stack_push(strl__group_stack *stack, const char *name, const strl__affine *place,
                                   strl_error *err)
{
    if (stack->depth == STRL__GROUP_DEPTH_MOST)
        return strl__fail(err, STRL_ERR_INTERNAL, "group %s lies in more than %d others", name, STRL__GROUP_DEPTH_MOST);
    stack->world[stack->depth] = stack->depth ? strl__affine_of(&stack->world[stack->depth - 1], place) : *place;
    snprintf(stack->names[stack->depth], STRL__PART_NAME_BYTES, "%s", name);
    stack->depth++;
    return STRL_OK;
}

void strl__group_stack_pop(strl__group_stack *stack)
{
    stack->depth--;
}
