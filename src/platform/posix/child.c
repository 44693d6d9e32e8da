/* Child processes. Between fork and exec only calls that are safe in a copy of a process with threads: what they need
 * is made ready before. */
#include "platform/process.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/posix/facts.h"
#include "platform/thread.h"

#define NS_PER_MS 1000000u
#define WAIT_STEP_MS 5 /* how late the end of a child may be seen */
/* Of standard error the end is kept: what a program says last is why it failed. */
#define ERROR_TEXT_BYTES 4096u
#define COMPLAINT_BYTES 200u

struct strl_process {
    pid_t id;   /* 0 = waited for */
    int output; /* -1 = ended */
    int errors; /* -1 = ended */
    uint64_t cpu_seconds;
    strl_process_end end;        /* once id is 0 */
    char text[ERROR_TEXT_BYTES]; /* the last of standard error */
    size_t text_bytes;
    char complaint[COMPLAINT_BYTES + 1];
};

/* What the child needs between fork and exec. */
typedef struct child_plan {
    const strl_process_desc *desc;
    int input, output, errors, report; /* report: where errno goes if exec fails; closed by exec */
    pid_t parent;
} child_plan;

/* ---- in the child, before the program ---- */

static bool limit(int resource, uint64_t soft, uint64_t hard)
{
    struct rlimit now, wanted = {.rlim_cur = (rlim_t)soft, .rlim_max = (rlim_t)hard};
    if (getrlimit(resource, &now) != 0)
        return false;
    /* Who may not raise a limit may at least not fail to lower it. */
    wanted.rlim_max = wanted.rlim_max < now.rlim_max ? wanted.rlim_max : now.rlim_max;
    wanted.rlim_cur = wanted.rlim_cur < wanted.rlim_max ? wanted.rlim_cur : wanted.rlim_max;
    return setrlimit(resource, &wanted) == 0;
}

static bool set_limits(const strl_process_desc *desc)
{
    bool good = limit(RLIMIT_CORE, 0, 0) && (desc->is_sanitized || limit(RLIMIT_FSIZE, 0, 0));
    /* The soft limit ends the program by a signal that tells why; the hard one those that do not listen. */
    if (desc->cpu_seconds)
        good = good && limit(RLIMIT_CPU, desc->cpu_seconds, desc->cpu_seconds + 1);
    if (desc->address_bytes && !desc->is_sanitized)
        good = good && limit(RLIMIT_AS, desc->address_bytes, desc->address_bytes);
    return good;
}

/* All descriptors from 3 on are closed by exec, the report's among them. */
static void mark_descriptors(void)
{
#ifdef SYS_close_range
    const unsigned close_on_exec = 4; /* CLOSE_RANGE_CLOEXEC */
    if (syscall(SYS_close_range, 3u, ~0u, close_on_exec) == 0)
        return;
#endif
    struct rlimit files;
    int most = getrlimit(RLIMIT_NOFILE, &files) == 0 && files.rlim_cur < 65536 ? (int)files.rlim_cur : 65536;
    for (int i = 3; i < most; i++)
        fcntl(i, F_SETFD, FD_CLOEXEC);
}

/* What was ignored or blocked in us would stay so in the program. */
static void reset_signals(void)
{
    static const int numbers[] = {SIGPIPE, SIGXCPU, SIGXFSZ, SIGINT, SIGQUIT, SIGTERM, SIGHUP, SIGCHLD};
    sigset_t none;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        signal(numbers[i], SIG_DFL);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
}

static void become(const child_plan *plan)
{
    setpgid(0, 0); /* so that what the program starts can be killed with it */
    reset_signals();
    bool good = prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && getppid() == plan->parent &&
                prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && dup2(plan->input, 0) == 0 &&
                dup2(plan->output, 1) == 1 && dup2(plan->errors, 2) == 2;
    if (good) {
        mark_descriptors();
        good = set_limits(plan->desc);
    }
    if (good)
        execv(plan->desc->arguments[0], (char *const *)plan->desc->arguments);
    int code = errno;
    ssize_t written = write(plan->report, &code, sizeof code);
    (void)written; /* the exit status says enough */
    _exit(127);
}

/* ---- starting ---- */

static void close_end(int *descriptor)
{
    if (*descriptor >= 0)
        close(*descriptor);
    *descriptor = -1;
}

/* A copy of 3 or more: dup2 onto 0, 1 and 2 would clear the mark of a lower one, or meet itself. */
static bool raise_above_standard(int *descriptor)
{
    if (*descriptor > 2)
        return true;
    int raised = fcntl(*descriptor, F_DUPFD_CLOEXEC, 3);
    close_end(descriptor);
    *descriptor = raised;
    return raised >= 0;
}

static bool open_pipe(int ends[2])
{
    int made[2];
    if (pipe2(made, O_CLOEXEC) != 0)
        return false;
    ends[0] = made[0];
    ends[1] = made[1];
    return raise_above_standard(&ends[0]) && raise_above_standard(&ends[1]);
}

static int read_report(int descriptor)
{
    int code = 0;
    ssize_t got;
    do
        got = read(descriptor, &code, sizeof code);
    while (got < 0 && errno == EINTR);
    return got == (ssize_t)sizeof code ? code : 0;
}

/* Returns errno of what failed, 0 = the program runs. */
static int spawn(strl_process *process, const strl_process_desc *desc)
{
    int output[2] = {-1, -1}, errors[2] = {-1, -1}, report[2] = {-1, -1}, code = 0;
    int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
    bool good =
        input >= 0 && raise_above_standard(&input) && open_pipe(output) && open_pipe(errors) && open_pipe(report);
    const child_plan plan = {desc, input, output[1], errors[1], report[1], getpid()};
    pid_t id = good ? fork() : -1;
    if (id == 0)
        become(&plan);
    if (id < 0)
        code = errno;
    else
        setpgid(id, id); /* both do it, whoever comes first: kill must not come before either */
    close_end(&input);
    close_end(&output[1]);
    close_end(&errors[1]);
    close_end(&report[1]);
    if (id > 0) {
        process->id = id;
        process->output = output[0];
        process->errors = errors[0];
        fcntl(process->output, F_SETFL, O_NONBLOCK);
        fcntl(process->errors, F_SETFL, O_NONBLOCK);
        code = read_report(report[0]);
    } else {
        close_end(&output[0]);
        close_end(&errors[0]);
    }
    close_end(&report[0]);
    return code;
}

strl_status strl_process_start(const strl_process_desc *desc, strl_process **process, strl_error *err)
{
    *process = NULL;
    strl_process *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to run %s", strl__path_shown(desc->arguments[0]));
    made->output = made->errors = -1;
    made->cpu_seconds = desc->cpu_seconds;
    int code = spawn(made, desc);
    if (code) {
        strl_process_close(made);
        return strl__fail_system(err, code, "run", desc->arguments[0]);
    }
    *process = made;
    return STRL_OK;
}

/* ---- listening ---- */

static void take_errors(strl_process *process)
{
    while (process->errors >= 0) {
        if (process->text_bytes == ERROR_TEXT_BYTES) {
            process->text_bytes /= 2;
            memmove(process->text, process->text + process->text_bytes, process->text_bytes);
        }
        ssize_t got =
            read(process->errors, process->text + process->text_bytes, ERROR_TEXT_BYTES - process->text_bytes);
        if (got > 0)
            process->text_bytes += (size_t)got;
        else if (got == 0 || (errno != EAGAIN && errno != EINTR))
            close_end(&process->errors);
        else if (errno == EAGAIN)
            break;
    }
}

/* Until something comes on a pipe that is open, or a signal, or the time is over. */
static void listen_for(strl_process *process, bool output, uint64_t deadline_ns)
{
    uint64_t now = strl_clock_ns(), left = deadline_ns > now ? deadline_ns - now : 0;
    struct pollfd polled[2] = {{.fd = process->errors, .events = POLLIN},
                               {.fd = output ? process->output : -1, .events = POLLIN}};
    uint64_t left_ms = (left + NS_PER_MS - 1) / NS_PER_MS;
    poll(polled, 2, left_ms < 1000 ? (int)left_ms : 1000);
    take_errors(process);
}

strl_status strl_process_read(strl_process *process, uint64_t timeout_ns, void *data, size_t size, size_t *got,
                              bool *ended, strl_error *err)
{
    uint64_t deadline_ns = strl_clock_ns() + timeout_ns;
    *got = 0;
    *ended = process->output < 0;
    while (process->output >= 0) {
        ssize_t read_bytes = read(process->output, data, size);
        if (read_bytes > 0) {
            *got = (size_t)read_bytes;
            take_errors(process);
            return STRL_OK;
        }
        if (read_bytes == 0) {
            close_end(&process->output);
            *ended = true;
        } else if (errno != EAGAIN && errno != EINTR) {
            return strl__fail_system(err, errno, "read from", "a child process");
        } else if (strl_clock_ns() >= deadline_ns) {
            break;
        } else {
            listen_for(process, true, deadline_ns);
        }
    }
    return STRL_OK;
}

/* ---- ending ---- */

/* Of a child that has ended, but was not waited for: until then its number stands for its group too, and cannot become
 * another's. */
static void note_end(strl_process *process)
{
    strl_process_end *end = &process->end;
    struct rusage usage = {0};
    int status = 0;
    kill(-process->id, SIGKILL);
    while (wait4(process->id, &status, 0, &usage) < 0 && errno == EINTR)
        ;
    process->id = 0;
    end->exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
    end->signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    end->peak_rss_bytes = usage.ru_maxrss > 0 ? (uint64_t)usage.ru_maxrss << 10 : 0;
    uint64_t cpu = (uint64_t)usage.ru_utime.tv_sec + (uint64_t)usage.ru_stime.tv_sec;
    end->cpu_exhausted =
        end->signal == SIGXCPU || (end->signal == SIGKILL && process->cpu_seconds && cpu >= process->cpu_seconds);
}

bool strl_process_wait(strl_process *process, uint64_t timeout_ns, strl_process_end *end)
{
    uint64_t deadline_ns = strl_clock_ns() + timeout_ns;
    while (process->id) {
        siginfo_t info = {0};
        int found = waitid(P_PID, (id_t)process->id, &info, WEXITED | WNOHANG | WNOWAIT);
        if (found == 0 && info.si_pid == process->id) {
            note_end(process);
        } else if (found < 0 && errno == ECHILD) { /* a host that ignores SIGCHLD: nobody knows how it ended */
            process->id = 0;
            process->end.exit_status = 255;
        } else if (strl_clock_ns() >= deadline_ns) {
            return false;
        } else if (process->errors >= 0) {
            listen_for(process, false, strl_clock_ns() + WAIT_STEP_MS * NS_PER_MS);
        } else {
            strl_sleep_ns(WAIT_STEP_MS * NS_PER_MS);
        }
    }
    take_errors(process);
    *end = process->end;
    return true;
}

const char *strl_process_complaint(strl_process *process)
{
    const char *text = process->text;
    size_t end = process->text_bytes;
    while (end > 0 && (unsigned char)text[end - 1] <= ' ')
        end--;
    size_t start = end;
    while (start > 0 && text[start - 1] != '\n')
        start--;
    while (start < end && (unsigned char)text[start] <= ' ')
        start++;
    size_t length = end - start < COMPLAINT_BYTES ? end - start : COMPLAINT_BYTES;
    for (size_t i = 0; i < length; i++) {
        char letter = text[start + i];
        process->complaint[i] = letter >= 0x20 && letter < 0x7f ? letter : '?';
    }
    process->complaint[length] = 0;
    return process->complaint;
}

void strl_process_close(strl_process *process)
{
    if (!process)
        return;
    if (process->id) {
        kill(-process->id, SIGKILL);
        kill(process->id, SIGKILL);
        int status;
        while (wait4(process->id, &status, 0, NULL) < 0 && errno == EINTR)
            ;
    }
    close_end(&process->output);
    close_end(&process->errors);
    strl__free(process);
}

const char *strl_signal_name(int number)
{
    const char *name = sigdescr_np(number);
    return name ? name : "an unknown signal";
}

char *strl_program_folder(void)
{
    char path[4096];
    ssize_t length = readlink("/proc/self/exe", path, sizeof path - 1);
    if (length <= 0)
        return NULL;
    path[length] = 0;
    return strl__path_parent(path);
}
