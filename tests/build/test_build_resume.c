/* Builds that are stopped at every kind of place and resumed; and checkpoints that say what cannot be. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "base/cursor.h"
#include "base/hash.h"
#include "base/memory.h"
#include "build/built.h"
#include "platform/file.h"
#include "verify/verify.h"

/* How much of what could be tried is: under a sanitizer, where all takes ten times as long, less. Under ThreadSanitizer
 * only that checkpoints are made and gone on with while workers run. */
#if defined(__SANITIZE_THREAD__)
#define CALL_STRIDE 29u
#define FAILURE_SHARE 1u
#elif defined(__SANITIZE_ADDRESS__)
#define CALL_STRIDE 9u
#define FAILURE_SHARE 2u
#define BYTE_STRIDE 41u
#define WORD_SHARE 3u
#else
#define CALL_STRIDE 2u
#define FAILURE_SHARE 5u
#define BYTE_STRIDE 7u
#define WORD_SHARE 8u
#endif
#define HEAD_BYTES 20u /* of a checkpoint, before what its checksum is of */
#define STEP_BYTES 16384u
/* Rings of a torus: the fewest that give a root two and three levels above the leaves. */
#define TWO_LEVELS 52u
#define THREE_LEVELS 101u

static uint8_t *expected;
static size_t expected_bytes;
static bool compact, samples;

typedef struct stop {
    uint64_t calls, after; /* 0 = never */
    const char *stage;     /* NULL = any */
} stop;

static bool say_no(void *context, const strl_build_progress *progress)
{
    stop *s = context;
    s->calls += !s->stage || !strcmp(s->stage, progress->stage);
    return s->calls != s->after;
}

static strl_status build(bool resume, unsigned jobs, stop *s, strl_build_result *result, strl_error *err)
{
    const char *input = built_path("in.ply");
    strl_build_desc desc = {.inputs = &input,
                            .input_count = 1,
                            .output = built_path("out.stroll"),
                            .memory_bytes = STRL_BUILD_LEAST_MEMORY,
                            .jobs = jobs,
                            .compact = compact,
                            .keep = true,
                            .keep_triangles = 1,
                            .resume = resume,
                            .progress = s ? say_no : NULL,
                            .context = s};
    *err = (strl_error){0};
    return samples ? strl_build_samples(&desc, result, err) : strl_build_clusters(&desc, result, err);
}

/* And what a build of it gives that nothing stops. */
static void make_input(uint32_t rings)
{
    mesh_file mesh = {0};
    mesh_file_torus(&mesh, rings, 100);
    for (uint32_t i = 0; i < 200 && samples; i++) /* too large for what they lie in */
        mesh_file_add_face(&mesh, i, mesh.vertex_count / 2 + i, mesh.vertex_count - 1 - i);
    mesh_file_write_ply(&mesh, built_path("in.ply"));
    mesh_file_free(&mesh);
    strl_build_result result;
    strl_error err;
    assert_int_equal(build(false, 1, NULL, &result, &err), STRL_OK);
    expected = built_read_file(built_path("out.stroll"), &expected_bytes);
    assert_int_equal(remove(built_path("out.stroll")), 0);
    assert_int_equal(built_files_left(), 1);
}

static void assert_output(void)
{
    size_t size;
    uint8_t *bytes = built_read_file(built_path("out.stroll"), &size);
    assert_int_equal(size, expected_bytes);
    assert_memory_equal(bytes, expected, size);
    free(bytes);
    assert_int_equal(remove(built_path("out.stroll")), 0);
    assert_int_equal(built_files_left(), 1); /* no scratch */
}

static void must_resume(void)
{
    strl_build_result result;
    strl_error err;
    if (build(true, 2, NULL, &result, &err) != STRL_OK)
        fail_msg("%s", err.message);
    assert_output();
}

static int clean_up(void **state)
{
    free(expected);
    expected = NULL;
    compact = samples = false;
    strl_path_remove_directory(built_path("out.stroll.tmp"), NULL);
    return built_teardown(state);
}

/* ---- scratch folders, kept in memory ---- */
typedef struct saved_file {
    char name[64];
    uint8_t *bytes;
    size_t size;
} saved_file;

typedef struct saved_folder {
    saved_file file[64];
    unsigned count;
} saved_folder;

static const char *scratch_path(const char *name)
{
    char path[128];
    snprintf(path, sizeof path, "out.stroll.tmp/%s", name);
    return built_path(path);
}

static void load_folder(saved_folder *saved)
{
    DIR *listing = opendir(built_path("out.stroll.tmp"));
    assert_non_null(listing);
    saved->count = 0;
    for (struct dirent *entry; (entry = readdir(listing)) != NULL;) {
        if (entry->d_name[0] == '.')
            continue;
        assert_true(saved->count < 64);
        saved_file *file = &saved->file[saved->count++];
        snprintf(file->name, sizeof file->name, "%.60s", entry->d_name);
        file->bytes = built_read_file(scratch_path(file->name), &file->size);
    }
    closedir(listing);
}

static void put_folder(const saved_folder *saved)
{
    strl_path_remove_directory(built_path("out.stroll.tmp"), NULL);
    assert_int_equal(strl_path_make_directory(built_path("out.stroll.tmp"), NULL), STRL_OK);
    for (unsigned i = 0; i < saved->count; i++) {
        FILE *file = fopen(scratch_path(saved->file[i].name), "wb");
        assert_non_null(file);
        assert_int_equal(fwrite(saved->file[i].bytes, 1, saved->file[i].size, file), saved->file[i].size);
        fclose(file);
    }
}

/* Stops at the stage's call of that number. */
static void stop_in(const char *stage, uint64_t call, saved_folder *saved)
{
    strl_build_result result;
    strl_error err;
    stop middle = {.after = call, .stage = stage};
    assert_int_equal(build(false, 1, &middle, &result, &err), STRL_ERR_CANCELLED);
    assert_true(result.scratch_kept);
    load_folder(saved);
}

static void free_folder(saved_folder *saved)
{
    for (unsigned i = 0; i < saved->count; i++)
        free(saved->file[i].bytes);
}

/* ---- stopped ---- */
static void cancelled_at_any_call_it_resumes(void **state)
{
    (void)state;
    make_input(THREE_LEVELS);
    unsigned kept = 0, tried = 0;
    for (uint64_t after = 1;; after += CALL_STRIDE, tried++) {
        stop s = {.after = after};
        strl_build_result result;
        strl_error err;
        strl_status status = build(false, 2, &s, &result, &err);
        if (status == STRL_OK)
            break;
        assert_int_equal(status, STRL_ERR_CANCELLED);
        assert_int_equal(result.scratch_kept, strl_path_exists(built_path("out.stroll.tmp")));
        kept += result.scratch_kept;
        assert_int_equal(strstr(err.message, "--resume") != NULL, result.scratch_kept);
        must_resume();
    }
    assert_output();
    assert_true(kept > 0 && kept < tried);
}

static void a_sample_tree_cancelled_at_any_call_resumes(void **state)
{
    samples = true;
    cancelled_at_any_call_it_resumes(state);
}

/* Every node of a compact container, one after the other. */
static void cancelled_at_any_node_that_is_written_it_resumes(void **state)
{
    (void)state;
    compact = true;
    make_input(TWO_LEVELS);
    uint64_t nodes = 0;
    for (;; nodes++) {
        stop s = {.after = nodes + 1, .stage = "write"};
        strl_build_result result;
        strl_error err;
        strl_status status = build(nodes > 0, 2, &s, &result, &err);
        if (status == STRL_OK)
            break;
        assert_int_equal(status, STRL_ERR_CANCELLED);
        assert_true(result.scratch_kept);
    }
    assert_true(nodes >= 3);
    assert_output();
}

/* Fails the n-th call, then resumes until it gets through, for growing n. before: a folder with stages that each try
 * goes on with, or NULL to begin anew. */
static void fail_each(void (*fail_after)(uint64_t n), strl_status failure, const saved_folder *before)
{
    unsigned kept = 0;
    for (uint64_t n = 1;; n += 1 + n / FAILURE_SHARE) {
        strl_build_result result;
        strl_error err;
        if (before)
            put_folder(before);
        fail_after(n);
        strl_status status = build(before != NULL, 2, NULL, &result, &err);
        fail_after(0);
        if (status == STRL_OK)
            break;
        if (status != failure)
            fail_msg("failure %llu: %s (%s)", (unsigned long long)n, err.message, strl_status_name(status));
        kept += result.scratch_kept;
        assert_true(!before || strl_path_exists(built_path("out.stroll.tmp/checkpoint")));
        must_resume();
    }
    assert_output();
    assert_true(kept >= 3);
}

static void fail_each_while_resuming(void (*fail_after)(uint64_t n), strl_status failure)
{
    saved_folder before;
    make_input(THREE_LEVELS);
    stop_in(samples ? "sort" : "level 1", samples ? 1 : 2, &before);
    fail_each(fail_after, failure, &before);
    free_folder(&before);
}

static void a_disk_that_is_still_full_loses_nothing(void **state)
{
    (void)state;
    fail_each_while_resuming(strl_file_fail_writes_after, STRL_ERR_DISK_FULL);
}

static void a_sample_tree_loses_nothing_on_a_full_disk(void **state)
{
    (void)state;
    samples = true;
    fail_each_while_resuming(strl_file_fail_writes_after, STRL_ERR_DISK_FULL);
}

#ifndef __SANITIZE_THREAD__
static void a_sample_tree_loses_nothing_without_memory_or_reads(void **state)
{
    samples = true;
    fail_each_while_resuming(strl__alloc_fail_after, STRL_ERR_MEMORY);
    clean_up(state);
    built_setup(state);
    samples = true;
    fail_each_while_resuming(strl_file_fail_reads_after, STRL_ERR_IO);
}

static void on_a_full_disk_it_keeps_what_is_finished(void **state)
{
    (void)state;
    make_input(TWO_LEVELS);
    fail_each(strl_file_fail_writes_after, STRL_ERR_DISK_FULL, NULL);
}

static void without_memory_to_resume_nothing_is_lost(void **state)
{
    (void)state;
    fail_each_while_resuming(strl__alloc_fail_after, STRL_ERR_MEMORY);
}

static void a_read_that_fails_while_resuming_loses_nothing(void **state)
{
    (void)state;
    fail_each_while_resuming(strl_file_fail_reads_after, STRL_ERR_IO);
}

/* ---- scratch that lies ---- */
static saved_file *find(saved_folder *saved, const char *name)
{
    for (unsigned i = 0; i < saved->count; i++)
        if (!strcmp(saved->file[i].name, name))
            return &saved->file[i];
    fail_msg("there is no %s", name);
    return NULL;
}

static void reseal(saved_file *checkpoint)
{
    strl__store_le(checkpoint->bytes + 12, 8,
                   strl__checksum(checkpoint->bytes + HEAD_BYTES, checkpoint->size - HEAD_BYTES));
}

/* Gives the checkpoint the checksum that a changed step has now. */
static void reseal_step(saved_file *checkpoint, uint64_t before, uint64_t after)
{
    for (size_t at = HEAD_BYTES; at + 8 <= checkpoint->size; at++)
        if (strl__load_le(checkpoint->bytes + at, 8) == before)
            strl__store_le(checkpoint->bytes + at, 8, after);
    reseal(checkpoint);
}

/* By the independent check. */
static void assert_sound(const char *model)
{
    char folder[512];
    strl_verify_report report;
    strl_error err = {0};
    snprintf(folder, sizeof folder, "%s", built_path(""));
    const strl_verify_desc desc = {
        .model = model, .scratch_dir = folder, .memory_bytes = 256u << 20, .jobs = 1, .cuts = 1};
    if (strl_verify_run(&desc, &report, &err) != STRL_OK)
        fail_msg("%s", err.message);
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        if (report.checks[kind].failures)
            fail_msg("%s: %s", strl_verify_name((strl_verify_kind)kind), report.checks[kind].first);
    strl_verify_report_deinit(&report);
}

/* Whatever it says, it is refused or built. What is built may be another model; of a checkpoint, whose counts are
 * checked, not a broken container, but the record of a node is believed: who forges one with its checksums gets what it
 * says. */
static void resume_what_lies(const saved_folder *saved, bool is_sound, unsigned *refused)
{
    strl_build_result result;
    strl_error err;
    put_folder(saved);
    strl_status status = build(true, 1, NULL, &result, &err);
    *refused += status != STRL_OK;
    if (status != STRL_OK) {
        assert_true(strlen(err.message) > 12);
        return;
    }
    if (is_sound)
        assert_sound(built_path("out.stroll"));
    assert_int_equal(remove(built_path("out.stroll")), 0);
}

static void any_byte_of_a_checkpoint_may_lie(void **state)
{
    (void)state;
    saved_folder saved;
    unsigned refused = 0, tried = 0;
    make_input(TWO_LEVELS);
    stop_in(samples ? "sort" : "level 1", 1, &saved);
    saved_file *checkpoint = find(&saved, "checkpoint");
    for (size_t at = HEAD_BYTES; at < checkpoint->size; at += BYTE_STRIDE, tried++) {
        static const uint8_t masks[] = {0x01, 0x80, 0xff};
        uint8_t mask = masks[tried % 3];
        checkpoint->bytes[at] ^= mask;
        reseal(checkpoint);
        resume_what_lies(&saved, true, &refused);
        checkpoint->bytes[at] ^= mask;
    }
    reseal(checkpoint);
    put_folder(&saved);
    must_resume();
    assert_true(refused > tried / 3);
    free_folder(&saved);
}

static void any_byte_of_a_checkpoint_of_samples_may_lie(void **state)
{
    samples = true;
    any_byte_of_a_checkpoint_may_lie(state);
}

static void a_checkpoint_may_be_cut_off_anywhere(void **state)
{
    (void)state;
    saved_folder saved;
    unsigned refused = 0, tried = 0;
    make_input(TWO_LEVELS);
    stop_in("level 1", 1, &saved);
    saved_file *checkpoint = find(&saved, "checkpoint");
    size_t whole = checkpoint->size;
    for (checkpoint->size = 0; checkpoint->size < whole; checkpoint->size += 1 + checkpoint->size / 50, tried++) {
        if (checkpoint->size >= HEAD_BYTES)
            reseal(checkpoint);
        resume_what_lies(&saved, false, &refused);
    }
    assert_int_equal(refused, tried);
    free_folder(&saved);
}

/* Of the step that a stage's stream begins with, with the checksum that it then has. */
static void lie_in(const char *name, saved_folder *saved, bool is_checked)
{
    unsigned refused = 0, tried = 0;
    saved_file *checkpoint = find(saved, "checkpoint"), *stage = find(saved, name);
    size_t size = stage->size < STEP_BYTES ? stage->size : STEP_BYTES;
    for (size_t at = 0; at < size; at += 1 + at / WORD_SHARE, tried++) {
        uint64_t before = strl__checksum(stage->bytes, size);
        stage->bytes[at] ^= 0x41;
        uint64_t after = strl__checksum(stage->bytes, size);
        reseal_step(checkpoint, before, after);
        resume_what_lies(saved, false, &refused);
        stage->bytes[at] ^= 0x41;
        reseal_step(checkpoint, after, before);
    }
    assert_true(!is_checked || refused > tried / 8);
}

static void any_word_of_a_stage_may_lie(void **state)
{
    (void)state;
    saved_folder saved;
    make_input(TWO_LEVELS);
    stop_in("partition", 1, &saved);
    lie_in("graph.spill", &saved, true);
    lie_in("ingest.spill", &saved, true);
    free_folder(&saved);
    stop_in("level 0", 2, &saved);
    lie_in("partition.spill", &saved, true);
    free_folder(&saved);
    stop_in("level 1", 1, &saved);
    lie_in("nodes-00.spill", &saved, true);
    free_folder(&saved);
}

/* What payloads and triangles say is believed, as far as it can be said in a tree. */
static void any_word_of_what_samples_keep_may_lie(void **state)
{
    (void)state;
    saved_folder saved;
    samples = true;
    make_input(THREE_LEVELS);
    stop_in("sort", 1, &saved);
    lie_in("ingest.spill", &saved, true);
    lie_in("buckets.spill", &saved, true);
    lie_in("pieces.spill", &saved, true);
    lie_in("bricks.spill", &saved, false);
    lie_in("bucket-001.spill", &saved, false);
    free_folder(&saved);
}

static void must_refuse_the_pieces(const saved_folder *saved)
{
    strl_build_result result;
    strl_error err;
    put_folder(saved);
    assert_int_equal(build(true, 1, NULL, &result, &err), STRL_ERR_FORMAT);
    if (!strstr(err.message, "the pieces of the tree"))
        fail_msg("%s", err.message);
}

/* A stream of so many zeros, of one step, with the length and the checksum that it then has. */
static void put_zeros(saved_folder *saved, const char *name, size_t size)
{
    char file[64];
    snprintf(file, sizeof file, "%s.spill", name);
    saved_file *checkpoint = find(saved, "checkpoint"), *stream = find(saved, file);
    size_t length = strlen(name), steps = (stream->size + STEP_BYTES - 1) / STEP_BYTES;
    uint8_t *at = checkpoint->bytes + HEAD_BYTES, *end = checkpoint->bytes + checkpoint->size;
    while (at[0] != length || memcmp(at + 1, name, length) || strl__load_le(at + 1 + length, 8) != stream->size)
        assert_true(++at + 9 + length < end);
    assert_true(size <= stream->size && size <= STEP_BYTES);
    memset(stream->bytes, 0, size);
    stream->size = size;
    at += 1 + length;
    strl__store_le(at, 8, size);
    strl__store_le(at + 8, 2, 0);
    strl__store_le(at + 10, 8, strl__checksum(stream->bytes, size));
    memmove(at + 18, at + 8 + 10 * steps, (size_t)(end - (at + 8 + 10 * steps)));
    checkpoint->size -= 10 * (steps - 1);
    reseal(checkpoint);
}

static void pieces_without_all_triangles_are_refused(void **state)
{
    (void)state;
    enum { TOTAL_AT = 8 + 15 }; /* behind the counts of the bucket and what the cell of its first piece begins with */
    saved_folder saved;
    samples = true;
    make_input(TWO_LEVELS);
    stop_in("write", 1, &saved);
    saved_file *checkpoint = find(&saved, "checkpoint"), *pieces = find(&saved, "pieces.spill");
    size_t step = pieces->size < STEP_BYTES ? pieces->size : STEP_BYTES;
    uint32_t buckets = (uint32_t)strl__load_le(find(&saved, "buckets.spill")->bytes, 4);
    assert_true(strl__load_le(pieces->bytes, 4) > 0);
    uint64_t before = strl__checksum(pieces->bytes, step);
    pieces->bytes[TOTAL_AT] ^= 1;
    reseal_step(checkpoint, before, strl__checksum(pieces->bytes, step));
    must_refuse_the_pieces(&saved);
    put_zeros(&saved, "pieces", 8 * buckets); /* all buckets are finished, and have handed up nothing */
    must_refuse_the_pieces(&saved);
    free_folder(&saved);
}
#endif

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(cancelled_at_any_call_it_resumes, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(cancelled_at_any_node_that_is_written_it_resumes, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(a_sample_tree_cancelled_at_any_call_resumes, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(a_sample_tree_loses_nothing_on_a_full_disk, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(a_disk_that_is_still_full_loses_nothing, built_setup, clean_up),
#ifndef __SANITIZE_THREAD__
        cmocka_unit_test_setup_teardown(on_a_full_disk_it_keeps_what_is_finished, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(without_memory_to_resume_nothing_is_lost, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(a_read_that_fails_while_resuming_loses_nothing, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(any_byte_of_a_checkpoint_may_lie, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(a_checkpoint_may_be_cut_off_anywhere, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(any_word_of_a_stage_may_lie, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(a_sample_tree_loses_nothing_without_memory_or_reads, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(any_byte_of_a_checkpoint_of_samples_may_lie, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(any_word_of_what_samples_keep_may_lie, built_setup, clean_up),
        cmocka_unit_test_setup_teardown(pieces_without_all_triangles_are_refused, built_setup, clean_up),
#endif
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
