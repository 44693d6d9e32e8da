#include "platform/output.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <string.h>
#include <unistd.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/posix/facts.h"

#define COPY_BYTES ((size_t)1 << 20)
#define MOST_LINKS 40
/* Of the name's own characters: with the random ones and ".part" it stays within the 255 of common file systems. */
#define MOST_NAME_KEPT 200

struct strl_output {
    char *path;      /* owned; as the user gave it */
    char *target;    /* owned; the file to be replaced */
    char *temporary; /* owned; NULL where there is none (any more) */
    strl_file *file;
    FILE *stream; /* onto the file; NULL until asked for */
};

/* ---- what a name stands for ---- */

static strl_status fail_memory(const char *path, strl_error *err)
{
    return strl__fail(err, STRL_ERR_MEMORY, "no memory to write %s", strl__path_shown(path));
}

static strl_status fail_kind(const char *path, const char *kind, strl_error *err)
{
    return strl__fail(err, STRL_ERR_ARGUMENT, "%s is a %s, expected the name of a file to write",
                      strl__path_shown(path), kind);
}

/* Where a link leads to, owned by the caller; NULL without memory. */
static char *link_target(const char *path, const char *text)
{
    if (*text == '/')
        return strl__strdup(text);
    char *folder = strl__path_parent(path);
    char *target = folder ? strl_path_join(folder, text) : NULL;
    strl__free(folder);
    return target;
}

/* Follows *at, which is replaced; *exists and *facts tell about the end. */
static strl_status follow_links(char **at, bool *exists, struct stat *facts, strl_error *err)
{
    char text[PATH_MAX];
    for (int hop = 0; hop < MOST_LINKS; hop++) {
        *exists = lstat(*at, facts) == 0;
        if (!*exists && errno == ENAMETOOLONG)
            return strl__fail_system(err, errno, "write", *at);
        if (!*exists || !S_ISLNK(facts->st_mode))
            return STRL_OK;
        ssize_t length = readlink(*at, text, sizeof text - 1);
        if (length <= 0)
            return strl__fail_system(err, length < 0 ? errno : EINVAL, "follow the link", *at);
        text[length] = 0;
        char *next = link_target(*at, text);
        if (!next)
            return fail_memory(*at, err);
        strl__free(*at);
        *at = next;
    }
    return strl__fail_system(err, ELOOP, "follow the link", *at);
}

static strl_status check_existing(const char *path, const struct stat *facts, strl_error *err)
{
    if (S_ISDIR(facts->st_mode))
        return fail_kind(path, "folder", err);
    if (S_ISFIFO(facts->st_mode))
        return fail_kind(path, "pipe", err);
    if (S_ISSOCK(facts->st_mode))
        return fail_kind(path, "socket", err);
    if (!S_ISREG(facts->st_mode))
        return fail_kind(path, "device", err);
    /* Renaming over a file that is protected against writing would be allowed, but is not what protects it. */
    return faccessat(AT_FDCWD, path, W_OK, AT_EACCESS) == 0 ? STRL_OK : strl__fail_system(err, errno, "write", path);
}

static strl_status check_folder(const char *target, strl_error *err)
{
    struct stat facts;
    char *folder = strl__path_parent(target);
    if (!folder)
        return fail_memory(target, err);
    strl_status status = STRL_OK;
    if (stat(folder, &facts) != 0)
        status = errno == ENOENT ? strl__fail(err, STRL_ERR_IO, "cannot write %s: the folder %s is missing",
                                              strl__path_shown(target), strl__path_shown(folder))
                                 : strl__fail_system(err, errno, "write", target);
    else if (!S_ISDIR(facts.st_mode))
        status = strl__fail(err, STRL_ERR_IO, "cannot write %s: %s is not a folder", strl__path_shown(target),
                            strl__path_shown(folder));
    else if (faccessat(AT_FDCWD, folder, W_OK | X_OK, AT_EACCESS) != 0)
        status = strl__fail_system(err, errno, "write in the folder", folder);
    strl__free(folder);
    return status;
}

static strl_status find_target(const char *path, char **target, struct stat *facts, bool *exists, strl_error *err)
{
    *target = NULL;
    if (!*path)
        return strl__fail(err, STRL_ERR_ARGUMENT, "the output's name is empty, expected the name of a file to write");
    if (!strcmp(path, "-"))
        return strl__fail(
            err, STRL_ERR_ARGUMENT,
            "the output's name is -, but nothing is written to standard output, expected the name of a file to write "
            "(./- names one of that name)");
    char *at = strl__strdup(path);
    if (!at)
        return fail_memory(path, err);
    strl_status status = follow_links(&at, exists, facts, err);
    if (status == STRL_OK && *exists)
        status = check_existing(at, facts, err);
    else if (status == STRL_OK && at[strlen(at) - 1] == '/')
        status = strl__fail(err, STRL_ERR_ARGUMENT, "%s names a folder, expected the name of a file to write",
                            strl__path_shown(at));
    if (status == STRL_OK)
        status = check_folder(at, err);
    if (status == STRL_OK)
        *target = at;
    else
        strl__free(at);
    return status;
}

strl_status strl_output_target(const char *path, char **target, strl_error *err)
{
    struct stat facts;
    bool exists;
    return find_target(path, target, &facts, &exists, err);
}

strl_status strl_output_check(const char *path, strl_error *err)
{
    char *target;
    strl_status status = strl_output_target(path, &target, err);
    strl__free(target);
    return status;
}

/* ---- the temporary file ---- */

/* Whether `folder` lies in the same folder as the target: then a rename from there cannot meet another file system. */
static bool is_beside(const char *folder, const char *target_folder)
{
    struct stat a, b;
    char *parent = strl__path_parent(folder);
    bool same =
        parent && stat(parent, &a) == 0 && stat(target_folder, &b) == 0 && a.st_dev == b.st_dev && a.st_ino == b.st_ino;
    strl__free(parent);
    return same;
}

/* FOLDER/NAME.XXXXXXXX.part; *random_at: where the X are. Owned by the caller; NULL without memory. */
static char *temporary_pattern(const char *target, const char *scratch, size_t *random_at)
{
    const char *slash = strrchr(target, '/'), *name = slash ? slash + 1 : target;
    char *folder = strl__path_parent(target), kept[MOST_NAME_KEPT + sizeof ".XXXXXXXX.part"];
    if (!folder)
        return NULL;
    int length = snprintf(kept, MOST_NAME_KEPT + 1, "%s", name);
    length = length > MOST_NAME_KEPT ? MOST_NAME_KEPT : length;
    memcpy(kept + length, ".XXXXXXXX.part", sizeof ".XXXXXXXX.part");
    char *pattern = strl_path_join(scratch && is_beside(scratch, folder) ? scratch : folder, kept);
    if (pattern)
        *random_at = strlen(pattern) - strlen("XXXXXXXX.part");
    strl__free(folder);
    return pattern;
}

strl_status strl_output_open(const char *path, const char *scratch, strl_output **output, strl_error *err)
{
    *output = NULL;
    struct stat facts;
    bool exists;
    size_t random_at = 0;
    strl_output *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return fail_memory(path, err);
    strl_status status = find_target(path, &made->target, &facts, &exists, err);
    if (status == STRL_OK) {
        made->path = strl__strdup(path);
        char *pattern = temporary_pattern(made->target, scratch, &random_at);
        status = made->path && pattern ? strl__file_create_unique(pattern, random_at, 0666, path, &made->file, err)
                                       : fail_memory(path, err);
        made->temporary = pattern;
        if (status != STRL_OK) {
            strl__free(pattern);
            made->temporary = NULL;
        }
    }
    /* Who could read the older file can read the new one, and nobody else. */
    if (status == STRL_OK && exists && fchmod(strl__file_descriptor(made->file), facts.st_mode & 0777) != 0)
        status = strl__fail_system(err, errno, "set the permissions of", path);
    if (status != STRL_OK)
        strl_output_close(made);
    else
        *output = made;
    return status;
}

strl_file *strl_output_file(strl_output *output)
{
    return output->file;
}

strl_status strl_output_stream(strl_output *output, FILE **stream, strl_error *err)
{
    *stream = NULL;
    if (!output->stream) {
        int descriptor = fcntl(strl__file_descriptor(output->file), F_DUPFD_CLOEXEC, 0);
        output->stream = descriptor < 0 ? NULL : fdopen(descriptor, "wb");
        if (!output->stream) {
            int code = errno;
            if (descriptor >= 0)
                close(descriptor);
            return strl__fail_system(err, code, "write", output->path);
        }
    }
    *stream = output->stream;
    return STRL_OK;
}

strl_status strl_output_spill(strl_output *output, strl_file **spill, strl_error *err)
{
    *spill = NULL;
    char *folder = strl__path_parent(output->temporary);
    strl_status status =
        folder ? strl__file_create_nameless(folder, output->path, spill, err) : fail_memory(output->path, err);
    strl__free(folder);
    return status;
}

strl_status strl_output_append(strl_output *output, strl_file *spill, strl_output_report report, void *context,
                               strl_error *err)
{
    uint64_t end = strl_file_bytes(output->file), total = strl_file_bytes(spill);
    uint8_t *buffer = strl__alloc(COPY_BYTES, 1);
    strl_status status = buffer ? STRL_OK : fail_memory(output->path, err);
    for (uint64_t at = 0; status == STRL_OK && at < total;) {
        size_t step = total - at < COPY_BYTES ? (size_t)(total - at) : COPY_BYTES;
        status = strl_file_read(spill, at, buffer, step, err);
        if (status == STRL_OK)
            status = strl_file_write(output->file, end + at, buffer, step, err);
        strl_file_punch(spill, at, step);
        at += step;
        if (status == STRL_OK && report)
            status = report(context, at, total, err);
    }
    strl__free(buffer);
    return status;
}

static strl_status close_files(strl_output *output, bool durable, strl_error *err)
{
    strl_status status = STRL_OK;
    strl_file *file = output->file;
    FILE *stream = output->stream;
    output->stream = NULL;
    output->file = NULL;
    if (stream) {
        bool failed = ferror(stream);
        errno = EIO; /* of a write that failed earlier nothing more is known */
        if (fclose(stream) != 0 || failed)
            status = strl__fail_system(err, errno, "write", output->path);
    }
    if (status == STRL_OK && durable)
        status = strl_file_sync(file, err);
    strl_status closed = strl_file_close(file, status == STRL_OK ? err : NULL);
    return status != STRL_OK ? status : closed;
}

strl_status strl_output_finish(strl_output *output, bool durable, strl_error *err)
{
    strl_status status = close_files(output, durable, err);
    if (status == STRL_OK && durable)
        status = strl_path_rename(output->temporary, output->target, err);
    else if (status == STRL_OK && rename(output->temporary, output->target) != 0)
        status = strl__fail_system(err, errno, "rename a file to", output->target);
    if (status == STRL_OK) {
        strl__free(output->temporary);
        output->temporary = NULL;
    }
    return status;
}

void strl_output_close(strl_output *output)
{
    if (!output)
        return;
    if (output->stream)
        fclose(output->stream);
    strl_file_close(output->file, NULL);
    if (output->temporary)
        unlink(output->temporary);
    strl__free(output->temporary);
    strl__free(output->target);
    strl__free(output->path);
    strl__free(output);
}
