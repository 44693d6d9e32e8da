/* Names of files and folders, and the lock that keeps two builds out of one scratch folder. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/file.h"
#include "platform/posix/facts.h"

strl_status strl_path_stat(const char *path, strl_file_info *info, strl_error *err)
{
    struct stat facts;
    if (stat(path, &facts) != 0)
        return strl__fail_system(err, errno, "examine", path);
    strl__file_info_fill(info, &facts);
    return STRL_OK;
}

bool strl_path_exists(const char *path)
{
    struct stat facts;
    return stat(path, &facts) == 0;
}

char *strl__path_parent(const char *path)
{
    const char *slash = strrchr(path, '/');
    if (!slash)
        return strl__strdup(".");
    size_t length = slash == path ? 1 : (size_t)(slash - path);
    char *parent = strl__alloc(length + 1, 1);
    if (parent) {
        memcpy(parent, path, length);
        parent[length] = 0;
    }
    return parent;
}

/* A rename is on disk only when its folder is. Folders that cannot be synced (EINVAL, EACCES) keep their rename. */
static strl_status sync_folder(const char *folder, strl_error *err)
{
    int descriptor = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0)
        return errno == EACCES ? STRL_OK : strl__fail_system(err, errno, "open folder", folder);
    int code = fsync(descriptor) == 0 ? 0 : errno;
    close(descriptor);
    if (code == 0 || code == EINVAL || code == EROFS)
        return STRL_OK;
    return strl__fail_system(err, code, "sync folder", folder);
}

strl_status strl_path_rename(const char *from, const char *to, strl_error *err)
{
    /* Before the rename: without memory nothing shall have happened. */
    char *folder = strl__path_parent(to);
    if (!folder)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to rename %s", strl__path_shown(from));
    strl_status status;
    if (rename(from, to) != 0)
        status = strl__fail_system(err, errno, "rename a file to", to);
    else
        status = sync_folder(folder, err);
    strl__free(folder);
    return status;
}

strl_status strl_path_remove(const char *path, strl_error *err)
{
    if (unlink(path) != 0 && errno != ENOENT)
        return strl__fail_system(err, errno, "remove", path);
    return STRL_OK;
}

static strl_status make_directory(const char *path, mode_t mode, strl_error *err)
{
    if (mkdir(path, mode) == 0)
        return STRL_OK;
    int code = errno;
    struct stat facts;
    if (code == EEXIST && stat(path, &facts) == 0 && S_ISDIR(facts.st_mode))
        return STRL_OK;
    return strl__fail_system(err, code, "create folder", path);
}

strl_status strl_path_make_directory(const char *path, strl_error *err)
{
    return make_directory(path, 0777, err);
}

strl_status strl_path_make_private_directory(const char *path, strl_error *err)
{
    return make_directory(path, 0700, err);
}

strl_status strl_path_make_temporary(char *pattern, strl_error *err)
{
    return mkdtemp(pattern) ? STRL_OK : strl__fail_system(err, errno, "create folder", pattern);
}

void strl_path_remove_if_empty(const char *path)
{
    rmdir(path);
}

/* Removes what is not a folder from an open folder; a folder in it is left for rmdir to refuse. */
static int empty_folder(DIR *folder)
{
    for (;;) {
        errno = 0;
        const struct dirent *entry = readdir(folder);
        if (!entry)
            return errno;
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        if (unlinkat(dirfd(folder), entry->d_name, 0) != 0 && errno != ENOENT && errno != EISDIR && errno != EPERM)
            return errno;
    }
}

strl_status strl_path_remove_directory(const char *path, strl_error *err)
{
    /* A link in the folder's place is refused, or somebody else's files would be removed. */
    int descriptor = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor < 0)
        return errno == ENOENT ? STRL_OK : strl__fail_system(err, errno, "open folder", path);
    DIR *folder = fdopendir(descriptor);
    if (!folder) {
        int code = errno;
        close(descriptor);
        return strl__fail_system(err, code, "open folder", path);
    }
    int code = empty_folder(folder);
    closedir(folder);
    if (code == 0 && rmdir(path) != 0 && errno != ENOENT)
        code = errno;
    return code ? strl__fail_system(err, code, "remove folder", path) : STRL_OK;
}

strl_status strl_path_free_bytes(const char *path, uint64_t *bytes, strl_error *err)
{
    *bytes = 0;
    struct statvfs facts;
    int failed;
    do
        failed = statvfs(path, &facts);
    while (failed && errno == EINTR);
    if (failed)
        return strl__fail_system(err, errno, "ask for the free space of", path);
    if (__builtin_mul_overflow((uint64_t)facts.f_bavail, (uint64_t)facts.f_frsize, bytes))
        *bytes = UINT64_MAX;
    return STRL_OK;
}

char *strl_path_join(const char *dir, const char *name)
{
    size_t dir_length = strlen(dir), name_length = strlen(name);
    bool slash = dir_length > 0 && dir[dir_length - 1] != '/';
    char *path = strl__alloc(dir_length + slash + name_length + 1, 1);
    if (!path)
        return NULL;
    memcpy(path, dir, dir_length);
    if (slash)
        path[dir_length] = '/';
    memcpy(path + dir_length + slash, name, name_length + 1);
    return path;
}

struct strl_lock {
    int descriptor;
};

/* Whether the descriptor is still what path names: its last holder may have removed the file before we got the lock. */
static bool is_named(int descriptor, const char *path)
{
    struct stat held, named;
    return fstat(descriptor, &held) == 0 && stat(path, &named) == 0 && held.st_dev == named.st_dev &&
           held.st_ino == named.st_ino;
}

strl_status strl_lock_acquire(const char *path, strl_lock **lock, strl_error *err)
{
    bool held;
    return strl__lock_acquire(path, lock, &held, err);
}

strl_status strl__lock_acquire(const char *path, strl_lock **lock, bool *held, strl_error *err)
{
    *lock = NULL;
    *held = false;
    strl_lock *made = strl__alloc(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to lock %s", strl__path_shown(path));
    for (;;) {
        made->descriptor = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOCTTY, 0666);
        int code = made->descriptor < 0 ? errno : 0;
        if (!code && flock(made->descriptor, LOCK_EX | LOCK_NB) != 0)
            code = errno;
        if (!code && is_named(made->descriptor, path)) {
            *lock = made;
            return STRL_OK;
        }
        if (made->descriptor >= 0)
            close(made->descriptor);
        if (!code || code == EINTR)
            continue;
        strl__free(made);
        *held = code == EWOULDBLOCK;
        if (*held)
            return strl__fail(err, STRL_ERR_IO, "%s is locked: another process is using it", strl__path_shown(path));
        return strl__fail_system(err, code, "lock", path);
    }
}

void strl_lock_release(strl_lock *lock)
{
    if (!lock)
        return;
    close(lock->descriptor);
    strl__free(lock);
}
