/* What a container says of its model to who only walks: counts, parts of vertices, sentences that name it. */
#include "container/fixture.h"

static strl_container *must_open(const fixture *self)
{
    strl_container *container;
    strl_error err;
    if (strl_container_open_path(self->path, &container, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return container;
}

static void each_vertex_is_of_the_part_and_material_it_was_written_with(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    uint32_t parts[64], materials[64];
    fixture_setup(&self, 5, 3);
    assert_int_equal(fixture_write(&self, &err), STRL_OK);
    strl_container *container = must_open(&self);
    for (uint32_t id = 0; id < self.node_count; id++) {
        uint32_t count = self.nodes[id].vertex_count, palette = 1 + id % 2;
        assert_int_equal(strl_container_vertex_parts(container, 0, id, count, parts, materials, &err), STRL_OK);
        for (uint32_t v = 0; v < count; v++) {
            uint32_t entry = v % palette; /* fixture_mesh */
            assert_int_equal(parts[v], (id + entry) % FIXTURE_PARTS);
            assert_int_equal(materials[v], entry % FIXTURE_MATERIALS);
        }
        assert_int_equal(strl_container_vertex_parts(container, 0, id, count, NULL, NULL, &err), STRL_OK);
    }
    strl_container_close(container);
    fixture_teardown(&self);
}

static void what_is_no_vertex_of_a_draw_item_is_refused(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    uint32_t parts[64];
    fixture_setup(&self, 3, 2);
    assert_int_equal(fixture_write(&self, &err), STRL_OK);
    strl_container *container = must_open(&self);
    uint32_t count = self.nodes[1].vertex_count;
    assert_int_equal(strl_container_vertex_parts(container, 0, 1, count + 1, parts, NULL, &err), STRL_ERR_ARGUMENT);
    assert_non_null(strstr(err.message, "node 1 of placement 0"));
    assert_int_equal(strl_container_vertex_parts(container, 1, 1, count, parts, NULL, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(strl_container_vertex_parts(container, 0, self.node_count, count, parts, NULL, &err),
                     STRL_ERR_ARGUMENT);
    assert_int_equal(strl_container_vertex_parts(container, 0, 1, count, parts, NULL, &err), STRL_OK);
    strl_container_close(container);
    fixture_teardown(&self);
}

static void triangles_are_those_of_the_finest_level(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    uint64_t expected = 0;
    fixture_setup(&self, 4, 3);
    assert_int_equal(fixture_write(&self, &err), STRL_OK);
    strl_container *container = must_open(&self);
    for (uint32_t id = 0; id < self.node_count; id++)
        expected += self.nodes[id].level == 0 ? self.nodes[id].triangle_count : 0;
    assert_int_equal(strl_container_triangle_count(container), expected);
    strl_container_close(container);
    fixture_teardown(&self);
}

static strl_status read_bytes(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    (void)err;
    memcpy(data, (const uint8_t *)context + offset, size);
    return STRL_OK;
}

static void a_broken_container_is_named_whatever_it_is_read_from(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    size_t size;
    fixture_setup(&self, 2, 2);
    assert_int_equal(fixture_write(&self, &err), STRL_OK);
    uint8_t *bytes = fixture_load(self.path, &size);
    bytes[100] ^= 1;
    const strl_source_callbacks callbacks = {
        .name = "hall in pack.zip", .bytes = size, .context = bytes, .read = read_bytes};
    strl_source *source;
    strl_container *container;
    assert_int_equal(strl_source_open_callbacks(&callbacks, 0, &source, &err), STRL_OK);
    assert_int_equal(strl_container_open(source, &container, &err), STRL_ERR_FORMAT);
    assert_null(container);
    assert_true(strncmp(err.message, "hall in pack.zip: ", 18) == 0);
    FILE *file = fopen(self.path, "wb");
    assert_true(file && fwrite(bytes, 1, size, file) == size && fclose(file) == 0);
    assert_int_equal(strl_container_open_path(self.path, &container, &err), STRL_ERR_FORMAT);
    assert_true(strncmp(err.message, self.path, strlen(self.path)) == 0);
    free(bytes);
    fixture_teardown(&self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_vertex_is_of_the_part_and_material_it_was_written_with),
        cmocka_unit_test(what_is_no_vertex_of_a_draw_item_is_refused),
        cmocka_unit_test(triangles_are_those_of_the_finest_level),
        cmocka_unit_test(a_broken_container_is_named_whatever_it_is_read_from),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
