#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "base/hash.h"
#include "mesh_check.h"
#include "scenes/scene.h"

static char path[64];

static int make_path(void **state)
{
    (void)state;
    snprintf(path, sizeof path, "test_plain_scenes_%d.ply", (int)getpid());
    return 0;
}

static int remove_file(void **state)
{
    (void)state;
    remove(path);
    return 0;
}

static void write_and_load(const char *name, uint64_t triangles, uint64_t seed, mesh_check *mesh)
{
    strl_error err = {0};
    strl_scene_result result;
    strl_scene_desc desc = {.name = name, .path = path, .triangles = triangles, .seed = seed};
    if (strl_scene_write(&desc, NULL, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    mesh_check_load(mesh, path);
    assert_int_equal(result.triangles, mesh->triangle_count);
    assert_int_equal(result.vertices, mesh->vertex_count);
    assert_int_equal(result.bytes, mesh->size);
}

static void check_golden(const char *name, uint64_t triangles, uint64_t expected)
{
    mesh_check mesh;
    write_and_load(name, triangles, 0, &mesh);
    uint64_t found = strl__checksum(mesh.bytes, mesh.size);
    mesh_check_free(&mesh);
    if (found != expected)
        fail_msg("%s: found 0x%016llx", name, (unsigned long long)found);
}

static void check_plane(const char *name, uint64_t triangles)
{
    mesh_check mesh;
    mesh_topology topology;
    write_and_load(name, triangles, 3, &mesh);
    assert_true(fabs(mesh.triangle_count / (double)triangles - 1) < 0.02);
    mesh_check_topology(&mesh, &topology);
    assert_int_equal(topology.crowded_edges + topology.open_inside + topology.unused_vertices + topology.fans_apart, 0);
    assert_int_equal(topology.components, 1);
    assert_int_equal(topology.rims, 1);
    assert_int_equal(topology.genus, 0);
    double area = 0;
    for (uint32_t i = 0; i < mesh.triangle_count; i++) {
        double normal[3];
        mesh_check_face(&mesh, i, normal);
        assert_true(normal[2] > 0); /* none turned over by the jitter */
        area += normal[2] * 0.5;
    }
    assert_true(fabs(area - 1) < 1e-6);
    mesh_check_free(&mesh);
}

static void planes_are_one_flat_unit_square(void **state)
{
    (void)state;
    check_plane("plain-plane", 1000);
    check_plane("plain-plane", 100000);
    check_plane("painted-plane", 100000);
}

/* How many edges join two colours: none in the plain plane, many sharp ones in the painted one. */
static uint64_t sharp_edges(const char *name)
{
    mesh_check mesh;
    write_and_load(name, 200000, 0, &mesh);
    uint64_t sharp = 0;
    for (size_t i = 0; i < 3 * (size_t)mesh.triangle_count; i++) {
        const uint8_t *a = mesh.records + 15 * (size_t)mesh.corners[i] + 12;
        const uint8_t *b = mesh.records + 15 * (size_t)mesh.corners[i % 3 == 2 ? i - 2 : i + 1] + 12;
        sharp += memcmp(a, b, 3) != 0;
    }
    mesh_check_free(&mesh);
    return sharp;
}

static void only_the_painted_plane_has_edges_of_colour(void **state)
{
    (void)state;
    assert_int_equal(sharp_edges("plain-plane"), 0);
    uint64_t sharp = sharp_edges("painted-plane");
    assert_true(sharp > 60000 && sharp < 300000); /* of 600,000: detailed, yet mostly areas of one colour */
}

static void boxes_are_separate_closed_and_turned_outward(void **state)
{
    (void)state;
    mesh_check mesh;
    mesh_topology topology;
    write_and_load("boxes", 60007, 1, &mesh);
    assert_int_equal(mesh.triangle_count, 60000);
    mesh_check_topology(&mesh, &topology);
    assert_int_equal(topology.components, 5000);
    assert_int_equal(topology.open_edges + topology.crowded_edges + topology.unused_vertices + topology.fans_apart, 0);
    assert_int_equal(topology.genus, 0);
    for (uint32_t box = 0; box < 5000; box++) {
        double volume = 0;
        float origin[3];
        mesh_check_position(&mesh, 8 * box, origin);
        for (uint32_t i = 12 * box; i < 12 * box + 12; i++) {
            double normal[3];
            float p[3];
            mesh_check_face(&mesh, i, normal);
            mesh_check_position(&mesh, mesh.corners[3 * (size_t)i], p);
            assert_true(normal[0] != 0 || normal[1] != 0 || normal[2] != 0);
            for (int k = 0; k < 3; k++)
                volume += normal[k] * ((double)p[k] - origin[k]);
        }
        assert_true(volume > 0);
    }
    mesh_check_free(&mesh);
}

static void the_seed_fixes_every_byte(void **state)
{
    (void)state;
    check_golden("painted-plane", 20000, UINT64_C(0x75435f0bbcba7592));
    check_golden("plain-plane", 20000, UINT64_C(0x8baf24aefa527753));
    check_golden("boxes", 24000, UINT64_C(0x047ea7f6d0a2867d));
}

static void the_list_of_scenes_ends(void **state)
{
    (void)state;
    size_t count = 0;
    while (strl_scene_at(count))
        count++;
    assert_int_equal(count, 8);
    assert_string_equal(strl_scene_at(0)->name, "isosurface");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, make_path, remove_file)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(planes_are_one_flat_unit_square),
        TEST(only_the_painted_plane_has_edges_of_colour),
        TEST(boxes_are_separate_closed_and_turned_outward),
        TEST(the_seed_fixes_every_byte),
        TEST(the_list_of_scenes_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
