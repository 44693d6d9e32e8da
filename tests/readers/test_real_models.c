/* The models that are too large for this repository, where they are at hand: in the folder named by
 * STRL_DATA, or in
 * ../shared/data beside the checkout. Their triangle counts come from the list that describes them.
 */
#include "reader_test.h"

typedef struct real_model {
    const char *path; /* without .zst */
    uint64_t triangles;
    uint32_t parts;
    const char *format;
} real_model;

static const real_model models[] = {
    {"scans/bunny.ply", 69451, 1, "ply"},      {"scans/lucy.ply", 99970, 1, "ply"},
    {"scans/horse.ply", 96966, 1, "ply"},      {"scans/turbineblade.ply", 199034, 1, "ply"},
    {"scans/igea.ply", 268686, 1, "ply"},      {"scans/dragon_scans.ply", 879576, 1, "ply"},
    {"iso/iso_engine.ply", 593754, 1, "ply"},  {"iso/iso_cthead.ply", 607770, 1, "ply"},
    {"scans/dragon.obj", 100000, 1, "obj"},    {"scans/nefertiti.obj", 99938, 1, "obj"},
    {"scans/skull.obj", 100002, 1, "obj"},     {"scans/ogre.obj", 124008, 1, "obj"},
    {"scans/beast.obj", 64618, 1, "obj"},      {"arch/buildings.obj", 400020, 1, "obj"},
    {"arch/spaceship.obj", 257480, 86, "obj"}, {"cad/motorBike.obj", 331653, 67, "obj"},
    {"cad/ship_hull.stl", 116062, 1, "stl"},
};

static const char *data_folder(void)
{
    static char folder[1024];
    const char *given = getenv("STRL_DATA");
    const char *root = getenv("STRL_TEST_ROOT");
    if (given)
        return given;
    snprintf(folder, sizeof folder, "%s/../shared/data", root ? root : ".");
    return folder;
}

static bool unpack(const real_model *model, const char *name)
{
    char packed[1400], command[3000];
    snprintf(packed, sizeof packed, "%s/%s.zst", data_folder(), model->path);
    if (access(packed, R_OK) != 0)
        return false;
    snprintf(command, sizeof command, "zstd -q -f -d '%s' -o '%s'", packed, test_path(name));
    return system(command) == 0;
}

static void check_model(const real_model *model, const char *name)
{
    strl_reader *reader;
    strl_error err;
    strl_reader_info info;
    read_result small, large;
    assert_int_equal(open_test_file(name, MEMORY_LEAST, &reader, &err), STRL_OK);
    strl_reader_info_get(reader, &info);
    assert_string_equal(info.format, model->format);
    read_pass(reader, &small);
    if (small.status)
        fail_msg("%s", small.err.message);
    assert_int_equal(small.count, model->triangles);
    assert_int_equal(strl_reader_part_count(reader), model->parts);
    assert_int_equal(strl_reader_bytes_done(reader), info.file_bytes);
    assert_int_equal(small.drops.nonfinite + small.drops.degenerate_faces + small.drops.lines +
                         small.drops.points,
                     0);
    strl_reader_close(reader);
    read_test_file(name, 0, &large);
    assert_true(large.checksum == small.checksum);
    free_result(&small);
    free_result(&large);
}

static void every_model_has_its_triangles(void **state)
{
    (void)state;
    const size_t count = sizeof models / sizeof *models;
    size_t read = 0;
    for (size_t i = 0; i < count; i++) {
        const char *name = strrchr(models[i].path, '/') + 1;
        if (!unpack(&models[i], name)) {
            print_message("skipped: %s/%s.zst is not there\n", data_folder(), models[i].path);
            continue;
        }
        check_model(&models[i], name);
        assert_int_equal(strl_path_remove(test_path(name), NULL), STRL_OK);
        read++;
    }
    print_message("%zu of %zu models read\n", read, count);
    if (read == 0)
        skip();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_model_has_its_triangles)};
    return cmocka_run_group_tests(tests, make_test_folder, remove_test_folder);
}
