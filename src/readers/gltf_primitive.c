/* One placement of one primitive: its vertices, transformed, and the triangles they make. Where
 * there are indices, all its vertices go into the reader's table, which spills when it has to. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"

/* ---- Draco */

static strl_status check_announced(strl__gltf *gltf, const strl__gltf_primitive *primitive, const uint8_t *packed,
                                   size_t size, strl__draco_facts *facts, strl_error *err)
{
    /* Of a strip the accessor counts the corners of the strip. */
    const uint64_t faces_most = strl__gltf_triangle_count(primitive->mode, gltf->accessors[primitive->indices].count);
    if (strl__draco_announced(packed, size, facts))
        return strl__fail(err, STRL_ERR_FORMAT, "%s, bufferViews[%u]: expected a Draco mesh of version 2.2",
                          gltf->reader->path, primitive->draco->view);
    if (facts->faces > faces_most || facts->points > gltf->accessors[primitive->position].count)
        return strl__fail(err, STRL_ERR_FORMAT,
                          "%s, bufferViews[%u]: expected a Draco mesh of at most %" PRIu64 " faces and %" PRIu64
                          " points, found %" PRIu64 " and %" PRIu64,
                          gltf->reader->path, primitive->draco->view, faces_most,
                          gltf->accessors[primitive->position].count, facts->faces, facts->points);
    gltf->draco_bytes = 0;
    return strl__gltf_make_room(gltf, facts->connectivity_bytes, "a Draco mesh's faces alone", err);
}

static strl_status check_decoded(const strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    const strl__gltf_draco_use *use = primitive->draco;
    const uint32_t texcoord = strl__gltf_texcoord(gltf, primitive);
    const uint32_t ids[4] = {use->position, use->normal, use->colour,
                             texcoord == STRL__NO_ITEM ? STRL__NO_ITEM
                                                       : use->texcoord[gltf->materials[primitive->material].set]};
    const uint32_t accessors[4] = {primitive->position, primitive->normal, primitive->colour, texcoord};
    const uint64_t points = strl__draco_point_count(gltf->draco);
    for (unsigned i = 0; i < 4; i++)
        if (accessors[i] != STRL__NO_ITEM &&
            (points > gltf->accessors[accessors[i]].count ||
             (ids[i] != STRL__NO_ITEM &&
              strl__draco_components(gltf->draco, ids[i]) != gltf->accessors[accessors[i]].values.components)))
            return strl__fail(err, STRL_ERR_FORMAT,
                              "%s, bufferViews[%u]: its %" PRIu64 " Draco points do not fit "
                              "accessors[%u]",
                              gltf->reader->path, use->view, points, accessors[i]);
    return STRL_OK;
}

static strl_status decode_announced(strl__gltf *gltf, const strl__gltf_primitive *primitive, const uint8_t *packed,
                                    const strl__draco_facts *facts, strl_error *err)
{
    const size_t size = (size_t)gltf->views[primitive->draco->view].bytes;
    char why[120];
    strl__draco_room room = {.bytes = strl__gltf_room(gltf) - facts->connectivity_bytes};
    gltf->draco = strl__draco_decode(packed, size, facts, &room, why);
    if (room.wanted > room.bytes && gltf->reader->textures.held_bytes) {
        strl__textures_rest(&gltf->reader->textures); /* as if none had come before */
        room.bytes = strl__gltf_room(gltf) - facts->connectivity_bytes;
        gltf->draco = strl__draco_decode(packed, size, facts, &room, why);
    }
    uint64_t wanted;
    if (__builtin_add_overflow(facts->connectivity_bytes, room.wanted, &wanted))
        wanted = UINT64_MAX;
    if (room.wanted > room.bytes) {
        strl_status status = strl__gltf_make_room(gltf, wanted, "a Draco mesh", err);
        if (status)
            return status;
    }
    if (!gltf->draco)
        return strl__fail(err, STRL_ERR_FORMAT, "%s, bufferViews[%u]: its Draco mesh is damaged: %s",
                          gltf->reader->path, primitive->draco->view, why);
    gltf->draco_bytes = wanted;
    return STRL_OK;
}

static strl_status decode_draco(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    const strl__gltf_view *view = &gltf->views[primitive->draco->view];
    strl__draco_facts facts;
    strl_status status = strl__gltf_make_room(gltf, view->bytes, "a Draco mesh's compressed form", err);
    uint8_t *packed = status ? NULL : strl__alloc((size_t)view->bytes, 1);
    if (!status && !packed)
        status = strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for a Draco mesh", gltf->reader->path);
    if (!status)
        status = strl__gltf_read_view(gltf, primitive->draco->view, 0, packed, (size_t)view->bytes, err);
    if (!status)
        status = check_announced(gltf, primitive, packed, (size_t)view->bytes, &facts, err);
    if (!status)
        status = decode_announced(gltf, primitive, packed, &facts, err);
    if (!status)
        status = check_decoded(gltf, primitive, err);
    strl__free(packed);
    return status;
}

/* Has the mesh of a compressed primitive at hand, and none else. */
static strl_status open_draco(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    const uint32_t index = (uint32_t)(primitive - gltf->primitives);
    if (gltf->draco && gltf->draco_primitive == index && primitive->draco)
        return STRL_OK;
    strl__draco_close(gltf->draco);
    gltf->draco = NULL;
    gltf->draco_bytes = 0;
    if (!primitive->draco)
        return STRL_OK;
    strl_status status = decode_draco(gltf, primitive, err);
    if (status) {
        strl__draco_close(gltf->draco);
        gltf->draco = NULL;
    }
    gltf->draco_primitive = index;
    return status;
}

/* ---- vertices */

strl_status strl__gltf_read_attribute(strl__gltf *gltf, uint32_t index, bool normalized, uint32_t draco_id,
                                      uint64_t first, size_t count, strl_error *err)
{
    const strl__gltf_column *column = &gltf->accessors[index].values;
    if (!gltf->draco || draco_id == STRL__NO_ITEM)
        return strl__gltf_read_numbers(gltf, index, normalized, first, count, gltf->values, err);
    if (strl__draco_numbers(gltf->draco, draco_id, first, count, column->components, gltf->values))
        return strl__fail(err, STRL_ERR_FORMAT, "%s: the Draco attribute %u has no numbers for accessors[%u]",
                          gltf->reader->path, draco_id, index);
    for (size_t i = 0; normalized && i < count * column->components; i++)
        gltf->values[i] = strl__gltf_denormalize(column->type, gltf->values[i]);
    return STRL_OK;
}

static void place_positions(strl__gltf *gltf, strl__corner *corners, size_t count)
{
    const double *m = gltf->pass.placement.m;
    for (size_t i = 0; i < count; i++) {
        const double *p = gltf->values + 3 * i;
        for (unsigned row = 0; row < 3; row++)
            corners[i].position[row] =
                m[4 * row] * p[0] + m[4 * row + 1] * p[1] + m[4 * row + 2] * p[2] + m[4 * row + 3];
    }
}

static void place_normals(strl__gltf *gltf, strl__corner *corners, size_t count)
{
    const double *m = gltf->pass.normal_matrix;
    for (size_t i = 0; i < count; i++) {
        const double *n = gltf->values + 3 * i;
        double turned[3], length2 = 0;
        for (unsigned row = 0; row < 3; row++) {
            turned[row] = m[3 * row] * n[0] + m[3 * row + 1] * n[1] + m[3 * row + 2] * n[2];
            length2 += turned[row] * turned[row];
        }
        double length = sqrt(length2);
        if (!(length > 0 && length < INFINITY))
            continue; /* none */
        for (unsigned row = 0; row < 3; row++)
            corners[i].normal[row] = (float)(turned[row] / length);
    }
}

static void place_colours(strl__gltf *gltf, uint32_t material, unsigned components, strl__corner *corners, size_t count)
{
    const strl__srgb *srgb = &gltf->reader->textures.srgb;
    for (size_t i = 0; i < count; i++) {
        const double *c = gltf->values + components * i;
        corners[i].colour = strl__pack_colour(strl__srgb_encode(srgb, c[0]), strl__srgb_encode(srgb, c[1]),
                                              strl__srgb_encode(srgb, c[2]),
                                              strl__gltf_alpha(gltf, material, components == 4 ? c[3] : 1));
    }
}

/* Of vertices under an image: their own colours, white where there are none. */
static strl_status read_tints(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint32_t draco_id,
                              uint64_t first, size_t count, strl_error *err)
{
    for (size_t i = 0; i < 4 * count; i++)
        gltf->tints[i] = 1;
    if (primitive->colour == STRL__NO_ITEM)
        return STRL_OK;
    const unsigned components = gltf->accessors[primitive->colour].values.components;
    strl_status status = strl__gltf_read_attribute(gltf, primitive->colour, true, draco_id, first, count, err);
    for (size_t i = 0; i < count * components && !status; i++)
        gltf->tints[4 * (i / components) + i % components] = gltf->values[i];
    return status;
}

/* count <= STRL__GLTF_CHUNK */
static strl_status read_corners(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t first, size_t count,
                                strl__corner *corners, strl_error *err)
{
    static const strl__gltf_draco_use none = {
        0, STRL__NO_ITEM, STRL__NO_ITEM, STRL__NO_ITEM, {STRL__NO_ITEM, STRL__NO_ITEM, STRL__NO_ITEM, STRL__NO_ITEM}};
    const strl__gltf_draco_use *draco = primitive->draco ? primitive->draco : &none;
    strl_status status =
        strl__gltf_read_attribute(gltf, primitive->position, gltf->accessors[primitive->position].values.normalized,
                                  draco->position, first, count, err);
    if (status)
        return status;
    for (size_t i = 0; i < count; i++) {
        memset(corners[i].normal, 0, sizeof corners[i].normal);
        memset(corners[i].texcoord, 0, sizeof corners[i].texcoord);
        corners[i].colour = 0xffffffffu;
    }
    place_positions(gltf, corners, count);
    if (primitive->normal != STRL__NO_ITEM) {
        status = strl__gltf_read_attribute(gltf, primitive->normal, true, draco->normal, first, count, err);
        if (!status)
            place_normals(gltf, corners, count);
    }
    if (!status && gltf->paint.image)
        status = read_tints(gltf, primitive, draco->colour, first, count, err);
    if (!status && gltf->paint.texcoord != STRL__NO_ITEM)
        status = strl__gltf_paint_corners(gltf, primitive, first, count, corners, err);
    if (status || gltf->paint.image)
        return status;
    if (!status && primitive->colour != STRL__NO_ITEM) {
        status = strl__gltf_read_attribute(gltf, primitive->colour, true, draco->colour, first, count, err);
        if (!status)
            place_colours(gltf, primitive->material, gltf->accessors[primitive->colour].values.components, corners,
                          count);
    }
    return status;
}

static strl__layout corner_layout(void)
{
    strl__layout layout = {.stride = sizeof(strl__corner),
                           .big_endian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__,
                           .has_position = true,
                           .has_normal = true,
                           .has_colour = true,
                           .has_alpha = true,
                           .has_texcoord = true};
    for (uint32_t i = 0; i < 4; i++) {
        uint32_t byte = layout.big_endian ? 3 - i : i;
        layout.colour[i] = (strl__field){(uint32_t)offsetof(strl__corner, colour) + byte, STRL__U8};
    }
    for (uint32_t i = 0; i < 3; i++) {
        layout.position[i] = (strl__field){(uint32_t)offsetof(strl__corner, position) + 8 * i, STRL__F64};
        if (i < 2)
            layout.texcoord[i] = (strl__field){(uint32_t)offsetof(strl__corner, texcoord) + 4 * i, STRL__F32};
        layout.normal[i] = (strl__field){(uint32_t)offsetof(strl__corner, normal) + 4 * i, STRL__F32};
    }
    return layout;
}

void strl__gltf_empty_table(strl_reader *reader)
{
    const strl__layout layout = corner_layout();
    strl__table_deinit(&reader->vertices);
    strl__table_build(&reader->vertices, &layout, reader->scratch_dir, strl__gltf_table_bytes(reader));
}

/* Those that its indices use, into the reader's table. */
static strl_status load_vertices(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    strl_reader *reader = gltf->reader;
    const uint64_t total = gltf->pass.loaded_count, begin = gltf->pass.first_loaded;
    strl_status status = STRL_OK;
    strl__gltf_empty_table(reader);
    for (uint64_t first = 0; first < total && !status; first += STRL__GLTF_CHUNK) {
        size_t count = total - first < STRL__GLTF_CHUNK ? (size_t)(total - first) : STRL__GLTF_CHUNK;
        status = read_corners(gltf, primitive, begin + first, count, gltf->corners, err);
        for (size_t i = 0; i < count && !status; i++)
            status = strl__table_append(&reader->vertices, &gltf->corners[i], err);
    }
    return status ? status : strl__table_finish(&reader->vertices, err);
}

/* ---- placement */

static strl_status find_place(strl__gltf *gltf, strl_error *err)
{
    static const strl__gltf_matrix as_it_is = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    gltf->pass.placement = as_it_is;
    return gltf->pass.is_alone ? STRL_OK : strl__gltf_place_node(gltf, &gltf->pass.placement, err);
}

static strl_status name_part(strl__gltf *gltf, strl_error *err)
{
    strl__gltf_pass *pass = &gltf->pass;
    return pass->is_alone ? strl__gltf_name_piece(gltf, pass->mesh, &pass->part, err)
                          : strl__gltf_name_part(gltf, pass->node, &pass->part, err);
}

strl_status strl__gltf_read_elements(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t first,
                                     size_t count, uint32_t *elements, strl_error *err)
{
    if (!gltf->draco)
        return strl__gltf_read_indices(gltf, primitive->indices, first, count, elements, err);
    strl__draco_faces(gltf->draco, first / 3, count / 3, elements); /* faces make lists alone */
    return STRL_OK;
}

static strl_status index_fail(const strl__gltf *gltf, const strl__gltf_primitive *primitive, uint32_t found,
                              uint64_t triangle, strl_error *err)
{
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%s, accessors[%u]: expected indices below %" PRIu64 ", found %u in triangle %" PRIu64,
                      gltf->reader->path, primitive->indices, gltf->pass.vertex_count, found, triangle);
}

static strl_status read_first(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    uint64_t vertex = 0;
    strl_status status = STRL_OK;
    if (primitive->indices != STRL__NO_ITEM) {
        status = strl__gltf_read_elements(gltf, primitive, 0, 1, &gltf->first_element, err);
        vertex = gltf->first_element;
        if (status || !gltf->pass.is_scattered)
            return status;
        if (vertex >= gltf->pass.vertex_count)
            return index_fail(gltf, primitive, gltf->first_element, 0, err);
    }
    return read_corners(gltf, primitive, vertex, 1, &gltf->first_corner, err);
}

/* Draco keeps triangles as a list, whatever they were. */
unsigned strl__gltf_mode_of(const strl__gltf_primitive *primitive)
{
    return primitive->draco ? 4 : primitive->mode;
}

strl_status strl__gltf_begin_placement(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    strl__gltf_pass *pass = &gltf->pass;
    gltf->paint.image = NULL; /* of the placement before: from now on it may be given up */
    strl_status status = find_place(gltf, err);
    if (!status)
        status = open_draco(gltf, primitive, err);
    if (status)
        return status;
    strl__gltf_derive(pass);
    uint64_t elements =
        gltf->draco ? 3 * strl__draco_face_count(gltf->draco) : strl__gltf_element_count(gltf, primitive);
    pass->vertex_count =
        gltf->draco ? strl__draco_point_count(gltf->draco) : gltf->accessors[primitive->position].count;
    pass->triangle = 0;
    pass->is_scattered = false;
    pass->first_loaded = 0;
    pass->loaded_count = pass->vertex_count;
    pass->triangle_count = strl__gltf_triangle_count(strl__gltf_mode_of(primitive), elements);
    if (pass->triangle_count == 0)
        return STRL_OK;
    if (primitive->indices != STRL__NO_ITEM)
        status = strl__gltf_find_range(gltf, &gltf->primitives[primitive - gltf->primitives], elements, err);
    if (!status)
        status = strl__gltf_begin_paint(gltf, primitive, err);
    if (status)
        return status;
    gltf->reader->batch.has_corner_colour = primitive->colour != STRL__NO_ITEM || gltf->paint.image != NULL;
    gltf->reader->batch.has_texcoord = gltf->paint.texcoord != STRL__NO_ITEM;
    if (primitive->indices != STRL__NO_ITEM)
        status = load_vertices(gltf, primitive, err);
    if (!status && primitive->mode == 6 && !gltf->draco)
        status = read_first(gltf, primitive, err);
    if (!status)
        status = name_part(gltf, err);
    return status ? status : strl__gltf_list_material(gltf, primitive->material, &pass->material, err);
}

/* ---- triangles */

void strl__gltf_corners_of(unsigned mode, uint64_t triangle, size_t in_chunk, uint32_t slots[3])
{
    const uint32_t at = (uint32_t)in_chunk;
    if (mode == 4) {
        slots[0] = 3 * at;
        slots[1] = 3 * at + 1;
        slots[2] = 3 * at + 2;
    } else if (mode == 5) { /* every other one is turned, as the specification has it */
        slots[0] = at;
        slots[1] = at + 1 + (triangle & 1);
        slots[2] = at + 2 - (triangle & 1);
    } else {
        slots[0] = at;
        slots[1] = at + 1;
        slots[2] = STRL__GLTF_FAN_CENTRE;
    }
}

static strl_status add_indexed(strl__gltf *gltf, const strl__gltf_primitive *primitive, const uint32_t slots[3],
                               uint64_t triangle, strl_error *err)
{
    const strl__gltf_pass *pass = &gltf->pass;
    strl__batch *batch = &gltf->reader->batch;
    for (unsigned i = 0; i < 3; i++) {
        uint32_t index = slots[i] == STRL__GLTF_FAN_CENTRE ? gltf->first_element : gltf->elements[slots[i]];
        /* Below first_loaded: the file has changed since the range was found. */
        if (index >= pass->vertex_count || index < pass->first_loaded ||
            index - pass->first_loaded >= pass->loaded_count)
            return index_fail(gltf, primitive, index, triangle, err);
        batch->vertex[batch->corner_count + i] = index - pass->first_loaded;
    }
    return STRL_OK;
}

static void add_corners(strl__gltf *gltf, const uint32_t slots[3])
{
    strl__batch *batch = &gltf->reader->batch;
    for (unsigned i = 0; i < 3; i++) {
        batch->corners[batch->corner_count + i] =
            slots[i] == STRL__GLTF_FAN_CENTRE ? gltf->first_corner : gltf->corners[slots[i]];
        batch->vertex[batch->corner_count + i] = STRL__NO_INDEX;
    }
}

/* One corner after the other, where the vertices lie far apart; of triangles from `first` on. */
static strl_status look_up(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t first, size_t count,
                           strl_error *err)
{
    const unsigned mode = strl__gltf_mode_of(primitive), shared = mode == 4 ? 0 : mode == 5 ? 2 : 1;
    strl_status status = STRL_OK;
    for (size_t i = 0; i < count && !status; i++) {
        uint32_t index = gltf->elements[i];
        if (index >= gltf->pass.vertex_count)
            return index_fail(gltf, primitive, index, first + (mode == 4 ? i / 3 : i > shared ? i - shared : 0), err);
        status = read_corners(gltf, primitive, index, 1, &gltf->corners[i], err);
    }
    return status;
}

/* The elements of triangles first .. first + count - 1 into elements or corners. */
static strl_status read_run(strl__gltf *gltf, const strl__gltf_primitive *primitive, uint64_t first, size_t count,
                            strl_error *err)
{
    const unsigned mode = strl__gltf_mode_of(primitive);
    const uint64_t begin = mode == 4 ? 3 * first : mode == 5 ? first : first + 1;
    const size_t elements = mode == 4 ? 3 * count : mode == 5 ? count + 2 : count + 1;
    if (primitive->indices == STRL__NO_ITEM)
        return read_corners(gltf, primitive, begin, elements, gltf->corners, err);
    strl_status status = strl__gltf_read_elements(gltf, primitive, begin, elements, gltf->elements, err);
    if (!status && gltf->pass.is_scattered)
        status = look_up(gltf, primitive, first, elements, err);
    return status;
}

static size_t run_length(const strl__gltf *gltf, unsigned mode)
{
    const strl__batch *batch = &gltf->reader->batch;
    size_t room = (batch->corner_goal - batch->corner_count + 2) / 3;
    size_t most = mode == 4 ? STRL__GLTF_CHUNK / 3 : STRL__GLTF_CHUNK - 2;
    uint64_t left = gltf->pass.triangle_count - gltf->pass.triangle;
    most = most < room ? most : room;
    return most < left ? most : (size_t)left;
}

static void turn(uint32_t slots[3])
{
    uint32_t slot = slots[1];
    slots[1] = slots[2];
    slots[2] = slot;
}

strl_status strl__gltf_add_triangles(strl__gltf *gltf, const strl__gltf_primitive *primitive, strl_error *err)
{
    strl__gltf_pass *pass = &gltf->pass;
    strl__batch *batch = &gltf->reader->batch;
    const unsigned mode = strl__gltf_mode_of(primitive);
    strl_status status = STRL_OK;
    while (!status && pass->triangle < pass->triangle_count && !strl__batch_is_full(batch)) {
        const size_t count = run_length(gltf, mode);
        status = read_run(gltf, primitive, pass->triangle, count, err);
        for (size_t i = 0; i < count && !status; i++) {
            uint32_t slots[3];
            strl__gltf_corners_of(mode, pass->triangle + i, i, slots);
            if (pass->flips)
                turn(slots);
            if (primitive->indices == STRL__NO_ITEM || pass->is_scattered)
                add_corners(gltf, slots);
            else
                status = add_indexed(gltf, primitive, slots, pass->triangle + i, err);
            if (!status)
                strl__batch_add(batch, &(strl__face){3, pass->part, pass->material, 0xffffffffu});
        }
        pass->triangle += count;
        pass->done += count;
    }
    return status;
}
