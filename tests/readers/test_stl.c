#include "reader_test.h"

#include "base/cursor.h"

static void write_binary(strl_writer *stl, const char *header, uint32_t count)
{
    char head[80] = {0};
    memcpy(head, header, strlen(header));
    strl_writer_bytes(stl, head, sizeof head);
    strl_writer_u32(stl, count);
    for (uint32_t i = 0; i < count; i++) {
        for (unsigned k = 0; k < 12; k++)
            strl_writer_f32(stl, (float)(i + k));
        strl_writer_u16(stl, 0x1234);
    }
}

static void binary_is_known_by_its_size_even_if_it_begins_with_solid(void **state)
{
    (void)state;
    static const char *const headers[] = {"made by somebody", "solid but binary"};
    for (unsigned h = 0; h < 2; h++) {
        strl_writer stl = {0};
        read_result result;
        write_binary(&stl, headers[h], 5);
        write_test_file("b.stl", stl.data, stl.size);
        strl__free(stl.data);
        read_test_file("b.stl", 0, &result);
        assert_int_equal(result.status, STRL_OK);
        assert_int_equal(result.count, 5);
        assert_positions(&result.triangles[2], (double[]){5, 6, 7, 8, 9, 10, 11, 12, 13});
        assert_int_equal(result.triangles[2].flags, 0);
        free_result(&result);
        assert_rewinds("b.stl", MEMORY_LEAST);
    }
}

static void a_binary_file_of_another_size_is_refused(void **state)
{
    (void)state;
    strl_writer stl = {0};
    write_binary(&stl, "solid", 3);
    assert_int_equal(read_every_beginning("cut.stl", stl.data, stl.size), stl.size);
    write_test_file("long.stl", stl.data, stl.size);
    FILE *file = fopen(test_path("long.stl"), "ab");
    fputc('\n', file);
    fclose(file);
    assert_refused("long.stl",
                   "byte 80: announces 3 triangles, for which 234 bytes were expected, found a file of 235");
    stl.data[83] = 0xff;
    write_test_file("huge.stl", stl.data, stl.size);
    assert_refused("huge.stl", "announces 4278190083 triangles");
    strl__free(stl.data);
}

static const char two_solids[] =
    "solid first one\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n"
    "   vertex 0 1 0\n  endloop\n endfacet\nendsolid first one\n"
    "SOLID second # by hand\n# a remark\n\tFacet Normal nan 0 0 OUTER LOOP Vertex 0 0 0 vertex 1 0 0\r\n"
    "vertex 1. 1 .0e2 vertex +0 1 -0 endloop endfacet facet outer loop vertex 0 0 0\r"
    "vertex 2 0 0 endloop endfacet facet normal 1 1 1 outer loop vertex 0 0 nan vertex 1 0 0 "
    "vertex 0 1 0 endloop endfacet\nendsolid\nsolid first one\nfacet normal 0 0 0 outer loop "
    "vertex 0 0 1 vertex 1 0 1 vertex 0 1 1e0 endloop endfacet endsolid first one\n";

static void solids_of_a_text_are_parts(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err;
    read_result result;
    write_test_text("two.stl", two_solids);
    assert_int_equal(open_test_file("two.stl", 0, &reader, &err), STRL_OK);
    read_pass(reader, &result);
    if (result.status)
        fail_msg("%s", result.err.message);
    assert_int_equal(result.count, 4);
    assert_int_equal(result.drops.nonfinite, 1);
    assert_int_equal(result.drops.degenerate_faces, 1);
    assert_positions(&result.triangles[0], (double[]){0, 0, 0, 1, 0, 0, 0, 1, 0});
    assert_positions(&result.triangles[2], (double[]){0, 0, 0, 1, 1, 0, 0, 1, 0});
    assert_int_equal(strl_reader_part_count(reader), 2);
    assert_string_equal(strl_reader_part_name(reader, 0), "first one");
    assert_string_equal(strl_reader_part_name(reader, 1), "second # by hand");
    assert_int_equal(result.triangles[0].part, 0);
    assert_int_equal(result.triangles[1].part, 1);
    assert_int_equal(result.triangles[3].part, 0);
    strl_reader_close(reader);
    free_result(&result);
    assert_rewinds("two.stl", MEMORY_LEAST);
}

static void every_beginning_of_a_text_is_refused_or_read(void **state)
{
    (void)state;
    size_t refused = read_every_beginning("cut.stl", two_solids, sizeof two_solids - 1);
    assert_in_range(refused, sizeof two_solids - 80, sizeof two_solids - 1); /* readable only between solids */
}

static void bad_texts_are_refused_with_a_line(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n0\nvertex 1 0 up\n",
         "line 6: expected a coordinate, found 'up'"},
        {"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex",
         "line 5: expected a coordinate, found the end of the file"},
        {"solid\nface normal 0 0 1\n", "line 2: expected 'facet' or 'endsolid', found 'face'"},
        {"solid\nfacet normal 0 0 1\nfacet",
         "line 3: expected 'outer loop', 'vertex', 'endloop' or 'endfacet', found 'facet'"},
        {"solid x\nendsolid x\nv 0 0 0\n", "line 3: expected 'solid', found 'v'"},
        {"solid x\n", "line 2: expected 'facet' or 'endsolid', found the end of the file"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_text_refused("bad.stl", cases[i][0], cases[i][1]);
    assert_text_refused("words.stl", "nothing of the kind\n", "line 1: expected 'solid', found 'nothing'");
}

/* More solids than the budget has room for names: refused, not swallowed. */
static void names_without_end_are_refused(void **state)
{
    (void)state;
    FILE *file = fopen(test_path("names.stl"), "wb");
    assert_non_null(file);
    for (unsigned i = 0; i < 20000; i++)
        fprintf(
            file,
            "solid a rather long name for a solid, which is number %u of very many of its kind\nfacet normal 0 0 0\n"
            "outer loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid\n",
            i);
    fclose(file);
    assert_refused("names.stl", "bytes of names");
    read_result result;
    read_test_file("names.stl", 0, &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.count, 20000);
    free_result(&result);
}

static void a_failed_allocation_or_read_is_an_error(void **state)
{
    (void)state;
    strl_writer stl = {0};
    write_binary(&stl, "faults", 4);
    write_test_file("fault.stl", stl.data, stl.size);
    strl__free(stl.data);
    read_through_faults("fault.stl", strl__alloc_fail_after);
    read_through_faults("fault.stl", strl_file_fail_reads_after);
    write_test_text("fault.stl", two_solids);
    read_through_faults("fault.stl", strl__alloc_fail_after);
    read_through_faults("fault.stl", strl_file_fail_reads_after);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(binary_is_known_by_its_size_even_if_it_begins_with_solid),
        cmocka_unit_test(a_binary_file_of_another_size_is_refused),
        cmocka_unit_test(solids_of_a_text_are_parts),
        cmocka_unit_test(every_beginning_of_a_text_is_refused_or_read),
        cmocka_unit_test(bad_texts_are_refused_with_a_line),
        cmocka_unit_test(names_without_end_are_refused),
        cmocka_unit_test(a_failed_allocation_or_read_is_an_error),
    };
    return cmocka_run_group_tests(tests, make_test_folder, remove_test_folder);
}
