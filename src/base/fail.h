/* Writing errors. See include/stroll/error.h. */
#ifndef STRL_BASE_FAIL_H
#define STRL_BASE_FAIL_H

#include "stroll/error.h"

/* Writes status and sentence into err (which may be NULL) and returns status. Never allocates. */
strl_status strl__fail(strl_error *err, strl_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Puts "context: " before the sentence of an error that an inner call has written. Returns err's status, or `status`
 * where err is NULL. One layer only: contexts do not pile up. */
strl_status strl__fail_context(strl_error *err, strl_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
