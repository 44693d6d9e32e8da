#include "reader_test.h"

#include "base/cursor.h"

typedef enum encoding { ASCII, LITTLE, BIG } encoding;

static const char *const encoding_names[] = {"ascii", "binary_little_endian", "binary_big_endian"};

/* Writes values as text or bytes, whatever the encoding. */
typedef struct ply_writer {
    strl_writer bytes;
    encoding encoding;
} ply_writer;

static void put_text(ply_writer *ply, const char *text)
{
    strl_writer_bytes(&ply->bytes, text, strlen(text));
}

static void put(ply_writer *ply, strl__scalar type, double value)
{
    char text[40];
    uint64_t bits = 0;
    unsigned size = strl__scalar_bytes(type);
    float single = (float)value;
    if (ply->encoding == ASCII) {
        snprintf(text, sizeof text, "%.17g ", value);
        put_text(ply, text);
        return;
    }
    if (type == STRL__F32)
        memcpy(&bits, &single, sizeof single);
    else if (type == STRL__F64)
        memcpy(&bits, &value, sizeof value);
    else
        bits = (uint64_t)(int64_t)value;
    if (ply->encoding == BIG)
        bits = __builtin_bswap64(bits) >> (64 - 8 * size);
    strl_writer_le(&ply->bytes, size, bits);
}

static void end_line(ply_writer *ply)
{
    if (ply->encoding == ASCII)
        put_text(ply, "\n");
}

static void put_header(ply_writer *ply, const char *rest)
{
    put_text(ply, "ply\nformat ");
    put_text(ply, encoding_names[ply->encoding]);
    put_text(ply, " 1.0\n");
    put_text(ply, rest);
    put_text(ply, "end_header\n");
}

static void save(ply_writer *ply, const char *name)
{
    assert_false(ply->bytes.failed);
    write_test_file(name, ply->bytes.data, ply->bytes.size);
    strl__free(ply->bytes.data);
    *ply = (ply_writer){0};
}

static const double square[4][3] = {{0, 0, 0.5}, {4, 0, 0.25}, {4, 3, -0.5}, {0, 3, 8}};

/* A square of one triangle and one quad, in types and an order that no writer uses, with lists and
 * elements that must be passed over, before, between and behind. */
static void write_odd_square(ply_writer *ply, bool faces_first)
{
    const char *vertex = "element vertex 4\nproperty uchar red\nproperty double z\nproperty list uchar short tags\n"
                         "property short x\nproperty ushort nx\nproperty int y\nproperty uchar green\n"
                         "property float ny\nproperty uchar blue\nproperty double nz\nproperty uchar alpha\n";
    const char *face = "element face 2\nproperty uchar quality\nproperty list ushort uint vertex_indices\n"
                       "property list int float texcoord\n";
    char header[1024];
    snprintf(header, sizeof header,
             "comment odd\nelement camera 1\nproperty float fov\nproperty list uchar int ids\n%s%s"
             "element range_grid 2\nproperty list char int vertex_indices\nelement nothing 3\n",
             faces_first ? face : vertex, faces_first ? vertex : face);
    put_header(ply, header);
    put(ply, STRL__F32, 55);
    put(ply, STRL__U8, 2);
    put(ply, STRL__I32, -7);
    put(ply, STRL__I32, 1000000);
    end_line(ply);
    for (unsigned pass = 0; pass < 2; pass++) {
        for (unsigned i = 0; i < 4 && (pass == 1) == faces_first; i++) {
            put(ply, STRL__U8, 10 * i);
            put(ply, STRL__F64, square[i][2]);
            put(ply, STRL__U8, i);
            for (unsigned tag = 0; tag < i; tag++)
                put(ply, STRL__I16, -1);
            put(ply, STRL__I16, square[i][0]);
            put(ply, STRL__U16, 1);
            put(ply, STRL__I32, square[i][1]);
            put(ply, STRL__U8, 20 * i);
            put(ply, STRL__F32, -2);
            put(ply, STRL__U8, 30 * i);
            put(ply, STRL__F64, i);
            put(ply, STRL__U8, 128);
            end_line(ply);
        }
        for (unsigned i = 0; i < 2 && (pass == 0) == faces_first; i++) {
            put(ply, STRL__U8, 200);
            put(ply, STRL__U16, 3 + i);
            for (unsigned corner = 0; corner < 3 + i; corner++)
                put(ply, STRL__U32, 3 - corner);
            put(ply, STRL__I32, 1);
            put(ply, STRL__F32, 0.5);
            end_line(ply);
        }
    }
    for (unsigned i = 0; i < 2; i++) {
        put(ply, STRL__I8, 1);
        put(ply, STRL__I32, 77);
        end_line(ply);
    }
}

static void assert_odd_square(const char *name)
{
    read_result result;
    read_test_file(name, 0, &result);
    if (result.status)
        fail_msg("%s", result.err.message);
    assert_int_equal(result.count, 3);
    assert_positions(&result.triangles[0], (double[]){0, 3, 8, 4, 3, -0.5, 4, 0, 0.25});
    for (unsigned i = 0; i < 3; i++)
        assert_int_equal(result.triangles[i].flags, STRL_TRIANGLE_HAS_COLOUR | STRL_TRIANGLE_HAS_NORMAL);
    assert_int_equal(result.triangles[0].colour[0], 0x80000000u | 90u << 16 | 60u << 8 | 30u);
    assert_true(result.triangles[0].normal[0][0] == 1 && result.triangles[0].normal[0][1] == -2 &&
                result.triangles[0].normal[0][2] == 3);
    free_result(&result);
}

static void any_types_order_and_encoding_give_the_same_mesh(void **state)
{
    (void)state;
    for (encoding e = ASCII; e <= BIG; e++)
        for (int faces_first = 0; faces_first < 2; faces_first++) {
            ply_writer ply = {.encoding = e};
            write_odd_square(&ply, faces_first);
            save(&ply, "odd.ply");
            assert_odd_square("odd.ply");
        }
}

static void every_beginning_of_a_file_is_refused_or_read(void **state)
{
    (void)state;
    for (encoding e = ASCII; e <= BIG; e++) {
        ply_writer ply = {.encoding = e};
        write_odd_square(&ply, e == BIG);
        size_t refused = read_every_beginning("cut.ply", ply.bytes.data, ply.bytes.size);
        /* A binary file must be whole; a text may lack the digits and blanks of its last line. */
        assert_int_equal(refused, ply.bytes.size - (e == ASCII ? 3 : 0));
        strl__free(ply.bytes.data);
    }
}

static void strips_become_triangles_of_one_orientation(void **state)
{
    (void)state;
    for (encoding e = ASCII; e <= BIG; e++) {
        ply_writer ply = {.encoding = e};
        put_header(&ply, "element vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
                         "element tristrips 2\nproperty list int int vertex_indices\nproperty uchar tag\n");
        for (unsigned i = 0; i < 5; i++) {
            put(&ply, STRL__F32, i / 2);
            put(&ply, STRL__F32, i % 2);
            put(&ply, STRL__F32, 0);
            end_line(&ply);
        }
        const int items[] = {8, 0, 1, 2, 3, -1, 2, 3, 4};
        for (unsigned i = 0; i < 9; i++) {
            put(&ply, STRL__I32, items[i]);
            if (i == 4)
                end_line(&ply); /* a strip may go on in the next line */
        }
        put(&ply, STRL__U8, 1);
        end_line(&ply);
        put(&ply, STRL__I32, 0);
        put(&ply, STRL__U8, 2);
        end_line(&ply);
        save(&ply, "strips.ply");
        read_result result;
        read_test_file("strips.ply", 0, &result);
        assert_int_equal(result.status, STRL_OK);
        assert_int_equal(result.count, 3);
        assert_positions(&result.triangles[0], (double[]){0, 0, 0, 0, 1, 0, 1, 0, 0});
        assert_positions(&result.triangles[1], (double[]){1, 0, 0, 0, 1, 0, 1, 1, 0});
        assert_positions(&result.triangles[2], (double[]){1, 0, 0, 1, 1, 0, 2, 0, 0});
        free_result(&result);
    }
}

#define TRIANGLE "property float x\nproperty float y\nproperty float z\n"
#define FACE "property list uchar int vertex_indices\nend_header\n"

static void real_colours_and_colours_of_faces_are_read(void **state)
{
    (void)state;
    read_result result;
    write_test_text("real.ply", "ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE
                                "property float red\nproperty float green\nproperty float blue\nelement face 1\n" FACE
                                "0 0 0 0 0.5 1\n1 0 0 -1 2 nan\n0 1 0 0 0.5 1\n3 0 1 2\n");
    read_test_file("real.ply", 0, &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.triangles[0].colour[0], 0xffff8000u);
    assert_int_equal(result.triangles[0].colour[1], 0xffffff00u);
    free_result(&result);
    write_test_text("faces.ply", "ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE
                                 "element face 2\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n" FACE
                                 "0 0 0\n1 0 0\n0 1 0\n1 2 3 3 0 1 2\n4 5 6 3 2 1 0\n");
    read_test_file("faces.ply", 0, &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.triangles[0].colour[2], 0xff030201u);
    assert_int_equal(result.triangles[1].colour[0], 0xff060504u);
    assert_int_equal(result.triangles[1].flags, STRL_TRIANGLE_HAS_COLOUR);
    free_result(&result);
}

static void a_signature_in_the_header_and_bytes_behind_the_last_record_are_passed_over(void **state)
{
    (void)state;
    read_result result;
    write_test_text("signed.ply", "ply\nformat ascii 1.0\nCreated by a program\nelement vertex 3\n" TRIANGLE
                                  "element face 1\n" FACE "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n");
    read_test_file("signed.ply", 0, &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.count, 1);
    assert_int_equal(result.drops.unread_bytes, strlen("3 0 1 2\n"));
    free_result(&result);
    ply_writer ply = {.encoding = LITTLE};
    write_odd_square(&ply, true);
    put_text(&ply, "more");
    save(&ply, "more.ply");
    read_test_file("more.ply", 0, &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.drops.unread_bytes, 4);
    free_result(&result);
}

static void what_cannot_be_a_triangle_is_counted(void **state)
{
    (void)state;
    read_result result;
    write_test_text("drops.ply",
                    "ply\nformat ascii 1.0\nelement vertex 5\n" TRIANGLE "element edge 2\n"
                    "property int vertex1\nproperty int vertex2\nelement face 5\n" FACE
                    "0 0 0\n1 0 0\n0 1 0\nnan 0 0\n0 -inf 0\n0 1\n1 2\n3 0 1 2\n2 0 1\n0\n3 0 1 3\n4 0 1 2 4\n");
    read_test_file("drops.ply", 0, &result);
    assert_int_equal(result.status, STRL_OK);
    assert_int_equal(result.count, 1);
    assert_int_equal(result.drops.nonfinite, 3);
    assert_int_equal(result.drops.degenerate_faces, 2);
    assert_int_equal(result.drops.lines, 2);
    free_result(&result);
}

static void other_line_ends_and_words_too_many_are_accepted(void **state)
{
    (void)state;
    static const char *const ends[] = {"\n", "\r\n", "\r"};
    const char *text = "ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE
                       "\n0 0 0 9 9\n1 0 0 9\n\n0 1 0\n3 0 1 2 0.5 0.5\n\n";
    for (unsigned e = 0; e < 3; e++) {
        ply_writer ply = {.encoding = ASCII};
        for (const char *c = text; *c; c++)
            put_text(&ply, *c == '\n' ? ends[e] : (char[]){*c, 0});
        save(&ply, "ends.ply");
        read_result result;
        read_test_file("ends.ply", 0, &result);
        assert_int_equal(result.status, STRL_OK);
        assert_int_equal(result.count, 1);
        free_result(&result);
    }
}

/* They belong into the header, but some programs write them anywhere between lines. */
static void comments_between_records_are_passed_over(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 2\n" FACE
        "\n0 0 0\ncomment this is another\ncomment\n\n1 0 0\nobj_info 7 8 9\n0 1 0\n"
        "comment before faces\n3 0 1 2\n  comment 3 0 1 2\n3 2 1 0\ncomment the end",
        "ply\nformat ascii 1.0\nelement edge 1\nproperty int vertex1\nelement vertex 3\n" TRIANGLE
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        "comment first\n1\n0 0 0\n1 0 0\ncomment\n0 1 0\n5 0 1\ncomment inside a strip\n2 -1 0\n"};
    for (unsigned i = 0; i < 2; i++) {
        read_result result;
        write_test_text("comments.ply", texts[i]);
        read_test_file("comments.ply", MEMORY_LEAST, &result);
        if (result.status)
            fail_msg("%s", result.err.message);
        assert_int_equal(result.count, i ? 1 : 2);
        assert_positions(&result.triangles[0], (double[]){0, 0, 0, 1, 0, 0, 0, 1, 0});
        assert_int_equal(result.drops.lines, i);
        free_result(&result);
        assert_rewinds("comments.ply", MEMORY_LEAST);
    }
    assert_text_refused("inside.ply",
                        "ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE
                        "0 0 comment\n0 0 0\n0 0 0\n3 0 1 2\n",
                        "line 10: expected a number, found 'comment'");
    assert_text_refused("short.ply",
                        "ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE
                        "0 0 0\n0 0 0\n0 0 0\ncomment 3 0 1 2\n",
                        "line 14: expected the length of a list, found the end of the file");
}

/* In a binary file with \r line ends, a first data byte of \n is data. */
static void the_byte_after_the_header_is_data(void **state)
{
    (void)state;
    static const char *const ends[] = {"\n", "\r\n", "\r"};
    for (unsigned e = 0; e < 3; e++) {
        ply_writer ply = {.encoding = LITTLE};
        for (const char *c =
                 "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uchar uchar vertex_indices"
                 "\nelement vertex 10\nproperty uchar x\nproperty char y\nproperty uchar z\nend_header\n";
             *c; c++)
            put_text(&ply, *c == '\n' ? ends[e] : (char[]){*c, 0});
        put(&ply, STRL__U8, '\n');
        for (unsigned i = 0; i < 10; i++)
            put(&ply, STRL__U8, i);
        for (unsigned i = 0; i < 30; i++)
            put(&ply, STRL__U8, i * i % 13);
        save(&ply, "newline.ply");
        read_result result;
        read_test_file("newline.ply", 0, &result);
        assert_int_equal(result.status, STRL_OK);
        assert_int_equal(result.count, 8);
        free_result(&result);
    }
}

static void bad_files_are_refused_with_a_place(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"ply\n", "line 2: expected 'end_header', found the end of the file"},
        {"ply\nend_header\n", "line 2: expected a line 'format'"},
        {"ply\nformat ascii 2.0\n", "line 2: expected version '1.0', found '2.0'"},
        {"ply\nformat binary_middle_endian 1.0\n", "found 'binary_middle_endian'"},
        {"ply\nformat ascii 1.0\nproperty float x\n", "line 3: expected an element before its properties"},
        {"ply\nformat ascii 1.0\nelement vertex -3\n", "line 3: expected a count of records, found '-3'"},
        {"ply\nformat ascii 1.0\nelement vertex 99999999999999999999\n", "expected a count of records"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\n", "line 4: expected a type"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\n", "expected an integer type"},
        {"ply\nformat ascii 1.0\nelement vertex 0\nelement vertex 0\n", "one element 'vertex' only"},
        {"ply\nsurprise\nformat ascii 1.0\n", "line 2: expected 'element'"},
        {"ply\nformat ascii 1.0\nelement vertex 0\nsurprise\n", "line 4: expected 'element'"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
         "expected properties x, y and z"},
        {"ply\nformat ascii 1.0\nelement face 1\nproperty int a\nend_header\n1\n",
         "expected a list property vertex_indices"},
        {"ply\nformat ascii 1.0\nelement face 1\n" FACE "3 0 1 2\n", "expected an element 'vertex'"},
        {"ply\nformat ascii 1.0\nelement vertex 999999999999999999\n" TRIANGLE "end_header\n1 2 3\n",
         "announces 999999999999999999"},
        {"ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE "0 0 0\n0 0\n0 0 0\n3 0 1 2\n",
         "line 11: expected a number, found the end of the line"},
        {"ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE
         "0 0 0\n0 zero 0\n0 0 0\n3 0 1 2\n",
         "line 11: expected a number, found 'zero'"},
        {"ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE "0 0 0\n0 0 0\n0 0 0\n3 0 1 3\n",
         "line 13: expected a vertex index below 3, found 3"},
        {"ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE "0 0 0\n0 0 0\n0 0 0\n3 0 1 -1\n",
         "found -1"},
        {"ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 1\n" FACE
         "0 0 0\n0 0 0\n0 0 0\n200 0 1 2\n",
         "expected the length of a list below"},
        {"ply\nformat ascii 1.0\nelement vertex 3\n" TRIANGLE "element face 2\n" FACE
         "0 0 0\n0 0 0\n0 0 0\n3 0 1 2\n\n\n\n\n",
         "line 18: expected the length of a list, found the end of the file"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_text_refused("bad.ply", cases[i][0], cases[i][1]);
}

static void lying_binary_counts_are_refused_without_work(void **state)
{
    (void)state;
    const char *sizes[] = {"element vertex 1000000000000\n", "element vertex 4\n"};
    for (unsigned i = 0; i < 2; i++) {
        ply_writer ply = {.encoding = LITTLE};
        char header[256];
        snprintf(header, sizeof header, "%s" TRIANGLE "element face 1\nproperty list uint int vertex_indices\n",
                 sizes[i]);
        put_header(&ply, header);
        for (unsigned k = 0; k < 12; k++)
            put(&ply, STRL__F32, k);
        put(&ply, STRL__U32, 4000000000.0);
        save(&ply, "lie.ply");
        assert_refused("lie.ply",
                       i ? "expected the length of a list below 1, found 4000000000" : "announces 1000000000000");
    }
}

static void a_face_of_too_many_corners_is_refused(void **state)
{
    (void)state;
    ply_writer ply = {.encoding = LITTLE};
    put_header(&ply, "element vertex 3\n" TRIANGLE "element face 1\nproperty list uint uchar vertex_indices\n");
    for (unsigned k = 0; k < 9; k++)
        put(&ply, STRL__F32, k);
    put(&ply, STRL__U32, STRL__POLYGON_CORNERS_MAX + 1);
    for (unsigned k = 0; k < STRL__POLYGON_CORNERS_MAX + 1; k++)
        put(&ply, STRL__U8, k % 3);
    save(&ply, "many.ply");
    assert_refused("many.ply", "expected a number of corners below 16385, found 16385");
}

#define SIDE 600u

/* A bumpy grid whose vertices stand in a scattered order: more than the smallest budget holds at
 * once. */
static void write_scattered_grid(encoding e, const char *name)
{
    ply_writer ply = {.encoding = e};
    char header[256];
    snprintf(header, sizeof header,
             "element vertex %u\n" TRIANGLE "property float nx\nproperty float ny\n"
             "property float nz\nelement face %u\nproperty list uchar int vertex_indices\n",
             SIDE * SIDE, (SIDE - 1) * (SIDE - 1));
    put_header(&ply, header);
    const uint64_t step = 233323; /* a prime that does not divide SIDE^2: a walk over all vertices */
    for (uint64_t i = 0; i < SIDE * SIDE; i++) {
        uint64_t cell = i * step % (SIDE * SIDE);
        put(&ply, STRL__F32, (double)(cell % SIDE));
        put(&ply, STRL__F32, (double)(cell / SIDE));
        put(&ply, STRL__F32, (double)(strl__mix64(cell) % 16));
        put(&ply, STRL__F32, 1);
        put(&ply, STRL__F32, 0);
        put(&ply, STRL__F32, (double)(cell % 7));
        end_line(&ply);
    }
    uint32_t *place = malloc(SIDE * SIDE * sizeof *place);
    for (uint64_t i = 0; i < SIDE * SIDE; i++)
        place[i * step % (SIDE * SIDE)] = (uint32_t)i;
    for (uint32_t y = 0; y + 1 < SIDE; y++)
        for (uint32_t x = 0; x + 1 < SIDE; x++) {
            const uint32_t cell = y * SIDE + x;
            put(&ply, STRL__U8, 4);
            put(&ply, STRL__I32, place[cell]);
            put(&ply, STRL__I32, place[cell + 1]);
            put(&ply, STRL__I32, place[cell + SIDE + 1]);
            put(&ply, STRL__I32, place[cell + SIDE]);
            end_line(&ply);
        }
    free(place);
    save(&ply, name);
}

static void a_tiny_budget_gives_the_same_triangles(void **state)
{
    (void)state;
    uint64_t checksum = 0;
    for (encoding e = ASCII; e <= BIG; e++) {
        read_result small, large;
        write_scattered_grid(e, "grid.ply");
        read_test_file("grid.ply", MEMORY_LEAST, &small);
        read_test_file("grid.ply", (uint64_t)1 << 30, &large);
        assert_int_equal(small.status, STRL_OK);
        assert_int_equal(small.count, 2 * (SIDE - 1) * (SIDE - 1));
        assert_true(small.checksum == large.checksum);
        if (e != ASCII)
            assert_true(small.checksum == checksum);
        checksum = small.checksum;
        free_result(&small);
        free_result(&large);
    }
    assert_rewinds("grid.ply", MEMORY_LEAST);
}

static void a_text_that_must_spill_needs_a_scratch_folder(void **state)
{
    (void)state;
    strl_error err;
    strl_reader *reader;
    read_result result;
    write_scattered_grid(ASCII, "grid.ply");
    strl_reader_desc desc = {.path = test_path("grid.ply"), .memory_bytes = MEMORY_LEAST};
    assert_int_equal(strl_reader_open(&desc, &reader, &err), STRL_OK);
    read_pass(reader, &result);
    assert_int_equal(result.status, STRL_ERR_ARGUMENT);
    free_result(&result);
    strl_reader_close(reader);
    read_test_file("grid.ply", MEMORY_LEAST, &result);
    assert_int_equal(result.status, STRL_OK);
    free_result(&result);
    strl_file_fail_writes_after(1);
    read_test_file("grid.ply", MEMORY_LEAST, &result);
    strl_file_fail_writes_after(0);
    assert_int_equal(result.status, STRL_ERR_DISK_FULL);
    free_result(&result);
}

static void a_rewind_gives_the_same_and_notices_a_changed_file(void **state)
{
    (void)state;
    strl_error err;
    strl_reader *reader;
    ply_writer ply = {.encoding = BIG};
    write_odd_square(&ply, true);
    save(&ply, "rewind.ply");
    assert_rewinds("rewind.ply", 0);
    assert_int_equal(open_test_file("rewind.ply", 0, &reader, &err), STRL_OK);
    write_test_text("rewind.ply", "ply\n");
    assert_int_equal(strl_reader_rewind(reader, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "has changed"));
    strl_reader_close(reader);
}

static void a_failed_allocation_or_read_is_an_error(void **state)
{
    (void)state;
    for (encoding e = ASCII; e <= BIG; e++) {
        ply_writer ply = {.encoding = e};
        write_odd_square(&ply, e == LITTLE);
        save(&ply, "fault.ply");
        read_through_faults("fault.ply", strl__alloc_fail_after);
        read_through_faults("fault.ply", strl_file_fail_reads_after);
    }
}

static void facts_are_known_at_opening(void **state)
{
    (void)state;
    strl_error err;
    strl_reader *reader;
    strl_reader_info info;
    ply_writer ply = {.encoding = BIG};
    uint32_t rgba;
    write_odd_square(&ply, true);
    size_t size = ply.bytes.size;
    save(&ply, "named.stl"); /* content counts before names */
    assert_int_equal(open_test_file("named.stl", 0, &reader, &err), STRL_OK);
    strl_reader_info_get(reader, &info);
    assert_string_equal(info.format, "ply");
    assert_int_equal(info.default_up, STRL_AXIS_Z);
    assert_int_equal(info.triangles_hint, 2);
    assert_int_equal(info.file_bytes, size);
    assert_int_equal(strl_reader_part_count(reader), 1);
    assert_string_equal(strl_reader_part_name(reader, 0), "");
    assert_int_equal(strl_reader_material_count(reader), 1);
    assert_string_equal(strl_reader_material(reader, 0, &rgba), "");
    assert_int_equal(rgba, 0xffffffffu);
    strl_reader_close(reader);
    strl_reader_close(NULL);
    assert_int_equal(open_test_file("named.stl", MEMORY_LEAST - 1, &reader, &err), STRL_ERR_ARGUMENT);
    assert_null(reader);
    assert_int_equal(open_test_file("missing.ply", 0, &reader, &err), STRL_ERR_IO);
    write_test_text("what.txt", "once upon a time\n");
    assert_refused("what.txt", "expected a PLY, STL, OBJ or glTF file by its first bytes or its name's ending, "
                               "or a name's ending that assimp knows, found one that begins with 'once upon a time?'");
    write_test_file("what.bin", "RIFF\2\0\0\0", 8);
    assert_refused("what.bin", "expected a mesh, found raw data: name the model that it belongs to");
    write_test_file("what.obj.gz", "\x1f\x8b\x08", 3);
    assert_refused("what.obj.gz", "found a gzip archive: unpack it and name the model in it");
    write_test_text("empty.ply", "");
    assert_refused("empty.ply", "found an empty file");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_types_order_and_encoding_give_the_same_mesh),
        cmocka_unit_test(every_beginning_of_a_file_is_refused_or_read),
        cmocka_unit_test(strips_become_triangles_of_one_orientation),
        cmocka_unit_test(real_colours_and_colours_of_faces_are_read),
        cmocka_unit_test(a_signature_in_the_header_and_bytes_behind_the_last_record_are_passed_over),
        cmocka_unit_test(what_cannot_be_a_triangle_is_counted),
        cmocka_unit_test(other_line_ends_and_words_too_many_are_accepted),
        cmocka_unit_test(comments_between_records_are_passed_over),
        cmocka_unit_test(the_byte_after_the_header_is_data),
        cmocka_unit_test(bad_files_are_refused_with_a_place),
        cmocka_unit_test(lying_binary_counts_are_refused_without_work),
        cmocka_unit_test(a_face_of_too_many_corners_is_refused),
        cmocka_unit_test(a_tiny_budget_gives_the_same_triangles),
        cmocka_unit_test(a_text_that_must_spill_needs_a_scratch_folder),
        cmocka_unit_test(a_rewind_gives_the_same_and_notices_a_changed_file),
        cmocka_unit_test(a_failed_allocation_or_read_is_an_error),
        cmocka_unit_test(facts_are_known_at_opening),
    };
    return cmocka_run_group_tests(tests, make_test_folder, remove_test_folder);
}
