/* A progress line on the terminal: bar, rate, time left. Silent under --quiet and where standard error is no
 * terminal. */
#ifndef STRL_CLI_PROGRESS_H
#define STRL_CLI_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One thread at a time. Caller's storage; no release needed after strl_cli_progress_end. */
typedef struct strl_cli_progress {
    bool shown;        /* there is somebody to read it */
    bool drawn;        /* a line stands on the terminal and must be cleared */
    const char *stage; /* borrowed; compared by content */
    const char *unit;  /* borrowed: "triangles", "bytes", "frames" */
    uint64_t start_ns; /* when the stage began */
    uint64_t last_ns;  /* when the line was last drawn */
} strl_cli_progress;

void strl_cli_progress_init(strl_cli_progress *progress, bool quiet);
/* Draws at most ten times a second, so it may be called as often as is handy. A new stage starts a new rate.
 * total 0 = unknown: count and rate without bar. `stage` and `unit` are strings that live as long as progress. */
void strl_cli_progress_update(strl_cli_progress *progress, const char *stage, uint64_t done, uint64_t total,
                              const char *unit);
/* The same in parts, for a line of the caller's own making. */
bool strl_cli_progress_is_due(const strl_cli_progress *progress);
void strl_cli_progress_draw(strl_cli_progress *progress, const char *line);
unsigned strl_cli_progress_columns(void); /* that a line may have */
/* Clears the line, so that what follows starts on an empty one. */
void strl_cli_progress_end(strl_cli_progress *progress);

/* The text of the line, without terminal codes; separate, so that it can be tested. size at least 2. */
void strl_cli_progress_format(char *text, unsigned size, const char *stage, uint64_t done, uint64_t total,
                              const char *unit, double seconds, unsigned columns);

/* 75 seconds as "1:15". */
void strl_cli_format_time(char text[24], double seconds);

#ifdef __cplusplus
}
#endif
#endif
