/* Children: what they write is read, how they end is told, they keep to their limits, inherit nothing and never outlive
 * us. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "platform/file.h"
#include "platform/process.h"
#include "platform/thread.h"

#define SECOND 1000000000u
#define MOST_WAIT (60ull * SECOND)

static strl_process *start_shell(const char *script, uint64_t address_bytes, uint64_t cpu_seconds)
{
    const char *const arguments[] = {"/bin/sh", "-c", script, NULL};
    const strl_process_desc desc = {.arguments = arguments, .address_bytes = address_bytes, .cpu_seconds = cpu_seconds};
    strl_process *process;
    strl_error err = {0};
    if (strl_process_start(&desc, &process, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return process;
}

/* All output, of which the first bytes are kept and ended by a zero; returns how many there were. */
static size_t read_output(strl_process *process, char *text, size_t size)
{
    size_t total = 0, kept = 0;
    bool ended = false;
    char buffer[4096];
    while (!ended) {
        size_t got;
        assert_int_equal(strl_process_read(process, MOST_WAIT, buffer, sizeof buffer, &got, &ended, NULL), STRL_OK);
        for (size_t i = 0; i < got && kept + 1 < size; i++)
            text[kept++] = buffer[i];
        total += got;
    }
    text[kept] = 0;
    return total;
}

static strl_process_end run_shell(const char *script, char *text, size_t size)
{
    strl_process_end end;
    strl_process *process = start_shell(script, 0, 0);
    read_output(process, text, size);
    assert_true(strl_process_wait(process, MOST_WAIT, &end));
    strl_process_close(process);
    return end;
}

static void output_and_status_are_told(void **state)
{
    (void)state;
    char text[64];
    strl_process_end end = run_shell("printf 'a word'; exit 7", text, sizeof text);
    assert_string_equal(text, "a word");
    assert_int_equal(end.exit_status, 7);
    assert_int_equal(end.signal, 0);
    assert_true(end.peak_rss_bytes > 0);
    strl_process *process = start_shell("head -c 3000000 /dev/zero", 0, 0);
    assert_int_equal(read_output(process, text, sizeof text), 3000000);
    strl_process_close(process);
}

static void a_signal_is_told(void **state)
{
    (void)state;
    char text[8];
    strl_process_end end = run_shell("kill -SEGV $$", text, sizeof text);
    assert_int_equal(end.signal, SIGSEGV);
    assert_false(end.cpu_exhausted);
    assert_string_equal(strl_signal_name(SIGSEGV), "Segmentation fault");
    assert_non_null(strl_signal_name(12345));
}

static void the_last_line_of_errors_is_kept(void **state)
{
    (void)state;
    char text[8];
    strl_process_end end;
    /* More than a pipe holds: a child that complains must not have to wait for us. */
    strl_process *process =
        start_shell("i=0; while [ $i -lt 9000 ]; do echo a line of complaint >&2; i=$((i+1)); done; "
                    "printf 'the\\tlast one\\n\\n' >&2",
                    0, 0);
    assert_int_equal(read_output(process, text, sizeof text), 0);
    assert_true(strl_process_wait(process, MOST_WAIT, &end));
    assert_string_equal(strl_process_complaint(process), "the?last one");
    strl_process_close(process);
    process = start_shell(":", 0, 0);
    assert_true(strl_process_wait(process, MOST_WAIT, &end));
    assert_string_equal(strl_process_complaint(process), "");
    strl_process_close(process);
}

static void waiting_ends_in_time(void **state)
{
    (void)state;
    char byte;
    size_t got = 1;
    bool ended = true;
    strl_process_end end;
    strl_process *process = start_shell("exec sleep 1000", 0, 0);
    uint64_t start = strl_clock_ns();
    assert_int_equal(strl_process_read(process, SECOND / 5, &byte, 1, &got, &ended, NULL), STRL_OK);
    assert_int_equal(got, 0);
    assert_false(ended);
    assert_false(strl_process_wait(process, SECOND / 5, &end));
    assert_in_range(strl_clock_ns() - start, SECOND * 2 / 5, MOST_WAIT);
    strl_process_close(process);
}

static bool is_gone(pid_t id)
{
    for (int i = 0; i < 200; i++) {
        if (kill(id, 0) != 0 && errno == ESRCH)
            return true;
        strl_sleep_ns(SECOND / 20);
    }
    return false;
}

static void closing_kills_with_all_descendants(void **state)
{
    (void)state;
    char text[64] = {0};
    size_t got = 0;
    bool ended;
    int shell, sleeper;
    strl_process *process = start_shell("sleep 1000 & echo $$ $! .; wait", 0, 0);
    assert_int_equal(strl_process_read(process, MOST_WAIT, text, sizeof text - 1, &got, &ended, NULL), STRL_OK);
    assert_int_equal(sscanf(text, "%d %d .", &shell, &sleeper), 2);
    assert_int_equal(kill(shell, 0), 0);
    strl_process_close(process);
    assert_true(kill(shell, 0) != 0 && errno == ESRCH); /* waited for: no zombie either */
    assert_true(is_gone(sleeper));
    assert_true(waitpid(-1, NULL, WNOHANG) < 0 && errno == ECHILD);
}

static void what_a_child_leaves_running_is_killed(void **state)
{
    (void)state;
    char text[64];
    strl_process_end end;
    strl_process *process = start_shell("sleep 1000 >/dev/null 2>&1 & echo $!", 0, 0);
    read_output(process, text, sizeof text);
    assert_true(strl_process_wait(process, MOST_WAIT, &end));
    assert_int_equal(end.exit_status, 0);
    assert_true(is_gone(atoi(text)));
    strl_process_close(process);
}

static void a_child_dies_with_us(void **state)
{
    (void)state;
    int ends[2];
    pid_t child = 0;
    assert_int_equal(pipe(ends), 0);
    pid_t parent = fork();
    assert_true(parent >= 0);
    if (parent == 0) {
        const char *const arguments[] = {"/bin/sh", "-c", "echo $$; exec sleep 1000", NULL};
        const strl_process_desc desc = {.arguments = arguments};
        strl_process *process;
        char text[32] = {0};
        size_t got = 0;
        bool ended;
        if (strl_process_start(&desc, &process, NULL) == STRL_OK)
            strl_process_read(process, MOST_WAIT, text, sizeof text - 1, &got, &ended, NULL);
        pid_t id = atoi(text);
        _exit(write(ends[1], &id, sizeof id) == (ssize_t)sizeof id ? 0 : 1);
    }
    assert_int_equal(read(ends[0], &child, sizeof child), sizeof child);
    assert_int_equal(waitpid(parent, NULL, 0), parent);
    close(ends[0]);
    close(ends[1]);
    assert_true(child > 0);
    assert_true(is_gone(child));
}

static void nothing_is_inherited(void **state)
{
    (void)state;
    char text[256];
    int leaked = dup(1), pipe_ends[2];
    assert_true(leaked > 2);
    assert_int_equal(pipe(pipe_ends), 0);
    run_shell("cat; exec ls /proc/self/fd", text, sizeof text); /* cat: the input is empty */
    assert_string_equal(text, "0\n1\n2\n3\n");                  /* the last is that of the folder which ls reads */
    close(leaked);
    close(pipe_ends[0]);
    close(pipe_ends[1]);
    signal(SIGPIPE, SIG_IGN);
    strl_process_end end = run_shell("kill -PIPE $$; exit 3", text, sizeof text);
    signal(SIGPIPE, SIG_DFL);
    assert_int_equal(end.signal, SIGPIPE);
}

static void limits_hold(void **state)
{
    (void)state;
    char text[256], folder[] = "/tmp/stroll-process-XXXXXX", script[128];
    strl_process_end end;
    assert_non_null(mkdtemp(folder));
    snprintf(script, sizeof script, "echo word > %s/file", folder);
    end = run_shell(script, text, sizeof text);
    assert_true(end.signal == SIGXFSZ || end.exit_status != 0);
    strl_process *process = start_shell("ulimit -v; ulimit -t; ulimit -c", 512u << 20, 33);
    read_output(process, text, sizeof text);
    assert_string_equal(text, "524288\n33\n0\n");
    strl_process_close(process);
    process = start_shell("while :; do :; done", 0, 1);
    assert_int_equal(read_output(process, text, sizeof text), 0);
    assert_true(strl_process_wait(process, MOST_WAIT, &end));
    assert_true(end.cpu_exhausted);
    strl_process_close(process);
    assert_int_equal(strl_path_remove_directory(folder, NULL), STRL_OK);
}

static void what_cannot_run_is_refused(void **state)
{
    (void)state;
    strl_process *process;
    strl_error err = {0};
    const char *const missing[] = {"/nonexistent/program", NULL}, *const folder[] = {"/tmp", NULL};
    assert_int_equal(strl_process_start(&(strl_process_desc){.arguments = missing}, &process, &err), STRL_ERR_IO);
    assert_null(process);
    assert_string_equal(err.message, "cannot run /nonexistent/program: No such file or directory");
    assert_int_equal(strl_process_start(&(strl_process_desc){.arguments = folder}, &process, &err), STRL_ERR_IO);
    assert_string_equal(err.message, "cannot run /tmp: Permission denied");
    strl_process_close(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(output_and_status_are_told),
        cmocka_unit_test(a_signal_is_told),
        cmocka_unit_test(the_last_line_of_errors_is_kept),
        cmocka_unit_test(waiting_ends_in_time),
        cmocka_unit_test(closing_kills_with_all_descendants),
        cmocka_unit_test(what_a_child_leaves_running_is_killed),
        cmocka_unit_test(a_child_dies_with_us),
        cmocka_unit_test(nothing_is_inherited),
        cmocka_unit_test(limits_hold),
        cmocka_unit_test(what_cannot_run_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
