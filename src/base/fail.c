#include "base/fail.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const char *strl_status_name(strl_status status)
{
    static const char *const names[] = {
        "ok",          "bad argument",   "out of memory", "input/output error", "disk full",      "bad format",
        "unsupported", "limit exceeded", "cancelled",     "network error",      "internal error",
    };
    unsigned index = (unsigned)status;
    return index < sizeof names / sizeof *names ? names[index] : "unknown status";
}

strl_status strl_error_set(strl_error *err, strl_status status, const char *sentence)
{
    return strl__fail(err, status, "%s", sentence ? sentence : "");
}

strl_status strl__fail(strl_error *err, strl_status status, const char *format, ...)
{
    if (err) {
        va_list args;
        va_start(args, format);
        err->status = status;
        vsnprintf(err->message, sizeof err->message, format, args);
        va_end(args);
    }
    return status;
}

strl_status strl__fail_context(strl_error *err, strl_status status, const char *format, ...)
{
    if (!err)
        return status;
    char inner[sizeof err->message];
    memcpy(inner, err->message, sizeof inner);
    inner[sizeof inner - 1] = 0;
    va_list args;
    va_start(args, format);
    int used = vsnprintf(err->message, sizeof err->message, format, args);
    va_end(args);
    if (used > 0 && (size_t)used < sizeof err->message - 2)
        snprintf(err->message + used, sizeof err->message - (size_t)used, ": %.*s", (int)sizeof err->message - used - 3,
                 inner);
    return err->status ? err->status : status;
}
