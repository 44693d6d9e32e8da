/* Open files. Positional calls only, so the kernel's file offset is never shared between threads. */
#include "platform/file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/posix/facts.h"

/* Linux moves at most 2 GiB - 4 KiB in one call; a round smaller step keeps 32-bit systems inside ssize_t too. */
#define STEP_BYTES ((size_t)1 << 30)

struct strl_file {
    int descriptor;
    _Atomic uint64_t bytes;
    char *path; /* owned */
};

static _Atomic uint64_t reads_until_failure; /* test hooks, see strl_file_fail_reads_after */
static _Atomic uint64_t writes_until_failure;

void strl_file_fail_reads_after(uint64_t n)
{
    atomic_store(&reads_until_failure, n);
}

void strl_file_fail_writes_after(uint64_t n)
{
    atomic_store(&writes_until_failure, n);
}

/* Counts down to 1 and stays there: the n-th call and all after it fail. */
static bool injected_failure(_Atomic uint64_t *countdown)
{
    uint64_t left = atomic_load_explicit(countdown, memory_order_relaxed);
    while (left > 1)
        if (atomic_compare_exchange_weak(countdown, &left, left - 1))
            return false;
    return left == 1;
}

static int open_retrying(const char *path, int flags, mode_t mode)
{
    int descriptor;
    do
        descriptor = open(path, flags | O_CLOEXEC, mode);
    while (descriptor < 0 && errno == EINTR);
    return descriptor;
}

strl_status strl__file_adopt(int descriptor, uint64_t bytes, const char *path, strl_file **file, strl_error *err)
{
    strl_file *made = strl__alloc_zero(1, sizeof *made);
    char *copy = strl__strdup(path);
    if (!made || !copy) {
        strl__free(copy);
        strl__free(made);
        close(descriptor);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open %s", strl__path_shown(path));
    }
    made->descriptor = descriptor;
    atomic_init(&made->bytes, bytes);
    made->path = copy;
    *file = made;
    return STRL_OK;
}

/* A regular file that is there; its facts. */
static strl_status open_regular(const char *path, int flags, int *descriptor, struct stat *facts, strl_error *err)
{
    /* Without O_NONBLOCK a named pipe would wait for its writer before it could be refused. */
    *descriptor = open_retrying(path, flags | O_NONBLOCK | O_NOCTTY, 0);
    if (*descriptor < 0)
        return strl__fail_system(err, errno, "open", path);
    if (fstat(*descriptor, facts) != 0) {
        int code = errno;
        close(*descriptor);
        return strl__fail_system(err, code, "examine", path);
    }
    if (!S_ISREG(facts->st_mode)) {
        close(*descriptor);
        return strl__fail(err, STRL_ERR_IO, "cannot open %s: expected a file, found a %s", strl__path_shown(path),
                          S_ISDIR(facts->st_mode) ? "folder" : "device or pipe");
    }
    return STRL_OK;
}

strl_status strl_file_open(const char *path, strl_file **file, strl_error *err)
{
    *file = NULL;
    int descriptor;
    struct stat facts;
    strl_status status = open_regular(path, O_RDONLY, &descriptor, &facts, err);
    return status != STRL_OK ? status : strl__file_adopt(descriptor, (uint64_t)facts.st_size, path, file, err);
}

strl_status strl_file_reopen(const char *path, uint64_t bytes, strl_file **file, strl_error *err)
{
    *file = NULL;
    int descriptor;
    struct stat facts;
    strl_status status = open_regular(path, O_RDWR | O_NOFOLLOW, &descriptor, &facts, err);
    if (status != STRL_OK)
        return status;
    if ((uint64_t)facts.st_size < bytes)
        status = strl__fail(err, STRL_ERR_FORMAT, "%s ends at byte %" PRIu64 ", expected %" PRIu64 " bytes",
                            strl__path_shown(path), (uint64_t)facts.st_size, bytes);
    else if ((uint64_t)facts.st_size > bytes && ftruncate(descriptor, (off_t)bytes) != 0)
        status = strl__fail_system(err, errno, "cut", path);
    if (status != STRL_OK) {
        close(descriptor);
        return status;
    }
    return strl__file_adopt(descriptor, bytes, path, file, err);
}

strl_status strl_file_create(const char *path, strl_file **file, strl_error *err)
{
    *file = NULL;
    int descriptor = open_retrying(path, O_RDWR | O_CREAT | O_TRUNC | O_NOCTTY, 0666);
    if (descriptor < 0)
        return strl__fail_system(err, errno, "create", path);
    return strl__file_adopt(descriptor, 0, path, file, err);
}

#define RANDOM_CHARACTERS 8u
#define MOST_NAMES_TRIED 100

static void put_random(char *at)
{
    static const char letters[] = "0123456789abcdefghijkmnpqrstuvwx";
    static _Atomic uint64_t turn;
    uint64_t bits = 0;
    if (getrandom(&bits, sizeof bits, GRND_NONBLOCK) != (ssize_t)sizeof bits) {
        struct timespec now = {0};
        clock_gettime(CLOCK_REALTIME, &now);
        bits = ((uint64_t)now.tv_nsec << 20) ^ (uint64_t)getpid() ^ atomic_fetch_add(&turn, 1) * 0x9e3779b97f4a7c15u;
    }
    for (unsigned i = 0; i < RANDOM_CHARACTERS; i++)
        at[i] = letters[bits >> 5 * i & 31];
}

strl_status strl__file_create_unique(char *path, size_t random_at, mode_t mode, const char *shown, strl_file **file,
                                     strl_error *err)
{
    *file = NULL;
    int descriptor = -1;
    errno = EEXIST;
    for (int i = 0; i < MOST_NAMES_TRIED && descriptor < 0 && errno == EEXIST; i++) {
        put_random(path + random_at);
        descriptor = open_retrying(path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_NOCTTY, mode);
    }
    if (descriptor < 0)
        return strl__fail_system(err, errno, "create", shown);
    strl_status status = strl__file_adopt(descriptor, 0, shown, file, err);
    if (status != STRL_OK)
        unlink(path);
    return status;
}

strl_status strl__file_create_nameless(const char *folder, const char *shown, strl_file **file, strl_error *err)
{
    *file = NULL;
    static const char name[] = "stroll.XXXXXXXX.spill";
    char *path = strl_path_join(folder, name);
    if (!path)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a scratch file of %s", strl__path_shown(shown));
    strl_status status =
        strl__file_create_unique(path, strlen(path) - strlen("XXXXXXXX.spill"), 0600, shown, file, err);
    if (status == STRL_OK)
        status = strl_path_remove(path, err);
    if (status != STRL_OK) {
        strl_file_close(*file, NULL);
        *file = NULL;
    }
    strl__free(path);
    return status;
}

strl_status strl_file_create_nameless(const char *folder, strl_file **file, strl_error *err)
{
    return strl__file_create_nameless(folder, folder, file, err);
}

strl_status strl_file_duplicate(const strl_file *file, strl_file **copy, strl_error *err)
{
    *copy = NULL;
    int descriptor = fcntl(file->descriptor, F_DUPFD_CLOEXEC, 0);
    if (descriptor < 0)
        return strl__fail_system(err, errno, "open", file->path);
    return strl__file_adopt(descriptor, strl_file_bytes(file), file->path, copy, err);
}

int strl__file_descriptor(const strl_file *file)
{
    return file->descriptor;
}

strl_status strl_file_close(strl_file *file, strl_error *err)
{
    if (!file)
        return STRL_OK;
    strl_status status = STRL_OK;
    /* After EINTR the descriptor is gone already (Linux): closing again could hit another thread's new file. */
    if (close(file->descriptor) != 0 && errno != EINTR)
        status = strl__fail_system(err, errno, "close", file->path);
    strl__free(file->path);
    strl__free(file);
    return status;
}

const char *strl_file_path(const strl_file *file)
{
    return file->path;
}

uint64_t strl_file_bytes(const strl_file *file)
{
    return atomic_load(&file->bytes);
}

strl_status strl_file_stat(const strl_file *file, strl_file_info *info, strl_error *err)
{
    struct stat facts;
    if (fstat(file->descriptor, &facts) != 0)
        return strl__fail_system(err, errno, "examine", file->path);
    strl__file_info_fill(info, &facts);
    return STRL_OK;
}

/* One system call. *got is 0 at the end of the file, and for offsets that no file can have. */
static strl_status read_step(strl_file *file, uint64_t offset, uint8_t *data, size_t size, size_t *got, strl_error *err)
{
    *got = 0;
    if (offset > (uint64_t)INT64_MAX)
        return STRL_OK;
    uint64_t room = (uint64_t)INT64_MAX - offset;
    if (size > room)
        size = (size_t)room;
    if (size > STEP_BYTES)
        size = STEP_BYTES;
    ssize_t moved = -1;
    errno = EIO;
    if (!injected_failure(&reads_until_failure))
        do
            moved = pread(file->descriptor, data, size, (off_t)offset);
        while (moved < 0 && errno == EINTR);
    if (moved < 0)
        return strl__fail_system(err, errno, "read", file->path);
    *got = (size_t)moved;
    return STRL_OK;
}

strl_status strl_file_read_some(strl_file *file, uint64_t offset, void *data, size_t size, size_t *got, strl_error *err)
{
    *got = 0;
    while (*got < size) {
        size_t moved = 0;
        strl_status status = read_step(file, offset + *got, (uint8_t *)data + *got, size - *got, &moved, err);
        if (status != STRL_OK)
            return status;
        if (moved == 0)
            break;
        *got += moved;
    }
    return STRL_OK;
}

strl_status strl_file_read(strl_file *file, uint64_t offset, void *data, size_t size, strl_error *err)
{
    size_t got = 0;
    strl_status status = strl_file_read_some(file, offset, data, size, &got, err);
    if (status != STRL_OK || got == size)
        return status;
    struct stat facts;
    uint64_t end = got ? offset + got : fstat(file->descriptor, &facts) == 0 ? (uint64_t)facts.st_size : 0;
    return strl__fail(err, STRL_ERR_FORMAT, "%s ends at byte %" PRIu64 ", expected %zu bytes from byte %" PRIu64,
                      strl__path_shown(file->path), end, size, offset);
}

static void raise_bytes(strl_file *file, uint64_t end)
{
    uint64_t bytes = atomic_load(&file->bytes);
    while (bytes < end && !atomic_compare_exchange_weak(&file->bytes, &bytes, end))
        ;
}

strl_status strl_file_write(strl_file *file, uint64_t offset, const void *data, size_t size, strl_error *err)
{
    if (offset > (uint64_t)INT64_MAX || size > (uint64_t)INT64_MAX - offset)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "cannot write %s: %zu bytes at byte %" PRIu64 " pass the largest file size",
                          strl__path_shown(file->path), size, offset);
    size_t done = 0;
    while (done < size) {
        size_t step = size - done < STEP_BYTES ? size - done : STEP_BYTES;
        ssize_t moved = -1;
        errno = ENOSPC;
        if (!injected_failure(&writes_until_failure))
            moved = pwrite(file->descriptor, (const uint8_t *)data + done, step, (off_t)(offset + done));
        if (moved < 0 && errno == EINTR)
            continue;
        if (moved <= 0) /* a device that takes nothing and names no reason is as good as full */
            return strl__fail_system(err, moved < 0 ? errno : ENOSPC, "write", file->path);
        done += (size_t)moved;
        raise_bytes(file, offset + done);
    }
    return STRL_OK;
}

bool strl_file_punch(strl_file *file, uint64_t offset, uint64_t size)
{
#ifdef FALLOC_FL_PUNCH_HOLE
    if (offset > (uint64_t)INT64_MAX || size > (uint64_t)INT64_MAX - offset)
        return false;
    int failed;
    do
        failed = fallocate(file->descriptor, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, (off_t)offset, (off_t)size);
    while (failed && errno == EINTR);
    return !failed;
#else
    (void)file, (void)offset, (void)size;
    return false;
#endif
}

strl_status strl_file_sync(strl_file *file, strl_error *err)
{
    int failed;
    do
        failed = fsync(file->descriptor);
    while (failed && errno == EINTR);
    return failed ? strl__fail_system(err, errno, "sync", file->path) : STRL_OK;
}
