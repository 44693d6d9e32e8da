/* The scene of parts: its counts, its files, and what is left of a failure. test_plant_files.py reads what is inside.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>
#include <glob.h>

#include "base/hash.h"
#include "base/memory.h"
#include "mesh_check.h"
#include "platform/file.h"
#include "scenes/plant/plant.h"
#include "scenes/scene.h"

/* Under a sanitizer, where all takes ten times as long, less. */
#if defined(__SANITIZE_ADDRESS__)
#define MOST_TRIANGLES 100000u
#define FAILURE_STRIDE 7u
#else
#define MOST_TRIANGLES 2000000u
#define FAILURE_STRIDE 2u
#endif

static char folder[] = "test_plant_XXXXXX";
static char gltf[64], obj[64], ply[64], stl[64];

static int make_folder(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return 1;
    snprintf(gltf, sizeof gltf, "%s/a plant.gltf", folder);
    snprintf(obj, sizeof obj, "%s/plant.obj", folder);
    snprintf(ply, sizeof ply, "%s/plant.ply", folder);
    snprintf(stl, sizeof stl, "%s/plant.stl", folder);
    return 0;
}

static int clear_folder(void **state)
{
    (void)state;
    char pattern[80];
    glob_t found;
    snprintf(pattern, sizeof pattern, "%s/*", folder);
    if (glob(pattern, 0, NULL, &found) == 0)
        for (size_t i = 0; i < found.gl_pathc; i++)
            remove(found.gl_pathv[i]);
    globfree(&found);
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    return strl_path_remove_directory(folder, NULL) != STRL_OK;
}

static size_t count_files(void)
{
    char pattern[80];
    glob_t found;
    snprintf(pattern, sizeof pattern, "%s/*", folder);
    int result = glob(pattern, GLOB_PERIOD, NULL, &found);
    assert_int_equal(result, 0);
    size_t count = found.gl_pathc - 2; /* . and .. */
    globfree(&found);
    return count;
}

static strl_scene_result write_plant(const char *path, uint64_t triangles, uint64_t seed, uint64_t buffer_bytes)
{
    strl_error err = {0};
    strl_scene_result result;
    const strl_scene_desc desc = {
        .name = "plant", .path = path, .triangles = triangles, .seed = seed, .buffer_bytes = buffer_bytes};
    if (strl_scene_write(&desc, NULL, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return result;
}

static uint64_t hash_of(const char *path)
{
    strl_file *file = NULL;
    assert_int_equal(strl_file_open(path, &file, NULL), STRL_OK);
    size_t size = (size_t)strl_file_bytes(file);
    uint8_t *bytes = malloc(size);
    assert_non_null(bytes);
    assert_int_equal(strl_file_read(file, 0, bytes, size, NULL), STRL_OK);
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    uint64_t hash = strl__checksum(bytes, size);
    free(bytes);
    return hash;
}

/* The yard takes what is left, down to less than one crate. */
static void counts_are_met_to_the_last_dozen(void **state)
{
    (void)state;
    static const uint64_t counts[] = {10000, 10007, 23456, 60000, 100000, 333333, 719999, 720001, 1500000};
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++)
        for (uint64_t seed = 0; seed < 3 && counts[i] <= MOST_TRIANGLES && (seed == 0 || counts[i] <= 100000); seed++) {
            strl_scene_result result = write_plant(gltf, counts[i], seed, 0);
            assert_true(result.triangles <= counts[i] && counts[i] - result.triangles < STRL__PLANT_PART_LEAST);
            assert_true(result.parts > counts[i] / 400 && result.parts < counts[i] / 20);
        }
}

static void sizes_out_of_range_are_refused(void **state)
{
    (void)state;
    static const uint64_t counts[] = {1, 9999, 4000000001};
    for (size_t i = 0; i < 3; i++) {
        strl_error err = {0};
        const strl_scene_desc desc = {.name = "plant", .path = gltf, .triangles = counts[i]};
        assert_int_equal(strl_scene_write(&desc, NULL, NULL, &err), STRL_ERR_LIMIT);
        assert_non_null(strstr(err.message, "10000 to 4000000000"));
    }
    assert_int_equal(count_files(), 0);
}

static void the_seed_fixes_every_byte(void **state)
{
    (void)state;
    char bin[80];
    snprintf(bin, sizeof bin, "%s/a plant_000.bin", folder);
    write_plant(gltf, 60000, 7, 0);
    uint64_t text = hash_of(gltf), numbers = hash_of(bin);
    strl_pool *pool = NULL;
    assert_int_equal(strl_pool_create(3, &pool, NULL), STRL_OK);
    const strl_scene_desc desc = {
        .name = "plant", .path = gltf, .triangles = 60000, .seed = 7, .memory_bytes = 1 << 20, .pool = pool};
    assert_int_equal(strl_scene_write(&desc, NULL, NULL, NULL), STRL_OK);
    strl_pool_destroy(pool);
    assert_true(hash_of(gltf) == text && hash_of(bin) == numbers);
    write_plant(gltf, 60000, 8, 0);
    assert_true(hash_of(gltf) != text && hash_of(bin) != numbers);
}

/* On every machine: nothing depends on a C library's sine. */
static void the_bytes_are_those_of_the_first_machine(void **state)
{
    (void)state;
    static const struct {
        const char *path;
        uint64_t hash;
    } golden[] = {{gltf, 0x9b9b9cd0458c6000}, {obj, 0xe3ec1a4223f3abe2}, {ply, 0x21d34100d84978b0}};
    for (int i = 0; i < 3 && MOST_TRIANGLES > 800000; i++) {
        write_plant(golden[i].path, 800000, 0, 0);
        uint64_t found = hash_of(golden[i].path);
        if (found != golden[i].hash)
            fail_msg("%s: found 0x%016llx", golden[i].path, (unsigned long long)found);
    }
}

/* Batches are larger than these buffers: each gets a file of its own. */
static void small_buffers_are_many(void **state)
{
    (void)state;
    char bin[80];
    strl_scene_result whole = write_plant(gltf, 400000, 1, 0);
    assert_int_equal(count_files(), 2);
    strl_scene_result split = write_plant(gltf, 400000, 1, 5 << 20);
    assert_int_equal(split.triangles, whole.triangles);
    assert_true(count_files() > 3);
    for (unsigned i = 0; i + 1 < count_files(); i++) {
        strl_file_info info;
        snprintf(bin, sizeof bin, "%s/a plant_%03u.bin", folder, i);
        assert_int_equal(strl_path_stat(bin, &info, NULL), STRL_OK);
        assert_true(info.bytes > 0 && info.bytes <= 8 << 20);
    }
}

/* Nobody would know whose they are. A model of another program keeps what lies beside it. */
static void buffers_of_an_older_model_go(void **state)
{
    (void)state;
    static const char other[] = "{\"asset\":{\"version\":\"2.0\",\"generator\":\"another\"}}";
    strl_file *file = NULL;
    write_plant(gltf, 400000, 1, 5 << 20);
    size_t many = count_files();
    assert_true(many > 3);
    write_plant(gltf, 20000, 1, 0);
    assert_int_equal(count_files(), 2);
    write_plant(gltf, 400000, 1, 5 << 20);
    assert_int_equal(strl_file_create(gltf, &file, NULL), STRL_OK);
    assert_int_equal(strl_file_write(file, 0, other, sizeof other - 1, NULL), STRL_OK);
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    write_plant(gltf, 20000, 1, 0);
    assert_int_equal(count_files(), many);
}

/* No part reaches out of its file: all kinds of files have the same triangles. */
static void every_kind_of_file_has_the_same_counts(void **state)
{
    (void)state;
    strl_scene_result nodes = write_plant(gltf, 50000, 2, 0);
    const char *const others[] = {obj, ply, stl};
    for (int i = 0; i < 3; i++) {
        strl_scene_result other = write_plant(others[i], 50000, 2, 0);
        assert_int_equal(other.triangles, nodes.triangles);
        assert_int_equal(other.vertices, nodes.vertices);
        assert_int_equal(other.parts, nodes.parts);
    }
    mesh_check mesh;
    mesh_topology topology;
    mesh_check_load(&mesh, ply);
    mesh_check_topology(&mesh, &topology);
    assert_int_equal(topology.unused_vertices, 0);
    mesh_check_free(&mesh);
}

static void what_cannot_be_is_refused(void **state)
{
    (void)state;
    char other[80], long_name[80];
    snprintf(other, sizeof other, "%s/plant.glb", folder);
    snprintf(long_name, sizeof long_name, "%s/missing/plant.gltf", folder);
    const struct {
        strl_scene_desc desc;
        const char *words;
    } refused[] = {{{.name = "plant", .path = other}, ".gltf, .obj, .ply or .stl"},
                   {{.name = "plant", .path = gltf, .shuffle = true}, "random order"},
                   {{.name = "plant", .path = obj, .shuffle = true}, "random order"},
                   {{.name = "plant", .path = long_name}, "missing"},
                   {{.name = "boxes", .path = gltf}, ".ply or .stl"}};
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        strl_error err = {0};
        assert_int_not_equal(strl_scene_write(&refused[i].desc, NULL, NULL, &err), STRL_OK);
        if (!strstr(err.message, refused[i].words))
            fail_msg("expected \"%s\" in \"%s\"", refused[i].words, err.message);
    }
    assert_int_equal(count_files(), 0);
}

static bool stop_half_way(void *context, const char *phase, uint64_t done, uint64_t total)
{
    (void)context;
    (void)phase;
    return done < total / 2;
}

static void a_stop_leaves_no_file(void **state)
{
    (void)state;
    const strl_scene_progress progress = {stop_half_way, NULL};
    const char *const paths[] = {gltf, obj, ply};
    for (int i = 0; i < 3; i++) {
        strl_error err = {0};
        const strl_scene_desc desc = {.name = "plant", .path = paths[i], .triangles = 100000};
        assert_int_equal(strl_scene_write(&desc, &progress, NULL, &err), STRL_ERR_CANCELLED);
        assert_int_equal(count_files(), 0);
    }
}

/* Every write, then every allocation fails in turn; nothing is left, and an older file keeps its bytes. */
static void a_failure_leaves_no_file(void **state)
{
    (void)state;
    strl_pool *pool = NULL;
    assert_int_equal(strl_pool_create(0, &pool, NULL), STRL_OK);
    for (int kind = 0; kind < 4; kind++) {
        strl_status status = STRL_ERR_MEMORY;
        uint64_t n = 0;
        while (status != STRL_OK) {
            strl_error err = {0};
            const strl_scene_desc desc = {
                .name = "plant", .path = kind & 1 ? obj : gltf, .triangles = 12000, .pool = pool, .buffer_bytes = 1};
            n += FAILURE_STRIDE;
            assert_true(n < 10000);
            (kind & 2 ? strl__alloc_fail_after : strl_file_fail_writes_after)(n);
            status = strl_scene_write(&desc, NULL, NULL, &err);
            strl__alloc_fail_after(0);
            strl_file_fail_writes_after(0);
            if (status == STRL_OK)
                break;
            assert_int_equal(status, kind & 2 ? STRL_ERR_MEMORY : STRL_ERR_DISK_FULL);
            assert_true(err.message[0] != 0);
            assert_int_equal(count_files(), 0);
        }
        assert_true(n > (kind & 1 ? 3 : 5));
        clear_folder(NULL);
    }
    strl_pool_destroy(pool);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, NULL, clear_folder)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(counts_are_met_to_the_last_dozen),
        TEST(sizes_out_of_range_are_refused),
        TEST(the_seed_fixes_every_byte),
        TEST(the_bytes_are_those_of_the_first_machine),
        TEST(small_buffers_are_many),
        TEST(buffers_of_an_older_model_go),
        TEST(every_kind_of_file_has_the_same_counts),
        TEST(what_cannot_be_is_refused),
        TEST(a_stop_leaves_no_file),
        TEST(a_failure_leaves_no_file),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
