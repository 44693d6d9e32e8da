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
    uint64_t lines;  /* dropped */
    uint64_t memory; /* where the least that a reader takes does not hold its names and nodes */
} real_model;

static const real_model models[] = {
    {"scans/bunny.ply", 69451, 1, "ply", 0, 0},
    {"scans/lucy.ply", 99970, 1, "ply", 0, 0},
    {"scans/horse.ply", 96966, 1, "ply", 0, 0},
    {"scans/turbineblade.ply", 199034, 1, "ply", 0, 0},
    {"scans/igea.ply", 268686, 1, "ply", 0, 0},
    {"scans/dragon_scans.ply", 879576, 1, "ply", 0, 0},
    {"iso/iso_engine.ply", 593754, 1, "ply", 0, 0},
    {"iso/iso_cthead.ply", 607770, 1, "ply", 0, 0},
    {"scans/dragon.obj", 100000, 1, "obj", 0, 0},
    {"scans/nefertiti.obj", 99938, 1, "obj", 0, 0},
    {"scans/skull.obj", 100002, 1, "obj", 0, 0},
    {"scans/ogre.obj", 124008, 1, "obj", 0, 0},
    {"scans/beast.obj", 64618, 1, "obj", 0, 0},
    {"arch/buildings.obj", 400020, 1, "obj", 0, 0},
    {"arch/spaceship.obj", 257480, 86, "obj", 0, 0},
    {"cad/motorBike.obj", 331653, 67, "obj", 0, 0},
    {"cad/ship_hull.stl", 116062, 1, "stl", 0, 0},
    {"cad/two_cylinder_engine.glb", 121496, 67, "glb", 0, 0},
    {"cad/reciprocating_saw.glb", 198470, 113, "glb", 0, 0},
    {"cad/rac_house.glb", 118626, 2098, "glb", 753, 16 << 20},
    {"cad/map_ifc.glb", 271614, 5562, "glb", 5, 32 << 20},
    {"cad/schependomlaan.glb", 464562, 6137, "glb", 0, 32 << 20},
    {"cad/sgd_bodo.glb", 1039512, 13417, "glb", 7829, 64 << 20},
    {"cad/clinic.glb", 1354234, 15861, "glb", 0, 64 << 20},
    {"textured/lod3_room10_chunk0.glb", 2697, 1, "glb", 0, 0},
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
    char packed[1500], plain[1400], command[3000];
    snprintf(plain, sizeof plain, "%s/%s", data_folder(), model->path);
    snprintf(packed, sizeof packed, "%s.zst", plain);
    if (access(packed, R_OK) == 0)
        snprintf(command, sizeof command, "zstd -q -f -d '%s' -o '%s'", packed, test_path(name));
    else if (access(plain, R_OK) == 0)
        snprintf(command, sizeof command, "cp '%s' '%s'", plain, test_path(name));
    else
        return false;
    return system(command) == 0;
}

static void check_model(const real_model *model, const char *name)
{
    strl_reader *reader;
    strl_error err;
    strl_reader_info info;
    read_result small, large;
    if (open_test_file(name, model->memory ? model->memory : MEMORY_LEAST, &reader, &err))
        fail_msg("%s", err.message);
    strl_reader_info_get(reader, &info);
    assert_string_equal(info.format, model->format);
    assert_true(!info.hint_is_exact || info.triangles_hint == model->triangles);
    read_pass(reader, &small);
    if (small.status)
        fail_msg("%s", small.err.message);
    assert_int_equal(small.count, model->triangles);
    assert_int_equal(strl_reader_part_count(reader), model->parts);
    assert_int_equal(strl_reader_bytes_done(reader), info.file_bytes);
    assert_int_equal(small.drops.lines, model->lines);
    assert_int_equal(small.drops.nonfinite + small.drops.degenerate_faces + small.drops.points, 0);
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
