/* From a dropped file to a container: at once, by a build, from an older build, or not at all. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "platform/file.h"
#include "platform/thread.h"
#include "support/folder.h"
#include "viewer/opener.h"

#define POLL_NS 2000000u

static void write_mesh(const char *path, int side)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    for (int y = 0; y <= side; y++)
        for (int x = 0; x <= side; x++)
            fprintf(file, "v %d %d %d\n", x, y, x * y % 7);
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++) {
            int a = y * (side + 1) + x + 1;
            fprintf(file, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + side + 1, a + 1, a + side + 2, a + side + 1);
        }
    fclose(file);
}

static strl_opener *make(const char *cache)
{
    strl_opener *opener = NULL;
    assert_int_equal(strl_opener_create(cache, &opener, NULL), STRL_OK);
    return opener;
}

/* Polls until the build has ended; *builds: it was seen to build. */
static strl_opener_news wait_for_end(strl_opener *opener, bool *builds)
{
    strl_opener_news news;
    *builds = false;
    for (;;) {
        strl_opener_poll(opener, &news);
        if (news.state != STRL_OPENER_BUILDS)
            return news;
        assert_true(news.share >= 0 && news.share <= 1 && news.text[0]);
        *builds = true;
        strl_sleep_ns(POLL_NS);
    }
}

static strl_opener_news open_or_build(strl_opener *opener, const char *file, bool again, bool *builds)
{
    strl_error err = {0};
    if (strl_opener_start(opener, file, again, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return wait_for_end(opener, builds);
}

static strl_opener_news open_file(strl_opener *opener, const char *file, bool *builds)
{
    return open_or_build(opener, file, false, builds);
}

static void a_mesh_is_built_once_and_a_container_opened_at_once(void **state)
{
    (void)state;
    char mesh[600], container[620];
    bool builds;
    strl_opener_news news;
    snprintf(mesh, sizeof mesh, "%s", strl_test_path("mesh.obj"));
    snprintf(container, sizeof container, "%s.stroll", mesh);
    write_mesh(mesh, 100);
    strl_opener *opener = make(NULL);
    strl_opener_poll(opener, &news);
    assert_int_equal(news.state, STRL_OPENER_IDLE);

    news = open_file(opener, mesh, &builds);
    assert_int_equal(news.state, STRL_OPENER_READY);
    assert_string_equal(news.container, container);
    assert_true(builds);
    strl_opener_poll(opener, &news);
    assert_int_equal(news.state, STRL_OPENER_IDLE); /* it is told once */

    assert_true(!news.built_before && !news.warning[0]);
    news = open_file(opener, mesh, &builds);
    assert_true(news.state == STRL_OPENER_READY && !builds && news.built_before);
    assert_string_equal(news.mesh, mesh);
    news = open_or_build(opener, mesh, true, &builds);
    assert_true(news.state == STRL_OPENER_READY && builds && !news.built_before);
    news = open_file(opener, container, &builds);
    assert_true(news.state == STRL_OPENER_READY && !builds && !news.built_before && !news.mesh[0]);
    assert_string_equal(news.container, container);

    write_mesh(mesh, 101); /* younger than its container */
    news = open_file(opener, mesh, &builds);
    assert_true(news.state == STRL_OPENER_READY && builds);
    strl_opener_destroy(opener);
    strl_path_remove(mesh, NULL);
    strl_path_remove(container, NULL);
}

static void what_is_amiss_is_told(void **state)
{
    (void)state;
    char mesh[600], container[620];
    bool builds;
    snprintf(mesh, sizeof mesh, "%s", strl_test_path("mesh.obj"));
    snprintf(container, sizeof container, "%s.stroll", mesh);
    FILE *file = fopen(mesh, "w");
    assert_non_null(file);
    fputs("mtllib nowhere.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n", file);
    fclose(file);
    strl_opener *opener = make(NULL);
    strl_opener_news news = open_file(opener, mesh, &builds);
    assert_int_equal(news.state, STRL_OPENER_READY);
    assert_non_null(strstr(news.warning, "nowhere.mtl"));
    news = open_file(opener, mesh, &builds); /* once, as the build was */
    assert_true(news.built_before && !news.warning[0]);
    strl_opener_destroy(opener);
    strl_path_remove(mesh, NULL);
    strl_path_remove(container, NULL);
}

/* Those of the program's own formats are read without it. */
static void foreign_files_go_to_the_importer_that_is_named(void **state)
{
    (void)state;
    char mesh[600], importer[600];
    bool builds;
    snprintf(mesh, sizeof mesh, "%s", strl_test_path("mesh.dae"));
    snprintf(importer, sizeof importer, "%s", strl_test_path("no importer"));
    FILE *file = fopen(mesh, "w");
    assert_non_null(file);
    fputs(
        "<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\"/>\n",
        file);
    fclose(file);
    setenv("STROLL_IMPORT", importer, 1);
    strl_opener *opener = make(NULL);
    strl_opener_news news = open_file(opener, mesh, &builds);
    assert_int_equal(news.state, STRL_OPENER_FAILED);
    assert_non_null(strstr(news.error.message, importer));
    unsetenv("STROLL_IMPORT");
    strl_opener_destroy(opener);
    strl_path_remove(mesh, NULL);
}

static void what_cannot_be_written_beside_the_mesh_goes_to_the_cache(void **state)
{
    (void)state;
    char mesh[600], beside[620], cache[600];
    bool builds;
    strl_error err = {0};
    snprintf(mesh, sizeof mesh, "%s", strl_test_path("mesh.obj"));
    snprintf(cache, sizeof cache, "%s", strl_test_path("cache"));
    snprintf(beside, sizeof beside, "%s.stroll", mesh);
    write_mesh(mesh, 20);
    assert_int_equal(strl_path_make_directory(beside, NULL), STRL_OK); /* a folder is in the way */
    strl_opener *opener = make(NULL);
    assert_true(strl_opener_start(opener, mesh, false, &err) != STRL_OK);
    strl_opener_destroy(opener);
    opener = make(cache);
    strl_opener_news news = open_file(opener, mesh, &builds);
    assert_int_equal(news.state, STRL_OPENER_READY);
    assert_true(strncmp(news.container, cache, strlen(cache)) == 0 && strl_path_exists(news.container));
    news = open_file(opener, mesh, &builds);
    assert_true(news.state == STRL_OPENER_READY && !builds);
    strl_opener_destroy(opener);
    strl_path_remove(mesh, NULL);
    assert_int_equal(strl_path_remove_directory(beside, NULL), STRL_OK);
    assert_int_equal(strl_path_remove_directory(cache, NULL), STRL_OK);
}

static void a_build_is_cancelled_or_fails_and_leaves_nothing(void **state)
{
    (void)state;
    char mesh[600], container[620];
    bool builds;
    strl_error err = {0};
    snprintf(mesh, sizeof mesh, "%s", strl_test_path("mesh.obj"));
    snprintf(container, sizeof container, "%s.stroll", mesh);
    write_mesh(mesh, 300);
    strl_opener *opener = make(NULL);
    assert_int_equal(strl_opener_start(opener, mesh, false, &err), STRL_OK);
    assert_int_equal(strl_opener_start(opener, mesh, false, &err), STRL_ERR_ARGUMENT); /* one at a time */
    strl_opener_cancel(opener);
    strl_opener_news news = wait_for_end(opener, &builds);
    assert_int_equal(news.state, STRL_OPENER_FAILED);
    assert_int_equal(news.error.status, STRL_ERR_CANCELLED);
    assert_false(strl_path_exists(container));

    FILE *file = fopen(mesh, "w");
    assert_non_null(file);
    fputs("f 1 2\n", file);
    fclose(file);
    news = open_file(opener, mesh, &builds);
    assert_int_equal(news.state, STRL_OPENER_FAILED);
    assert_non_null(strstr(news.error.message, "mesh.obj"));
    assert_int_equal(strl_opener_start(opener, strl_test_path("none.obj"), false, &err), STRL_ERR_IO);

    write_mesh(mesh, 300); /* and one that is still at work when the window closes */
    assert_int_equal(strl_opener_start(opener, mesh, false, &err), STRL_OK);
    strl_opener_destroy(opener);
    assert_false(strl_path_exists(container));
    strl_path_remove(mesh, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mesh_is_built_once_and_a_container_opened_at_once),
        cmocka_unit_test(what_is_amiss_is_told),
        cmocka_unit_test(foreign_files_go_to_the_importer_that_is_named),
        cmocka_unit_test(what_cannot_be_written_beside_the_mesh_goes_to_the_cache),
        cmocka_unit_test(a_build_is_cancelled_or_fails_and_leaves_nothing),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
