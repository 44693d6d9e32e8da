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
#define NOT_OURS "there is one, and it was not made by a build"
#define MOST_ATTEMPTS 20

struct strl_scratch {
    char *path, *lock_path; /* owned */
    char *made_parent;      /* owned; NULL = it was there before */
    const char *const *names;
    bool keep;
    strl_lock *lock;                                 /* NULL until the folder is ours */
    bool held;                                       /* by another process */
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
static bool each_file(strl_scratch *scratch,
                      bool (*visit)(strl_scratch *scratch, int folder, const char *name, strl_error *err),
                      strl_error *err)
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
    return strl__fail(err, STRL_ERR_ARGUMENT,
                      "the scratch folder %s cannot be made: %s (remove or rename it, or name "
                      "another place by --scratch)",
                      strl__path_shown(scratch->path), why);
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

static bool must_be_absent(strl_scratch *scratch, int folder, const char *name, strl_error *err)
{
    (void)scratch, (void)folder, (void)name, (void)err;
    return false;
}

/* Elsewhere the lock would be a new file in somebody's folder. The files come first: as long as a run has any, its lock
 * file is there. */
static bool can_be_locked(strl_scratch *scratch)
{
    struct stat facts;
    bool empty = each_file(scratch, must_be_absent, NULL);
    return lstat(scratch->lock_path, &facts) == 0 ? S_ISREG(facts.st_mode) : empty && errno == ENOENT;
}

/* What the lock file says: that the folder is ours, and perhaps the one it is in. */
typedef struct claim {
    bool is_signed, with_parent;
} claim;

/* Asked under the lock: before, another process may be about to sign. What ended between making its folder and signing
 * it has left nothing but, perhaps, a lock file without a word. */
static strl_status read_claim(strl_scratch *scratch, claim *found, strl_error *err)
{
    char text[sizeof PARENT_SIGNATURE + 1] = "";
    strl_file *file = NULL;
    size_t got = 0;
    strl_status status = strl_file_open(scratch->lock_path, &file, err);
    if (status == STRL_OK)
        status = strl_file_read_some(file, 0, text, sizeof PARENT_SIGNATURE, &got, err);
    strl_file_close(file, NULL);
    found->with_parent = strcmp(text, PARENT_SIGNATURE) == 0;
    found->is_signed = found->with_parent || strcmp(text, SIGNATURE) == 0;
    if (status != STRL_OK || found->is_signed || (got == 0 && each_file(scratch, must_be_absent, NULL)))
        return status;
    return refuse(scratch, err, NOT_OURS);
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

/* The folder is there. Nothing in it is touched before all of it is known to be ours. */
static strl_status clear_left_over(strl_scratch *scratch, const char *parent, strl_error *err)
{
    claim found;
    strl_error inner = {.status = STRL_ERR_IO};
    bool good = read_claim(scratch, &found, &inner) == STRL_OK && each_file(scratch, must_be_ours, &inner) &&
                (scratch->keep || each_file(scratch, remove_ours, &inner));
    if (!good)
        return strl__fail(err, inner.status, "%s", inner.message);
    if (parent && found.with_parent && !scratch->made_parent)
        scratch->made_parent = strl__strdup(parent); /* without memory it stays */
    /* Its last holder may have removed the lock file just before we made it again. What is signed is left as it is: a
     * lock file without a word beside files would be nobody's. */
    return found.is_signed ? STRL_OK : sign(scratch, scratch->lock_path, err);
}

static strl_status take_over(strl_scratch *scratch, const char *parent, strl_error *err)
{
    struct stat facts;
    if (lstat(scratch->path, &facts) == 0 && !S_ISDIR(facts.st_mode))
        return refuse(scratch, err, "there is something of that name, and it is not a folder");
    if (!can_be_locked(scratch))
        return refuse(scratch, err, NOT_OURS);
    strl_status status = strl__lock_acquire(scratch->lock_path, &scratch->lock, &scratch->held, err);
    if (status != STRL_OK)
        return status;
    status = clear_left_over(scratch, parent, err);
    if (status != STRL_OK) { /* what is in it stays */
        strl_lock_release(scratch->lock);
        scratch->lock = NULL;
    }
    return status;
}

static strl_status lock_new(strl_scratch *scratch, strl_error *err)
{
    strl_status status = strl__lock_acquire(scratch->lock_path, &scratch->lock, &scratch->held, err);
    if (status == STRL_ERR_MEMORY)
        rmdir(scratch->path); /* else it is another process's by now, or gone */
    return status == STRL_OK ? sign(scratch, scratch->lock_path, err) : status;
}

static strl_status make(strl_scratch *scratch, const char *parent, strl_error *err)
{
    strl_status status = STRL_OK;
    for (int attempt = 0; attempt < MOST_ATTEMPTS; attempt++) {
        bool made = mkdir(scratch->path, 0777) == 0;
        if (!made && errno != EEXIST)
            return strl__fail_system(err, errno, "create folder", scratch->path);
        status = made ? lock_new(scratch, err) : take_over(scratch, parent, err);
        /* Anything else may be the work of another process that begins or ends just now. */
        if (status == STRL_OK || status == STRL_ERR_MEMORY || scratch->lock || scratch->held)
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
    strl_status status =
        made->path && made->lock_path ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for a path");
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
