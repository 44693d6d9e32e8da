/* A scene has the same triangles in every kind of file and in every order. */
#include <math.h>
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
#include "stroll/build.h"
#include "mesh_check.h"
#include "platform/file.h"
#include "scenes/scene.h"
#include "scenes/shuffle.h"

enum { MOST_RECORD = 24 };

/* Three vertices as the file has them. */
typedef struct triangle {
    uint8_t vertex[3][MOST_RECORD];
} triangle;

typedef struct soup {
    triangle *triangles;
    size_t count;
} soup;

static char folder[] = "test_scene_files_XXXXXX";
static char ply[64], stl[64], shuffled[64], other[64];
static const char *const names[] = {"isosurface", "painted-plane", "plain-plane", "boxes"};

static int make_folder(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return 1;
    snprintf(ply, sizeof ply, "%s/scene.ply", folder);
    snprintf(stl, sizeof stl, "%s/scene.stl", folder);
    snprintf(shuffled, sizeof shuffled, "%s/shuffled.ply", folder);
    snprintf(other, sizeof other, "%s/OTHER.STL", folder);
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    return strl_path_remove_directory(folder, NULL) != STRL_OK;
}

static strl_scene_result write_scene(const strl_scene_desc *desc)
{
    strl_error err = {0};
    strl_scene_result result;
    if (strl_scene_write(desc, NULL, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return result;
}

static uint8_t *load(const char *path, size_t *size)
{
    strl_file *file = NULL;
    assert_int_equal(strl_file_open(path, &file, NULL), STRL_OK);
    *size = (size_t)strl_file_bytes(file);
    uint8_t *bytes = malloc(*size);
    assert_non_null(bytes);
    assert_int_equal(strl_file_read(file, 0, bytes, *size, NULL), STRL_OK);
    assert_int_equal(strl_file_close(file, NULL), STRL_OK);
    return bytes;
}

static uint64_t hash_of(const char *path)
{
    size_t size;
    uint8_t *bytes = load(path, &size);
    uint64_t hash = strl__checksum(bytes, size);
    free(bytes);
    return hash;
}

static soup load_ply(const char *path, size_t kept_bytes)
{
    mesh_check mesh;
    mesh_check_load(&mesh, path);
    soup all = {calloc(mesh.triangle_count, sizeof(triangle)), mesh.triangle_count};
    assert_non_null(all.triangles);
    size_t bytes = kept_bytes ? kept_bytes : mesh.record_bytes;
    for (size_t i = 0; i < 3 * all.count; i++)
        memcpy(all.triangles[i / 3].vertex[i % 3], mesh.records + mesh.corners[i] * mesh.record_bytes, bytes);
    mesh_check_free(&mesh);
    return all;
}

/* Checks each facet's normal too. */
static soup load_stl(const char *path)
{
    size_t size;
    uint8_t *bytes = load(path, &size);
    uint32_t count;
    memcpy(&count, bytes + 80, sizeof count);
    assert_int_equal(size, 84 + 50 * (size_t)count);
    assert_memory_not_equal(bytes, "solid", 5);
    soup all = {calloc(count, sizeof(triangle)), count};
    assert_non_null(all.triangles);
    for (size_t i = 0; i < count; i++) {
        float normal[3], p[3][3];
        memcpy(normal, bytes + 84 + 50 * i, sizeof normal);
        memcpy(p, bytes + 84 + 50 * i + 12, sizeof p);
        double length2 = 0;
        for (int k = 0; k < 3; k++) {
            double along = 0, across = 0;
            memcpy(all.triangles[i].vertex[k], p[k], 12);
            length2 += (double)normal[k] * normal[k];
            for (int axis = 0; axis < 3; axis++) {
                double edge = (double)p[(k + 1) % 3][axis] - p[k][axis];
                along += edge * normal[axis];
                across += edge * edge;
            }
            assert_true(fabs(along) <= 1e-5 * sqrt(across));
        }
        assert_true(fabs(length2 - 1) < 1e-5);
        assert_int_equal(bytes[84 + 50 * i + 48] | bytes[84 + 50 * i + 49], 0);
    }
    free(bytes);
    return all;
}

static int compare_triangles(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(triangle));
}

/* The same triangles with the same first corner, however they lie; both are used up. */
static void check_same_triangles(soup a, soup b)
{
    assert_int_equal(a.count, b.count);
    qsort(a.triangles, a.count, sizeof(triangle), compare_triangles);
    qsort(b.triangles, b.count, sizeof(triangle), compare_triangles);
    assert_memory_equal(a.triangles, b.triangles, a.count * sizeof(triangle));
    free(a.triangles);
    free(b.triangles);
}

static void every_place_is_taken_once(void **state)
{
    (void)state;
    static const uint64_t counts[] = {1,  2,  3,  4,  5,   7,    8,    9,    15,   16,
                                      17, 63, 64, 65, 100, 1000, 4095, 4096, 4097, 1000003};
    for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++)
        for (uint64_t seed = 0; seed < 3; seed++) {
            const strl__permutation order = strl__permutation_of(counts[c], seed);
            uint8_t *taken = calloc(counts[c], 1);
            assert_non_null(taken);
            uint64_t stayed = 0;
            for (uint64_t i = 0; i < counts[c]; i++) {
                uint64_t place = strl__permutation_at(&order, i);
                assert_true(place < counts[c]);
                assert_int_equal(taken[place]++, 0);
                stayed += place == i;
            }
            free(taken);
            assert_true(counts[c] < 100 || stayed < 12); /* one is to be expected, of any number */
        }
    const strl__permutation first = strl__permutation_of(1000, 1), second = strl__permutation_of(1000, 2);
    uint64_t same = 0;
    for (uint64_t i = 0; i < 1000; i++)
        same += strl__permutation_at(&first, i) == strl__permutation_at(&second, i);
    assert_true(same < 12);
}

/* How many neighbours in the file are neighbours in space: a shuffled file has hardly any. */
static double far_share(const soup *all)
{
    size_t far = 0;
    for (size_t i = 1; i < all->count; i++) {
        float a[3], b[3];
        double square = 0;
        memcpy(a, all->triangles[i - 1].vertex[0], sizeof a);
        memcpy(b, all->triangles[i].vertex[0], sizeof b);
        for (int k = 0; k < 3; k++)
            square += ((double)a[k] - b[k]) * ((double)a[k] - b[k]);
        far += square > 0.1 * 0.1;
    }
    return (double)far / (double)all->count;
}

static void a_shuffled_file_has_the_same_triangles(void **state)
{
    (void)state;
    for (int i = 0; i < 4; i++) {
        strl_scene_desc desc = {.name = names[i], .path = ply, .triangles = 20000, .seed = 5};
        strl_scene_result plain = write_scene(&desc);
        desc.path = shuffled;
        desc.shuffle = true;
        strl_scene_result mixed = write_scene(&desc);
        assert_memory_equal(&plain, &mixed, sizeof plain);
        soup before = load_ply(ply, 0), after = load_ply(shuffled, 0);
        assert_true(far_share(&after) > 0.9);
        check_same_triangles(before, after);
    }
}

static void the_vertices_are_shuffled_too(void **state)
{
    (void)state;
    mesh_check mesh;
    strl_scene_desc desc = {.name = "plain-plane", .path = shuffled, .triangles = 20000, .shuffle = true};
    write_scene(&desc);
    mesh_check_load(&mesh, shuffled);
    uint32_t far = 0;
    for (uint32_t i = 1; i < mesh.vertex_count; i++) {
        float a[3], b[3];
        mesh_check_position(&mesh, i - 1, a);
        mesh_check_position(&mesh, i, b);
        far += hypot((double)a[0] - b[0], (double)a[1] - b[1]) > 0.1;
    }
    assert_true(far > mesh.vertex_count * 0.9);
    mesh_check_free(&mesh);
}

static void an_stl_file_has_the_same_triangles(void **state)
{
    (void)state;
    for (int i = 0; i < 4; i++) {
        strl_scene_desc desc = {.name = names[i], .path = ply, .triangles = 20000, .seed = 5};
        strl_scene_result plain = write_scene(&desc);
        desc.path = stl;
        strl_scene_result facets = write_scene(&desc);
        assert_int_equal(facets.triangles, plain.triangles);
        assert_int_equal(facets.bytes, 84 + 50 * plain.triangles);
        desc.path = other;
        desc.shuffle = true;
        write_scene(&desc);
        soup mixed = load_stl(other), straight = load_stl(stl), reference = load_ply(ply, 12);
        assert_memory_equal(straight.triangles, reference.triangles,
                            reference.count * sizeof(triangle)); /* in order, too */
        assert_true(i == 0 || far_share(&mixed) > 0.9);
        free(straight.triangles);
        check_same_triangles(reference, mixed);
    }
}

/* With 2 MB a file goes through many windows, and vertices through few pages. */
static void neither_memory_nor_threads_change_a_byte(void **state)
{
    (void)state;
    for (int kind = 0; kind < 2; kind++) {
        const char *path = kind ? other : shuffled;
        strl_scene_desc desc = {.name = "boxes", .path = path, .triangles = 60000, .shuffle = true};
        write_scene(&desc);
        uint64_t hash = hash_of(path);
        desc.memory_bytes = 2000000;
        write_scene(&desc);
        assert_true(hash_of(path) == hash);
        desc.seed = 1;
        write_scene(&desc);
        assert_true(hash_of(path) != hash);
    }
    strl_scene_desc desc = {.name = "isosurface", .path = shuffled, .triangles = 60000, .shuffle = true};
    write_scene(&desc);
    uint64_t hash = hash_of(shuffled);
    for (unsigned threads = 1; threads < 8; threads += 6) {
        assert_int_equal(strl_pool_create(threads, &desc.pool, NULL), STRL_OK);
        write_scene(&desc);
        strl_pool_destroy(desc.pool);
        assert_true(hash_of(shuffled) == hash);
    }
}

static uint64_t leaf_triangles(const char *input)
{
    char output[80];
    strl_error err = {0};
    strl_build_result result;
    snprintf(output, sizeof output, "%s/scene.stroll", folder);
    const strl_build_desc desc = {.inputs = &input, .input_count = 1, .output = output};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return result.triangles_leaf;
}

static void all_files_build_to_the_same_number_of_triangles(void **state)
{
    (void)state;
    strl_scene_desc desc = {.name = "isosurface", .path = ply, .triangles = 20000, .seed = 1};
    strl_scene_result plain = write_scene(&desc);
    desc.path = stl;
    write_scene(&desc);
    desc.shuffle = true;
    desc.path = shuffled;
    write_scene(&desc);
    desc.path = other;
    write_scene(&desc);
    const char *const files[] = {ply, stl, shuffled, other};
    for (int i = 0; i < 4; i++)
        assert_int_equal(leaf_triangles(files[i]), plain.triangles);
}

static void no_file_is_left(void)
{
    char pattern[80];
    glob_t found;
    snprintf(pattern, sizeof pattern, "%s/*", folder);
    int result = glob(pattern, GLOB_PERIOD, NULL, &found); /* . and .. */
    assert_int_equal(result, 0);
    assert_int_equal(found.gl_pathc, 2);
    globfree(&found);
}

static void other_endings_are_refused(void **state)
{
    (void)state;
    static const char *const endings[] = {"scene.obj", "scene", "ply", "scene.ply.gz", ".stl"};
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
        char path[80];
        strl_error err = {0};
        snprintf(path, sizeof path, "%s/%s", folder, endings[i]);
        strl_scene_desc desc = {.name = "boxes", .path = i == 4 ? ".stl" : path, .triangles = 1200};
        assert_int_equal(strl_scene_write(&desc, NULL, NULL, &err), STRL_ERR_ARGUMENT);
        assert_non_null(strstr(err.message, endings[i]));
        assert_non_null(strstr(err.message, ".ply or .stl"));
    }
    no_file_is_left();
}

static void too_little_memory_to_shuffle_is_refused(void **state)
{
    (void)state;
    strl_error err = {0};
    strl_scene_desc desc = {
        .name = "boxes", .path = shuffled, .triangles = 600000, .shuffle = true, .memory_bytes = 100000};
    assert_int_equal(strl_scene_write(&desc, NULL, NULL, &err), STRL_ERR_MEMORY);
    assert_non_null(strstr(err.message, shuffled));
    no_file_is_left();
}

/* Every write, then every allocation fails in turn. */
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
            strl_scene_desc desc = {.name = "boxes",
                                    .path = kind & 1 ? stl : shuffled,
                                    .triangles = 6000,
                                    .shuffle = true,
                                    .memory_bytes = 1u << 18,
                                    .pool = pool};
            n++;
            assert_true(n < 10000);
            (kind & 2 ? strl__alloc_fail_after : strl_file_fail_writes_after)(n);
            status = strl_scene_write(&desc, NULL, NULL, &err);
            strl__alloc_fail_after(0);
            strl_file_fail_writes_after(0);
            if (status == STRL_OK)
                break;
            assert_int_equal(status, kind & 2 ? STRL_ERR_MEMORY : STRL_ERR_DISK_FULL);
            assert_true(err.message[0] != 0);
            no_file_is_left();
        }
        assert_true(n > 5);
        assert_int_equal(remove(kind & 1 ? stl : shuffled), 0);
    }
    strl_pool_destroy(pool);
}

static int clear_folder(void **state)
{
    (void)state;
    static char *const files[] = {ply, stl, shuffled, other};
    for (int i = 0; i < 4; i++)
        remove(files[i]);
    char output[80];
    snprintf(output, sizeof output, "%s/scene.stroll", folder);
    remove(output);
    return 0;
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, NULL, clear_folder)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(every_place_is_taken_once),
        TEST(a_shuffled_file_has_the_same_triangles),
        TEST(the_vertices_are_shuffled_too),
        TEST(an_stl_file_has_the_same_triangles),
        TEST(neither_memory_nor_threads_change_a_byte),
        TEST(all_files_build_to_the_same_number_of_triangles),
        TEST(other_endings_are_refused),
        TEST(too_little_memory_to_shuffle_is_refused),
        TEST(a_failure_leaves_no_file),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
