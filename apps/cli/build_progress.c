#include "build_progress.h"

#include <stdio.h>
#include <string.h>

#include "options.h"
#include "platform/thread.h"

enum { LINE_BYTES = 256, BAR_MOST = 30, BAR_LEAST = 8 };

#define LOG_NS 60000000000u

/* 1536 MiB as "1.5G": short, and as --memory is given. */
static void format_bytes(char text[16], uint64_t bytes)
{
    static const char units[] = "KMGTP";
    double amount = (double)bytes / 1024;
    unsigned unit = 0;
    while (amount >= 1000 && unit + 2 < sizeof units) {
        amount /= 1024;
        unit++;
    }
    snprintf(text, 16, amount < 9.95 && unit > 1 ? "%.1f%c" : "%.0f%c", amount, units[unit]);
    char *fraction = strstr(text, ".0");
    if (fraction)
        memmove(fraction, fraction + 2, strlen(fraction + 2) + 1);
}

void strl_cli_build_estimate_format(char *text, unsigned size, const strl_build_estimate *estimate)
{
    char triangles[16], scratch[16], room[16], time[24];
    strl_cli_format_amount(triangles, (double)estimate->triangles);
    format_bytes(scratch, estimate->scratch_bytes);
    format_bytes(room, estimate->scratch_free_bytes);
    strl_cli_format_time(time, estimate->seconds);
    if (estimate->triangles == 0)
        snprintf(text, size, "an unknown number of triangles; %s free for scratch", room);
    else
        snprintf(text, size, "about %s triangles: up to %s of scratch, %s free%s; some %s", triangles, scratch, room,
                 estimate->scratch_bytes > estimate->scratch_free_bytes ? " and that may be TOO LITTLE" : "", time);
}

static void format_bar(char bar[BAR_MOST + 4], double share, int length)
{
    bar[0] = '\0';
    if (length < BAR_LEAST)
        return;
    length = length < BAR_MOST ? length : BAR_MOST;
    bar[0] = '[';
    memset(bar + 1, '-', (size_t)length);
    memset(bar + 1, '#', (size_t)(share * length));
    memcpy(bar + 1 + length, "] ", 3);
}

void strl_cli_build_progress_format(char *text, unsigned size, const strl_build_progress *now, uint64_t resident_bytes,
                                    unsigned columns)
{
    char used[16], budget[16], scratch[16], amount[16], time[24], bar[BAR_MOST + 4];
    char stage[64], rate[48] = "", left[40] = "", rest[LINE_BYTES];
    format_bytes(used, resident_bytes);
    format_bytes(budget, now->memory_bytes);
    format_bytes(scratch, now->scratch_bytes);
    if (now->stage_index)
        snprintf(stage, sizeof stage, "%u/%u %-10.40s ", now->stage_index, now->stage_count, now->stage);
    else
        snprintf(stage, sizeof stage, "%.40s ", now->stage); /* before a resumed build goes on */
    if (now->triangles_per_s > 0) {
        strl_cli_format_amount(amount, now->triangles_per_s);
        snprintf(rate, sizeof rate, "  %s triangles/s", amount);
    }
    if (now->seconds_left > 0) {
        strl_cli_format_time(time, now->seconds_left);
        snprintf(left, sizeof left, "  left %s", time);
    }
    snprintf(rest, sizeof rest, "%3.0f %%%s%s  mem %s/%s  scratch %s", now->share * 100, rate, left, used, budget,
             scratch);
    format_bar(bar, now->share, (int)columns - (int)(strlen(stage) + strlen(rest) + 3));
    snprintf(text, size, "%s%s%s", stage, bar, rest);
    if (strlen(text) > columns)
        text[columns] = '\0';
}

void strl_cli_build_progress_init(strl_cli_build_progress *progress, bool quiet)
{
    *progress = (strl_cli_build_progress){.is_quiet = quiet, .logged_ns = strl_clock_ns()};
    strl_cli_progress_init(&progress->line, quiet);
}

void strl_cli_build_progress_estimate(strl_cli_build_progress *progress, const strl_build_estimate *estimate)
{
    char text[LINE_BYTES];
    progress->estimate = *estimate;
    progress->has_estimate = true;
    if (!progress->line.shown)
        return;
    strl_cli_build_estimate_format(text, sizeof text, estimate);
    fprintf(stderr, "%s\n", text);
}

static void write_log(strl_cli_build_progress *progress, const strl_build_progress *now)
{
    char text[LINE_BYTES];
    uint64_t now_ns = strl_clock_ns();
    if (now_ns - progress->logged_ns < LOG_NS)
        return;
    progress->logged_ns = now_ns;
    if (progress->has_estimate) {
        strl_cli_build_estimate_format(text, sizeof text, &progress->estimate);
        fprintf(stderr, "stroll: %s\n", text);
        progress->has_estimate = false;
    }
    strl_cli_build_progress_format(text, sizeof text, now, strl_process_rss_bytes(), LINE_BYTES);
    fprintf(stderr, "stroll: %s\n", text);
}

void strl_cli_build_progress_update(strl_cli_build_progress *progress, const strl_build_progress *now)
{
    char text[LINE_BYTES];
    if (progress->line.shown && strl_cli_progress_is_due(&progress->line)) {
        strl_cli_build_progress_format(text, sizeof text, now, strl_process_rss_bytes(), strl_cli_progress_columns());
        strl_cli_progress_draw(&progress->line, text);
    } else if (!progress->line.shown && !progress->is_quiet) {
        write_log(progress, now);
    }
}

void strl_cli_build_progress_end(strl_cli_build_progress *progress)
{
    strl_cli_progress_end(&progress->line);
}
