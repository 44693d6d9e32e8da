/* Parts as OBJ: an object for each part, named by its groups' names and its own, and the materials in a file beside it.
 * Coordinates are in metres with five digits, y up. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "scenes/parts/writer.h"
#include "scenes/stream.h"

enum { LINE_MOST = 512, POSITION_DIGITS = 5, NORMAL_DIGITS = 4, ENDING = 4 };

typedef struct obj_writer {
    strl__parts_writer base;
    strl__parts_desc desc;
    strl_output *obj, *mtl;
    strl__stream text;
    char *mtl_path; /* owned */
    strl__group_stack groups;
} obj_writer;

/* ---- text ---- */

/* A number with a fixed count of digits behind the point, without the C library's locale; at most 24 characters. */
static char *put_number(char *to, double value, int digits)
{
    static const int64_t scales[] = {1, 10, 100, 1000, 10000, 100000};
    char reversed[24];
    int64_t number = llrint(value * (double)scales[digits]);
    int count = 0;
    if (number < 0)
        *to++ = '-';
    number = number < 0 ? -number : number;
    while (number > 0 || count < digits + 2) {
        reversed[count++] = (char)('0' + number % 10);
        number /= 10;
        if (count == digits)
            reversed[count++] = '.';
    }
    while (count > 0)
        *to++ = reversed[--count];
    return to;
}

static char *put_index(char *to, uint64_t index)
{
    char reversed[24];
    int count = 0;
    do
        reversed[count++] = (char)('0' + index % 10);
    while (index /= 10);
    while (count > 0)
        *to++ = reversed[--count];
    return to;
}

static strl_status put_triple(strl__stream *text, const char *what, const double value[3], int digits, strl_error *err)
{
    strl_status status = strl__stream_reserve(text, LINE_MOST, err);
    if (status != STRL_OK)
        return status;
    char *start = (char *)text->buffer + text->used, *to = start;
    while (*what)
        *to++ = *what++;
    for (int k = 0; k < 3; k++) {
        *to++ = ' ';
        to = put_number(to, value[k], digits);
    }
    *to++ = '\n';
    text->used += (size_t)(to - start);
    return STRL_OK;
}

static strl_status put_face(strl__stream *text, const uint64_t corners[3], bool normals, strl_error *err)
{
    strl_status status = strl__stream_reserve(text, LINE_MOST, err);
    if (status != STRL_OK)
        return status;
    char *start = (char *)text->buffer + text->used, *to = start;
    *to++ = 'f';
    for (int k = 0; k < 3; k++) {
        *to++ = ' ';
        to = put_index(to, corners[k]);
        if (normals) {
            *to++ = '/';
            *to++ = '/';
            to = put_index(to, corners[k]);
        }
    }
    *to++ = '\n';
    text->used += (size_t)(to - start);
    return STRL_OK;
}

static strl_status put_text(strl__stream *text, const char *line, strl_error *err)
{
    return strl__stream_write(text, line, strlen(line), err);
}

/* ---- groups and parts ---- */

static strl_status open_group(strl__parts_writer *base, const char *name, const strl__affine *place, strl_error *err)
{
    return strl__group_stack_push(&((obj_writer *)base)->groups, name, place, err);
}

static strl_status close_group(strl__parts_writer *base, strl_error *err)
{
    (void)err;
    strl__group_stack_pop(&((obj_writer *)base)->groups);
    return STRL_OK;
}

/* The outermost group is the model itself and is left out of names. */
static strl_status put_head(obj_writer *self, const strl__part *part, strl_error *err)
{
    char line[LINE_MOST];
    int used = snprintf(line, sizeof line, "o ");
    for (int i = 1; i < self->groups.depth; i++)
        used += snprintf(line + used, sizeof line - (size_t)used, "%s/", self->groups.names[i]);
    snprintf(line + used, sizeof line - (size_t)used, "%s\nusemtl %s\n", part->name,
             self->desc.materials[part->material].name);
    return put_text(&self->text, line, err);
}

static strl_status put_vertices(obj_writer *self, const strl__part_mesh *mesh, const strl__affine *world,
                                strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && i < mesh->vertex_count; i++) {
        double position[3], normal[3];
        strl__part_vertex_in_world(mesh, i, world, position, normal);
        status = put_triple(&self->text, "v", position, POSITION_DIGITS, err);
        if (status == STRL_OK && !self->desc.no_normals)
            status = put_triple(&self->text, "vn", normal, NORMAL_DIGITS, err);
    }
    return status;
}

static strl_status put_part(strl__parts_writer *base, const strl__part *part, strl_error *err)
{
    obj_writer *self = (obj_writer *)base;
    const strl__part_mesh *mesh = part->mesh;
    const strl__affine world = strl__affine_of(&self->groups.world[self->groups.depth - 1], &part->place);
    bool mirrored = strl__affine_determinant(&world) < 0;
    strl_status status = put_head(self, part, err);
    if (status == STRL_OK)
        status = put_vertices(self, mesh, &world, err);
    for (uint32_t i = 0; status == STRL_OK && i < mesh->triangle_count; i++) {
        const uint32_t *from = mesh->corners + 3 * (size_t)i;
        uint64_t first = base->vertices + 1;
        const uint64_t corners[3] = {first + from[0], first + from[mirrored ? 2 : 1], first + from[mirrored ? 1 : 2]};
        status = put_face(&self->text, corners, !self->desc.no_normals, err);
    }
    base->vertices += mesh->vertex_count;
    base->triangles += mesh->triangle_count;
    base->parts++;
    return status;
}

/* ---- the files ---- */

static strl_status write_materials(obj_writer *self, strl_error *err)
{
    char line[LINE_MOST];
    uint64_t offset = 0;
    strl_status status = STRL_OK;
    for (unsigned i = 0; status == STRL_OK && i < self->desc.material_count; i++) {
        const strl__material *material = &self->desc.materials[i];
        char *to = line + snprintf(line, sizeof line, "newmtl %s\nKd", material->name);
        for (int k = 0; k < 3; k++) {
            *to++ = ' ';
            to = put_number(to, material->srgb[k] / 255.0, 4);
        }
        to = put_number(to + snprintf(to, 16, "\nd "), material->alpha, 2);
        *to++ = '\n';
        status = strl_file_write(strl_output_file(self->mtl), offset, line, (size_t)(to - line), err);
        offset += (uint64_t)(to - line);
    }
    return status;
}

static strl_status finish(strl__parts_writer *base, strl_output_report report, void *context, strl_error *err)
{
    (void)report;
    (void)context;
    obj_writer *self = (obj_writer *)base;
    strl_status status = strl__stream_flush(&self->text, err);
    if (status == STRL_OK)
        status = write_materials(self, err);
    if (status == STRL_OK)
        base->bytes = strl_file_bytes(strl_output_file(self->obj)) + strl_file_bytes(strl_output_file(self->mtl));
    if (status == STRL_OK)
        status = strl_output_finish(self->mtl, false, err);
    return status == STRL_OK ? strl_output_finish(self->obj, false, err) : status;
}

static void destroy(strl__parts_writer *base)
{
    obj_writer *self = (obj_writer *)base;
    strl_output_close(self->obj);
    strl_output_close(self->mtl);
    strl__stream_deinit(&self->text);
    strl__free(self->mtl_path);
    strl__free(self);
}

static strl_status open_files(obj_writer *self, strl_error *err)
{
    strl_status status = strl_output_open(self->desc.path, NULL, &self->obj, err);
    if (status == STRL_OK)
        status = strl_output_open(self->mtl_path, NULL, &self->mtl, err);
    if (status == STRL_OK)
        status = strl__stream_init(&self->text, self->desc.path, err);
    if (status != STRL_OK)
        return status;
    self->text.file = strl_output_file(self->obj);
    status = put_text(&self->text, "# made by stroll scene; metres, y up\nmtllib ", err);
    if (status == STRL_OK)
        status = put_text(&self->text, strl__path_name(self->mtl_path), err);
    return status == STRL_OK ? put_text(&self->text, "\n", err) : status;
}

strl_status strl__obj_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err)
{
    *writer = NULL;
    obj_writer *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the writer", desc->path);
    *self = (obj_writer){
        .base = {open_group, put_part, close_group, strl__parts_write_out, finish, destroy, 0, 0, 0, 0},
        .desc = *desc,
        .mtl_path = strl__path_sibling(desc->path, ENDING, ".mtl"),
    };
    strl_status status = self->mtl_path ? open_files(self, err)
                                        : strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a path", desc->path);
    if (status != STRL_OK) {
        destroy(&self->base);
        return status;
    }
    *writer = &self->base;
    return STRL_OK;
}
