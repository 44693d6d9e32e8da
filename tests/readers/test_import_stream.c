/* The stream that an importer writes: read whole, or refused with a sentence wherever it lies or ends early. */
#include <math.h>

#include "import_writer.h"
#include "reader_test.h"
#include "readers/import_stream.h"

#define NONE STRL_IMPORT_NO_MATERIAL

static strl_status open_stream(const char *name, strl_reader **reader, strl_error *err)
{
    strl_reader_desc desc = {.path = test_path(name), .scratch_dir = test_folder, .memory_bytes = MEMORY_LEAST};
    return strl__reader_open_as(&desc, &strl__format_import, reader, err);
}

static void save(const char *name, import_writer *stream)
{
    write_test_file(name, stream->bytes.data, stream->bytes.size);
}

static void read_stream(const char *name, read_result *result)
{
    strl_reader *reader;
    strl_error err = {0};
    strl_status status = open_stream(name, &reader, &err);
    *result = (read_result){.status = status, .err = err};
    if (status)
        return;
    read_pass(reader, result);
    strl_reader_close(reader);
}

/* Refuses the stream, saved and released here, with a sentence that has this in it. */
static void assert_stream_refused(import_writer *stream, strl_status status, const char *part_of_sentence)
{
    read_result result;
    save("refused.stream", stream);
    import_writer_deinit(stream);
    read_stream("refused.stream", &result);
    if (result.status != status || !strstr(result.err.message, part_of_sentence) ||
        !strstr(result.err.message, "refused.stream"))
        fail_msg("status %d, '%s', expected %d, '%s'", result.status, result.err.message, status, part_of_sentence);
    free_result(&result);
}

/* A quad with normals and colours and a triangle in one block of doubles, then a plain triangle: 4 triangles. */
static void write_rich(import_writer *stream)
{
    const double x[] = {0, 0.1, 1, 1, 0.1, 1, 0, 0.1, 0, 5, 5, 5};
    const float normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, NAN, 1};
    const uint16_t counts[] = {4, 3}, corners[] = {0, 1, 2, 3, 0, 1, 3};
    import_write_facts(stream, 2, 4);
    import_write_part(stream, "house/roof");
    import_write_material(stream, 0xff0000ffu, "red");
    import_write_material(stream, 0x80ff0000u, "red");
    import_begin_block(stream, 1 | 2 | 4 | 8, 1, 4, 2, 7);
    for (int i = 0; i < 12; i++)
        strl_writer_f64(&stream->bytes, x[i]);
    import_write_floats(stream, normals, 12);
    for (uint32_t i = 0; i < 4; i++)
        strl_writer_u32(&stream->bytes, 0xff000000u + i);
    import_write_shorts(stream, counts, 2);
    import_write_shorts(stream, corners, 7);
    import_end_record(stream);
    import_write_part(stream, "");
    import_write_triangle(stream, NONE, 7);
    import_write_totals(stream, 4, 5, 6, 7);
}

static void everything_arrives(void **state)
{
    (void)state;
    import_writer stream = {0};
    strl_reader *reader;
    strl_reader_info info;
    read_result result, again;
    strl_error err;
    uint32_t rgba;
    write_rich(&stream);
    save("rich.stream", &stream);
    import_writer_deinit(&stream);
    assert_int_equal(open_stream("rich.stream", &reader, &err), STRL_OK);
    strl_reader_info_get(reader, &info);
    assert_int_equal(info.default_up, STRL_AXIS_Z);
    assert_int_equal(info.triangles_hint, 4);
    read_pass(reader, &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.count, 4);
    const double plain[9] = {7, 0, 0, 8, 0, 0, 7, 1, 0};
    assert_positions(&result.triangles[3], plain);
    assert_int_equal(result.triangles[3].flags, 0);
    assert_int_equal(result.triangles[0].position[1][1] == 0.1, 1);
    assert_int_equal(result.triangles[2].flags, STRL_TRIANGLE_HAS_COLOUR); /* a normal that is none */
    assert_int_equal(result.triangles[2].colour[2], 0xff000003u);
    assert_string_equal(strl_reader_part_name(reader, result.triangles[0].part), "house/roof");
    assert_string_equal(strl_reader_part_name(reader, result.triangles[3].part), "");
    assert_string_equal(strl_reader_material(reader, result.triangles[0].material, &rgba), "red #2");
    assert_int_equal(rgba, 0x80ff0000u);
    strl_reader_material(reader, result.triangles[3].material, &rgba);
    assert_int_equal(rgba, 0xffffffffu);
    assert_int_equal(result.drops.lines, 5);
    assert_int_equal(result.drops.points, 6);
    assert_int_equal(result.drops.degenerate_faces, 7);
    assert_int_equal(strl_reader_bytes_done(reader), info.file_bytes);
    assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
    read_pass(reader, &again);
    assert_int_equal(again.count, 4);
    assert_true(again.checksum == result.checksum);
    assert_int_equal(again.drops.points, 6);
    assert_int_equal(strl_reader_part_count(reader), 2);
    assert_int_equal(strl_reader_material_count(reader), 3);
    strl_reader_close(reader);
    free_result(&result);
    free_result(&again);
}

static void what_is_not_finite_is_counted(void **state)
{
    (void)state;
    import_writer stream = {0};
    read_result result;
    import_write_facts(&stream, 1, 2);
    import_write_triangle(&stream, NONE, INFINITY);
    import_write_triangle(&stream, NONE, 1);
    import_write_totals(&stream, 2, 0, 0, 0);
    save("infinite.stream", &stream);
    import_writer_deinit(&stream);
    read_stream("infinite.stream", &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.count, 1);
    assert_int_equal(result.drops.nonfinite, 1);
    free_result(&result);
}

static void a_stream_cut_anywhere_is_refused(void **state)
{
    (void)state;
    import_writer stream = {0};
    write_rich(&stream);
    for (size_t size = 1; size < stream.bytes.size; size++) {
        read_result result;
        write_test_file("cut.stream", stream.bytes.data, size);
        read_stream("cut.stream", &result);
        if (result.status != STRL_ERR_FORMAT || result.count > 0 || !strstr(result.err.message, "cut.stream"))
            fail_msg("cut to %zu bytes: %d, '%s'", size, result.status, result.err.message);
        free_result(&result);
    }
    import_writer_deinit(&stream);
}

/* No change of one byte is read as other triangles: it is refused, or what changed is not of the triangles. */
static void a_changed_byte_is_noticed(void **state)
{
    (void)state;
    import_writer stream = {0};
    write_rich(&stream);
    size_t facts = 8 + 8 + 44;
    for (size_t at = facts; at < stream.bytes.size; at++) {
        read_result result;
        stream.bytes.data[at] ^= 0x41;
        write_test_file("changed.stream", stream.bytes.data, stream.bytes.size);
        stream.bytes.data[at] ^= 0x41;
        read_stream("changed.stream", &result);
        bool is_drops = at >= stream.bytes.size - 32 && at < stream.bytes.size - 8;
        if (is_drops ? result.status != STRL_OK : result.status == STRL_OK)
            fail_msg("byte %zu of %zu: %d, '%s'", at, stream.bytes.size, result.status, result.err.message);
        free_result(&result);
    }
    import_writer_deinit(&stream);
}

static void errors_are_told(void **state)
{
    (void)state;
    import_writer stream = {0};
    strl_writer_bytes(&stream.bytes, STRL_IMPORT_MAGIC, 8);
    import_write_error(&stream, STRL_IMPORT_BROKEN, "OFF: no\nvertices\xff");
    assert_stream_refused(&stream, STRL_ERR_FORMAT, ": OFF: no vertices ");
    strl_writer_bytes(&stream.bytes, STRL_IMPORT_MAGIC, 8);
    import_write_error(&stream, STRL_IMPORT_UNSUPPORTED, "");
    assert_stream_refused(&stream, STRL_ERR_UNSUPPORTED, "for a reason that was not told");
    import_write_facts(&stream, 0, 2);
    import_write_triangle(&stream, NONE, 0);
    import_write_error(&stream, STRL_IMPORT_MEMORY, "no more");
    assert_stream_refused(&stream, STRL_ERR_MEMORY, ": no more");
}

static void broken_frames_are_refused(void **state)
{
    (void)state;
    import_writer stream = {0};
    strl_writer_bytes(&stream.bytes, "STRLIMP2", 8);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected the word STRLIMP1 at byte 0");
    import_write_facts(&stream, 3, 0);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected facts or an error at byte 8");
    import_write_facts(&stream, 1, 0);
    import_begin(&stream, 7);
    import_end_record(&stream);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected a record of a known kind at byte 60");
    import_write_facts(&stream, 1, 0);
    strl_writer_u32(&stream.bytes, STRL_IMPORT_BLOCK);
    strl_writer_u32(&stream.bytes, 0x7fffffff);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected a record of at most 768 KiB at byte 60");
    import_write_facts(&stream, 1, 0);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected a record at byte 60");
    import_write_facts(&stream, 1, 0);
    import_write_totals(&stream, 0, 0, 0, 0);
    import_write_part(&stream, "late");
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected nothing more at byte 108");
}

static void lies_are_refused(void **state)
{
    (void)state;
    import_writer stream = {0};
    import_write_facts(&stream, 1, 2);
    import_write_triangle(&stream, NONE, 0);
    import_write_totals(&stream, 1, 0, 0, 0);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "it announces 2 triangles, ends with 1 and has 1");
    import_write_facts(&stream, 1, UINT64_MAX);
    import_write_triangle(&stream, NONE, 0);
    import_write_totals(&stream, UINT64_MAX, 0, 0, 0);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "and has 1");
    import_write_facts(&stream, 1, 1);
    import_write_triangle(&stream, 0, 0);
    import_write_totals(&stream, 1, 0, 0, 0);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected a block of a material that came before it at byte 60");
    import_write_facts(&stream, 1, 1);
    import_write_triangle(&stream, NONE, 0);
    stream.checksum ^= 1;
    import_write_totals(&stream, 1, 0, 0, 0);
    assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected another checksum in the end");
}

static void blocks_that_do_not_add_up_are_refused(void **state)
{
    (void)state;
    /* flags, vertices, faces, corners; then what is there: positions of 3 vertices and 3 corners. */
    static const uint32_t heads[][4] = {
        {0, 3, 1, 4},          {0, 2, 1, 3},     {0, 0, 1, 3},          {0, 3, 0, 0},
        {0, 3, 2, 3},          {16, 3, 1, 3},    {1, 3, 1, 3},          {2, 3, 1, 3},
        {4, 3, 1, 3},          {8, 3, 1, 3},     {0, 0xffffffff, 1, 3}, {0, 3, 1, 0xffffffff},
        {0, 3, 0x55555556, 2}, {0, 16385, 1, 3}, {0, 3, 5462, 16386},   {0, 4, 1, 3},
    };
    const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint16_t corners[] = {0, 1, 2};
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) {
        import_writer stream = {0};
        const uint32_t *head = heads[i];
        import_write_facts(&stream, 1, 1);
        import_begin_block(&stream, head[0], NONE, head[1], head[2], head[3]);
        import_write_floats(&stream, positions, 9);
        import_write_shorts(&stream, corners, 3);
        import_end_record(&stream);
        import_write_totals(&stream, 1, 0, 0, 0);
        assert_stream_refused(&stream, STRL_ERR_FORMAT, "expected a block whose counts fit its size at byte 60");
    }
}

static void corners_and_faces_are_checked(void **state)
{
    (void)state;
    const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const struct {
        uint16_t counts[2], corners[6];
        const char *sentence;
    } cases[] = {{{3, 3}, {0, 1, 2, 0, 1, 3}, "whose corners are among its vertices"},
                 {{4, 2}, {0, 1, 2, 0, 1, 2}, "whose counts fit its size"},
                 {{3, 4}, {0, 1, 2, 0, 1, 2}, "whose counts fit its size"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        import_writer stream = {0};
        import_write_facts(&stream, 1, 2);
        import_begin_block(&stream, 8, NONE, 3, 2, 6);
        import_write_floats(&stream, positions, 9);
        import_write_shorts(&stream, cases[i].counts, 2);
        import_write_shorts(&stream, cases[i].corners, 6);
        import_end_record(&stream);
        import_write_totals(&stream, 2, 0, 0, 0);
        assert_stream_refused(&stream, STRL_ERR_FORMAT, cases[i].sentence);
    }
}

/* As many corners as a block may have, in one polygon and in triangles, one block behind the other. */
static void full_blocks_fit(void **state)
{
    (void)state;
    const uint32_t corners = STRL_IMPORT_CORNERS_MOST;
    import_writer stream = {0};
    read_result result;
    import_write_facts(&stream, 1, corners - 2 + 5461);
    import_begin_block(&stream, 8, NONE, corners, 1, corners);
    for (uint32_t i = 0; i < corners; i++) {
        double angle = 6.283185307179586 * i / corners;
        const float position[3] = {(float)cos(angle), (float)sin(angle), 0};
        import_write_floats(&stream, position, 3);
    }
    strl_writer_u16(&stream.bytes, (uint16_t)corners);
    for (uint32_t i = 0; i < corners; i++)
        strl_writer_u16(&stream.bytes, (uint16_t)i);
    import_end_record(&stream);
    import_begin_block(&stream, 0, NONE, 3, 5461, 16383);
    import_write_floats(&stream, (const float[]){0, 0, 0, 1, 0, 0, 0, 1, 0}, 9);
    for (uint32_t i = 0; i < 16383; i++)
        strl_writer_u16(&stream.bytes, (uint16_t)(i % 3));
    import_end_record(&stream);
    import_write_totals(&stream, corners - 2 + 5461, 0, 0, 0);
    save("full.stream", &stream);
    import_writer_deinit(&stream);
    read_stream("full.stream", &result);
    if (result.status)
        fail_msg("%s", result.err.message);
    assert_int_equal(result.count, corners - 2 + 5461);
    free_result(&result);
}

static void faults_are_survived(void **state)
{
    (void)state;
    import_writer stream = {0};
    read_result whole, result = {0};
    write_rich(&stream);
    save("rich.stream", &stream);
    import_writer_deinit(&stream);
    read_stream("rich.stream", &whole);
    uint64_t n = 0;
    do {
        free_result(&result);
        strl__alloc_fail_after(++n);
        read_stream("rich.stream", &result);
        strl__alloc_fail_after(0);
        if (result.status && result.status != STRL_ERR_MEMORY)
            fail_msg("allocation %u: %s", (unsigned)n, result.err.message);
    } while (result.status && n < 1000);
    assert_in_range(n, 5, 999);
    assert_true(result.checksum == whole.checksum);
    free_result(&whole);
    free_result(&result);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(everything_arrives),
        cmocka_unit_test(what_is_not_finite_is_counted),
        cmocka_unit_test(a_stream_cut_anywhere_is_refused),
        cmocka_unit_test(a_changed_byte_is_noticed),
        cmocka_unit_test(errors_are_told),
        cmocka_unit_test(broken_frames_are_refused),
        cmocka_unit_test(lies_are_refused),
        cmocka_unit_test(blocks_that_do_not_add_up_are_refused),
        cmocka_unit_test(corners_and_faces_are_checked),
        cmocka_unit_test(full_blocks_fit),
        cmocka_unit_test(faults_are_survived),
    };
    return cmocka_run_group_tests(tests, make_test_folder, remove_test_folder);
}
