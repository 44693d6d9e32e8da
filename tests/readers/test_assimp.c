/* Foreign formats: what the importer gives arrives, and whatever becomes of it is one sentence that names the file,
 * soon, with nothing left running and nothing left in scratch. The importers that misbehave are scripts. */
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "import_writer.h"
#include "platform/process.h"
#include "platform/thread.h"
#include "reader_test.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define IS_SANITIZED true
#else
#define IS_SANITIZED false
#endif

static char importer[PATH_MAX]; /* the script, or "" for the real one */
static strl_reader_child child; /* what the tests ask for */
static uint64_t whole_bytes;    /* as if by --memory */

static void write_script(const char *lines)
{
    char text[2048];
    snprintf(text, sizeof text, "#!/bin/sh\ncd %s\n%s\n", test_folder, lines);
    write_test_text("importer", text);
    assert_int_equal(chmod(test_path("importer"), 0755), 0);
    snprintf(importer, sizeof importer, "%s", test_path("importer"));
}

static void make_scratch(char *path, size_t size)
{
    snprintf(path, size, "%s/scratch", test_folder);
    assert_int_equal(strl_path_make_directory(path, NULL), STRL_OK);
}

static strl_status open_foreign(const char *name, strl_reader **reader, strl_error *err)
{
    char scratch[128];
    make_scratch(scratch, sizeof scratch);
    child.importer = importer[0] ? importer : NULL;
    strl_reader_desc desc = {.path = test_path(name),
                             .scratch_dir = scratch,
                             .memory_bytes = MEMORY_LEAST,
                             .whole_bytes = whole_bytes,
                             .child = child};
    return strl_reader_open(&desc, reader, err);
}

static void assert_nothing_left(void)
{
    char scratch[128];
    make_scratch(scratch, sizeof scratch);
    assert_int_equal(rmdir(scratch), 0);
    assert_true(waitpid(-1, NULL, WNOHANG) < 0 && errno == ECHILD);
}

static void assert_import_fails(const char *script, strl_status expected, const char *part_of_sentence)
{
    strl_reader *reader;
    strl_error err = {0};
    write_script(script);
    write_test_text("model.fbx", "nothing that matters");
    strl_status status = open_foreign("model.fbx", &reader, &err);
    assert_null(reader);
    if (status != expected || !strstr(err.message, part_of_sentence) || !strstr(err.message, "model.fbx") ||
        strchr(err.message, '\n'))
        fail_msg("status %d, '%s', expected %d, '%s'", status, err.message, expected, part_of_sentence);
    assert_nothing_left();
}

/* A good stream of some triangles in the folder's file `stream`. */
static void write_stream(uint32_t triangles)
{
    import_writer stream = {0};
    import_write_facts(&stream, 0, triangles);
    import_write_part(&stream, "a/b");
    for (uint32_t i = 0; i < triangles; i++)
        import_write_triangle(&stream, STRL_IMPORT_NO_MATERIAL, (float)i);
    import_write_totals(&stream, triangles, 0, 2, 0);
    write_test_file("stream", stream.bytes.data, stream.bytes.size);
    import_writer_deinit(&stream);
}

static void a_stream_is_spooled_and_read_twice(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_reader_info info;
    strl_reader_costs costs;
    read_result first, second;
    strl_error err = {0};
    write_stream(500);
    write_script("test $# = 1 && test -s \"$1\" && exec cat stream");
    write_test_text("model.fbx", "nothing that matters");
    strl_status status = open_foreign("model.fbx", &reader, &err);
    if (status)
        fail_msg("%s", err.message);
    strl_reader_info_get(reader, &info);
    strl_reader_costs_get(reader, &costs);
    assert_string_equal(info.format, "assimp");
    assert_int_equal(info.default_up, STRL_AXIS_X);
    assert_true(costs.scratch_bytes > 500 * 40 && costs.child_rss_bytes > 0);
    read_pass(reader, &first);
    assert_int_equal(strl_reader_rewind(reader, &err), STRL_OK);
    read_pass(reader, &second);
    assert_int_equal(first.count, 500);
    assert_int_equal(first.drops.points, 2);
    assert_true(second.count == 500 && second.checksum == first.checksum);
    assert_string_equal(strl_reader_part_name(reader, 0), "a/b");
    strl_reader_close(reader);
    free_result(&first);
    free_result(&second);
    assert_nothing_left();
}

static void death_is_one_sentence(void **state)
{
    (void)state;
    write_stream(500);
    assert_import_fails("kill -SEGV $$", STRL_ERR_FORMAT, "was ended by signal 11 (Segmentation fault)");
    assert_import_fails("head -c 5000 stream; kill -ABRT $$", STRL_ERR_FORMAT, "was ended by signal 6 (Aborted)");
    assert_import_fails("cat stream; kill -SEGV $$", STRL_ERR_FORMAT, "was ended by signal 11");
    assert_import_fails("exit 3", STRL_ERR_FORMAT, "the program that imports it ended with status 3");
    assert_import_fails("cat stream; echo 'it has died' >&2; exit 9", STRL_ERR_FORMAT, "with status 9: it has died");
    assert_import_fails("kill -KILL $$", STRL_ERR_MEMORY,
                        "was ended by signal 9 (Killed): the machine's memory may have run out");
    assert_import_fails("echo terminate after throwing std::bad_alloc >&2; kill -ABRT $$", STRL_ERR_MEMORY,
                        "may be broken: convert it to PLY");
    whole_bytes = 1u << 30;
    assert_import_fails("echo terminate after throwing std::bad_alloc >&2; kill -ABRT $$", STRL_ERR_MEMORY,
                        "give more by --memory");
    whole_bytes = 0;
}

static void hanging_is_one_sentence(void **state)
{
    (void)state;
    uint64_t start = strl_clock_ns();
    child.cpu_seconds = 1;
    assert_import_fails("exec sleep 1000", STRL_ERR_LIMIT, "takes more than 4 s, its limit, and was stopped");
    assert_import_fails("head -c 30 stream; exec >&-; exec sleep 1000", STRL_ERR_LIMIT,
                        "has closed its output but did not end within 10 s, and was stopped");
    assert_import_fails("sleep 1000 & kill -9 $$", STRL_ERR_LIMIT, "takes more than"); /* the pipe stays open */
    /* Of processor time, unless others have so much of it that the clock comes first; test_process has that limit
     * alone. */
    assert_import_fails("while :; do :; done", STRL_ERR_LIMIT, "and was stopped");
    child = (strl_reader_child){0};
    assert_true(strl_clock_ns() - start < 60000000000u);
}

static void a_lying_stream_is_one_sentence(void **state)
{
    (void)state;
    write_stream(500);
    assert_import_fails("exec cat /dev/zero", STRL_ERR_FORMAT, "is broken");
    assert_import_fails("cat stream; exec cat /dev/zero", STRL_ERR_FORMAT,
                        "more than the 100000 bytes that it announces");
    assert_import_fails("head -c 10000 stream", STRL_ERR_FORMAT, "is broken: expected a");
    assert_import_fails("head -c 20 stream", STRL_ERR_FORMAT, "is broken: expected a");
    assert_import_fails(":", STRL_ERR_FORMAT, "is broken: expected the word");
    assert_import_fails("cat stream; echo more", STRL_ERR_FORMAT, "expected nothing more");
    assert_import_fails("echo a greeting; cat stream", STRL_ERR_FORMAT, "expected the word");
    assert_import_fails("head -c 36 stream; head -c 16 /dev/zero | tr '\\0' '\\177'; tail -c +53 stream",
                        STRL_ERR_DISK_FULL, "bytes free");
}

static void an_error_is_told(void **state)
{
    (void)state;
    import_writer stream = {0};
    strl_writer_bytes(&stream.bytes, STRL_IMPORT_MAGIC, 8);
    import_write_error(&stream, STRL_IMPORT_BROKEN, "assimp cannot import it: no root");
    write_test_file("stream", stream.bytes.data, stream.bytes.size);
    import_writer_deinit(&stream);
    assert_import_fails("cat stream; exit 1", STRL_ERR_FORMAT, "model.fbx: assimp cannot import it: no root");
    strl_writer_bytes(&stream.bytes, STRL_IMPORT_MAGIC, 8);
    import_write_error(&stream, STRL_IMPORT_MEMORY, "no memory");
    write_test_file("stream", stream.bytes.data, stream.bytes.size);
    import_writer_deinit(&stream);
    child.memory_bytes = 333u << 20;
    assert_import_fails("cat stream; exit 2", STRL_ERR_MEMORY, "more than 333M of memory");
    child = (strl_reader_child){0};
}

/* A path so long that a sentence has no room for what comes behind it. */
static void an_error_of_a_file_far_below_is_told(void **state)
{
    (void)state;
    char path[PATH_MAX], scratch[128];
    strl_reader *reader;
    strl_error err = {0};
    import_writer stream = {0};
    strl_writer_bytes(&stream.bytes, STRL_IMPORT_MAGIC, 8);
    import_write_error(&stream, STRL_IMPORT_MEMORY, "no memory");
    write_test_file("stream", stream.bytes.data, stream.bytes.size);
    import_writer_deinit(&stream);
    write_script("cat stream; exit 2");
    make_scratch(scratch, sizeof scratch);
    size_t used = (size_t)snprintf(path, sizeof path, "%s", test_folder), top = used;
    for (unsigned i = 0; i < 4; i++) {
        used += (size_t)snprintf(path + used, sizeof path - used, "/%0150u", i);
        assert_int_equal(strl_path_make_directory(path, NULL), STRL_OK);
    }
    snprintf(path + used, sizeof path - used, "/model.fbx");
    FILE *file = fopen(path, "w");
    fputs("nothing that matters", file);
    fclose(file);
    const strl_reader_desc desc = {
        .path = path, .scratch_dir = scratch, .memory_bytes = MEMORY_LEAST, .child = {.importer = importer}};
    assert_int_equal(strl_reader_open(&desc, &reader, &err), STRL_ERR_MEMORY);
    assert_int_equal(strncmp(err.message, path, sizeof err.message - 1), 0);
    assert_int_equal(remove(path), 0);
    for (; used > top; used -= 151) {
        path[used] = 0;
        assert_int_equal(rmdir(path), 0);
    }
    assert_nothing_left();
}

static bool stop_at_once(void *context)
{
    ++*(int *)context;
    return false;
}

static void cancelling_stops_it(void **state)
{
    (void)state;
    int asked = 0;
    uint64_t start = strl_clock_ns();
    strl_reader *reader;
    strl_error err = {0};
    write_script("exec sleep 1000");
    write_test_text("model.fbx", "nothing that matters");
    child.go_on = stop_at_once;
    child.context = &asked;
    assert_int_equal(open_foreign("model.fbx", &reader, &err), STRL_ERR_CANCELLED);
    child = (strl_reader_child){0};
    assert_int_equal(asked, 1);
    assert_true(strl_clock_ns() - start < 20000000000u);
    assert_nothing_left();
}

static void a_missing_program_is_told(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err = {0};
    write_test_text("model.fbx", "nothing that matters");
    snprintf(importer, sizeof importer, "%s/nowhere", test_folder);
    assert_int_equal(open_foreign("model.fbx", &reader, &err), STRL_ERR_IO);
    assert_non_null(strstr(err.message, "model.fbx: cannot run "));
    assert_non_null(strstr(err.message, "nowhere: No such file"));
    assert_nothing_left();
}

/* Our own formats are read by us even where they are broken, and unknown endings are asked of nobody. */
static void nobody_else_reads_our_formats(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text, *sentence;
    } cases[] = {{"a.ply", "plx", "ply"},
                 {"a.stl", "broken", "solid"},
                 {"a.obj", "f 1 2 3", "line 1"},
                 {"a.unknown", "some text", "expected a PLY, STL, OBJ or glTF file"},
                 {"fbx", "some text", "expected a PLY, STL, OBJ or glTF file"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        strl_reader *reader;
        strl_error err = {0};
        read_result result = {0};
        write_script("touch called; kill -9 $$");
        write_test_text(cases[i].name, cases[i].text);
        strl_status status = open_foreign(cases[i].name, &reader, &err);
        if (!status) {
            read_pass(reader, &result);
            status = result.status;
            err = result.err;
            strl_reader_close(reader);
        }
        if (!status || !strstr(err.message, cases[i].sentence) || strstr(err.message, "signal"))
            fail_msg("%s: '%s'", cases[i].name, err.message);
        free_result(&result);
    }
    /* What begins like an OBJ file, but is named as something else. */
    strl_reader *reader;
    strl_error err = {0};
    write_stream(3);
    write_script("cat stream");
    write_test_text("scene.NFF", "v 0 0 0\n");
    assert_int_equal(open_foreign("scene.NFF", &reader, &err), STRL_OK);
    strl_reader_close(reader);
}

/* ---- the real importer ---- */

static bool find_real_importer(void)
{
    char *folder = strl_program_folder(), *path = folder ? strl_path_join(folder, "stroll-import") : NULL;
    bool found = path && strl_path_exists(path);
    strl__free(path);
    strl__free(folder);
    importer[0] = 0;
    return found;
}

static void read_foreign(const char *name, read_result *result, strl_reader **reader)
{
    strl_error err = {0};
    strl_status status = open_foreign(name, reader, &err);
    if (status)
        fail_msg("%s", err.message);
    read_pass(*reader, result);
    if (result->status)
        fail_msg("%s", result->err.message);
}

static const char off[] = "OFF\n8 6 0\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n0 0 1\n2 0 1\n2 1 1\n0 1 1\n"
                          "4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";

static void off_arrives(void **state)
{
    (void)state;
    strl_reader *reader;
    read_result result;
    uint32_t rgba;
    if (!find_real_importer())
        skip();
    write_test_text("box.off", off);
    read_foreign("box.off", &result, &reader);
    assert_int_equal(result.count, 12);
    const double first[9] = {0, 0, 0, 0, 1, 0, 2, 1, 0};
    assert_positions(&result.triangles[0], first);
    strl_reader_material(reader, 0, &rgba);
    assert_int_equal(rgba, 0xffffffffu);
    strl_reader_close(reader);
    free_result(&result);
    assert_nothing_left();
}

/* Two placements of one triangle, the second one mirrored, in a tree of nodes; lines are counted. */
static const char dae[] =
    "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
    "<asset><unit name=\"meter\" meter=\"1\"/><up_axis>Y_UP</up_axis></asset>"
    "<library_effects><effect id=\"e\"><profile_COMMON><technique sid=\"t\"><lambert><diffuse>"
    "<color>1 0 0 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>"
    "<library_materials><material id=\"m\" name=\"paint\"><instance_effect url=\"#e\"/></material></library_materials>"
    "<library_geometries><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"pa\" count=\"9\">"
    "0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source=\"#pa\" count=\"3\" stride=\"3\">"
    "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor>"
    "</technique_common></source><source id=\"n\"><float_array id=\"na\" count=\"3\">0 0 1</float_array><technique_common>"
    "<accessor source=\"#na\" count=\"1\" stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/>"
    "<param name=\"Z\" type=\"float\"/></accessor></technique_common></source><vertices id=\"v\"><input "
    "semantic=\"POSITION\" source=\"#p\"/></vertices>"
    "<triangles count=\"1\" material=\"s\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>"
    "<input semantic=\"NORMAL\" source=\"#n\" offset=\"1\"/><p>0 0 1 0 2 0</p></triangles>"
    "<lines count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1</p></lines></mesh></geometry>"
    "</library_geometries><library_visual_scenes><visual_scene id=\"s\"><node id=\"house\" name=\"house\">"
    "<node id=\"a\" name=\"a\"><translate>10 0 0</translate><instance_geometry url=\"#g\"><bind_material>"
    "<technique_common><instance_material symbol=\"s\" target=\"#m\"/></technique_common></bind_material>"
    "</instance_geometry></node><node id=\"b\" name=\"b\"><scale>-2 1 1</scale><instance_geometry url=\"#g\"/></node>"
    "</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";

static bool has_part(const strl_reader *reader, const char *name)
{
    for (uint32_t i = 0; i < strl_reader_part_count(reader); i++)
        if (strcmp(strl_reader_part_name(reader, i), name) == 0)
            return true;
    return false;
}

static void collada_arrives(void **state)
{
    (void)state;
    strl_reader *reader;
    read_result result;
    uint32_t rgba;
    if (!find_real_importer())
        skip();
    write_test_text("house.dae", dae);
    read_foreign("house.dae", &result, &reader);
    assert_int_equal(result.count, 2);
    assert_int_equal(result.drops.lines, 2);
    assert_true(has_part(reader, "house/a") && has_part(reader, "house/b"));
    const double moved[9] = {10, 0, 0, 11, 0, 0, 10, 1, 0}, mirrored[9] = {0, 0, 0, 0, 1, 0, -2, 0, 0};
    assert_positions(&result.triangles[0], moved);
    /* turned over, so that it is seen from where its normal points */
    assert_positions(&result.triangles[1], mirrored);
    for (int t = 0; t < 2; t++) {
        assert_int_equal(result.triangles[t].flags, STRL_TRIANGLE_HAS_NORMAL);
        assert_true(result.triangles[t].normal[1][2] == 1);
    }
    assert_string_equal(strl_reader_material(reader, result.triangles[0].material, &rgba), "paint");
    assert_int_equal(rgba, 0xff0000ffu);
    strl_reader_close(reader);
    free_result(&result);
}

/* A quad that is z up, in metres, moved by its node. */
static const char fbx[] =
    "; FBX 7.4.0 project file\nFBXHeaderExtension: {\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}\n"
    "GlobalSettings: {\nVersion: 1000\nProperties70: {\nP: \"UpAxis\", \"int\", \"Integer\", \"\",2\n"
    "P: \"UnitScaleFactor\", \"double\", \"Number\", \"\",100\n}\n}\n"
    "Objects: {\nGeometry: 1, \"Geometry::tri\", \"Mesh\" {\nVertices: *12 {\na: 0,0,0,1,0,0,1,0,1,0,0,1\n}\n"
    "PolygonVertexIndex: *4 {\na: 0,1,2,-4\n}\nGeometryVersion: 124\n}\nModel: 2, \"Model::wall\", \"Mesh\" {\n"
    "Version: 232\nProperties70: {\nP: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\",5,6,7\n}\n}\n}\n"
    "Connections: {\nC: \"OO\",2,0\nC: \"OO\",1,2\n}\n";

static void fbx_arrives_with_its_axis_and_unit(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_reader_info info;
    read_result result;
    if (!find_real_importer())
        skip();
    write_test_text("Wall.FBX", fbx);
    read_foreign("Wall.FBX", &result, &reader);
    strl_reader_info_get(reader, &info);
    assert_int_equal(info.default_up, STRL_AXIS_Z);
    assert_string_equal(info.default_unit, "m");
    assert_int_equal(result.count, 2);
    const double first[9] = {5, 6, 7, 6, 6, 7, 6, 6, 8};
    assert_positions(&result.triangles[0], first);
    assert_string_equal(strl_reader_part_name(reader, 0), "wall");
    strl_reader_close(reader);
    free_result(&result);
}

static void other_formats_arrive(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text;
        uint64_t triangles;
    } files[] = {
        {"quad.ac",
         "AC3Db\nMATERIAL \"m\" rgb 1 0 0 amb 1 1 1 emis 0 0 0 spec 0 0 0 shi 0 trans 0\nOBJECT world\nkids 1\n"
         "OBJECT poly\nname \"quad\"\nnumvert 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\nnumsurf 1\nSURF 0x20\nmat 0\nrefs 4\n"
         "0 0 0\n1 1 0\n2 1 1\n3 0 1\nkids 0\n",
         2},
        {"two.dxf",
         "0\nSECTION\n2\nENTITIES\n0\n3DFACE\n8\n0\n10\n0\n20\n0\n30\n0\n11\n1\n21\n0\n31\n0\n12\n1\n22\n1\n32\n0\n"
         "13\n0\n23\n1\n33\n0\n0\nENDSEC\n0\nEOF\n",
         2},
        {"one.amf",
         "<?xml version=\"1.0\"?><amf unit=\"millimeter\"><object id=\"1\"><mesh><vertices>"
         "<vertex><coordinates><x>0</x><y>0</y><z>0</z></coordinates></vertex>"
         "<vertex><coordinates><x>1</x><y>0</y><z>0</z></coordinates></vertex>"
         "<vertex><coordinates><x>0</x><y>1</y><z>0</z></coordinates></vertex></vertices>"
         "<volume><triangle><v1>0</v1><v2>1</v2><v3>2</v3></triangle></volume></mesh></object></amf>",
         1},
        {"one.x3d",
         "<?xml version=\"1.0\"?><X3D version=\"3.0\" profile=\"Interchange\"><Scene><Shape><IndexedFaceSet "
         "coordIndex=\"0 1 2 3 -1\"><Coordinate point=\"0 0 0 1 0 0 1 1 0 0 1 0\"/></IndexedFaceSet></Shape>"
         "</Scene></X3D>",
         2},
    };
    if (!find_real_importer())
        skip();
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        strl_reader *reader;
        read_result result;
        write_test_text(files[i].name, files[i].text);
        read_foreign(files[i].name, &result, &reader);
        if (result.count != files[i].triangles)
            fail_msg("%s: %u triangles", files[i].name, (unsigned)result.count);
        strl_reader_close(reader);
        free_result(&result);
    }
    assert_nothing_left();
}

/* One triangle from 1 2 3, which the formats take for a point of a model with z up or y up, in some unit; the last is
 * glTF 1. */
static void directions_are_those_of_what_arrives(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text;
        strl_axis up;
        const char *unit;
        double first[3];
    } files[] = {
        {"up.off", "OFF\n3 1 0\n1 2 3\n2 2 3\n1 4 8\n3 0 1 2\n", STRL_AXIS_Z, NULL, {1, 2, 3}},
        {"up.raw", "1 2 3 2 2 3 1 4 8\n", STRL_AXIS_Z, NULL, {1, 2, 3}},
        {"up.nff", "p 3\n1 2 3\n2 2 3\n1 4 8\n", STRL_AXIS_Z, NULL, {1, 4, 8}} /* from behind */,
        {"up.smd",
         "version 1\nnodes\n0 \"a\" -1\nend\nskeleton\ntime 0\n0 0 0 0 0 0 0\nend\ntriangles\nm\n0 1 2 3 0 0 1"
         " 0 0\n0 2 2 3 0 0 1 0 0\n0 1 4 8 0 0 1 0 0\nend\n",
         STRL_AXIS_Z,
         NULL,
         {1, 2, 3}},
        {"up.amf",
         "<?xml version=\"1.0\"?><amf unit=\"inch\"><object id=\"1\"><mesh><vertices><vertex><coordinates><x>1"
         "</x><y>2</y><z>3</z></coordinates></vertex><vertex><coordinates><x>2</x><y>2</y><z>3</z></coordinate"
         "s></vertex><vertex><coordinates><x>1</x><y>4</y><z>8</z></coordinates></vertex></vertices><volume><t"
         "riangle><v1>0</v1><v2>1</v2><v3>2</v3></triangle></volume></mesh></object></amf>",
         STRL_AXIS_Z,
         NULL,
         {1, 2, 3}},
        {"up.ac",
         "AC3Db\nMATERIAL \"m\" rgb 1 1 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0\nOBJECT world\nkids 1"
         "\nOBJECT poly\nname \"a\"\nnumvert 3\n1 2 3\n2 2 3\n1 4 8\nnumsurf 1\nSURF 0x20\nmat 0\nrefs 3\n0 0 "
         "0\n1 0 0\n2 0 0\nkids 0\n",
         STRL_AXIS_Y,
         NULL,
         {1, 2, 3}},
        {"up.dxf",
         "0\nSECTION\n2\nENTITIES\n0\n3DFACE\n8\n0\n 10\n1\n 20\n2\n 30\n3\n 11\n2\n 21\n2\n 31\n3\n 12\n1\n 2"
         "2\n4\n 32\n8\n 13\n1\n 23\n4\n 33\n8\n0\nENDSEC\n0\nEOF\n",
         STRL_AXIS_Y,
         NULL,
         {1, 3, -2}},
        {"up.dae",
         "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4"
         ".1\"><asset><unit name=\"inch\" meter=\"0.0254\"/><up_axis>Z_UP</up_axis></asset><library_geometries"
         "><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"pa\" count=\"9\">1 2 3 2 2 3 1 4 8</flo"
         "at_array><technique_common><accessor source=\"#pa\" count=\"3\" stride=\"3\"><param name=\"X\" type="
         "\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></techniqu"
         "e_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices><triangl"
         "es count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2</p></triangles></mesh"
         "></geometry></library_geometries><library_visual_scenes><visual_scene id=\"s\"><node id=\"a\"><insta"
         "nce_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene"
         " url=\"#s\"/></scene></COLLADA>",
         STRL_AXIS_Y,
         "m",
         {0.0254, 3 * 0.0254, -2 * 0.0254}},
        {"up.gltf",
         "{\"asset\":{\"version\":\"1.0\"},\"scene\":\"s\",\"scenes\":{\"s\":{\"nodes\":[\"n\"]}},\"nodes\":{"
         "\"n\":{\"meshes\":[\"m\"]}},\"meshes\":{\"m\":{\"primitives\":[{\"attributes\":{\"POSITION\":\"a\"},"
         "\"indices\":\"i\",\"mode\":4}]}},\"accessors\":{\"a\":{\"bufferView\":\"v\",\"byteOffset\":0,\"byteS"
         "tride\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},\"i\":{\"bufferView\":\"w\",\"byteOf"
         "fset\":0,\"byteStride\":0,\"componentType\":5123,\"count\":3,\"type\":\"SCALAR\"}},\"bufferViews\":{"
         "\"v\":{\"buffer\":\"b\",\"byteOffset\":0,\"byteLength\":36,\"target\":34962},\"w\":{\"buffer\":\"b\""
         ",\"byteOffset\":36,\"byteLength\":6,\"target\":34963}},\"buffers\":{\"b\":{\"byteLength\":42,\"type"
         "\":\"arraybuffer\",\"uri\":\"data:application/octet-stream;base64,AACAPwAAAEAAAEBAAAAAQAAAAEAAAEBAAA"
         "CAPwAAgEAAAABBAAABAAIA\"}}}",
         STRL_AXIS_Y,
         "m",
         {1, 2, 3}},
    };
    if (!find_real_importer())
        skip();
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        strl_reader *reader;
        strl_reader_info info;
        read_result result;
        write_test_text(files[i].name, files[i].text);
        read_foreign(files[i].name, &result, &reader);
        strl_reader_info_get(reader, &info);
        bool same = info.default_unit && files[i].unit ? strcmp(info.default_unit, files[i].unit) == 0
                                                       : info.default_unit == files[i].unit;
        if (!same || info.default_up != files[i].up || result.count == 0)
            fail_msg("%s: unit %s, up %d", files[i].name, info.default_unit, (int)info.default_up);
        assert_string_equal(info.format, "assimp");
        assert_true(info.hint_is_exact && info.triangles_hint == result.count);
        for (int k = 0; k < 3; k++)
            if (fabs(result.triangles[0].position[0][k] - files[i].first[k]) > 1e-7)
                fail_msg("%s: %g on axis %d", files[i].name, result.triangles[0].position[0][k], k);
        strl_reader_close(reader);
        free_result(&result);
    }
    assert_nothing_left();
}

static void broken_files_are_refused_in_assimps_words(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err = {0};
    if (!find_real_importer())
        skip();
    static const char *const names[] = {"broken.fbx", "broken.dae", "broken.3ds", "broken.blend"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        write_test_text(names[i], "This is no model at all, and whoever says so is right.\n");
        strl_status status = open_foreign(names[i], &reader, &err);
        if (status != STRL_ERR_FORMAT || !strstr(err.message, names[i]) ||
            !strstr(err.message, "assimp cannot import it: "))
            fail_msg("%s: %d, '%s'", names[i], status, err.message);
    }
    assert_nothing_left();
}

/* A grid of 500 x 500 quads in 28 MiB of address space. */
static void too_little_memory_is_told(void **state)
{
    (void)state;
    strl_reader *reader;
    strl_error err = {0};
    if (IS_SANITIZED || !find_real_importer())
        skip();
    FILE *file = fopen(test_path("grid.off"), "w");
    assert_non_null(file);
    fprintf(file, "OFF\n250000 249001 0\n");
    for (int i = 0; i < 250000; i++)
        fprintf(file, "%d %d 0\n", i % 500, i / 500);
    for (int i = 0; i < 499 * 499; i++) {
        int at = i / 499 * 500 + i % 499;
        fprintf(file, "4 %d %d %d %d\n", at, at + 1, at + 501, at + 500);
    }
    assert_int_equal(fclose(file), 0);
    child.memory_bytes = 28u << 20;
    whole_bytes = 64u << 20;
    assert_int_equal(open_foreign("grid.off", &reader, &err), STRL_ERR_MEMORY);
    whole_bytes = 0;
    assert_non_null(strstr(err.message, "grid.off: importing it by assimp takes more than 28M of memory"));
    assert_non_null(strstr(err.message, "give more by --memory"));
    /* Less than the importer itself takes. */
    for (unsigned megabytes = 1; megabytes <= 20; megabytes += 3) {
        child.memory_bytes = (uint64_t)megabytes << 20;
        strl_status status = open_foreign("grid.off", &reader, &err);
        if (status != STRL_ERR_MEMORY || !strstr(err.message, "grid.off: "))
            fail_msg("%u MiB: %d, '%s'", megabytes, status, err.message);
    }
    child = (strl_reader_child){0};
    read_result result;
    read_foreign("grid.off", &result, &reader);
    assert_int_equal(result.count, 2 * 499 * 499);
    strl_reader_close(reader);
    free_result(&result);
    assert_nothing_left();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stream_is_spooled_and_read_twice),
        cmocka_unit_test(death_is_one_sentence),
        cmocka_unit_test(hanging_is_one_sentence),
        cmocka_unit_test(a_lying_stream_is_one_sentence),
        cmocka_unit_test(an_error_is_told),
        cmocka_unit_test(an_error_of_a_file_far_below_is_told),
        cmocka_unit_test(cancelling_stops_it),
        cmocka_unit_test(a_missing_program_is_told),
        cmocka_unit_test(nobody_else_reads_our_formats),
        cmocka_unit_test(off_arrives),
        cmocka_unit_test(collada_arrives),
        cmocka_unit_test(fbx_arrives_with_its_axis_and_unit),
        cmocka_unit_test(other_formats_arrive),
        cmocka_unit_test(directions_are_those_of_what_arrives),
        cmocka_unit_test(broken_files_are_refused_in_assimps_words),
        cmocka_unit_test(too_little_memory_is_told),
    };
    return cmocka_run_group_tests(tests, make_test_folder, remove_test_folder);
}
