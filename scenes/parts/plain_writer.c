/* Parts as one PLY or STL file: triangles in the world's place, z up, without names. */
#include "base/fail.h"
#include "base/memory.h"
#include "scenes/parts/writer.h"
#include "scenes/scene_mesh.h"

typedef struct plain_writer {
    strl__parts_writer base;
    strl__scene_mesh *mesh;
    strl__group_stack groups;
    bool no_normals;
} plain_writer;

enum { VERTEX_BATCH = 256, TRIANGLE_BATCH = 256 };

static strl_status open_group(strl__parts_writer *base, const char *name, const strl__affine *place, strl_error *err)
{
    plain_writer *self = (plain_writer *)base;
    const strl__affine upright = strl__affine_identity();
    return strl__group_stack_push(&self->groups, name, self->groups.depth ? place : &upright, err);
}

static strl_status close_group(strl__parts_writer *base, strl_error *err)
{
    (void)err;
    strl__group_stack_pop(&((plain_writer *)base)->groups);
    return STRL_OK;
}

static strl_status put_vertices(plain_writer *self, const strl__part_mesh *mesh, const strl__affine *world,
                                strl_error *err)
{
    float records[VERTEX_BATCH * STRL__PART_VERTEX_FLOATS], *to = records;
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && i < mesh->vertex_count; i++) {
        double position[3], normal[3];
        strl__part_vertex_in_world(mesh, i, world, position, normal);
        for (int k = 0; k < 3; k++)
            *to++ = (float)position[k];
        for (int k = 0; k < 3 && !self->no_normals; k++)
            *to++ = (float)normal[k];
        if ((i + 1) % VERTEX_BATCH == 0 || i + 1 == mesh->vertex_count) {
            status = strl__scene_mesh_vertices(self->mesh, records, i % VERTEX_BATCH + 1, err);
            to = records;
        }
    }
    return status;
}

static strl_status put_triangles(plain_writer *self, const strl__part_mesh *mesh, uint32_t first, bool mirrored,
                                 strl_error *err)
{
    uint32_t corners[TRIANGLE_BATCH * 3];
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && i < mesh->triangle_count; i += TRIANGLE_BATCH) {
        uint32_t left = mesh->triangle_count - i, count = left < TRIANGLE_BATCH ? left : TRIANGLE_BATCH;
        for (uint32_t k = 0; k < count; k++) {
            const uint32_t *from = mesh->corners + 3 * (size_t)(i + k);
            corners[3 * k] = first + from[0];
            corners[3 * k + 1] = first + from[mirrored ? 2 : 1];
            corners[3 * k + 2] = first + from[mirrored ? 1 : 2];
        }
        status = strl__scene_mesh_triangles(self->mesh, corners, count, err);
    }
    return status;
}

static strl_status put_part(strl__parts_writer *base, const strl__part *part, strl_error *err)
{
    plain_writer *self = (plain_writer *)base;
    const strl__affine world = strl__affine_of(&self->groups.world[self->groups.depth - 1], &part->place);
    uint32_t first = (uint32_t)strl__scene_mesh_vertex_count(self->mesh);
    strl_status status = put_vertices(self, part->mesh, &world, err);
    if (status == STRL_OK)
        status = put_triangles(self, part->mesh, first, strl__affine_determinant(&world) < 0, err);
    base->vertices += part->mesh->vertex_count;
    base->triangles += part->mesh->triangle_count;
    base->parts++;
    return status;
}

static strl_status finish(strl__parts_writer *base, strl_output_report report, void *context, strl_error *err)
{
    return strl__scene_mesh_finish(((plain_writer *)base)->mesh, report, context, &base->bytes, err);
}

static void destroy(strl__parts_writer *base)
{
    strl__scene_mesh_destroy(((plain_writer *)base)->mesh);
    strl__free(base);
}

strl_status strl__plain_writer_create(const strl__parts_desc *desc, strl__parts_writer **writer, strl_error *err)
{
    *writer = NULL;
    plain_writer *self = strl__alloc_zero(1, sizeof *self);
    if (!self)
        return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for the writer", desc->path);
    self->base =
        (strl__parts_writer){open_group, put_part, close_group, strl__parts_write_out, finish, destroy, 0, 0, 0, 0};
    self->no_normals = desc->no_normals;
    const strl__scene_mesh_desc mesh = {.path = desc->path,
                                        .layout = desc->no_normals ? STRL__SCENE_MESH_POSITION
                                                                   : STRL__SCENE_MESH_POSITION_NORMAL,
                                        .shuffle = desc->shuffle,
                                        .seed = desc->seed,
                                        .memory_bytes = desc->memory_bytes};
    strl_status status = strl__scene_mesh_create(&mesh, &self->mesh, err);
    if (status != STRL_OK) {
        destroy(&self->base);
        return status;
    }
    *writer = &self->base;
    return STRL_OK;
}
