/* Spill streams: append-only files in a scratch folder, for what does not fit into a build's memory. A set counts the
 * bytes its streams hold on disk, now and at most, and keeps them under a limit.
 *
 * One thread at a time appends to a stream and closes it; any number may read flushed bytes meanwhile. Different
 * streams of one set may be used by different threads. A stream holds one file descriptor as long as it is open. */
#ifndef STRL_STORE_SPILL_H
#define STRL_STORE_SPILL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/cursor.h"
#include "stroll/error.h"

typedef struct strl_spill_set strl_spill_set;
typedef struct strl_spill strl_spill;

/* directory: an existing folder, left to its owner to lock and remove. limit_bytes: on disk at once; 0 = no limit. */
strl_status strl_spill_set_create(const char *directory, uint64_t limit_bytes, strl_spill_set **set, strl_error *err);
/* Closes streams that are still open, without flushing, and leaves the files. NULL is legal. */
void strl_spill_set_destroy(strl_spill_set *set);
uint64_t strl_spill_set_bytes(strl_spill_set *set);      /* on disk now, over all streams */
uint64_t strl_spill_set_peak_bytes(strl_spill_set *set); /* the most there ever were */

/* The files of all streams end in this, which tells them from others in their folder. */
#define STRL_SPILL_SUFFIX ".spill"

/* An empty stream in the file `name`.spill of the set's folder; a file left there by an earlier run is overwritten, a
 * name that is open in this set is refused. buffer_bytes: 0 = 256 KiB; the buffer exists from the first append to the
 * next flush. */
strl_status strl_spill_open(strl_spill_set *set, const char *name, size_t buffer_bytes, strl_spill **spill,
                            strl_error *err);
/* On failure nothing has been appended, and the stream can be used on: STRL_ERR_DISK_FULL where the disk is full,
 * STRL_ERR_LIMIT where the set's limit would be passed. A failure of bytes still in the buffer shows at a later
 * call. */
strl_status strl_spill_append(strl_spill *spill, const void *data, size_t size, strl_error *err);
/* Writes what is buffered and releases the buffer. */
strl_status strl_spill_flush(strl_spill *spill, strl_error *err);
/* Appended so far, buffered bytes included; for the appending thread. */
uint64_t strl_spill_bytes(const strl_spill *spill);

/* Exactly size bytes at offset, all of them flushed and not dropped, or failure. */
strl_status strl_spill_read(strl_spill *spill, uint64_t offset, void *data, size_t size, strl_error *err);
/* Promises that these bytes, flushed ones, will not be read again, by a later run of the program
 * neither; to be said once of a byte. Whole 16 KiB steps of such bytes are given back to the disk,
 * and to the count, where the file system can do that. One thread at a time; others may read other
 * bytes meanwhile. */
void strl_spill_drop(strl_spill *spill, uint64_t offset, uint64_t size);

/* The stream is closed in any case; failure means that its file is still there, and counted. NULL is legal. */
strl_status strl_spill_close_and_delete(strl_spill *spill, strl_error *err);

/* ---- streams that a later run of the program can go on with ----
 *
 * open_kept, append, drop -> set_save -> (the saved words are put where the later run finds them) -> set_settle ->
 * append ... later run: set_restore -> set_check -> take -> read, append ...
 *
 * What is dropped or deleted of a kept stream stays on disk until a save that does not need it is in place; what was
 * appended since the last save is lost with the run. Of each 16 KiB step there is a checksum, 8 bytes in memory and in
 * the save. All of it on the thread that appends. */
strl_status strl_spill_open_kept(strl_spill_set *set, const char *name, size_t buffer_bytes, strl_spill **spill,
                                 strl_error *err);
/* Flushes all open kept streams and appends to writer what restore needs of them. */
strl_status strl_spill_set_save(strl_spill_set *set, strl_writer *writer, strl_error *err);
/* The last save is in place: gives back to the disk what it does not need. */
void strl_spill_set_settle(strl_spill_set *set);
/* Opens the streams of a save, each cut to what it had then, and passes over the save's words. The set is new. */
strl_status strl_spill_set_restore(strl_spill_set *set, strl_cursor *saved, strl_error *err);
/* Reads all bytes that restored streams may be asked for and compares their checksums. report: called every few
 * MiB; its failure ends the check; may be NULL. */
strl_status strl_spill_set_check(strl_spill_set *set,
                                 strl_status (*report)(void *context, uint64_t done, uint64_t total, strl_error *err),
                                 void *context, strl_error *err);
/* The restored stream of that name, once. */
strl_status strl_spill_take(strl_spill_set *set, const char *name, strl_spill **spill, strl_error *err);
/* Whether a file of this name in the folder is that of an open stream. */
bool strl_spill_set_uses(strl_spill_set *set, const char *file);
/* The file of a kept stream stays, that of another is deleted. NULL is legal. */
void strl_spill_close(strl_spill *spill);

#endif
