#include "platform/posix/facts.h"

#include <errno.h>
#include <string.h>

#include "base/fail.h"

#define PATH_SHOWN_BYTES ((size_t)280)

const char *strl__path_shown(const char *path)
{
    size_t length = strlen(path);
    if (length == 0)
        return "\"\"";
    return length > PATH_SHOWN_BYTES ? path + (length - PATH_SHOWN_BYTES) : path;
}

static strl_status status_of(int code)
{
    switch (code) {
    case ENOSPC:
    case EDQUOT:
        return STRL_ERR_DISK_FULL;
    case ENOMEM:
        return STRL_ERR_MEMORY;
    case EFBIG:
        return STRL_ERR_LIMIT;
    default:
        return STRL_ERR_IO;
    }
}

strl_status strl__fail_system(strl_error *err, int code, const char *verb, const char *path)
{
    char buffer[128];
    const char *reason = strerror_r(code, buffer, sizeof buffer);
    return strl__fail(err, status_of(code), "cannot %s %s: %s", verb, strl__path_shown(path), reason);
}

void strl__file_info_fill(strl_file_info *info, const struct stat *facts)
{
    *info = (strl_file_info){
        .bytes = facts->st_size > 0 ? (uint64_t)facts->st_size : 0,
        .modified_ns = (uint64_t)facts->st_mtim.tv_sec * 1000000000u + (uint64_t)facts->st_mtim.tv_nsec,
        .device = (uint64_t)facts->st_dev,
        .inode = (uint64_t)facts->st_ino,
        .is_directory = S_ISDIR(facts->st_mode),
    };
}
