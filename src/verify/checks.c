#include "verify/checks.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const char *const names[STRL_VERIFY_KINDS] = {
    "header", "references", "checksums", "tables", "records", "pages",  "payloads", "counts",         "boxes",
    "cones",  "errors",     "groups",    "root",   "unions",  "closed", "cracks",   "leaf_triangles", "distances",
};

const char *strl_verify_name(strl_verify_kind kind)
{
    return (unsigned)kind < STRL_VERIFY_KINDS ? names[kind] : "unknown";
}

void strl__v_checks_init(strl__checks *checks)
{
    memset(checks, 0, sizeof *checks);
    strl_mutex_init(&checks->mutex);
}

void strl__v_checks_deinit(strl__checks *checks)
{
    strl_mutex_deinit(&checks->mutex);
}

void strl__v_checked(strl__checks *checks, strl_verify_kind kind, uint64_t count)
{
    atomic_fetch_add_explicit(&checks->count[kind], count, memory_order_relaxed);
}

void strl__v_flaw(strl__checks *checks, strl_verify_kind kind, uint64_t key, const char *format, ...)
{
    strl_mutex_lock(&checks->mutex);
    if (checks->failures[kind]++ == 0 || key < checks->first_key[kind]) {
        va_list args;
        va_start(args, format);
        vsnprintf(checks->first[kind], sizeof checks->first[kind], format, args);
        va_end(args);
        checks->first_key[kind] = key;
    }
    strl_mutex_unlock(&checks->mutex);
}

bool strl__v_flawed(strl__checks *checks, strl_verify_kind kind)
{
    strl_mutex_lock(&checks->mutex);
    bool flawed = checks->failures[kind] > 0;
    strl_mutex_unlock(&checks->mutex);
    return flawed;
}

void strl__v_checks_report(strl__checks *checks, strl_verify_report *report)
{
    report->ok = true;
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++) {
        strl_verify_check *check = &report->checks[kind];
        check->count = atomic_load(&checks->count[kind]);
        check->failures = checks->failures[kind];
        check->done = check->count > 0 || check->failures > 0;
        memcpy(check->first, checks->first[kind], sizeof check->first);
        report->ok = report->ok && check->failures == 0;
    }
}
