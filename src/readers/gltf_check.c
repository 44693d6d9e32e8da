/* What the drawn nodes use, checked once before anything is read: so that the number of triangles
 * is known and a broken file is refused at once. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"

#define TYPE(scalar) (1u << (scalar))

/* What an accessor may be in one place. */
typedef struct expectation {
    const char *name;
    unsigned components, more_components; /* either */
    unsigned types;                       /* one bit each */
    const char *sentence;
} expectation;

static const expectation expected_position = {
    "POSITION", 3, 3, TYPE(STRL__F32) | TYPE(STRL__I8) | TYPE(STRL__U8) | TYPE(STRL__I16) | TYPE(STRL__U16),
    "three floats, bytes or shorts"};
static const expectation expected_normal = {"NORMAL", 3, 3, TYPE(STRL__F32) | TYPE(STRL__I8) | TYPE(STRL__I16),
                                            "three floats, signed bytes or shorts"};
static const expectation expected_colour = {"COLOR_0", 3, 4, TYPE(STRL__F32) | TYPE(STRL__U8) | TYPE(STRL__U16),
                                            "three or four floats, unsigned bytes or shorts"};
static const expectation expected_texcoord = {
    "TEXCOORD", 2, 2, TYPE(STRL__F32) | TYPE(STRL__I8) | TYPE(STRL__U8) | TYPE(STRL__I16) | TYPE(STRL__U16),
    "two floats, bytes or shorts"};
static const expectation expected_indices = {"indices", 1, 1, TYPE(STRL__U8) | TYPE(STRL__U16) | TYPE(STRL__U32),
                                             "unsigned integers"};
static const expectation expected_translation = {"TRANSLATION", 3, 3, TYPE(STRL__F32), "three floats"};
static const expectation expected_rotation = {"ROTATION", 4, 4, TYPE(STRL__F32) | TYPE(STRL__I8) | TYPE(STRL__I16),
                                              "four floats, signed bytes or shorts"};
static const expectation expected_scale = {"SCALE", 3, 3, TYPE(STRL__F32), "three floats"};

strl_status strl__gltf_fail_index(const strl__gltf *gltf, const char *where, const char *list, size_t count,
                                  uint32_t found, strl_error *err)
{
    const char *path = gltf->reader->path;
    if (count == 0)
        return strl__fail(err, STRL_ERR_FORMAT, "%s%s: expected no index of %s, of which there are none, found %u",
                          path, where, list, found);
    return strl__fail(err, STRL_ERR_FORMAT, "%s%s: expected an index of %s from 0 to %zu, found %u", path, where, list,
                      count - 1, found);
}

/* The kind of an accessor, not its bytes. */
static strl_status check_kind(const strl__gltf *gltf, uint32_t index, const expectation *expected, strl_error *err)
{
    const char *path = gltf->reader->path;
    char where[32];
    snprintf(where, sizeof where, ", %s", expected->name);
    if (index >= gltf->accessor_count)
        return strl__gltf_fail_index(gltf, where, "accessors", gltf->accessor_count, index, err);
    const strl__gltf_column *column = &gltf->accessors[index].values;
    if ((column->components == expected->components || column->components == expected->more_components) &&
        expected->types >> column->type & 1)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT, "%s, accessors[%u]: expected %s as %s, found others", path, index,
                      expected->sentence, expected->name);
}

static strl_status check_use(strl__gltf *gltf, uint32_t index, const expectation *expected, bool is_compressed,
                             strl_error *err)
{
    strl_status status = check_kind(gltf, index, expected, err);
    if (!status && !is_compressed)
        status = strl__gltf_check_accessor(gltf, index, err);
    return status;
}

static strl_status count_fail(const strl__gltf *gltf, const strl__gltf_primitive *primitive, uint32_t index,
                              const expectation *expected, strl_error *err)
{
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%s, accessors[%u]: expected %" PRIu64 " elements of %s, as many as POSITION "
                      "has, found %" PRIu64,
                      gltf->reader->path, index, gltf->accessors[primitive->position].count, expected->name,
                      gltf->accessors[index].count);
}

/* NORMAL and COLOR_0 follow POSITION. */
static strl_status check_companion(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint32_t index,
                                   const expectation *expected, bool is_compressed, strl_error *err)
{
    if (index == STRL__NO_ITEM)
        return STRL_OK;
    strl_status status = check_use(gltf, index, expected, is_compressed, err);
    if (status)
        return status;
    if (gltf->accessors[index].count >= gltf->accessors[primitive->position].count)
        return STRL_OK;
    return count_fail(gltf, primitive, index, expected, err);
}

/* Where the material has an image. Integers may stand for themselves (KHR_mesh_quantization). */
static strl_status check_texcoord(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    const uint32_t index = strl__gltf_texcoord(gltf, primitive);
    if (index == STRL__NO_ITEM)
        return STRL_OK;
    const strl__gltf_draco_use *draco = primitive->draco;
    const uint32_t set = gltf->materials[primitive->material].set;
    strl_status status =
        check_use(gltf, index, &expected_texcoord, draco && draco->texcoord[set] != STRL__NO_ITEM, err);
    if (status || gltf->accessors[index].count >= gltf->accessors[primitive->position].count)
        return status;
    return count_fail(gltf, primitive, index, &expected_texcoord, err);
}

static strl_status check_triangles(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    const strl__gltf_draco_use *draco = primitive->draco;
    strl_status status =
        check_use(gltf, primitive->position, &expected_position, draco && draco->position != STRL__NO_ITEM, err);
    if (!status)
        status = check_companion(gltf, primitive, primitive->normal, &expected_normal,
                                 draco && draco->normal != STRL__NO_ITEM, err);
    if (!status)
        status = check_companion(gltf, primitive, primitive->colour, &expected_colour,
                                 draco && draco->colour != STRL__NO_ITEM, err);
    if (!status)
        status = check_texcoord(gltf, primitive, err);
    if (!status && primitive->indices != STRL__NO_ITEM)
        status = check_use(gltf, primitive->indices, &expected_indices, draco != NULL, err);
    if (!status && draco)
        status = strl__gltf_check_view(gltf, draco->view, err);
    if (!status && draco && primitive->indices == STRL__NO_ITEM)
        status = strl__fail(err, STRL_ERR_FORMAT, "%s: expected indices beside KHR_draco_mesh_compression, found none",
                            gltf->reader->path);
    return status;
}

uint64_t strl__gltf_element_count(const strl__gltf *gltf, const strl__gltf_primitive *primitive)
{
    uint32_t index = primitive->indices != STRL__NO_ITEM ? primitive->indices : primitive->position;
    return index == STRL__NO_ITEM ? 0 : gltf->accessors[index].count;
}

uint64_t strl__gltf_triangle_count(unsigned mode, uint64_t elements)
{
    if (mode < 4)
        return 0;
    return mode == 4 ? elements / 3 : elements < 3 ? 0 : elements - 2;
}

static strl_status check_primitive(strl__gltf *gltf, strl__gltf_mesh *mesh, const strl__gltf_primitive *primitive,
                                   strl_error *err)
{
    strl_status status = STRL_OK;
    if (primitive->material != STRL__NO_ITEM && primitive->material >= gltf->material_count)
        return strl__gltf_fail_index(gltf, ", material", "materials", gltf->material_count, primitive->material, err);
    if (primitive->position == STRL__NO_ITEM) /* nothing to draw, says the specification */
        return STRL_OK;
    if (primitive->mode >= 4)
        status = check_triangles(gltf, primitive, err);
    else
        status = check_kind(gltf, primitive->position, &expected_position, err);
    if (!status && primitive->mode < 4 && primitive->indices != STRL__NO_ITEM)
        status = check_kind(gltf, primitive->indices, &expected_indices, err);
    if (status)
        return status;
    uint64_t elements = strl__gltf_element_count(gltf, primitive);
    mesh->triangles += strl__gltf_triangle_count(primitive->mode, elements);
    mesh->vertices += gltf->accessors[primitive->position].count;
    return STRL_OK;
}

/* "PATH, accessors[3]: .." becomes "PATH, meshes[0].primitives[1], accessors[3]: ..". */
static strl_status name_primitive(const strl__gltf *gltf, uint32_t mesh, uint32_t primitive, strl_status status,
                                  strl_error *err)
{
    const char *path = gltf->reader->path;
    const size_t length = strlen(path);
    if (!err || strncmp(err->message, path, length) != 0)
        return strl__fail_context(err, status, "%s, meshes[%u].primitives[%u]", path, mesh, primitive);
    strl_error inner = *err;
    return strl__fail(err, status, "%s, meshes[%u].primitives[%u]%s", path, mesh, primitive, inner.message + length);
}

static strl_status check_mesh(strl__gltf *gltf, uint32_t index, strl_error *err)
{
    strl__gltf_mesh *mesh = &gltf->meshes[index];
    strl_status status = STRL_OK;
    if (mesh->is_checked)
        return STRL_OK;
    uint32_t checked = 0;
    for (; checked < mesh->primitive_count && !status; checked++)
        status = check_primitive(gltf, mesh, &gltf->primitives[mesh->first_primitive + checked], err);
    mesh->is_checked = true;
    gltf->vertices += mesh->vertices;
    return status ? name_primitive(gltf, index, checked - 1, status, err) : STRL_OK;
}

static strl_status check_instances(strl__gltf *gltf, strl__gltf_instances *instances, strl_error *err)
{
    const uint32_t accessors[3] = {instances->translation, instances->rotation, instances->scale};
    const expectation *const expected[3] = {&expected_translation, &expected_rotation, &expected_scale};
    bool has_count = false;
    for (unsigned i = 0; i < 3; i++) {
        if (accessors[i] == STRL__NO_ITEM)
            continue;
        strl_status status = check_use(gltf, accessors[i], expected[i], false, err);
        if (status)
            return status;
        const strl__gltf_accessor *accessor = &gltf->accessors[accessors[i]];
        if (has_count && accessor->count != instances->count)
            return strl__fail(err, STRL_ERR_FORMAT, "%s, accessors[%u]: expected %" PRIu64 " instances, found %" PRIu64,
                              gltf->reader->path, accessors[i], instances->count, accessor->count);
        instances->count = accessor->count;
        has_count = true;
    }
    return STRL_OK;
}

/* More than can be counted is as good as the largest number. */
static void add_product(uint64_t *sum, uint64_t a, uint64_t b)
{
    uint64_t product;
    if (__builtin_mul_overflow(a, b, &product) || __builtin_add_overflow(*sum, product, sum))
        *sum = UINT64_MAX;
}

static void count_image_changes(strl__gltf *gltf, const strl__gltf_mesh *mesh)
{
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const strl__gltf_primitive *primitive = &gltf->primitives[mesh->first_primitive + i];
        if (primitive->mode < 4 || primitive->position == STRL__NO_ITEM ||
            strl__gltf_texcoord(gltf, primitive) == STRL__NO_ITEM)
            continue;
        const uint32_t texture = gltf->materials[primitive->material].texture;
        const uint32_t picture = gltf->reader->textures.items[texture].picture;
        gltf->image_changes += picture != gltf->last_picture;
        gltf->last_picture = picture;
    }
}

strl_status strl__gltf_check_scene(strl__gltf *gltf, strl_error *err)
{
    strl_status status = STRL_OK;
    while (!status && strl__gltf_next_node(gltf)) {
        strl__gltf_node *node = &gltf->nodes[gltf->pass.node];
        if (node->mesh == STRL__NO_ITEM)
            continue;
        status = check_mesh(gltf, node->mesh, err);
        if (!status && node->instances)
            status = check_instances(gltf, node->instances, err);
        if (!status)
            count_image_changes(gltf, &gltf->meshes[node->mesh]);
        add_product(&gltf->triangles, gltf->meshes[node->mesh].triangles, strl__gltf_instance_count(node));
        add_product(&gltf->meshes[node->mesh].uses, 1, strl__gltf_instance_count(node));
    }
    strl__gltf_rewind(gltf);
    return status ? status : strl__gltf_find_pieces(gltf, err);
}
