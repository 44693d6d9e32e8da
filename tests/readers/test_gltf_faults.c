/* glTF with its buffer beside it: rewinding, what changes under the reader, no memory, no reads. */
#include "reader_test.h"

#include "base/cursor.h"
#include "readers/gltf.h"

#define GRID 24u

/* A sheet of GRID x GRID squares with its vertices, colours and indices in one file. */
static void write_buffer(const char *name)
{
    strl_writer out = {0};
    for (uint32_t i = 0; i < (GRID + 1) * (GRID + 1); i++) {
        strl_writer_f32(&out, (float)(i % (GRID + 1)));
        strl_writer_f32(&out, (float)(i / (GRID + 1)));
        strl_writer_f32(&out, (float)(i * 7 % 5) / 4);
    }
    for (uint32_t i = 0; i < GRID * GRID; i++) {
        uint32_t corner = i / GRID * (GRID + 1) + i % GRID;
        const uint32_t corners[6] = {0, 1, GRID + 2, 0, GRID + 2, GRID + 1};
        for (unsigned k = 0; k < 6; k++)
            strl_writer_u16(&out, (uint16_t)(corner + corners[k]));
    }
    write_test_file(name, out.data, out.size);
    strl__free(out.data);
}

static void write_sheet(const char *model, const char *buffer)
{
    char text[1200];
    const unsigned vertices = (GRID + 1) * (GRID + 1), indices = 6 * GRID * GRID;
    snprintf(text, sizeof text,
             "{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0,"
             "\"name\":\"sheet\"}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},"
             "\"indices\":1,\"material\":0}]}],\"materials\":[{\"name\":\"grey\"}],\"accessors\":[{"
             "\"bufferView\":0,\"componentType\":5126,\"count\":%u,\"type\":\"VEC3\"},{"
             "\"bufferView\":1,\"componentType\":5123,\"count\":%u,\"type\":\"SCALAR\"}],"
             "\"bufferViews\":[{\"buffer\":0,\"byteLength\":%u},{\"buffer\":0,\"byteOffset\":%u,"
             "\"byteLength\":%u}],\"buffers\":[{\"uri\":\"%s\",\"byteLength\":%u}]}",
             vertices, indices, 12 * vertices, 12 * vertices, 2 * indices, buffer, 12 * vertices + 2 * indices);
    write_test_text(model, text);
    write_buffer(buffer);
}

static void a_second_pass_gives_the_same_triangles(void **state)
{
    (void)state;
    write_sheet("sheet.gltf", "sheet.bin");
    assert_rewinds("sheet.gltf", MEMORY_LEAST);
    assert_rewinds("sheet.gltf", 0);
}

static void a_buffer_that_changes_is_refused_by_name(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err;
    read_result result;
    write_sheet("sheet.gltf", "sheet.bin");
    assert_int_equal(open_test_file("sheet.gltf", 0, &reader, &err), STRL_OK);
    read_pass(reader, &result);
    assert_int_equal(result.count, 2 * GRID * GRID);
    free_result(&result);
    FILE *file = fopen(test_path("sheet.bin"), "ab");
    fputc('x', file);
    fclose(file);
    assert_int_equal(strl_reader_rewind(reader, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "sheet.bin has changed"));
    strl_reader_close(reader);
}

static void a_buffer_that_shrinks_while_it_is_read_is_refused(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err;
    read_result result;
    write_sheet("sheet.gltf", "sheet.bin");
    assert_int_equal(open_test_file("sheet.gltf", 0, &reader, &err), STRL_OK);
    assert_int_equal(truncate(test_path("sheet.bin"), 500), 0);
    read_pass(reader, &result);
    assert_int_equal(result.status, STRL_ERR_FORMAT);
    assert_non_null(strstr(result.err.message, "sheet.bin"));
    strl_reader_close(reader);
    free_result(&result);
}

static void a_failed_allocation_or_read_is_an_error(void **state)
{
    (void)state;
    write_sheet("fault.gltf", "fault.bin");
    read_through_faults("fault.gltf", strl__alloc_fail_after);
    read_through_faults("fault.gltf", strl_file_fail_reads_after);
}

/* An image of the fuzzer's corpus beside the model. */
static void copy_image(const char *name)
{
    char path[512];
    static uint8_t bytes[65536];
    snprintf(path, sizeof path, "%s/fuzz/corpus/image/%s", getenv("STRL_TEST_ROOT") ? getenv("STRL_TEST_ROOT") : ".",
             name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    write_test_file(name, bytes, fread(bytes, 1, sizeof bytes, file));
    fclose(file);
}

static void write_painted_triangle(const char *model, const char *buffer, const char *image)
{
    char text[1400];
    strl_writer out = {0};
    static const float numbers[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0.1f, 0.2f, 0.9f, 0.1f, 0.5f, 0.8f};
    for (unsigned i = 0; i < 15; i++)
        strl_writer_f32(&out, numbers[i]);
    for (unsigned i = 0; i < 3; i++)
        strl_writer_u16(&out, (uint16_t)i);
    write_test_file(buffer, out.data, out.size);
    strl__free(out.data);
    snprintf(text, sizeof text,
             "{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
             "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"indices\":2,"
             "\"material\":0}]}],\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}],"
             "\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"%s\"}],\"accessors\":[{\"bufferView\":0,"
             "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},{\"bufferView\":0,\"byteOffset\":36,"
             "\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"},{\"bufferView\":0,\"byteOffset\":60,"
             "\"componentType\":5123,\"count\":3,\"type\":\"SCALAR\"}],\"bufferViews\":[{\"buffer\":0,"
             "\"byteLength\":66}],\"buffers\":[{\"uri\":\"%s\",\"byteLength\":66}]}",
             image, buffer);
    write_test_text(model, text);
}

/* No failed allocation passes for an image that cannot be used: the next pass would give other colours. */
static void a_failed_allocation_under_an_image_is_an_error(void **state)
{
    (void)state;
    static const char *const images[] = {"rgba.png", "adam7.png", "halved.png", "baseline.jpg"};
    for (unsigned i = 0; i < sizeof images / sizeof *images; i++) {
        strl_reader *reader;
        strl_error err;
        read_result result;
        char text[64];
        copy_image(images[i]);
        write_painted_triangle("painted.gltf", "painted.bin", images[i]);
        read_through_faults("painted.gltf", strl__alloc_fail_after);
        snprintf(text, sizeof text, "newmtl m\nmap_Kd %s\n", images[i]);
        write_test_text("painted.mtl", text);
        write_test_text("painted.obj",
                        "mtllib painted.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.1 0.1\nvt 0.9 0.3\nvt 0 1\n"
                        "f 1/1 2/2 3/3\n");
        read_through_faults("painted.obj", strl__alloc_fail_after);
        assert_int_equal(open_test_file("painted.gltf", MEMORY_LEAST, &reader, &err), STRL_OK);
        read_pass(reader, &result);
        assert_int_equal(strl_reader_missing_image_count(reader), 0);
        assert_int_equal(result.count, 1);
        free_result(&result);
        strl_reader_close(reader);
    }
}

/* Its buffer stands in its text and is decoded to memory. */
static void a_reader_that_rests_holds_nothing(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err;
    read_result first, none, again;
    write_test_text("text.gltf",
                    "{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
                    "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
                    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],"
                    "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],\"buffers\":[{\"byteLength\":36,"
                    "\"uri\":\"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}]}");
    assert_int_equal(open_test_file("text.gltf", MEMORY_LEAST, &reader, &err), STRL_OK);
    const strl__gltf *gltf = strl__gltf_of(reader);
    read_pass(reader, &first);
    assert_true(gltf->text_bytes == 36 && reader->prepared);
    strl_reader_rest(reader);
    read_pass(reader, &none);
    assert_true(none.status == STRL_OK && none.count == 0);
    assert_true(gltf->text_bytes == 0 && !reader->prepared);
    assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
    read_pass(reader, &again);
    assert_true(first.count == 1 && again.count == 1 && again.checksum == first.checksum);
    strl_reader_close(reader);
    free_result(&first);
    free_result(&none);
    free_result(&again);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_second_pass_gives_the_same_triangles),
        cmocka_unit_test(a_buffer_that_changes_is_refused_by_name),
        cmocka_unit_test(a_buffer_that_shrinks_while_it_is_read_is_refused),
        cmocka_unit_test(a_reader_that_rests_holds_nothing),
        cmocka_unit_test(a_failed_allocation_or_read_is_an_error),
        cmocka_unit_test(a_failed_allocation_under_an_image_is_an_error),
    };
    return cmocka_run_group_tests(tests, make_test_folder, remove_test_folder);
}
