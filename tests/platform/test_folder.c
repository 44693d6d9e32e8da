/* A name opens what lies in the folder and nothing else, whether or not the kernel watches over links. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "platform/folder.h"
#include "support/folder.h"

static void put_file(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void link_to(const char *target, const char *name)
{
    assert_int_equal(symlink(target, strl_test_path(name)), 0);
}

/* served/{a, sub/b, links}, outside/secret */
static strl_folder *make_tree(bool watched)
{
    strl_error err;
    strl_folder *folder;
    assert_int_equal(mkdir(strl_test_path("served"), 0755), 0);
    assert_int_equal(mkdir(strl_test_path("served/sub"), 0755), 0);
    assert_int_equal(mkdir(strl_test_path("outside"), 0755), 0);
    put_file(strl_test_path("served/a"), "a");
    put_file(strl_test_path("served/sub/b"), "bb");
    put_file(strl_test_path("outside/secret"), "secret");
    link_to("sub/b", "served/inner");
    link_to("../a", "served/sub/up");
    link_to("sub", "served/way");
    link_to("../outside/secret", "served/leak");
    link_to("../outside", "served/door");
    link_to("/etc/passwd", "served/absolute");
    link_to("/proc/self/root/etc/passwd", "served/magic");
    link_to("loop", "served/loop");
    assert_int_equal(mkfifo(strl_test_path("served/pipe"), 0644), 0);
    assert_int_equal(strl_folder_open(strl_test_path("served"), &folder, &err), STRL_OK);
    if (!watched)
        strl_folder_follow_no_links(folder);
    return folder;
}

static void remove_tree(strl_folder *folder)
{
    static const char *const names[] = {"served/a",        "served/sub/b", "outside/secret", "served/inner",
                                        "served/sub/up",   "served/way",   "served/leak",    "served/door",
                                        "served/absolute", "served/magic", "served/loop",    "served/pipe"};
    strl_folder_close(folder);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        unlink(strl_test_path(names[i]));
    rmdir(strl_test_path("served/sub"));
    rmdir(strl_test_path("served"));
    rmdir(strl_test_path("outside"));
}

static void expect(strl_folder *folder, const char *name, const char *content)
{
    strl_error err = {0};
    strl_file *file;
    char text[16] = "";
    strl_found found = strl_folder_open_file(folder, name, &file, &err);
    if (!content) {
        if (found != STRL_FOUND_NOTHING)
            fail_msg("\"%s\" gave %d", name, (int)found);
        assert_null(file);
        assert_true(err.message[0]);
        return;
    }
    if (found != STRL_FOUND)
        fail_msg("\"%s\": %s", name, err.message);
    assert_int_equal(strl_file_bytes(file), strlen(content));
    assert_int_equal(strl_file_read(file, 0, text, strlen(content), &err), STRL_OK);
    assert_string_equal(text, content);
    strl_file_close(file, NULL);
}

static void expect_all(strl_folder *folder, bool links)
{
    static const char *const refused[] = {
        "",
        ".",
        "..",
        "/",
        "/etc/passwd",
        "../outside/secret",
        "sub/../a",
        "sub/../../outside/secret",
        "./a",
        "sub/./b",
        "sub//b",
        "a/",
        "sub/",
        "sub",
        "missing",
        "a/b",
        "leak",
        "door/secret",
        "absolute",
        "magic",
        "loop",
        "pipe",
        "sub/up/../../outside/secret",
    };
    char *long_name = calloc(5001, 1);
    assert_non_null(long_name);
    memset(long_name, 'a', 5000);
    expect(folder, "a", "a");
    expect(folder, "sub/b", "bb");
    expect(folder, "inner", links ? "bb" : NULL);
    expect(folder, "sub/up", links ? "a" : NULL);
    expect(folder, "way/b", links ? "bb" : NULL);
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        expect(folder, refused[i], NULL);
    expect(folder, long_name, NULL);
    free(long_name);
}

static void no_name_leads_out_where_the_kernel_watches(void **state)
{
    (void)state;
    strl_folder *folder = make_tree(true);
    strl_error err;
    strl_file *file;
    /* Linux before 5.6 has no such call */
    bool links = strl_folder_open_file(folder, "inner", &file, &err) == STRL_FOUND;
    strl_file_close(file, NULL);
    expect_all(folder, links);
    remove_tree(folder);
}

static void no_name_leads_out_where_it_does_not(void **state)
{
    (void)state;
    strl_folder *folder = make_tree(false);
    expect_all(folder, false);
    remove_tree(folder);
}

typedef struct seen {
    unsigned files, folders;
    bool leak;
} seen;

static bool see(void *context, const char *name, bool is_folder)
{
    seen *all = context;
    *(is_folder ? &all->folders : &all->files) += 1;
    all->leak |= is_folder && strcmp(name, "door") == 0;
    return true;
}

static void a_listing_shows_no_folder_behind_a_link_out(void **state)
{
    (void)state;
    strl_folder *folder = make_tree(true);
    strl_error err = {0};
    for (int again = 0; again < 2; again++) {
        seen all = {0};
        assert_int_equal(strl_folder_list(folder, "", see, &all, &err), STRL_FOUND);
        assert_int_equal(all.files + all.folders, 10);
        assert_in_range(all.folders, 1, 2); /* sub, and way where links are followed */
        assert_false(all.leak);
    }
    seen sub = {0};
    assert_int_equal(strl_folder_list(folder, "sub", see, &sub, &err), STRL_FOUND);
    assert_int_equal(sub.files, 2);
    static const char *const none[] = {"door", "..", "a", "missing", "sub/..", "leak"};
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) {
        assert_int_equal(strl_folder_list(folder, none[i], see, &sub, &err), STRL_FOUND_NOTHING);
        assert_false(strl_folder_has_folder(folder, none[i]));
    }
    remove_tree(folder);
}

static void a_replaced_file_stays_readable_through_a_duplicate(void **state)
{
    (void)state;
    strl_folder *folder = make_tree(true);
    strl_error err;
    strl_file *file, *copy;
    char text[4] = "";
    assert_int_equal(strl_folder_open_file(folder, "sub/b", &file, &err), STRL_FOUND);
    assert_int_equal(strl_file_duplicate(file, &copy, &err), STRL_OK);
    strl_file_close(file, NULL);
    put_file(strl_test_path("served/a"), "other");
    assert_int_equal(rename(strl_test_path("served/a"), strl_test_path("served/sub/b")), 0);
    assert_int_equal(strl_file_bytes(copy), 2);
    assert_int_equal(strl_file_read(copy, 0, text, 2, &err), STRL_OK);
    assert_string_equal(text, "bb");
    strl_file_close(copy, NULL);
    remove_tree(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_name_leads_out_where_the_kernel_watches),
        cmocka_unit_test(no_name_leads_out_where_it_does_not),
        cmocka_unit_test(a_listing_shows_no_folder_behind_a_link_out),
        cmocka_unit_test(a_replaced_file_stays_readable_through_a_duplicate),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
