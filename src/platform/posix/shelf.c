#include "platform/shelf.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/file.h"
#include "platform/posix/facts.h"

static uint64_t nanoseconds(const struct timespec *time)
{
    return time->tv_sec < 0 ? 0 : (uint64_t)time->tv_sec * 1000000000u + (uint64_t)time->tv_nsec;
}

uint64_t strl_shelf_now_ns(void)
{
    struct timespec now = {0};
    clock_gettime(CLOCK_REALTIME, &now);
    return nanoseconds(&now);
}

struct strl_shelf {
    DIR *folder;
    char *path; /* owned */
};

strl_status strl_shelf_open(const char *path, strl_shelf **shelf, strl_error *err)
{
    *shelf = NULL;
    strl_shelf *made = strl__alloc(1, sizeof *made);
    char *copy = strl__strdup(path);
    DIR *folder = made && copy ? opendir(path) : NULL;
    if (folder) {
        *made = (strl_shelf){folder, copy};
        *shelf = made;
        return STRL_OK;
    }
    strl_status status = made && copy
                             ? strl__fail_system(err, errno, "open folder", path)
                             : strl__fail(err, STRL_ERR_MEMORY, "no memory to list %s", strl__path_shown(path));
    strl__free(copy);
    strl__free(made);
    return status;
}

void strl_shelf_close(strl_shelf *shelf)
{
    if (!shelf)
        return;
    closedir(shelf->folder);
    strl__free(shelf->path);
    strl__free(shelf);
}

strl_status strl_shelf_next(strl_shelf *shelf, strl_shelf_entry *entry, strl_error *err)
{
    struct stat facts;
    *entry = (strl_shelf_entry){0};
    errno = 0;
    const struct dirent *found = readdir(shelf->folder);
    if (!found)
        return errno ? strl__fail_system(err, errno, "list folder", shelf->path) : STRL_OK;
    bool is_file =
        fstatat(dirfd(shelf->folder), found->d_name, &facts, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(facts.st_mode);
    entry->name = is_file ? found->d_name : ""; /* gone meanwhile, or no file */
    if (is_file) {
        entry->bytes = (uint64_t)facts.st_size;
        entry->used_ns = nanoseconds(&facts.st_mtim);
    }
    return STRL_OK;
}

static strl_status write_pieces(strl_file *file, const strl_shelf_piece *pieces, size_t count, strl_error *err)
{
    uint64_t at = 0;
    strl_status status = STRL_OK;
    for (size_t i = 0; status == STRL_OK && i < count; i++) {
        status = strl_file_write(file, at, pieces[i].data, pieces[i].size, err);
        at += pieces[i].size;
    }
    return status;
}

/* Writes to `temporary`, whose last 13 characters are XXXXXXXX.part, and renames. */
static strl_status put(char *temporary, const char *target, const strl_shelf_piece *pieces, size_t count,
                       strl_error *err)
{
    strl_file *file = NULL;
    strl_status status = strl__file_create_unique(temporary, strlen(temporary) - 13, 0600, target, &file, err);
    if (status != STRL_OK)
        return status;
    status = write_pieces(file, pieces, count, err);
    strl_status closed = strl_file_close(file, status == STRL_OK ? err : NULL);
    status = status != STRL_OK ? status : closed;
    if (status == STRL_OK && rename(temporary, target) != 0)
        status = strl__fail_system(err, errno, "rename a file to", target);
    if (status != STRL_OK)
        unlink(temporary);
    return status;
}

strl_status strl_shelf_put(const char *path, const char *name, const strl_shelf_piece *pieces, size_t count,
                           strl_error *err)
{
    static const char ending[] = ".XXXXXXXX.part";
    char *target = strl_path_join(path, name);
    size_t length = target ? strlen(target) : 0;
    char *temporary = target ? strl__alloc(length + sizeof ending, 1) : NULL;
    strl_status status = STRL_OK;
    if (temporary) {
        memcpy(temporary, target, length);
        memcpy(temporary + length, ending, sizeof ending);
        status = put(temporary, target, pieces, count, err);
    } else {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory to write into %s", strl__path_shown(path));
    }
    strl__free(temporary);
    strl__free(target);
    return status;
}

void strl_shelf_touch(const char *path, const char *name)
{
    const struct timespec now[2] = {{.tv_nsec = UTIME_NOW}, {.tv_nsec = UTIME_NOW}};
    char *target = strl_path_join(path, name);
    if (target)
        utimensat(AT_FDCWD, target, now, AT_SYMLINK_NOFOLLOW);
    strl__free(target);
}
