/* The elements of a glTF's JSON into tables. What one says of another is checked later: members may
 * stand in any order. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"
#include "readers/gltf_json.h"

/* Of the reader's budget the text of an element has such a part; as a tree it takes up to 18 times
 * as much. */
#define ELEMENT_SHARE 64u

typedef strl_status (*parse_element)(strl__gltf *gltf, strl__fields *fields, const json_t *value);

static void *keep(strl__gltf *gltf, strl__fields *fields, size_t bytes)
{
    void *block = fields->status ? NULL : strl__gltf_keep(gltf, bytes, fields->err);
    if (!block && !fields->status)
        fields->status = gltf->is_counting ? STRL_ERR_LIMIT : STRL_ERR_MEMORY;
    return block;
}

char *strl__gltf_keep_text(strl__gltf *gltf, strl__fields *fields, const json_t *value, const char *key)
{
    const char *text = strl__fields_text(fields, value, key);
    char *copy = text ? keep(gltf, fields, strlen(text) + 1) : NULL;
    return copy ? strcpy(copy, text) : NULL;
}

#define ADD(gltf, list, count, capacity, err)                                                                          \
    strl__gltf_add(gltf, &(gltf)->list, &(gltf)->count, &(gltf)->capacity, sizeof *(gltf)->list, err)

/* ---- buffers, views, accessors */

static strl_status parse_buffer(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    strl__gltf_buffer buffer = {.bytes = strl__fields_count(fields, value, "byteLength", 0),
                                .uri = strl__gltf_keep_text(gltf, fields, value, "uri")};
    strl_status status = fields->status;
    if (!status)
        status = ADD(gltf, buffers, buffer_count, buffer_capacity, fields->err);
    if (!status)
        gltf->buffers[gltf->buffer_count - 1] = buffer;
    return status;
}

/* The index of a word in a list that ends with NULL. */
static unsigned parse_word(strl__fields *fields, const json_t *value, const char *key, const char *const *words)
{
    const char *text = strl__fields_text(fields, value, key);
    unsigned index = 0;
    if (!text)
        return 0;
    while (words[index] && strcmp(words[index], text) != 0)
        index++;
    if (words[index])
        return index;
    strl__fields_fail(fields, key, "a word that EXT_meshopt_compression knows");
    return 0;
}

static strl__gltf_meshopt *parse_meshopt(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    static const char *const modes[] = {"ATTRIBUTES", "TRIANGLES", "INDICES", NULL};
    static const char *const filters[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", NULL};
    strl__gltf_meshopt *meshopt = keep(gltf, fields, sizeof *meshopt);
    if (!meshopt)
        return NULL;
    strl__fields_require(fields, value, "mode");
    *meshopt = (strl__gltf_meshopt){
        .buffer = strl__fields_index(fields, value, "buffer"),
        .offset = strl__fields_count(fields, value, "byteOffset", 0),
        .bytes = strl__fields_count(fields, value, "byteLength", 0),
        .count = strl__fields_count(fields, value, "count", 0),
        .mode = parse_word(fields, value, "mode", modes),
        .filter = parse_word(fields, value, "filter", filters),
    };
    uint64_t stride = strl__fields_count(fields, value, "byteStride", 0);
    if (stride == 0 || stride > 256)
        strl__fields_fail(fields, "byteStride", "a compressed stride of 1 to 256");
    meshopt->stride = (uint32_t)stride;
    return meshopt;
}

#define STRIDE_MAX 2048u /* the specification's is 252; some programs write more */

static strl_status parse_view(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const json_t *compressed = strl__fields_extension(fields, value, "EXT_meshopt_compression");
    strl__gltf_view view = {
        .buffer = strl__fields_index(fields, value, "buffer"),
        .offset = strl__fields_count(fields, value, "byteOffset", 0),
        .bytes = strl__fields_count(fields, value, "byteLength", 0),
    };
    uint64_t stride = strl__fields_count(fields, value, "byteStride", 0);
    if (stride > STRIDE_MAX)
        strl__fields_fail(fields, "byteStride", "at most 2048");
    view.stride = (uint32_t)stride;
    if (compressed)
        view.meshopt = parse_meshopt(gltf, fields, compressed);
    strl_status status = fields->status;
    if (!status)
        status = ADD(gltf, views, view_count, view_capacity, fields->err);
    if (!status)
        gltf->views[gltf->view_count - 1] = view;
    return status;
}

static strl__scalar parse_component_type(strl__fields *fields, const json_t *value)
{
    strl__fields_require(fields, value, "componentType");
    switch (strl__fields_count(fields, value, "componentType", 5120)) {
    case 5120:
        return STRL__I8;
    case 5121:
        return STRL__U8;
    case 5122:
        return STRL__I16;
    case 5123:
        return STRL__U16;
    case 5125:
        return STRL__U32;
    case 5126:
        return STRL__F32;
    default:
        strl__fields_fail(fields, "componentType", "5120 to 5123, 5125 or 5126");
        return STRL__U8;
    }
}

static uint8_t parse_components(strl__fields *fields, const json_t *value)
{
    static const struct {
        const char *type;
        uint8_t components;
    } types[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
    strl__fields_require(fields, value, "type");
    const char *text = strl__fields_text(fields, value, "type");
    for (size_t i = 0; text && i < sizeof types / sizeof *types; i++)
        if (strcmp(text, types[i].type) == 0)
            return types[i].components;
    strl__fields_fail(fields, "type", "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4");
    return 1;
}

static strl__gltf_column parse_column(strl__fields *fields, const json_t *value)
{
    return (strl__gltf_column){.view = strl__fields_index(fields, value, "bufferView"),
                               .offset = strl__fields_count(fields, value, "byteOffset", 0)};
}

static strl__gltf_sparse *parse_sparse(strl__gltf *gltf, strl__fields *fields, const json_t *value,
                                       const strl__gltf_column *elements)
{
    const json_t *indices = strl__fields_object(fields, value, "indices");
    const json_t *values = strl__fields_object(fields, value, "values");
    strl__gltf_sparse *sparse = keep(gltf, fields, sizeof *sparse);
    if (!indices || !values)
        strl__fields_fail(fields, "sparse", "indices and values");
    strl__fields_require(fields, indices, "bufferView");
    strl__fields_require(fields, values, "bufferView");
    if (!sparse || fields->status)
        return NULL;
    sparse->count = strl__fields_count(fields, value, "count", 0);
    sparse->indices = parse_column(fields, indices);
    sparse->indices.components = 1;
    sparse->indices.type = parse_component_type(fields, indices);
    if (sparse->indices.type != STRL__U8 && sparse->indices.type != STRL__U16 && sparse->indices.type != STRL__U32)
        strl__fields_fail(fields, "sparse.indices.componentType", "an unsigned type");
    sparse->values = parse_column(fields, values);
    sparse->values.components = elements->components;
    sparse->values.type = elements->type;
    return sparse;
}

static strl_status parse_accessor(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    strl__gltf_accessor accessor = {.values = parse_column(fields, value),
                                    .count = strl__fields_count(fields, value, "count", 0)};
    const json_t *sparse = strl__fields_object(fields, value, "sparse");
    accessor.values.type = parse_component_type(fields, value);
    accessor.values.components = parse_components(fields, value);
    accessor.values.normalized = strl__fields_bool(fields, value, "normalized");
    strl__fields_require(fields, value, "count");
    if (accessor.count > UINT32_MAX)
        strl__fields_fail(fields, "count", "at most 4294967295 elements");
    if (sparse)
        accessor.sparse = parse_sparse(gltf, fields, sparse, &accessor.values);
    strl_status status = fields->status;
    if (!status)
        status = ADD(gltf, accessors, accessor_count, accessor_capacity, fields->err);
    if (!status)
        gltf->accessors[gltf->accessor_count - 1] = accessor;
    return status;
}

/* ---- meshes */

static void parse_texcoords(strl__fields *fields, const json_t *attributes, uint32_t texcoord[STRL__GLTF_SETS])
{
    static const char *const names[STRL__GLTF_SETS] = {"TEXCOORD_0", "TEXCOORD_1", "TEXCOORD_2", "TEXCOORD_3"};
    for (unsigned set = 0; set < STRL__GLTF_SETS; set++)
        texcoord[set] = strl__fields_index(fields, attributes, names[set]);
}

static strl__gltf_draco_use *parse_draco(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const json_t *attributes = strl__fields_object(fields, value, "attributes");
    strl__gltf_draco_use *draco = keep(gltf, fields, sizeof *draco);
    if (!draco)
        return NULL;
    strl__fields_require(fields, value, "bufferView");
    *draco = (strl__gltf_draco_use){
        .view = strl__fields_index(fields, value, "bufferView"),
        .position = strl__fields_index(fields, attributes, "POSITION"),
        .normal = strl__fields_index(fields, attributes, "NORMAL"),
        .colour = strl__fields_index(fields, attributes, "COLOR_0"),
    };
    parse_texcoords(fields, attributes, draco->texcoord);
    return draco;
}

static strl_status parse_primitive(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const json_t *attributes = strl__fields_object(fields, value, "attributes");
    const json_t *draco = strl__fields_extension(fields, value, "KHR_draco_mesh_compression");
    uint64_t mode = strl__fields_count(fields, value, "mode", 4);
    strl__gltf_primitive primitive = {
        .mode = (uint8_t)mode,
        .indices = strl__fields_index(fields, value, "indices"),
        .material = strl__fields_index(fields, value, "material"),
        .position = strl__fields_index(fields, attributes, "POSITION"),
        .normal = strl__fields_index(fields, attributes, "NORMAL"),
        .colour = strl__fields_index(fields, attributes, "COLOR_0"),
    };
    parse_texcoords(fields, attributes, primitive.texcoord);
    if (mode > 6)
        strl__fields_fail(fields, "primitives.mode", "a mode of 0 to 6");
    if (draco)
        primitive.draco = parse_draco(gltf, fields, draco);
    strl_status status = fields->status;
    if (!status)
        status = ADD(gltf, primitives, primitive_count, primitive_capacity, fields->err);
    if (!status)
        gltf->primitives[gltf->primitive_count - 1] = primitive;
    return status;
}

static strl_status parse_mesh(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const json_t *list = strl__fields_list(fields, value, "primitives");
    strl__gltf_mesh mesh = {.part = STRL__NO_ITEM,
                            .name = strl__gltf_keep_text(gltf, fields, value, "name"),
                            .first_primitive = (uint32_t)gltf->primitive_count,
                            .primitive_count = (uint32_t)json_array_size(list)};
    strl_status status = fields->status;
    for (size_t i = 0; !status && i < json_array_size(list); i++)
        status = parse_primitive(gltf, fields, json_array_get(list, i));
    if (!status)
        status = ADD(gltf, meshes, mesh_count, mesh_capacity, fields->err);
    if (!status)
        gltf->meshes[gltf->mesh_count - 1] = mesh;
    return status;
}

/* ---- nodes and scenes */

static strl_status parse_indices(strl__gltf *gltf, strl__fields *fields, const json_t *list, const char *key,
                                 uint32_t **items, size_t *count, size_t *capacity)
{
    for (size_t i = 0; !fields->status && i < json_array_size(list); i++) {
        uint32_t index = strl__fields_list_index(fields, list, i, key);
        if (!fields->status)
            fields->status = strl__gltf_add(gltf, items, count, capacity, sizeof **items, fields->err);
        if (!fields->status)
            (*items)[*count - 1] = index;
    }
    return fields->status;
}

static strl__gltf_matrix parse_transform(strl__fields *fields, const json_t *value)
{
    double columns[16], translation[3] = {0}, rotation[4] = {0, 0, 0, 1}, scale[3] = {1, 1, 1};
    strl__gltf_matrix matrix;
    if (strl__fields_numbers(fields, value, "matrix", columns, 16)) {
        for (unsigned row = 0; row < 3; row++)
            for (unsigned column = 0; column < 4; column++)
                matrix.m[4 * row + column] = columns[4 * column + row];
        return matrix;
    }
    strl__fields_numbers(fields, value, "translation", translation, 3);
    strl__fields_numbers(fields, value, "rotation", rotation, 4);
    strl__fields_numbers(fields, value, "scale", scale, 3);
    return strl__gltf_compose(translation, rotation, scale);
}

static strl__gltf_instances *parse_instances(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const json_t *attributes = strl__fields_object(fields, value, "attributes");
    strl__gltf_instances *instances = keep(gltf, fields, sizeof *instances);
    if (!attributes)
        strl__fields_fail(fields, "extensions.EXT_mesh_gpu_instancing.attributes", "an object");
    if (!instances || fields->status)
        return NULL;
    *instances = (strl__gltf_instances){
        .count = 1, /* where nothing tells */
        .translation = strl__fields_index(fields, attributes, "TRANSLATION"),
        .rotation = strl__fields_index(fields, attributes, "ROTATION"),
        .scale = strl__fields_index(fields, attributes, "SCALE"),
    };
    return instances;
}

static strl_status parse_node(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const json_t *instances = strl__fields_extension(fields, value, "EXT_mesh_gpu_instancing");
    const json_t *list = strl__fields_list(fields, value, "children");
    strl__gltf_node node = {.name = strl__gltf_keep_text(gltf, fields, value, "name"),
                            .mesh = strl__fields_index(fields, value, "mesh"),
                            .parent = STRL__NO_ITEM,
                            .part = STRL__NO_ITEM,
                            .first_child = (uint32_t)gltf->child_count,
                            .child_count = (uint32_t)json_array_size(list),
                            .local = parse_transform(fields, value)};
    if (instances)
        node.instances = parse_instances(gltf, fields, instances);
    strl_status status =
        parse_indices(gltf, fields, list, "children", &gltf->children, &gltf->child_count, &gltf->child_capacity);
    if (!status)
        status = ADD(gltf, nodes, node_count, node_capacity, fields->err);
    if (!status)
        gltf->nodes[gltf->node_count - 1] = node;
    return status;
}

static strl_status parse_scene(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const json_t *list = strl__fields_list(fields, value, "nodes");
    strl__gltf_scene scene = {.first_root = (uint32_t)gltf->root_count, .root_count = (uint32_t)json_array_size(list)};
    strl_status status = fields->status;
    if (!status && !json_is_object(value))
        strl__fields_fail(fields, "", "an object");
    if (!status)
        status = parse_indices(gltf, fields, list, "nodes", &gltf->roots, &gltf->root_count, &gltf->root_capacity);
    if (!status)
        status = ADD(gltf, scenes, scene_count, scene_capacity, fields->err);
    if (!status)
        gltf->scenes[gltf->scene_count - 1] = scene;
    return status;
}

/* ---- the file as a whole */

static strl_status parse_asset(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const char *version = strl__fields_text(fields, value, "version");
    const char *least = strl__fields_text(fields, value, "minVersion");
    if (fields->status)
        return fields->status;
    gltf->has_asset = true;
    if (version && strncmp(version, "2.", 2) == 0 && (!least || strcmp(least, "2.0") == 0))
        return STRL_OK;
    gltf->reader->is_foreign = !gltf->has_binary && version && strncmp(version, "1.", 2) == 0;
    return strl__fail(fields->err, STRL_ERR_UNSUPPORTED, "%s: expected glTF 2.0, found version %.20s", fields->path,
                      least     ? least
                      : version ? version
                                : "unknown");
}

/* Those of textures and materials change no geometry: what is not understood of them becomes the
 * factor colour. */
static bool is_known_extension(const char *name)
{
    static const char *const known[] = {
        "KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing", "KHR_mesh_quantization",
        "KHR_texture_transform",      "KHR_texture_basisu",      "EXT_texture_webp",        "EXT_texture_avif",
        "MSFT_texture_dds",           "KHR_lights_punctual",     "KHR_xmp_json_ld",         "KHR_animation_pointer",
        "EXT_mesh_features",          "EXT_instance_features",   "EXT_structural_metadata", "KHR_techniques_webgl",
        "KHR_technique_webgl",
    };
    static const char materials[] = "KHR_materials_";
    if (strncmp(name, materials, sizeof materials - 1) == 0)
        return true;
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strcmp(name, known[i]) == 0)
            return true;
    return false;
}

static strl_status parse_required(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    const char *name = json_string_value(value);
    (void)gltf;
    if (!name)
        strl__fields_fail(fields, "", "the name of an extension");
    else if (!is_known_extension(name))
        return strl__fail(fields->err, STRL_ERR_UNSUPPORTED,
                          "%s requires the extension %.80s, which is not one that is read: %s", fields->path, name,
                          strstr(name, "meshopt") ? "pack it by gltfpack with -c or -cc, not -cz"
                                                  : "export the model without it");
    return fields->status;
}

static strl_status parse_default_scene(strl__gltf *gltf, strl__fields *fields, const json_t *value)
{
    if (!json_is_integer(value) || json_integer_value(value) < 0 || json_integer_value(value) >= STRL__NO_ITEM)
        strl__fields_fail(fields, "", "an index");
    else
        gltf->scene = (uint32_t)json_integer_value(value);
    return fields->status;
}

static const struct {
    const char *name;
    bool is_list;
    parse_element parse;
    bool is_optional; /* what is no list is passed over */
    size_t bytes;     /* of one in its table */
    const char *list; /* of each what is in tables of its own; may be NULL */
    size_t list_bytes;
} members[] = {
    {"asset", false, parse_asset, false, 0, NULL, 0},
    {"scene", false, parse_default_scene, false, 0, NULL, 0},
    {"extensionsRequired", true, parse_required, false, 0, NULL, 0},
    {"scenes", true, parse_scene, false, sizeof(strl__gltf_scene), "nodes", sizeof(uint32_t)},
    {"nodes", true, parse_node, false, sizeof(strl__gltf_node), "children", sizeof(uint32_t)},
    {"meshes", true, parse_mesh, false, sizeof(strl__gltf_mesh), "primitives",
     sizeof(strl__gltf_primitive) + sizeof(strl__gltf_draco_use)},
    {"accessors", true, parse_accessor, false, sizeof(strl__gltf_accessor), NULL, 0},
    {"bufferViews", true, parse_view, false, sizeof(strl__gltf_view), NULL, 0},
    {"buffers", true, parse_buffer, false, sizeof(strl__gltf_buffer), NULL, 0},
    {"materials", true, strl__gltf_parse_material, false, sizeof(strl__gltf_material), NULL, 0},
    {"textures", true, strl__gltf_parse_map, true, sizeof(strl__gltf_map), NULL, 0},
    {"samplers", true, strl__gltf_parse_sampler, true, sizeof(strl__gltf_sampler), NULL, 0},
    {"images", true, strl__gltf_parse_image, true, sizeof(strl__gltf_image), NULL, 0},
};

/* About what an element takes in the tables and the arena. */
static uint64_t element_bytes(size_t which, const json_t *value)
{
    static const char *const texts[] = {"name", "uri"};
    uint64_t bytes = members[which].bytes;
    if (!json_is_object(value))
        return bytes;
    if (members[which].list)
        bytes += json_array_size(json_object_get(value, members[which].list)) * members[which].list_bytes;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        bytes += json_string_length(json_object_get(value, texts[i])) + 16;
    if (json_object_get(value, "extensions") || json_object_get(value, "sparse"))
        bytes += sizeof(strl__gltf_sparse) + sizeof(strl__gltf_meshopt);
    return bytes;
}

static size_t member_index(const char *name)
{
    size_t index = 0;
    while (index < sizeof members / sizeof *members && strcmp(members[index].name, name) != 0)
        index++;
    return index;
}

static bool wants(void *context, const char *member)
{
    (void)context;
    return member_index(member) < sizeof members / sizeof *members;
}

static strl_status take(void *context, const char *member, uint64_t index, const json_t *value, strl_error *err)
{
    strl__gltf *gltf = context;
    const char *path = gltf->reader->path;
    const size_t which = member_index(member);
    strl__fields fields = {.path = path, .member = member, .index = index, .err = err};
    if (members[which].is_list && index == STRL__JSON_WHOLE && json_is_object(value) && !gltf->has_asset &&
        !gltf->has_binary)
        gltf->reader->is_foreign = true; /* as glTF 1 has it */
    const bool is_wrong = members[which].is_list != (index != STRL__JSON_WHOLE);
    if (is_wrong && members[which].is_optional)
        return STRL_OK;
    if (is_wrong)
        return members[which].is_list
                   ? strl__fail(err, STRL_ERR_UNSUPPORTED, "%s: expected glTF 2.0, whose %s are a list, found %s", path,
                                member, json_is_object(value) ? "an object, as in glTF 1" : "none")
                   : strl__fail(err, STRL_ERR_FORMAT, "%s: expected its %s not to be a list", path, member);
    if (index == 0 || index == STRL__JSON_WHOLE) {
        if (gltf->seen >> which & 1)
            return strl__fail(err, STRL_ERR_FORMAT, "%s: its %s stand in it twice", path, member);
        gltf->seen |= (uint64_t)1 << which;
    }
    strl_status status = gltf->is_counting ? STRL_OK : members[which].parse(gltf, &fields, value);
    if (!gltf->is_counting)
        return status;
    gltf->counted_bytes += element_bytes(which, value);
    return STRL_OK;
}

static strl_status refuse(void *context, uint64_t at, size_t bytes, strl_error *err)
{
    const strl__gltf *gltf = context;
    const uint64_t most = gltf->reader->memory_bytes / ELEMENT_SHARE;
    char advice[STRL__ADVICE_BYTES];
    strl__reader_advise(gltf->reader, bytes, most, advice);
    return strl__fail(err, STRL_ERR_LIMIT,
                      "%s, byte %" PRIu64 ": this part of its JSON is %zu bytes long, the memory "
                      "budget allows %" PRIu64 ": %s",
                      gltf->reader->path, at, bytes, most, advice);
}

strl_status strl__gltf_parse(strl__gltf *gltf, strl_error *err)
{
    strl_reader *reader = gltf->reader;
    const strl__json_sink sink = {.context = gltf,
                                  .most_bytes = (size_t)(reader->memory_bytes / ELEMENT_SHARE),
                                  .wants = wants,
                                  .take = take,
                                  .refuse = refuse};
    strl_status status = strl__json_split(&reader->input, reader->path, &sink, err);
    if (!status && gltf->is_counting)
        return strl__gltf_refuse_tables(gltf, err);
    if (!status && !gltf->has_asset)
        status = strl__fail(err, STRL_ERR_FORMAT, "%s: expected an asset of version 2.0 in its JSON, found none",
                            reader->path);
    return status;
}
