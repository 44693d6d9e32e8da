/* Clock, processors and memory of this process. */
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "platform/thread.h"

#define NS_PER_S 1000000000u

static uint64_t clock_now_ns(clockid_t clock)
{
    struct timespec now = {0};
    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * NS_PER_S + (uint64_t)now.tv_nsec;
}

uint64_t strl_clock_ns(void)
{
    return clock_now_ns(CLOCK_MONOTONIC);
}

uint64_t strl_clock_wall_ns(void)
{
    return clock_now_ns(CLOCK_REALTIME);
}

uint64_t strl_clock_cpu_ns(void)
{
    return clock_now_ns(CLOCK_PROCESS_CPUTIME_ID);
}

void strl_sleep_ns(uint64_t ns)
{
    struct timespec left = {.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = (long)(ns % NS_PER_S)};
    while (nanosleep(&left, &left) != 0 && errno == EINTR)
        ;
}

unsigned strl_cpu_count(void)
{
    cpu_set_t set;
    CPU_ZERO(&set);
    if (sched_getaffinity(0, sizeof set, &set) == 0 && CPU_COUNT(&set) > 0)
        return (unsigned)CPU_COUNT(&set);
    long online = sysconf(_SC_NPROCESSORS_ONLN); /* more processors than the set can name */
    return online > 0 ? (unsigned)online : 1;
}

/* A line of the system's account of this process, in bytes; 0 where there is none. */
static uint64_t status_bytes(const char *name)
{
    char text[4096];
    int descriptor = open("/proc/self/status", O_RDONLY | O_CLOEXEC);
    if (descriptor < 0)
        return 0;
    ssize_t got = read(descriptor, text, sizeof text - 1);
    close(descriptor);
    if (got <= 0)
        return 0;
    text[got] = 0;
    const char *line = strstr(text, name);
    return line ? (uint64_t)strtoull(line + strlen(name), NULL, 10) << 10 : 0;
}

static uint64_t usage_peak_bytes(int who)
{
    struct rusage usage;
    return getrusage(who, &usage) == 0 && usage.ru_maxrss > 0 ? (uint64_t)usage.ru_maxrss << 10 : 0;
}

uint64_t strl_thread_disk_waits(void)
{
    struct rusage usage;
    return getrusage(RUSAGE_THREAD, &usage) == 0 ? (uint64_t)usage.ru_inblock + (uint64_t)usage.ru_majflt : 0;
}

uint64_t strl_process_rss_bytes(void)
{
    return status_bytes("\nVmRSS:");
}

uint64_t strl_process_peak_rss_bytes(void)
{
    /* The high water mark of this program's own image: ru_maxrss would also count what a parent held before it became
     * this program. */
    uint64_t own = status_bytes("\nVmHWM:");
    if (own == 0)
        own = usage_peak_bytes(RUSAGE_SELF);
    uint64_t children = usage_peak_bytes(RUSAGE_CHILDREN);
    return own > children ? own : children;
}

void strl_process_forget_peak(void)
{
    int descriptor = open("/proc/self/clear_refs", O_WRONLY | O_CLOEXEC);
    if (descriptor < 0)
        return;
    ssize_t written = write(descriptor, "5\n", 2);
    (void)written; /* a system that cannot forget keeps the old peak */
    close(descriptor);
}

uint64_t strl_process_allow_files(uint64_t wanted)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        return 0;
    if (limit.rlim_cur != RLIM_INFINITY && limit.rlim_cur < wanted) {
        const struct rlimit raised = {
            .rlim_cur = limit.rlim_max == RLIM_INFINITY || wanted < limit.rlim_max ? (rlim_t)wanted : limit.rlim_max,
            .rlim_max = limit.rlim_max};
        if (setrlimit(RLIMIT_NOFILE, &raised) == 0)
            limit = raised;
    }
    return limit.rlim_cur == RLIM_INFINITY ? UINT64_MAX : (uint64_t)limit.rlim_cur;
}

void strl_cpu_model(char *model, size_t size)
{
    char line[256] = "", *colon = NULL;
    FILE *file = fopen("/proc/cpuinfo", "re");
    while (file && !colon && fgets(line, sizeof line, file))
        colon = strncmp(line, "model name", 10) ? NULL : strchr(line, ':');
    if (file)
        fclose(file);
    if (colon)
        colon[strcspn(colon, "\n")] = '\0';
    snprintf(model, size, "%s", colon && colon[1] ? colon + 2 : "unknown");
}
