#include "platform/scratch.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/posix/facts.h"

#define LOCK_NAME "lock"
/* What the lock file says: the folder is ours to clear, and perhaps the one it is in. */
#define SIGNATURE "stroll scratch folder: the next build of the same output resumes or clears it\n"
#define PARENT_SIGNATURE SIGNATURE "made with the folder that it is in\n"
#define MOST_ATTEMPTS 100

struct strl_scratch {
    char *path, *lock_path; /* owned */
    char *made_parent;      /* owned; NULL = it was there before */
    const char *const *names;
    bool keep;
    strl_lock *lock; /* NULL until the folder is ours */
    bool (*needed)(void *context, const char *name); /* of a sweep; NULL = nothing is */
    void *context;                                   /* its */
};

static bool is_ours(const strl_scratch *scratch, int folder, const char *name)
{
    struct stat facts;
    if (fstatat(folder, name, &facts, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(facts.st_mode))
        return false;
    for (const char *const *pattern = scratch->names; *pattern; pattern++)
        if (fnmatch(*pattern, name, FNM_PERIOD) == 0)
            return true;
    return false;
}

/* Calls visit for every file but the lock, until it returns false. False where the folder cannot be read, too. */
static bool each_file(strl_scratch *scratch, bool (*visit)(strl_scratch *scratch, int folder, const char *name,
                                                           strl_error *err), strl_error *err)
{
    int descriptor = open(scratch->path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    DIR *folder = descriptor < 0 ? NULL : fdopendir(descriptor);
    if (!folder) {
        strl__fail_system(err, errno, "open folder", scratch->path);
        if (descriptor >= 0)
            close(descriptor);
        return false;
    }
    bool good = true;
    const struct dirent *entry;
    while (good && (entry = readdir(folder)) != NULL)
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0 &&
            strcmp(entry->d_name, LOCK_NAME) != 0)
            good = visit(scratch, dirfd(folder), entry->d_name, err);
    closedir(folder);
    return good;
}

static strl_status refuse(const strl_scratch *scratch, strl_error *err, const char *why)
{
    return strl__fail(err, STRL_ERR_ARGUMENT, "the scratch folder %s cannot be made: %s (remove or rename it, or name "
                      "another place by --scratch)", strl__path_shown(scratch->path), why);
}

static bool must_be_ours(strl_scratch *scratch, int folder, const char *name, strl_error *err)
{
    char why[128];
    if (is_ours(scratch, folder, name))
        return true;
    snprintf(why, sizeof why, "there is one, and it holds %.60s, which is not a scratch file", name);
    refuse(scratch, err, why);
    return false;
}

static bool remove_ours(strl_scratch *scratch, int folder, const char *name, strl_error *err)
{
    bool needed = scratch->needed && scratch->needed(scratch->context, name);
    if (!needed && is_ours(scratch, folder, name) && unlinkat(folder, name, 0) != 0 && errno != ENOENT) {
        strl__fail_system(err, errno, "remove a scratch file in", scratch->path);
        return false;
    }
    return true;
}

/* What the lock file says: that the folder is ours, and perhaps the one it is in. */
typedef struct claim {
    bool is_ours, with_parent;
} claim;

static strl_status read_claim(const strl_scratch *scratch, claim *found, strl_error *err)
{
    char text[sizeof PARENT_SIGNATURE + 1] = "";
    struct stat facts;
    strl_file *file = NULL;
    size_t got = 0;
    *found = (claim){0};
    if (lstat(scratch->lock_path, &facts) != 0 || !S_ISREG(facts.st_mode))
        return STRL_OK;
    strl_status status = strl_file_open(scratch->lock_path, &file, err);
    if (status == STRL_OK)
        status = strl_file_read_some(file, 0, text, sizeof PARENT_SIGNATURE, &got, err);
    strl_file_close(file, NULL);
    found->with_parent = strcmp(text, PARENT_SIGNATURE) == 0;
    found->is_ours = found->with_parent || strcmp(text, SIGNATURE) == 0;
    return status;
}

static strl_status sign(const strl_scratch *scratch, const char *lock_path, strl_error *err)
{
    strl_file *file = NULL;
    const char *text = scratch->made_parent ? PARENT_SIGNATURE : SIGNATURE;
    strl_status status = strl_file_create(lock_path, &file, err);
    if (status == STRL_OK)
        status = strl_file_write(file, 0, text, strlen(text), err);
    strl_status closed = strl_file_close(file, status == STRL_OK ? err : NULL);
    return status != STRL_OK ? status : closed;
}

static void unlock(strl_scratch *scratch)
{
    strl_lock_release(scratch->lock);
    scratch->lock = NULL;
}

/* Nothing in the folder is touched before all of it is known to be ours. */
static strl_status clear_left_over(strl_scratch *scratch, strl_error *err)
{
    strl_error inner = {.status = STRL_ERR_IO};
    bool good = each_file(scratch, must_be_ours, &inner) && (scratch->keep || each_file(scratch, remove_ours, &inner));
    return good ? STRL_OK : strl__fail(err, inner.status, "%s", inner.message);
}

/* The folder is locked and cleared, as far as it is to be. */
static strl_status sign_again(strl_scratch *scratch, const char *parent, bool with_parent, strl_error *err)
{
    claim found;
    if (parent && with_parent && !scratch->made_parent)
        scratch->made_parent = strl__strdup(parent); /* without memory it stays */
    strl_status status = read_claim(scratch, &found, err);
    /* Its last holder may have removed the lock file just before we made it again. */
    return status != STRL_OK || found.is_ours ? status : sign(scratch, scratch->lock_path, err);
}

/* The folder is there. */
static strl_status take_over(strl_scratch *scratch, const char *parent, strl_error *err)
{
    struct stat facts;
    claim found;
    if (lstat(scratch->path, &facts) == 0 && !S_ISDIR(facts.st_mode))
        return refuse(scratch, err, "there is something of that name, and it is not a folder");
    strl_status status = read_claim(scratch, &found, err);
    if (status == STRL_OK && !found.is_ours)
        status = refuse(scratch, err, "there is one, and it was not made by a build");
    if (status == STRL_OK)
        status = strl_lock_acquire(scratch->lock_path, &scratch->lock, err);
    if (status != STRL_OK)
        return status;
    status = clear_left_over(scratch, err);
    if (status == STRL_OK)
        status = sign_again(scratch, parent, found.with_parent, err);
    if (status != STRL_OK)
        unlock(scratch); /* what is in it stays */
    return status;
}

/* Under no name that anything has. Where the file system cannot promise that, it is looked at before. */
static int rename_new(const char *from, const char *to)
{
    struct stat facts;
    if (renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE) == 0)
        return 0;
    if (errno != EINVAL && errno != ENOSYS)
        return errno;
    if (lstat(to, &facts) == 0)
        return EEXIST;
    return rename(from, to) == 0 ? 0 : errno;
}

/* Locked and signed before it gets its name: whenever the process may end, what has the name is known to be ours. *exists:
 * something else got it first. */
static strl_status make_new(strl_scratch *scratch, const char *folder, const char *lock_path, bool *exists, strl_error *err)
{
    if (mkdir(folder, 0777) != 0 && errno != EEXIST)
        return strl__fail_system(err, errno, "create folder", scratch->path);
    strl_status status = strl_lock_acquire(lock_path, &scratch->lock, err);
    if (status == STRL_OK)
        status = sign(scratch, lock_path, err);
    int code = status == STRL_OK ? rename_new(folder, scratch->path) : 0;
    *exists = code == EEXIST;
    if (status == STRL_OK && code == 0)
        return STRL_OK;
    if (code)
        status = strl__fail_system(err, code, "create folder", scratch->path);
    if (scratch->lock)
        unlink(lock_path);
    unlock(scratch);
    rmdir(folder);
    return status;
}

static strl_status make_beside(strl_scratch *scratch, bool *exists, strl_error *err)
{
    size_t size = strlen(scratch->path) + 32;
    char *folder = strl__alloc(size, 1), *lock_path = NULL;
    if (folder) { /* a folder of that name is that of an ended process */
        snprintf(folder, size, "%s.%ld", scratch->path, (long)getpid());
        lock_path = strl_path_join(folder, LOCK_NAME);
    }
    strl_status status = lock_path ? make_new(scratch, folder, lock_path, exists, err)
                                   : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    strl__free(lock_path);
    strl__free(folder);
    return status;
}

static strl_status make(strl_scratch *scratch, const char *parent, strl_error *err)
{
    strl_status status = STRL_OK;
    for (int attempt = 0; attempt < MOST_ATTEMPTS; attempt++) {
        struct stat facts;
        bool exists = lstat(scratch->path, &facts) == 0;
        if (!exists)
            status = make_beside(scratch, &exists, err);
        if (!exists)
            return status;
        status = take_over(scratch, parent, err);
        /* Gone meanwhile: its holder ended. */
        if (status == STRL_OK || scratch->lock || lstat(scratch->path, &facts) == 0)
            return status;
    }
    return status;
}

static strl_status make_parent(strl_scratch *scratch, const char *parent, strl_error *err)
{
    char *copy = strl__strdup(parent);
    if (!copy)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (mkdir(parent, 0777) == 0) {
        scratch->made_parent = copy;
        return STRL_OK;
    }
    strl__free(copy);
    return strl_path_make_directory(parent, err);
}

strl_status strl_scratch_create(const strl_scratch_desc *desc, strl_scratch **scratch, strl_error *err)
{
    *scratch = NULL;
    strl_scratch *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a scratch folder");
    made->names = desc->names;
    made->keep = desc->keep;
    made->path = strl__strdup(desc->path);
    made->lock_path = strl_path_join(desc->path, LOCK_NAME);
    strl_status status = made->path && made->lock_path ? STRL_OK
                                                       : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
    if (status == STRL_OK && desc->parent)
        status = make_parent(made, desc->parent, err);
    if (status == STRL_OK)
        status = make(made, desc->parent, err);
    if (status != STRL_OK)
        strl_scratch_destroy(made);
    else
        *scratch = made;
    return status;
}

const char *strl_scratch_path(const strl_scratch *scratch)
{
    return scratch->path;
}

strl_status strl_scratch_sweep(strl_scratch *scratch, bool (*needed)(void *context, const char *name), void *context,
                               strl_error *err)
{
    strl_error inner = {.status = STRL_ERR_IO};
    scratch->needed = needed;
    scratch->context = context;
    bool good = each_file(scratch, remove_ours, &inner);
    scratch->needed = NULL;
    return good ? STRL_OK : strl__fail(err, inner.status, "%s", inner.message);
}

static void release(strl_scratch *scratch)
{
    strl__free(scratch->made_parent);
    strl__free(scratch->lock_path);
    strl__free(scratch->path);
    strl__free(scratch);
}

void strl_scratch_leave(strl_scratch *scratch)
{
    if (!scratch)
        return;
    strl_lock_release(scratch->lock);
    release(scratch);
}

void strl_scratch_destroy(strl_scratch *scratch)
{
    if (!scratch)
        return;
    if (scratch->lock) {
        each_file(scratch, remove_ours, NULL);
        unlink(scratch->lock_path);
        rmdir(scratch->path); /* refused where somebody else's files came: they stay */
        strl_lock_release(scratch->lock);
    }
    if (scratch->made_parent)
        rmdir(scratch->made_parent);
    release(scratch);
}
