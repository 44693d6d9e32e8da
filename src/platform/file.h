/* Files, folders and renames. Every call either does all it was asked or fails with a sentence that names the path.
 * All reads and writes are positional (pread/pwrite), so one file may be read by several threads at once. */
#ifndef STRL_PLATFORM_FILE_H
#define STRL_PLATFORM_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

typedef struct strl_file strl_file;

typedef struct strl_file_info {
    uint64_t bytes;
    uint64_t modified_ns; /* time of last change */
    uint64_t device;      /* (device, inode) identify a file under any name */
    uint64_t inode;
    bool is_directory;
} strl_file_info;

strl_status strl_file_open(const char *path, strl_file **file, strl_error *err);   /* read only; a regular file */
strl_status strl_file_create(const char *path, strl_file **file, strl_error *err); /* read and write; truncates */
/* Read and write; a regular file that is there and has at least `bytes` bytes, to which it is cut. */
strl_status strl_file_reopen(const char *path, uint64_t bytes, strl_file **file, strl_error *err);
/* Read and write; without a name in `folder`, so that nothing of it is left when it is closed or the process ends. */
strl_status strl_file_create_nameless(const char *folder, strl_file **file, strl_error *err);
/* Another object onto the same open file, whatever has become of its name. */
strl_status strl_file_duplicate(const strl_file *file, strl_file **copy, strl_error *err);
strl_status strl_file_close(strl_file *file, strl_error *err); /* NULL is legal; reports a late write error */

const char *strl_file_path(const strl_file *file); /* borrowed */
uint64_t strl_file_bytes(const strl_file *file);   /* size at opening, or as grown by writes through this object */
strl_status strl_file_stat(const strl_file *file, strl_file_info *info, strl_error *err);

/* Exactly size bytes or failure: a short read is STRL_ERR_FORMAT ("ends at byte .."), an error is STRL_ERR_IO. */
strl_status strl_file_read(strl_file *file, uint64_t offset, void *data, size_t size, strl_error *err);
/* As many bytes as there are, up to size. */
strl_status strl_file_read_some(strl_file *file, uint64_t offset, void *data, size_t size, size_t *got,
                                strl_error *err);
/* STRL_ERR_DISK_FULL where there is no room. */
strl_status strl_file_write(strl_file *file, uint64_t offset, const void *data, size_t size, strl_error *err);
/* Gives the range's blocks back to the file system where it can; reads of it then return zeros. Returns
 * whether it could. */
bool strl_file_punch(strl_file *file, uint64_t offset, uint64_t size);
strl_status strl_file_sync(strl_file *file, strl_error *err);

strl_status strl_path_stat(const char *path, strl_file_info *info, strl_error *err);
bool strl_path_exists(const char *path);
strl_status strl_path_rename(const char *from, const char *to, strl_error *err); /* replaces; then syncs the folder */
strl_status strl_path_remove(const char *path, strl_error *err);                 /* a missing file is not an error */
strl_status strl_path_make_directory(const char *path, strl_error *err);         /* existing is not an error */
/* The same, but one that is made is for its owner alone. */
strl_status strl_path_make_private_directory(const char *path, strl_error *err);
/* A new folder of this process alone; `pattern` ends in XXXXXX, which becomes its name. */
strl_status strl_path_make_temporary(char *pattern, strl_error *err);
/* A folder with anything in it stays. */
void strl_path_remove_if_empty(const char *path);
/* With the files in it; a folder in it is a failure. A missing folder is not an error. */
strl_status strl_path_remove_directory(const char *path, strl_error *err);
strl_status strl_path_free_bytes(const char *path, uint64_t *bytes, strl_error *err);
/* dir + "/" + name, owned by the caller (strl__free); NULL without memory. */
char *strl_path_join(const char *dir, const char *name);

/* An exclusive advisory lock on path (created if missing), held until released or the process ends. */
typedef struct strl_lock strl_lock;
strl_status strl_lock_acquire(const char *path, strl_lock **lock, strl_error *err);
void strl_lock_release(strl_lock *lock);

/* Fault hook for tests, process-wide: the n-th read (write) from now and all after it fail with EIO (ENOSPC).
 * 0 switches it off. */
void strl_file_fail_reads_after(uint64_t n);
void strl_file_fail_writes_after(uint64_t n);

#endif
