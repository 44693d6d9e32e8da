/* Folders that nobody leaves: openat2 with RESOLVE_BENEATH, or one component after the other with O_NOFOLLOW. */
#include "platform/folder.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#if defined(SYS_openat2) && defined(__has_include)
#if __has_include(<linux/openat2.h>)
#include <linux/openat2.h>
#define HAVE_OPENAT2 1
#endif
#endif

#include "base/fail.h"
#include "base/memory.h"
#include "platform/posix/facts.h"

#ifndef O_PATH
#define O_PATH O_RDONLY
#endif

#define MOST_TRIES 64 /* openat2 gives up where somebody renames meanwhile */
#define NAME_BYTES 4096u

struct strl_folder {
    int descriptor;
    bool watched; /* the kernel watches over links */
    char *path;   /* owned */
};

/* -1 with errno where the kernel has no such call. */
static int open_watched(int root, const char *name, int flags)
{
#ifdef HAVE_OPENAT2
    struct open_how how = {.flags = (uint64_t)(flags | O_CLOEXEC), .resolve = RESOLVE_BENEATH | RESOLVE_NO_MAGICLINKS};
    long descriptor = -1;
    int tries = 0;
    do
        descriptor = syscall(SYS_openat2, root, name, &how, sizeof how);
    while (descriptor < 0 && (errno == EAGAIN || errno == EINTR) && ++tries < MOST_TRIES);
    return (int)descriptor;
#else
    (void)root, (void)name, (void)flags;
    errno = ENOSYS;
    return -1;
#endif
}

static int open_component(int at, const char *name, int flags)
{
    int descriptor;
    do
        descriptor = openat(at, name, flags | O_NOFOLLOW | O_CLOEXEC);
    while (descriptor < 0 && errno == EINTR);
    return descriptor;
}

/* No link on the way is followed, so no component leads anywhere but one down. */
static int open_stepwise(int root, const char *name, int flags)
{
    char component[NAME_BYTES];
    int at = root;
    for (const char *slash; at >= 0 && (slash = strchr(name, '/')); name = slash + 1) {
        memcpy(component, name, (size_t)(slash - name));
        component[slash - name] = 0;
        int next = open_component(at, component, O_PATH | O_DIRECTORY);
        int code = errno;
        if (at != root)
            close(at);
        at = next;
        errno = code;
    }
    if (at < 0)
        return -1;
    int descriptor = open_component(at, name, flags), code = errno;
    if (at != root)
        close(at);
    errno = code;
    return descriptor;
}

/* What both ways of opening rely on. "" is refused, too. */
static bool is_plain(const char *name)
{
    if (strlen(name) >= NAME_BYTES)
        return false;
    for (;;) {
        size_t length = strcspn(name, "/");
        if (length == 0 || (length == 1 && name[0] == '.') || (length == 2 && name[0] == '.' && name[1] == '.'))
            return false;
        if (!name[length])
            return true;
        name += length + 1;
    }
}

static int open_below(const strl_folder *folder, const char *name, int flags)
{
    if (!is_plain(name)) {
        errno = ENOENT;
        return -1;
    }
    return folder->watched ? open_watched(folder->descriptor, name, flags)
                           : open_stepwise(folder->descriptor, name, flags);
}

static strl_found found_of(int code)
{
    switch (code) {
    case ENOENT:
    case ENOTDIR:
    case EISDIR:
    case ELOOP:
    case EXDEV:
    case ENAMETOOLONG:
    case ENXIO:
    case ENODEV:
        return STRL_FOUND_NOTHING;
    case EACCES:
    case EPERM:
        return STRL_FOUND_BARRED;
    default:
        return STRL_FOUND_FAILED;
    }
}

static strl_found fail(int code, const char *verb, const char *name, strl_error *err)
{
    strl__fail_system(err, code, verb, name);
    return found_of(code);
}

strl_status strl_folder_open(const char *path, strl_folder **folder, strl_error *err)
{
    *folder = NULL;
    int descriptor = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0)
        return strl__fail_system(err, errno, "open folder", path);
    strl_folder *made = strl__alloc_zero(1, sizeof *made);
    char *copy = strl__strdup(path);
    if (!made || !copy) {
        strl__free(copy);
        strl__free(made);
        close(descriptor);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open folder %s", strl__path_shown(path));
    }
    int probe = open_watched(descriptor, ".", O_PATH | O_DIRECTORY);
    if (probe >= 0)
        close(probe);
    *made = (strl_folder){.descriptor = descriptor, .watched = probe >= 0, .path = copy};
    *folder = made;
    return STRL_OK;
}

void strl_folder_close(strl_folder *folder)
{
    if (!folder)
        return;
    close(folder->descriptor);
    strl__free(folder->path);
    strl__free(folder);
}

void strl_folder_follow_no_links(strl_folder *folder)
{
    folder->watched = false;
}

strl_found strl_folder_open_file(strl_folder *folder, const char *name, strl_file **file, strl_error *err)
{
    *file = NULL;
    /* Without O_NONBLOCK a named pipe would wait for its writer before it could be refused. */
    int descriptor = open_below(folder, name, O_RDONLY | O_NONBLOCK | O_NOCTTY);
    if (descriptor < 0)
        return fail(errno, "open", name, err);
    struct stat facts;
    if (fstat(descriptor, &facts) != 0) {
        int code = errno;
        close(descriptor);
        return fail(code, "examine", name, err);
    }
    if (!S_ISREG(facts.st_mode)) {
        close(descriptor);
        strl__fail(err, STRL_ERR_IO, "%s is no file", strl__path_shown(name));
        return STRL_FOUND_NOTHING;
    }
    strl_status status = strl__file_adopt(descriptor, (uint64_t)facts.st_size, name, file, err);
    return status == STRL_OK ? STRL_FOUND : STRL_FOUND_FAILED;
}

bool strl_folder_has_folder(strl_folder *folder, const char *name)
{
    int descriptor = open_below(folder, name, O_PATH | O_DIRECTORY);
    if (descriptor >= 0)
        close(descriptor);
    return descriptor >= 0;
}

/* Whether an entry leads to a folder that can be opened as one. */
static bool is_folder(strl_folder *folder, const char *parent, const struct dirent *entry)
{
    if (entry->d_type == DT_DIR)
        return true;
    if (entry->d_type != DT_LNK && entry->d_type != DT_UNKNOWN)
        return false;
    char name[NAME_BYTES];
    int length = snprintf(name, sizeof name, "%s%s%s", parent, *parent ? "/" : "", entry->d_name);
    return length > 0 && (size_t)length < sizeof name && strl_folder_has_folder(folder, name);
}

/* What readdir failed with; 0 at the end of the folder, or where the visitor has ended it. */
static int visit_all(strl_folder *folder, const char *name, DIR *listing, strl_folder_visit visit, void *context)
{
    for (bool go_on = true; go_on;) {
        errno = 0;
        const struct dirent *entry = readdir(listing);
        if (!entry)
            return errno;
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
            go_on = visit(context, entry->d_name, is_folder(folder, name, entry));
    }
    return 0;
}

strl_found strl_folder_list(strl_folder *folder, const char *name, strl_folder_visit visit, void *context,
                            strl_error *err)
{
    /* "." is the folder itself, opened anew: a descriptor's place in its listing belongs to one listing alone. */
    int descriptor = *name ? open_below(folder, name, O_RDONLY | O_DIRECTORY)
                           : openat(folder->descriptor, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0)
        return fail(errno, "list", *name ? name : folder->path, err);
    DIR *listing = fdopendir(descriptor);
    if (!listing) {
        int code = errno;
        close(descriptor);
        return fail(code, "list", *name ? name : folder->path, err);
    }
    int code = visit_all(folder, name, listing, visit, context);
    closedir(listing);
    return code ? fail(code, "list", *name ? name : folder->path, err) : STRL_FOUND;
}
