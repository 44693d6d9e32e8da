/* What `stroll build` tells while it works: before the inputs are read what the build will take, then a line that says
 * stage, share, rate, time left, memory and scratch. On a terminal the line stands still and changes; elsewhere, in a
 * log, one is written each minute, so a short build says nothing. Silent under --quiet. */
#ifndef STRL_CLI_BUILD_PROGRESS_H
#define STRL_CLI_BUILD_PROGRESS_H

#include "stroll/build.h"
#include "progress.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One thread at a time. Caller's storage. */
typedef struct strl_cli_build_progress {
    strl_cli_progress line;
    bool is_quiet;
    uint64_t logged_ns;           /* when the last line of a log was written, or the build began */
    strl_build_estimate estimate; /* of a log: told with its first line */
    bool has_estimate;
} strl_cli_build_progress;

void strl_cli_build_progress_init(strl_cli_build_progress *progress, bool quiet);
void strl_cli_build_progress_estimate(strl_cli_build_progress *progress, const strl_build_estimate *estimate);
void strl_cli_build_progress_update(strl_cli_build_progress *progress, const strl_build_progress *now);
void strl_cli_build_progress_end(strl_cli_build_progress *progress);

/* The texts, without terminal codes and line ends; separate, so that they can be tested. */
void strl_cli_build_estimate_format(char *text, unsigned size, const strl_build_estimate *estimate);
/* columns: of the terminal; where there is room a bar comes too, where there is too little the end is cut off. */
void strl_cli_build_progress_format(char *text, unsigned size, const strl_build_progress *now, uint64_t resident_bytes,
                                    unsigned columns);

#ifdef __cplusplus
}
#endif
#endif
