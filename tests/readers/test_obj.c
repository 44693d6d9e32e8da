#include "reader_test.h"

static const char corners[] = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\n";

static void read_text(const char *name, const char *text, read_result *result)
{
    write_test_text(name, text);
    read_test_file(name, MEMORY_LEAST, result);
    if (result->status)
        fail_msg("%s", result->err.message);
}

static void all_forms_of_an_index_name_the_same_corner(void **state)
{
    (void)state;
    static const char *const faces[] = {
        "f 1 2 3\n",          "f 1/1 2/7 3/2\n",
        "f 1//1 2//1 3//1\n", "f 1/1/1 2/1/1 3/1/1\n",
        "f -4 -3 -2\n",       "f -4//-1 -3//-1 -2//-1\n",
        "f 1/ 2/ 3/\n",       "f 1// 2// 3//\n",
        "f 1/1/ 2/1/ 3/1/\n", "f +1 02 003\n",
        "f 1 2 \\\n 3\n",     "f 1 \\\r\n2 3 # remark\n",
        "fo 1 2 3",           "  f\t1  2\t3  \n",
        "f 1 2 3 \\\n\n",
    };
    for (size_t i = 0; i < sizeof faces / sizeof *faces; i++) {
        char text[256];
        read_result result;
        snprintf(text, sizeof text, "%svn 0 0 2\nvt 0 0\n%s", corners, faces[i]);
        read_text("form.obj", text, &result);
        assert_int_equal(result.count, 1);
        assert_positions(&result.triangles[0], (double[]){0, 0, 0, 4, 0, 0, 4, 4, 0});
        bool has_normal = strstr(faces[i], "//1 ") || strstr(faces[i], "//-1 ") || strstr(faces[i], "/1/1 ");
        assert_int_equal(result.triangles[0].flags, has_normal ? STRL_TRIANGLE_HAS_NORMAL : 0);
        assert_true(result.triangles[0].normal[1][2] == (has_normal ? 2 : 0));
        free_result(&result);
    }
}

static void faces_may_stand_before_their_vertices(void **state)
{
    (void)state;
    read_result result;
    read_text("before.obj", "f 1 2 3\nv 1 0 0\nf -1 2 3\nv 0 1 0\nv 0 0 1\n", &result);
    assert_int_equal(result.count, 2);
    assert_positions(&result.triangles[1], (double[]){1, 0, 0, 0, 1, 0, 0, 0, 1});
    free_result(&result);
}

static void any_line_end_and_a_missing_last_one_are_accepted(void **state)
{
    (void)state;
    read_result result;
    read_text("n.obj", "\xef\xbb\xbfv 0 0 0\nv 1 0 0\n\nv 0 1 0\nf 1 2 3", &result);
    assert_int_equal(result.count, 1);
    free_result(&result);
    read_text("rn.obj", "v 0 0 0\r\nv 1 0 0\r\n\r\nv 0 1 0\r\nf 1 2 3", &result);
    assert_int_equal(result.count, 1);
    free_result(&result);
    read_text("r.obj", "v 0 0 0\rv 1 0 0\r\rv 0 1 0\rf 1 2 3", &result);
    assert_int_equal(result.count, 1);
    free_result(&result);
    assert_text_refused("r.obj", "v 0 0 0\rv 1 0 0\r\rv 0 1\rf 1 2 3",
                        "line 4: expected a number, found the end of the line");
}

static void objects_and_groups_are_parts(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err;
    read_result result;
    char text[512];
    snprintf(text, sizeof text,
             "%sf 1 2 3\ng left\nf 1 2 3\no house\nf 1 2 3\ng roof tiles  \nf 1 2 3\ng unused\no\ng left\n"
             "f 1 2 3\no b\xe4r \xc3\xa4\x01\nf 1 2 3\n",
             corners);
    write_test_text("parts.obj", text);
    assert_int_equal(open_test_file("parts.obj", 0, &reader, &err), STRL_OK);
    for (unsigned pass = 0; pass < 2; pass++) {
        static const uint32_t parts[] = {0, 1, 2, 3, 1, 4};
        read_pass(reader, &result);
        assert_int_equal(result.status, STRL_OK);
        for (unsigned i = 0; i < 6; i++)
            assert_int_equal(result.triangles[i].part, parts[i]);
        free_result(&result);
        assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
    }
    assert_int_equal(strl_reader_part_count(reader), 5);
    assert_string_equal(strl_reader_part_name(reader, 0), "");
    assert_string_equal(strl_reader_part_name(reader, 1), "left");
    assert_string_equal(strl_reader_part_name(reader, 2), "house");
    assert_string_equal(strl_reader_part_name(reader, 3), "house/roof tiles");
    assert_string_equal(strl_reader_part_name(reader, 4), "b\xc3\xa4r \xc3\xa4 ");
    strl_reader_close(reader);
}

static void materials_take_their_colours_from_the_libraries(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err;
    read_result result;
    uint32_t rgba;
    char text[512];
    write_test_text(
        "my colours.mtl",
        "newmtl red\nKa 1 1 1\nKd 1 0 0\n\nnewmtl glass  \r\n\tKd 0 0.5 1\n\td 0.25\nnewmtl fog\n"
        "Tr 0.75\nKd 0.2\nnewmtl halo\nd -halo 0.5\nKd spectral x.rfl\nKd one 2 3\nnewmtl wild\nKd 9 -3 nan");
    write_test_text("second.mtl", "Kd 0 0 0\nnewmtl second\nKd 0 1 0\n");
    snprintf(
        text, sizeof text,
        "mtllib my colours.mtl\n%sf 1 2 3\nusemtl glass\nf 1 2 3\nusemtl red\nf 1 2 3\nusemtl\tfog\n"
        "f 1 2 3\nusemtl nowhere\nf 1 2 3\nusemtl halo\nf 1 2 3\nusemtl wild\nf 1 2 3\nusemtl unused\nusemtl second\n"
        "f 1 2 3\nmtllib missing.mtl second.mtl\n",
        corners);
    write_test_text("materials.obj", text);
    assert_int_equal(open_test_file("materials.obj", 0, &reader, &err), STRL_OK);
    read_pass(reader, &result);
    assert_int_equal(result.status, STRL_OK);
    static const struct {
        const char *name;
        uint32_t rgba;
    } expected[] = {{"", 0xffffffffu},        {"glass", 0x40ff8000u}, {"red", 0xff0000ffu},  {"fog", 0x40333333u},
                    {"nowhere", 0xffffffffu}, {"halo", 0x80ffffffu},  {"wild", 0xffff00ffu}, {"second", 0xff00ff00u}};
    assert_int_equal(strl_reader_material_count(reader), 8);
    for (uint32_t i = 0; i < 8; i++) {
        assert_int_equal(result.triangles[i].material, i);
        assert_string_equal(strl_reader_material(reader, i, &rgba), expected[i].name);
        assert_int_equal(rgba, expected[i].rgba);
    }
    free_result(&result);
    strl_reader_close(reader);
}

/* Reads a model of one triangle after these mtllib lines; the caller closes the reader. */
static strl_reader *read_with_libraries(const char *lines)
{
    strl_reader *reader;
    strl_error err;
    read_result result;
    char text[512];
    snprintf(text, sizeof text, "%s%susemtl m\nf 1 2 3\n", lines, corners);
    write_test_text("libraries.obj", text);
    assert_int_equal(open_test_file("libraries.obj", 0, &reader, &err), STRL_OK);
    for (unsigned pass = 0; pass < 2; pass++) {
        read_pass(reader, &result);
        assert_int_equal(result.status, STRL_OK);
        assert_int_equal(result.count, 1);
        free_result(&result);
        assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
    }
    return reader;
}

static void libraries_that_cannot_be_read_are_told_once_each(void **state)
{
    (void)state;
    write_test_text("here.mtl", "newmtl m\nKd 0 1 0\n");
    assert_int_equal(strl_path_make_directory(test_path("folder.mtl"), NULL), STRL_OK);
    static const struct {
        const char *lines, *told[2];
    } cases[] = {
        {"mtllib here.mtl\n", {NULL}},
        {"mtllib\n", {NULL}},
        {"mtllib gone.mtl\nmtllib gone.mtl\n", {"/gone.mtl: No such file"}},
        {"mtllib gone with blanks.mtl\n", {"/gone with blanks.mtl: No such file"}},
        {"mtllib gone.mtl here.mtl folder.mtl\n", {"/gone.mtl: No such file", "/folder.mtl: expected a file"}},
        {"mtllib here.mtl \\\n gone.mtl\n", {"/gone.mtl: No such file"}},
        {"mtllib gone.mtl\nmtllib folder.mtl\n", {"/gone.mtl: No such file", "/folder.mtl: expected a file"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        strl_reader *reader = read_with_libraries(cases[i].lines);
        uint32_t expected = (cases[i].told[0] != NULL) + (cases[i].told[1] != NULL), rgba;
        if (strl_reader_missing_count(reader) != expected)
            fail_msg("%s: %u are missing", cases[i].lines, strl_reader_missing_count(reader));
        for (uint32_t m = 0; m < expected; m++)
            if (!strstr(strl_reader_missing(reader, m), cases[i].told[m]))
                fail_msg("%s: %s", cases[i].lines, strl_reader_missing(reader, m));
        strl_reader_material(reader, 0, &rgba);
        assert_int_equal(rgba, strstr(cases[i].lines, "here") ? 0xff00ff00u : 0xffffffffu);
        strl_reader_close(reader);
    }
    assert_int_equal(rmdir(test_path("folder.mtl")), 0);
}

static void vertices_are_counted_whether_used_or_not(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err;
    read_result result;
    write_test_text("points.obj", corners);
    assert_int_equal(open_test_file("points.obj", 0, &reader, &err), STRL_OK);
    read_pass(reader, &result);
    assert_int_equal(result.count, 0);
    assert_int_equal(strl_reader_vertex_count(reader), 4);
    free_result(&result);
    strl_reader_close(reader);
}

static void colours_of_vertices_are_read_and_weights_are_not(void **state)
{
    (void)state;
    read_result result;
    read_text("colour.obj", "v 0 0 0 1 0.5 0\nv 1 0 0 nan 0 2\nv 0 1 0 # white\nf 1 2 3\n", &result);
    assert_int_equal(result.triangles[0].flags, STRL_TRIANGLE_HAS_COLOUR);
    assert_int_equal(result.triangles[0].colour[0], 0xff0080ffu);
    assert_int_equal(result.triangles[0].colour[1], 0xffff00ffu);
    assert_int_equal(result.triangles[0].colour[2], 0xffffffffu);
    free_result(&result);
    read_text("weight.obj", "v 0 0 0 1\nv 1 0 0 0.5\nv 0 1 0 2\nf 1 2 3\n", &result);
    assert_int_equal(result.triangles[0].flags, 0);
    free_result(&result);
}

static void what_cannot_be_a_triangle_is_counted(void **state)
{
    (void)state;
    read_result result;
    char text[512];
    snprintf(text, sizeof text,
             "%sv nan 0 0\nv 0 inf 0\nf 1 2 3 4\nf 1 2\nf\nf 3\nl 1 2 3\nl 1 \\\n2\np 1 2\nf 1 2 5\nf 1 2 3 6\n"
             "curv2 1 2\nvp 1 2\n",
             corners);
    read_text("drops.obj", text, &result);
    assert_int_equal(result.count, 2);
    assert_int_equal(result.drops.degenerate_faces, 3);
    assert_int_equal(result.drops.lines, 2);
    assert_int_equal(result.drops.points, 1);
    assert_int_equal(result.drops.nonfinite, 3);
    free_result(&result);
}

static void bad_files_are_refused_with_a_line(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"v 0 0\n", "line 1: expected a number, found the end of the line"},
        {"v 0 0 z\n", "line 1: expected a number, found 'z'"},
        {"v 0 0 1e\n", "found '1e'"},
        {"v 0 0 0x10\n", "found '0x10'"},
        {"v 0 0 1,5\n", "found '1,5'"},
        {"v 0 0 0 red\n", "found 'red'"},
        {"vn 0 0\n", "line 1: expected a number"},
        {"v 0 0 0\n\nf 1 1 2\n", "line 3: expected the index of one of 1 vertices, found 2"},
        {"v 0 0 0\nf 0 1 1\n", "found 0"},
        {"v 0 0 0\nf -2 1 1\nv 0 0 0\n", "line 2: expected the index of one of 2 vertices, found -2"},
        {"v 0 0 0\nvn 0 0 1\nf 1//2 1//1 1//1\n", "expected the index of one of 1 normals, found 2"},
        {"v 0 0 0\nf 1 one 1\n", "line 2: expected a corner such as 1, 1/2, 1//3 or 1/2/3, found 'one'"},
        {"v 0 0 0\nf 1/1/1/1 1 1\n", "found '1/1/1/1'"},
        {"v 0 0 0\nf 1.0 1 1\n", "found '1.0'"},
        {"v 0 0 0\nf 99999999999999999999 1 1\n", "found '99999999999999999999'"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_text_refused("bad.obj", cases[i][0], cases[i][1]);
    write_test_file("wide.obj", "\xff\xfev\0 \0", 6);
    assert_refused("wide.obj", "line 1: expected a number, found the end of the file");
}

/* The text in UTF-16; letters beyond ASCII as \1 (two bytes of UTF-8), \2 (three), \3 (four), \4 (half a pair). */
static void write_wide(const char *name, const char *text, bool big_endian)
{
    static const unsigned letters[5][2] = {{0}, {0xe9}, {0x20ac}, {0xd83d, 0xde00}, {0xde00}};
    FILE *file = fopen(test_path(name), "wb");
    assert_non_null(file);
    fputs(big_endian ? "\xfe\xff" : "\xff\xfe", file);
    for (; *text; text++)
        for (unsigned k = 0; k < (*text == 3 ? 2 : 1); k++) {
            unsigned unit = *text < 5 ? letters[(int)*text][k] : (unsigned)*text;
            fputc((int)(big_endian ? unit >> 8 : unit & 255), file);
            fputc((int)(big_endian ? unit & 255 : unit >> 8), file);
        }
    assert_int_equal(fclose(file), 0);
}

static void text_in_utf_16_is_read(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 2; i++) {
        strl_reader *reader;
        strl_error err = {0};
        read_result result;
        write_wide("wide.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\no \1\2\3\4!\nf 1 2 3\n", i == 1);
        assert_int_equal(open_test_file("wide.obj", 0, &reader, &err), STRL_OK);
        for (unsigned pass = 0; pass < 2; pass++) {
            read_pass(reader, &result);
            assert_int_equal(result.status, STRL_OK);
            assert_int_equal(result.count, 1);
            assert_float_equal(result.triangles[0].position[1][0], 1, 0);
            free_result(&result);
            assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
        }
        assert_string_equal(strl_reader_part_name(reader, 0), "\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80\xef\xbf\xbd!");
        strl_reader_close(reader);
        write_wide("wide.obj", "v 0 0 0\nv 1 0 zero\n", i == 1);
        assert_refused("wide.obj", "wide.obj, line 2: expected a number, found 'zero'");
    }
}

static void a_comment_is_no_library(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err = {0};
    read_result result;
    uint32_t rgba;
    write_test_text("a b.mtl", "newmtl red\nKd 1 0 0\n");
    write_test_text("noted.obj", "mtllib a b.mtl # of the model\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_int_equal(open_test_file("noted.obj", 0, &reader, &err), STRL_OK);
    read_pass(reader, &result);
    free_result(&result);
    assert_int_equal(strl_reader_missing_count(reader), 0);
    assert_string_equal(strl_reader_material(reader, 0, &rgba), "red");
    assert_int_equal(rgba, 0xff0000ffu);
    strl_reader_close(reader);
}

/* Tokens and lines across the borders of the read buffer, and a polygon near the limit. */
static void long_lines_are_read_and_longer_polygons_refused(void **state)
{
    (void)state;
    const unsigned limit = STRL__POLYGON_CORNERS_MAX;
    for (unsigned extra = 0; extra < 2; extra++) {
        read_result result;
        FILE *file = fopen(test_path("long.obj"), "wb");
        assert_non_null(file);
        for (unsigned i = 0; i < limit + 1; i++) { /* a comb with a straight back: concave */
            double height = i == 0 || i + 1 == limit ? -5.0 : i % 2;
            fprintf(file, "v %u %g 0\n", i, height);
        }
        fprintf(file, "f");
        for (unsigned i = limit + extra; i > 0; i--)
            fprintf(file, " %032u/%032u", i, i);
        fprintf(file, "\n# %0300000d\nf 1 2 3", 0);
        fclose(file);
        if (extra) {
            assert_refused("long.obj", "line 16386: expected at most 16384 corners in a face, found 16385");
            continue;
        }
        read_test_file("long.obj", MEMORY_LEAST, &result);
        assert_int_equal(result.status, STRL_OK);
        assert_int_equal(result.count, limit - 2 + 1);
        free_result(&result);
    }
}

/* Vertices and normals beyond the smallest budget, used in scattered order. */
static void a_tiny_budget_gives_the_same_triangles(void **state)
{
    (void)state;
    const uint64_t count = 200000;
    FILE *file = fopen(test_path("big.obj"), "wb");
    assert_non_null(file);
    for (uint64_t i = 0; i < count; i++)
        fprintf(file, "v %d.5 %d -%de-2\nvn %d 1 %d\n", (int)(i % 1009), (int)(i / 1009), (int)(i % 97), (int)(i % 5),
                (int)(i % 3));
    for (uint64_t i = 0; i < count; i++) {
        uint64_t corner = strl__mix64(i);
        fprintf(file, "f %d//%d %d %d//%d\n", (int)(corner % count) + 1, (int)(corner / 7 % count) + 1, (int)(i + 1),
                (int)(corner / 99 % count) + 1, (int)(corner / 77 % count) + 1);
        if (i % 3 == 0)
            fprintf(file, "f %d//%d %d//%d %d//%d\n", (int)i + 1, (int)(corner / 3 % count) + 1,
                    (int)(corner % count) + 1, (int)i + 1, (int)(corner / 5 % count) + 1,
                    (int)(corner / 11 % count) + 1);
    }
    fclose(file);
    read_result small, large;
    read_test_file("big.obj", MEMORY_LEAST, &small);
    read_test_file("big.obj", (uint64_t)1 << 30, &large);
    assert_int_equal(small.status, STRL_OK);
    assert_int_equal(small.count, count + (count + 2) / 3);
    assert_true(small.checksum == large.checksum);
    assert_int_equal(small.triangles[0].flags, 0);
    assert_int_equal(small.triangles[1].flags, STRL_TRIANGLE_HAS_NORMAL);
    free_result(&small);
    free_result(&large);
    assert_rewinds("big.obj", MEMORY_LEAST);
    assert_int_equal(remove(test_path("big.obj")), 0);
    assert_int_equal(strl_path_remove_directory(test_folder, NULL),
                     STRL_OK); /* plain files only: no spill may be a folder */
    assert_int_equal(strl_path_make_directory(test_folder, NULL), STRL_OK);
}

static const char truncated[] =
    "mtllib none.mtl\no part\nv 0 0 0 1 1 1\nv 1.5 0 -2e1\nv 0 1 0\nvn 0 0 1\nvt 0 0\nusemtl m\nf 1/1/1 2/1/1 3/1/1\n"
    "g other\nf -3//-1 -2//-1 \\\n -1//-1 1//1\n# end\n";

static void every_beginning_of_a_file_is_refused_or_read(void **state)
{
    (void)state;
    size_t refused = read_every_beginning("cut.obj", truncated, sizeof truncated - 1);
    assert_in_range(refused, 5, sizeof truncated / 2);
}

static void a_failed_allocation_or_read_is_an_error(void **state)
{
    (void)state;
    write_test_text("fault.obj", truncated);
    read_through_faults("fault.obj", strl__alloc_fail_after);
    read_through_faults("fault.obj", strl_file_fail_reads_after);
}

static void facts_are_known_at_opening(void **state)
{
    (void)state;
    strl_error err;
    strl_reader *reader;
    strl_reader_info info;
    write_test_text("named.ply", "# a remark\n\nv 0 0 0\n"); /* content counts before names */
    assert_int_equal(open_test_file("named.ply", 0, &reader, &err), STRL_OK);
    strl_reader_info_get(reader, &info);
    assert_string_equal(info.format, "obj");
    assert_int_equal(info.default_up, STRL_AXIS_Y);
    strl_reader_close(reader);
    write_test_text("only.obj", "# a remark\n");
    assert_int_equal(open_test_file("only.obj", 0, &reader, &err), STRL_OK);
    strl_reader_close(reader);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_forms_of_an_index_name_the_same_corner),
        cmocka_unit_test(faces_may_stand_before_their_vertices),
        cmocka_unit_test(any_line_end_and_a_missing_last_one_are_accepted),
        cmocka_unit_test(objects_and_groups_are_parts),
        cmocka_unit_test(materials_take_their_colours_from_the_libraries),
        cmocka_unit_test(libraries_that_cannot_be_read_are_told_once_each),
        cmocka_unit_test(vertices_are_counted_whether_used_or_not),
        cmocka_unit_test(colours_of_vertices_are_read_and_weights_are_not),
        cmocka_unit_test(what_cannot_be_a_triangle_is_counted),
        cmocka_unit_test(bad_files_are_refused_with_a_line),
        cmocka_unit_test(text_in_utf_16_is_read),
        cmocka_unit_test(a_comment_is_no_library),
        cmocka_unit_test(long_lines_are_read_and_longer_polygons_refused),
        cmocka_unit_test(a_tiny_budget_gives_the_same_triangles),
        cmocka_unit_test(every_beginning_of_a_file_is_refused_or_read),
        cmocka_unit_test(a_failed_allocation_or_read_is_an_error),
        cmocka_unit_test(facts_are_known_at_opening),
    };
    return cmocka_run_group_tests(tests, make_test_folder, remove_test_folder);
}
