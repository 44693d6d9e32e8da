/* Errors: a code for programs, a sentence for people. There is no global error state: every call that can
 * fail takes the caller's strl_error (may be NULL) and returns a strl_status.
 *
 * Unless a declaration says otherwise: an error object is written on failure only; outputs come last and
 * are NULL or zero on failure; pointers to objects must not be NULL where "NULL is legal" is not said; any
 * call may fail with STRL_ERR_MEMORY. Different objects may be used by different threads at the same time,
 * one object by one thread at a time. The library never prints, exits, reads the environment or installs
 * signal handlers. */
#ifndef STROLL_ERROR_H
#define STROLL_ERROR_H

#include "stroll/export.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum strl_status {
    STRL_OK = 0,
    STRL_ERR_ARGUMENT,    /* the caller's mistake */
    STRL_ERR_MEMORY,      /* no memory, or the memory budget is too small */
    STRL_ERR_IO,          /* the system could not read, write, create or rename */
    STRL_ERR_DISK_FULL,   /* no space left; what was finished is kept */
    STRL_ERR_FORMAT,      /* the bytes are not what their format promises */
    STRL_ERR_UNSUPPORTED, /* well-formed, but not something Stroll reads or can do here */
    STRL_ERR_LIMIT,       /* a stated limit would be exceeded */
    STRL_ERR_CANCELLED,   /* the caller asked to stop */
    STRL_ERR_NETWORK,     /* a remote source failed */
    STRL_ERR_INTERNAL     /* a broken invariant of Stroll itself */
} strl_status;

/* The innermost failure writes `message`, one sentence without a full stop: what, where, expected and
 * found. UTF-8 as far as the file names in it are, zero-terminated, cut where it is too long. */
typedef struct strl_error {
    strl_status status;
    char message[480];
} strl_error;

/* A fixed English name of a status, never NULL. Thread-safe. */
STRL_API const char *strl_status_name(strl_status status);

/* For callbacks of yours that fail (a source's read, an executor's submit): copies the sentence into err
 * (NULL is legal) and returns status. Thread-safe. */
STRL_API strl_status strl_error_set(strl_error *err, strl_status status, const char *sentence);

#ifdef __cplusplus
}
#endif
#endif
