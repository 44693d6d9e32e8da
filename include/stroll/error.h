/* Errors: a code for programs, a sentence for people. There is no global error state: every call that can fail takes the
 * caller's strl_error (may be NULL) and returns a strl_status. */
#ifndef STROLL_ERROR_H
#define STROLL_ERROR_H

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

/* The innermost failure writes `message`, one sentence without a full stop: what, where, expected and found. */
typedef struct strl_error {
    strl_status status;
    char message[480];
} strl_error;

/* A fixed English name of a status, never NULL. */
const char *strl_status_name(strl_status status);

#ifdef __cplusplus
}
#endif
#endif
