/* A child process that is not trusted: its memory, time and files are limited, it inherits nothing but an empty input
 * and two pipes, and it ends with us. One thread at a time; the child dies with the thread that started it.
 *
 * Call order: start -> read* until ended -> wait -> complaint -> close. close may come at any time. */
#ifndef STRL_PLATFORM_PROCESS_H
#define STRL_PLATFORM_PROCESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

typedef struct strl_process strl_process;

typedef struct strl_process_desc {
    const char *const *arguments; /* [0] is the program's path, which is not searched for; ends in NULL; borrowed */
    uint64_t address_bytes;       /* of address space; 0 = as we have */
    uint64_t cpu_seconds;         /* of processor time; 0 = as we have */
    /* built with a sanitizer, which takes terabytes of address space and a file of its own: without the limits of
     * these two */
    bool is_sanitized;
} strl_process_desc;

/* How a child ended. */
typedef struct strl_process_end {
    int exit_status;    /* 0 to 255; of no meaning where a signal ended it */
    int signal;         /* which one ended it; 0 = none */
    bool cpu_exhausted; /* the limit of processor time ended it */
    /* of the child alone, as the system counts it: never less than what we had at the start */
    uint64_t peak_rss_bytes;
} strl_process_end;

/* The child writes no file and dumps no core. Its standard input is empty. Fails where the program cannot be run. */
strl_status strl_process_start(const strl_process_desc *desc, strl_process **process, strl_error *err);
/* Up to size bytes of its standard output, waiting at most timeout_ns for the first: *got 0 and not *ended = nothing
 * came. *ended: it will write no more. */
strl_status strl_process_read(strl_process *process, uint64_t timeout_ns, void *data, size_t size, size_t *got,
                              bool *ended, strl_error *err);
/* Waits at most timeout_ns for its end; false where it still runs. Output that was not read may keep it from ending. */
bool strl_process_wait(strl_process *process, uint64_t timeout_ns, strl_process_end *end);
/* The last line it wrote to standard error so far, cut to some 200 characters, without control characters; "" where
 * there is none. Borrowed until the next call. */
const char *strl_process_complaint(strl_process *process);
/* Kills what still runs, waits for it and releases. NULL is legal. */
void strl_process_close(strl_process *process);

const char *strl_signal_name(int number); /* "Segmentation fault"; static, never NULL */
/* The folder of the running program, owned by the caller (strl__free); NULL where the system does not tell. */
char *strl_program_folder(void);

#endif
