/* What a container says of its model to who only walks: counts, parts of vertices, sentences that name it. */
#include "container/fixture.h"

#include <math.h>

#include "verify/verify.h"

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

/* A fixture with images of its first `count` materials. */
static strl_status write_images(const fixture *self, const strl_material_image *images, unsigned count, strl_error *err)
{
    const strl_container_writer_desc desc = fixture_desc(self);
    strl_container_writer *writer;
    uint64_t bytes = 0;
    strl_status status = strl_container_writer_create(&desc, &writer, err);
    if (status == STRL_OK)
        status = fixture_add_all(self, writer, err);
    for (unsigned i = 0; i < count && status == STRL_OK; i++)
        status = strl_container_writer_add_image(writer, &images[i], err);
    if (status == STRL_OK)
        status = strl_container_writer_finish(writer, &bytes, err);
    strl_container_writer_destroy(writer);
    return status;
}

/* What the independent checker says of tables and header; "" = nothing. */
static void verify_tables(const fixture *self, char sentence[480])
{
    strl_verify_report report;
    strl_error err = {0};
    const strl_verify_desc desc = {.model = self->path, .memory_bytes = 64u << 20, .jobs = 1, .cuts = 1};
    if (strl_verify_run(&desc, &report, &err) != STRL_OK)
        fail_msg("%s", err.message);
    const strl_verify_check *header = &report.checks[STRL_VERIFY_HEADER], *tables = &report.checks[STRL_VERIFY_TABLES];
    snprintf(sentence, 480, "%s", header->failures ? header->first : tables->failures ? tables->first : "");
    strl_verify_report_deinit(&report);
}

static void images_come_back_as_they_were_written(void **state)
{
    (void)state;
    fixture self;
    strl_error err = {0};
    char reference[40], sentence[480];
    const strl_material_image images[FIXTURE_MATERIALS] = {{.reference = "textures/wall \xc3\xa4.png",
                                                            .wrap = {STRL_WRAP_CLAMP, STRL_WRAP_MIRROR},
                                                            .texcoord_min = {-2, 0.5f},
                                                            .texcoord_extent = {7, 0}},
                                                           {.reference = NULL},
                                                           {.reference = "", .texcoord_extent = {1e6f, 1}}};
    fixture_setup(&self, 3, 2);
    assert_int_equal(write_images(&self, images, FIXTURE_MATERIALS, &err), STRL_OK);
    verify_tables(&self, sentence);
    assert_string_equal(sentence, "");
    strl_container *container = must_open(&self);
    assert_true(strl_container_get_info(container)->has_images);
    for (uint32_t i = 0; i < FIXTURE_MATERIALS; i++) {
        strl_material_image image;
        assert_int_equal(strl_container_material_image(container, i, reference, sizeof reference, &image, &err),
                         STRL_OK);
        assert_int_equal(image.reference != NULL, images[i].reference != NULL);
        assert_string_equal(reference, images[i].reference ? images[i].reference : "");
        for (int k = 0; k < 2; k++) {
            assert_int_equal(image.wrap[k], images[i].wrap[k]);
            assert_true(image.texcoord_min[k] == images[i].texcoord_min[k] &&
                        image.texcoord_extent[k] == images[i].texcoord_extent[k]);
        }
    }
    strl_container_close(container);
    fixture_teardown(&self);
}

static void images_that_the_format_forbids_are_refused_by_both_readers(void **state)
{
    (void)state;
    const strl_material_image broken[] = {{.reference = "a", .wrap = {(strl_wrap)3}},
                                          {.reference = "a", .wrap = {STRL_WRAP_CLAMP, (strl_wrap)200}},
                                          {.reference = "a", .texcoord_min = {INFINITY, 0}},
                                          {.reference = "a", .texcoord_extent = {0, NAN}},
                                          {.reference = "a", .texcoord_extent = {-1, 1}}};
    for (unsigned i = 0; i < sizeof broken / sizeof *broken; i++) {
        fixture self;
        strl_error err = {0};
        char reference[40], sentence[480];
        strl_material_image image, images[FIXTURE_MATERIALS] = {{.reference = "fine"}, broken[i], {.reference = NULL}};
        fixture_setup(&self, 2, 2);
        assert_int_equal(write_images(&self, images, FIXTURE_MATERIALS, &err), STRL_OK);
        strl_container *container = must_open(&self);
        assert_int_equal(strl_container_material_image(container, 0, reference, sizeof reference, &image, &err),
                         STRL_OK);
        assert_int_equal(strl_container_material_image(container, 1, reference, sizeof reference, &image, &err),
                         STRL_ERR_FORMAT);
        assert_null(image.reference);
        assert_non_null(strstr(err.message, "images"));
        verify_tables(&self, sentence);
        assert_non_null(strstr(sentence, "image 1"));
        strl_container_close(container);
        fixture_teardown(&self);
    }
}

static void images_of_some_materials_alone_are_refused(void **state)
{
    (void)state;
    fixture self;
    strl_error err = {0};
    strl_container *container;
    char sentence[480];
    const strl_material_image image = {.reference = "a"};
    fixture_setup(&self, 2, 2);
    assert_int_equal(write_images(&self, &image, 1, &err), STRL_OK);
    assert_int_equal(strl_container_open_path(self.path, &container, &err), STRL_ERR_FORMAT);
    assert_non_null(strstr(err.message, "section images: 1 items"));
    verify_tables(&self, sentence);
    assert_non_null(strstr(sentence, "images of 1 materials"));
    fixture_teardown(&self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_vertex_is_of_the_part_and_material_it_was_written_with),
        cmocka_unit_test(what_is_no_vertex_of_a_draw_item_is_refused),
        cmocka_unit_test(triangles_are_those_of_the_finest_level),
        cmocka_unit_test(a_broken_container_is_named_whatever_it_is_read_from),
        cmocka_unit_test(images_come_back_as_they_were_written),
        cmocka_unit_test(images_that_the_format_forbids_are_refused_by_both_readers),
        cmocka_unit_test(images_of_some_materials_alone_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
