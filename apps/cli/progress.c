#include "progress.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "options.h"
#include "platform/thread.h"

enum { BAR_MOST = 30, LINE_BYTES = 256, REDRAW_NS = 100000000 };

/* A stage that has just begun has no rate yet, and what it says of the time left would be noise. */
#define LEAST_RATE_SECONDS 0.1

void strl_cli_format_time(char text[24], double seconds)
{
    unsigned whole = seconds < 359999 ? (unsigned)(seconds + 0.5) : 359999;
    if (whole >= 3600)
        snprintf(text, 24, "%u:%02u:%02u", whole / 3600, whole / 60 % 60, whole % 60);
    else
        snprintf(text, 24, "%u:%02u", whole / 60, whole % 60);
}

static void format_rate(char text[40], double rate, const char *unit)
{
    char amount[16];
    strl_cli_format_amount(amount, rate);
    snprintf(text, 40, "  %s%s%.16s/s", amount, *unit ? " " : "", unit);
}

void strl_cli_progress_format(char *text, unsigned size, const char *stage, uint64_t done, uint64_t total,
                              const char *unit, double seconds, unsigned columns)
{
    char amount[16], rate[40] = "", left[24] = "";
    char bar[BAR_MOST + 1] = "";
    bool known = done > 0 && seconds >= LEAST_RATE_SECONDS;
    strl_cli_format_amount(amount, (double)done);
    if (known)
        format_rate(rate, (double)done / seconds, total ? unit : "");
    if (total == 0) {
        snprintf(text, size, "%s  %s %s%s", stage, amount, unit, rate);
    } else {
        double share = done < total ? (double)done / (double)total : 1;
        memset(bar, '-', BAR_MOST);
        memset(bar, '#', (size_t)(share * BAR_MOST));
        if (known)
            strl_cli_format_time(left, seconds * (1 - share) / share);
        snprintf(text, size, "%-12s [%s] %3.0f %%%s%s%s", stage, bar, share * 100, rate, known ? "  left " : "", left);
    }
    if (strlen(text) > columns)
        text[columns] = '\0';
}

unsigned strl_cli_progress_columns(void)
{
    struct winsize window = {0};
    bool known = ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 1;
    return known ? window.ws_col - 1u : 79u;
}

void strl_cli_progress_init(strl_cli_progress *progress, bool quiet)
{
    *progress = (strl_cli_progress){.shown = !quiet && isatty(STDERR_FILENO)};
}

bool strl_cli_progress_is_due(const strl_cli_progress *progress)
{
    return progress->shown && strl_clock_ns() - progress->last_ns >= REDRAW_NS;
}

void strl_cli_progress_draw(strl_cli_progress *progress, const char *line)
{
    fprintf(stderr, "\r\033[K%s", line);
    fflush(stderr);
    progress->last_ns = strl_clock_ns();
    progress->drawn = true;
}

void strl_cli_progress_update(strl_cli_progress *progress, const char *stage, uint64_t done, uint64_t total,
                              const char *unit)
{
    if (!progress->shown)
        return;
    uint64_t now_ns = strl_clock_ns();
    if (!progress->stage || strcmp(progress->stage, stage)) {
        progress->stage = stage;
        progress->unit = unit;
        progress->start_ns = now_ns;
        progress->last_ns = 0;
    }
    if (!strl_cli_progress_is_due(progress))
        return;
    char line[LINE_BYTES];
    double seconds = (double)(now_ns - progress->start_ns) * 1e-9;
    strl_cli_progress_format(line, sizeof line, stage, done, total, unit, seconds, strl_cli_progress_columns());
    strl_cli_progress_draw(progress, line);
}

void strl_cli_progress_end(strl_cli_progress *progress)
{
    if (progress->drawn)
        fprintf(stderr, "\r\033[K");
    progress->drawn = false;
    progress->stage = NULL;
}
