/* Two decoders, one written from the format's text alone, agree on every bit of every mesh, and on what they
 * refuse. */
#include "verify/planted.h"

#include "container/treelet.h"
#include "verify/mesh.h"

static model torus;

static void assert_same(const void *a, const void *b, size_t size)
{
    assert_int_equal(memcmp(a, b, size), 0);
}

static void compare_meshes(const strl_pm *a, const strl__vmesh *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->triangle_count, b->triangle_count);
    assert_int_equal(a->step_count, b->step_count);
    assert_int_equal(a->palette_count, b->palette_count);
    size_t v = a->vertex_count, states = a->step_count + 1;
    assert_same(a->position, b->position, v * sizeof *a->position);
    assert_same(a->normal, b->normal, v * sizeof *a->normal);
    assert_same(a->parent, b->parent, v * sizeof *a->parent);
    assert_same(a->triangle, b->triangle, a->triangle_count * sizeof *a->triangle);
    assert_same(a->vertex_end, b->vertex_end, states * sizeof *a->vertex_end);
    assert_same(a->triangle_end, b->triangle_end, states * sizeof *a->triangle_end);
    assert_same(a->geometric_error, b->geometric_error, states * sizeof(float));
    assert_same(a->appearance_error, b->appearance_error, states * sizeof(float));
    assert_int_equal(a->colour != NULL, b->colour != NULL);
    assert_int_equal(a->palette_index != NULL, b->palette_index != NULL);
    if (a->colour)
        assert_same(a->colour, b->colour, v * sizeof *a->colour);
    assert_int_equal(a->texcoord != NULL, b->texcoord != NULL);
    for (uint32_t i = 0; a->texcoord && i < v; i++)
        assert_true(a->texcoord[i] == ((uint32_t)b->texcoord[i][0] | (uint32_t)b->texcoord[i][1] << 16));
    if (a->palette_index)
        assert_same(a->palette_index, b->palette_index, v * sizeof *a->palette_index);
    for (uint32_t i = 0; i < a->palette_count; i++) {
        assert_int_equal(a->palette[i].part, b->palette[i][0]);
        assert_int_equal(a->palette[i].material, b->palette[i][1]);
    }
}

/* Colours and palette indices that look like those of a scan: neighbours differ little, some jump. */
static void paint(strl_pm *mesh, strl_arena *arena, uint32_t seed)
{
    mesh->colour = strl_arena_alloc(arena, mesh->vertex_count, sizeof *mesh->colour);
    mesh->palette_index = strl_arena_alloc(arena, mesh->vertex_count, sizeof *mesh->palette_index);
    mesh->palette = strl_arena_alloc(arena, 3, sizeof *mesh->palette);
    mesh->texcoord = seed % 2 ? strl_arena_alloc(arena, mesh->vertex_count, sizeof *mesh->texcoord) : NULL;
    assert_non_null(mesh->colour);
    assert_non_null(mesh->palette_index);
    assert_non_null(mesh->palette);
    mesh->palette_count = 3;
    for (uint32_t i = 0; i < 3; i++)
        mesh->palette[i] = (strl_palette_entry){seed * 7 + i * i, 40000 - i, 0xff00ff00u + i};
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        mesh->colour[v] = (uint32_t)(mesh->position[v][0] >> 4) * 0x010203u ^
                          (v % 97 ? 0xff000000u : (uint32_t)strl__mix64(v + seed));
        if (mesh->texcoord)
            mesh->texcoord[v] = v % 61
                                    ? (uint32_t)(mesh->position[v][0] & 0xffff) | (uint32_t)mesh->position[v][1] << 16
                                    : (uint32_t)strl__mix64(v);
        mesh->palette_index[v] = (uint16_t)(v % 50 ? 1 : v % 3);
    }
}

typedef struct decode_tally {
    uint32_t meshes, refused, accepted;
} decode_tally;

/* What a payload is told by; */
typedef struct told_by {
    strl_pm mesh;
    strl_payload_reference reference;
    strl__vmesh view;
    strl__v_told told;
} told_by;

static void compare_decoders(const uint8_t *data, size_t size, const told_by *parent, decode_tally *tally)
{
    strl_arena a, b;
    strl_pm mesh;
    strl__vmesh own;
    strl_arena_init(&a, 0);
    strl_arena_init(&b, 0);
    strl_status one = strl_payload_decode(data, size, parent ? &parent->reference : NULL, &a, &mesh, NULL);
    strl_status other = strl__v_payload_decode(data, size, parent ? &parent->told : NULL, &b, true, &own, NULL);
    if (other == STRL_OK)
        other = strl__v_mesh_check_ranges(&own, NULL);
    if (other == STRL_OK)
        other = strl__v_mesh_check_states(&own, &b, NULL);
    assert_int_equal(one, other);
    if (one == STRL_OK)
        compare_meshes(&mesh, &own);
    tally->refused += one != STRL_OK;
    tally->accepted += one == STRL_OK;
    strl_arena_deinit(&a);
    strl_arena_deinit(&b);
}

static void damage(const strl_writer *payload, uint32_t seed, const told_by *parent, decode_tally *tally)
{
    uint8_t *copy = strl__alloc(payload->size, 1);
    assert_non_null(copy);
    for (uint32_t i = 0; i < 60; i++) {
        uint64_t r = strl__mix64(seed * 1000u + i + 1);
        memcpy(copy, payload->data, payload->size);
        copy[r % (i % 2 ? payload->size : 64)] ^= (uint8_t)(1u << (r >> 40) % 8);
        compare_decoders(copy, i % 5 ? payload->size : r % payload->size, parent, tally);
    }
    strl__free(copy);
}

static void visit(decode_tally *tally, uint32_t id, const told_by *parent, strl_pm *mesh, strl_arena *arena)
{
    strl_writer payload = {0};
    if (id % 2)
        paint(mesh, arena, id);
    assert_int_equal(strl_payload_encode(mesh, parent ? &parent->reference : NULL, arena, &payload, NULL, NULL),
                     STRL_OK);
    uint32_t before = tally->accepted;
    compare_decoders(payload.data, payload.size, parent, tally);
    assert_int_equal(tally->accepted, before + 1);
    damage(&payload, id, parent, tally);
    tally->meshes++;
    strl__free(payload.data);
}

static void take_parent(strl_container *container, const strl_node *record, strl_arena *arena, told_by *parent)
{
    strl_node above;
    assert_int_equal(strl_container_node(container, 0, record->decode_parent, &above, NULL), STRL_OK);
    assert_int_equal(strl_container_mesh(container, 0, &above, arena, &parent->mesh, NULL), STRL_OK);
    const strl_pm *mesh = &parent->mesh;
    parent->reference = strl_payload_reference_of(mesh);
    strl_page_place(&parent->reference, above.anchor, record);
    parent->view = (strl__vmesh){.vertex_count = mesh->vertex_count,
                                 .triangle_count = mesh->triangle_count,
                                 .position = mesh->position,
                                 .normal = mesh->normal,
                                 .triangle = mesh->triangle};
    parent->told.mesh = &parent->view;
    for (unsigned k = 0; k < 3; k++)
        parent->told.offset[k] = (uint32_t)parent->reference.offset[k];
}

static void test_the_text_alone_is_enough_to_decode(void **state)
{
    (void)state;
    decode_tally tally = {0};
    uint32_t told = 0;
    strl_container *container;
    assert_int_equal(strl_container_open_path(torus.good, &container, NULL), STRL_OK);
    for (uint32_t id = 0; id < strl_container_tree(container, 0)->node_count; id++) {
        strl_arena arena;
        strl_node record;
        strl_pm mesh;
        strl_arena_init(&arena, 0);
        assert_int_equal(strl_container_node(container, 0, id, &record, NULL), STRL_OK);
        assert_int_equal(strl_container_mesh(container, 0, &record, &arena, &mesh, NULL), STRL_OK);
        told_by parent, *given = record.decode_parent == STRL_NONE ? NULL : &parent;
        told += given != NULL;
        if (given)
            take_parent(container, &record, &arena, given);
        visit(&tally, id, given, &mesh, &arena);
        visit(&tally, id, NULL, &mesh, &arena);
        strl_arena_deinit(&arena);
    }
    strl_container_close(container);
    assert_true(tally.meshes > 20 && told > 10);
    assert_true(tally.refused > 20 * tally.meshes);
}

static int setup(void **state)
{
    (void)state;
    model_setup(&torus, 160, 110, true);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    model_teardown(&torus);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_text_alone_is_enough_to_decode),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
