/* Settings, bookmarks and paths: what is written is read again, and what is not ours is left alone. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "platform/file.h"
#include "support/folder.h"
#include "viewer/journal.h"
#include "viewer/recorder.h"
#include "viewer/settings.h"

static const double bounds[6] = {100, -20, 3, 140, 10, 9};

static void write_file(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static strl_settings load(const char *path)
{
    strl_settings settings;
    strl_error err = {0};
    if (strl_settings_load(&settings, path, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return settings;
}

static void settings_and_bookmarks_come_back(void **state)
{
    (void)state;
    static strl_bookmarks bookmarks, other;
    static const uint8_t id[16] = {1, 2, 0xab}, other_id[16] = {9};
    const char *path = strl_test_path("viewer.json");
    strl_navigator navigator;
    strl_navigator_init(&navigator, bounds, 2, 1);
    strl_navigator_drag_left(&navigator, 100, 30);
    navigator.orthographic = true;
    assert_true(strl_bookmarks_add(&bookmarks, "", &navigator));
    navigator.orthographic = false;
    assert_true(strl_bookmarks_add(&bookmarks, "the \"roof\" ä", &navigator));

    strl_settings settings = load(path);
    settings.size[0] = 1111, settings.size[1] = 555;
    settings.error_px = 0.7, settings.memory_bytes = (uint64_t)3 << 30, settings.gpu_memory_bytes = 64 << 20;
    settings.text_scale = 1.25;
    settings.show_parts = true;
    strl_settings_set_bookmarks(&settings, id, &bookmarks);
    assert_int_equal(strl_settings_save(&settings, NULL), STRL_OK);
    strl_settings_deinit(&settings);

    settings = load(path);
    assert_true(settings.size[0] == 1111 && settings.size[1] == 555 && settings.error_px == 0.7);
    assert_true(settings.memory_bytes == (uint64_t)3 << 30 && settings.gpu_memory_bytes == 64 << 20);
    assert_true(settings.text_scale == 1.25 && settings.show_parts && !settings.orthographic);
    strl_settings_get_bookmarks(&settings, other_id, &other);
    assert_int_equal(other.count, 0);
    strl_settings_get_bookmarks(&settings, id, &other);
    assert_int_equal(other.count, 2);
    for (int b = 0; b < 2; b++) {
        assert_string_equal(other.items[b].name, bookmarks.items[b].name);
        assert_memory_equal(&other.items[b].pose, &bookmarks.items[b].pose, sizeof(strl_pose));
        assert_int_equal(other.items[b].orthographic, b == 0);
    }
    assert_string_equal(strl_bookmarks_next(&other)->name, "view 1");
    assert_string_equal(strl_bookmarks_next(&other)->name, "the \"roof\" ä");
    assert_string_equal(strl_bookmarks_next(&other)->name, "view 1");
    strl_bookmarks_remove(&other, 0);
    assert_int_equal(other.count, 1);
    strl_settings_deinit(&settings);
    strl_path_remove(path, NULL);
}

/* Two windows, a model each: the one that is closed last forgets nothing of the other's. */
static void what_another_window_wrote_is_kept(void **state)
{
    (void)state;
    static strl_bookmarks bookmarks, found;
    static const uint8_t ids[2][16] = {{1}, {2}};
    const char *path = strl_test_path("viewer.json");
    strl_navigator navigator;
    strl_navigator_init(&navigator, bounds, 2, 1);
    assert_true(strl_bookmarks_add(&bookmarks, "", &navigator));
    strl_settings windows[2] = {load(path), load(path)};
    windows[0].error_px = 0.25;
    for (int w = 0; w < 2; w++) {
        if (w == 1)
            strl_settings_renew(&windows[w]);
        strl_settings_set_bookmarks(&windows[w], ids[w], &bookmarks);
        assert_int_equal(strl_settings_save(&windows[w], NULL), STRL_OK);
    }
    strl_settings settings = load(path);
    assert_true(settings.error_px == 0.25);
    for (int w = 0; w < 2; w++) {
        strl_settings_get_bookmarks(&settings, ids[w], &found);
        assert_int_equal(found.count, 1);
        strl_settings_deinit(&windows[w]);
    }
    write_file(path, "oops"); /* what is known stays */
    strl_settings_renew(&settings);
    strl_settings_get_bookmarks(&settings, ids[1], &found);
    assert_int_equal(found.count, 1);
    strl_settings_deinit(&settings);
    strl_path_remove(path, NULL);
}

/* A letter of several bytes is there as a whole or not at all: what is no UTF-8 could not be written. */
static void long_names_are_cut_between_letters(void **state)
{
    (void)state;
    static strl_bookmarks bookmarks, found;
    char name[STRL_BOOKMARK_NAME + 8] = "";
    strl_navigator navigator;
    strl_navigator_init(&navigator, bounds, 2, 1);
    memset(name, 'x', STRL_BOOKMARK_NAME - 2);
    strcpy(name + STRL_BOOKMARK_NAME - 2, "\xc3\xa4"); /* its second byte does not fit */
    assert_true(strl_bookmarks_add(&bookmarks, name, &navigator));
    assert_true(strl_bookmarks_add(&bookmarks, "br\xfc", &navigator));
    json_t *array = json_pack("[{s:s,s:[f,f,f],s:f,s:f,s:f}]", "name", name, "eye", 1.0, 2.0, 3.0, "yaw", 0.0, "pitch",
                              0.0, "distance", 1.0);
    strl_bookmarks_read(&found, array);
    json_decref(array);
    assert_int_equal(found.count, 1);
    assert_int_equal(strlen(found.items[0].name), STRL_BOOKMARK_NAME - 2);
    array = strl_bookmarks_write(&bookmarks);
    strl_bookmarks_read(&found, array);
    json_decref(array);
    assert_int_equal(found.count, 2);
    assert_int_equal(strlen(found.items[0].name), STRL_BOOKMARK_NAME - 2);
    assert_string_equal(found.items[1].name, "br?");
    assert_int_equal(strl_bookmarks_find(&bookmarks, &bookmarks.items[1]), 1);
    bookmarks.items[1].pose.yaw += 1;
    assert_int_equal(strl_bookmarks_find(&found, &bookmarks.items[1]), 2);
}

static void what_is_not_understood_stays(void **state)
{
    (void)state;
    const char *path = strl_test_path("viewer.json");
    write_file(path, "{\"error_px\": \"much\", \"width\": 1e300, \"future\": [1, 2], \"memory_bytes\": -4,"
                     " \"bookmarks\": {\"01000000000000000000000000000000\": [3, {\"name\": \"x\"}], \"else\": 5}}");
    static strl_bookmarks bookmarks;
    static const uint8_t id[16] = {1};
    strl_settings settings = load(path);
    assert_true(settings.error_px == 0 && settings.size[0] == 0 && settings.memory_bytes == 0);
    strl_settings_get_bookmarks(&settings, id, &bookmarks);
    assert_int_equal(bookmarks.count, 0);
    assert_int_equal(strl_settings_save(&settings, NULL), STRL_OK);
    strl_settings_deinit(&settings);
    settings = load(path);
    assert_int_equal(json_array_size(json_object_get(settings.root, "future")), 2);
    assert_true(json_integer_value(json_object_get(json_object_get(settings.root, "bookmarks"), "else")) == 5);
    strl_settings_deinit(&settings);
    strl_path_remove(path, NULL);
}

/* A slip in the file costs nobody the bookmarks in it. */
static void a_broken_file_is_told_and_not_overwritten(void **state)
{
    (void)state;
    static const char *const texts[] = {"{\"error_px\": 2,\n oops", "[1]", ""};
    const char *path = strl_test_path("viewer.json");
    for (int t = 0; t < 3; t++) {
        strl_settings settings;
        strl_error err = {0};
        strl_file_info info;
        write_file(path, texts[t]);
        assert_int_equal(strl_settings_load(&settings, path, &err), STRL_ERR_FORMAT);
        assert_non_null(strstr(err.message, "viewer.json"));
        settings.error_px = 5;
        assert_int_equal(strl_settings_save(&settings, NULL), STRL_OK);
        assert_int_equal(strl_path_stat(path, &info, NULL), STRL_OK);
        assert_int_equal(info.bytes, strlen(texts[t]));
        strl_settings_deinit(&settings);
    }
    strl_path_remove(path, NULL);
}

static void folders_are_made_and_nothing_is_written_without_a_name(void **state)
{
    (void)state;
    char above[600], folder[620], path[640];
    snprintf(above, sizeof above, "%s", strl_test_path("config"));
    snprintf(folder, sizeof folder, "%s/stroll", above);
    snprintf(path, sizeof path, "%s/viewer.json", folder);
    strl_settings settings = load(NULL);
    assert_int_equal(strl_settings_save(&settings, NULL), STRL_OK);
    strl_settings_deinit(&settings);
    settings = load(path);
    assert_int_equal(strl_settings_save(&settings, NULL), STRL_OK);
    assert_true(strl_path_exists(path));
    strl_settings_deinit(&settings);
    assert_int_equal(strl_path_remove_directory(folder, NULL), STRL_OK);
    assert_int_equal(strl_path_remove_directory(above, NULL), STRL_OK);
}

/* ---- the log */

static void the_log_tells_of_files_whose_names_are_not_utf8(void **state)
{
    (void)state;
    FILE *journal;
    char line[200] = "";
    const char *path = strl_test_path("log.jsonl");
    assert_int_equal(strl_journal_open(path, &journal, NULL), STRL_OK);
    strl_journal_write(journal, "opened",
                       json_pack("{s:o}", "file",
                                 strl_journal_text("br\xfc"
                                                   "cke.obj")));
    strl_journal_write(journal, "opened",
                       json_pack("{s:o}", "file",
                                 strl_journal_text("br\xc3\xbc"
                                                   "cke.obj")));
    strl_journal_close(journal);
    journal = fopen(path, "r");
    assert_non_null(journal);
    assert_non_null(fgets(line, sizeof line, journal));
    assert_string_equal(line, "{\"file\":\"br?cke.obj\",\"event\":\"opened\"}\n");
    assert_non_null(fgets(line, sizeof line, journal));
    assert_string_equal(line, "{\"file\":\"br\xc3\xbc"
                              "cke.obj\",\"event\":\"opened\"}\n");
    fclose(journal);
    strl_path_remove(path, NULL);
}

/* ---- paths */

static strl_camera camera_at(double x)
{
    return (strl_camera){
        .eye = {x, 0, 0}, .target = {x, 5, 0}, .up = {0, 0, 1}, .fov_y_deg = 60, .width = 8, .height = 8};
}

static void a_path_is_recorded_in_equal_times_and_replayed(void **state)
{
    (void)state;
    char file[600];
    strl_error err = {0};
    strl_recorder recorder = {0};
    strl_camera camera = camera_at(0);
    const uint32_t size[2] = {8, 8};
    assert_false(strl_recorder_replay(&recorder));
    strl_recorder_start(&recorder, 60);
    /* One second at 60 frames, then one frame of a second: the same length each. */
    for (int f = 0; f <= 60; f++) {
        camera = camera_at(f / 60.0);
        assert_true(strl_recorder_add(&recorder, &camera, f ? 1 / 60.0 : 0));
    }
    camera = camera_at(2);
    assert_true(strl_recorder_add(&recorder, &camera, 1));
    camera = camera_at(2.25); /* in less than a thirtieth of a second, and it ends there all the same */
    assert_true(strl_recorder_add(&recorder, &camera, 0.001));
    strl_recorder_stop(&recorder);
    assert_true(recorder.path.count >= 61 && recorder.path.count <= 63);
    assert_true(recorder.path.frames[recorder.path.count - 1].eye[0] == 2.25);
    assert_true(fabs(recorder.path.frames[45].eye[0] - 1.5) < 0.06);

    assert_int_equal(strl_recorder_save(&recorder, strl_test_folder, file, sizeof file, &err), STRL_OK);
    assert_non_null(strstr(file, "stroll_path_00000.json"));
    strl_recorder again = {0};
    assert_int_equal(strl_recorder_load(&again, file, &err), STRL_OK);
    assert_int_equal(again.path.count, recorder.path.count);
    assert_memory_equal(again.path.frames, recorder.path.frames, again.path.count * sizeof *again.path.frames);
    assert_int_equal(strl_recorder_load(&again, strl_test_path("none.json"), &err), STRL_ERR_IO);
    assert_int_equal(again.path.count, recorder.path.count);

    assert_true(strl_recorder_replay(&again));
    assert_true(strl_recorder_next(&again, 100, size, &camera) &&
                camera.eye[0] == 0); /* the first, whatever the time */
    assert_true(strl_recorder_next(&again, 0.5, size, &camera) && fabs(camera.eye[0] - 0.5) < 0.06);
    assert_true(strl_recorder_next(&again, 100, size, &camera) && camera.eye[0] == 2.25);
    assert_false(strl_recorder_next(&again, 0.1, size, &camera));
    assert_int_equal(again.state, STRL_RECORDER_IDLE);
    strl_recorder_deinit(&again);
    strl_recorder_deinit(&recorder);
    strl_path_remove(file, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(settings_and_bookmarks_come_back),
        cmocka_unit_test(what_another_window_wrote_is_kept),
        cmocka_unit_test(long_names_are_cut_between_letters),
        cmocka_unit_test(what_is_not_understood_stays),
        cmocka_unit_test(a_broken_file_is_told_and_not_overwritten),
        cmocka_unit_test(folders_are_made_and_nothing_is_written_without_a_name),
        cmocka_unit_test(the_log_tells_of_files_whose_names_are_not_utf8),
        cmocka_unit_test(a_path_is_recorded_in_equal_times_and_replayed),
    };
    return cmocka_run_group_tests(tests, strl_test_folder_make, strl_test_folder_remove);
}
