/* Where a container's bytes come from: a file, memory, or callbacks of yours. A walk and a container own
 * the source that they are opened with. They check every byte before they use it, so a source may be wrong,
 * late or hostile. */
#ifndef STROLL_SOURCE_H
#define STROLL_SOURCE_H

#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_source strl_source;

/* A regular file, UTF-8 path (copied). It is read by `threads` threads of the source's own, so that no
 * frame waits for a disk; 0: reads happen inside strl_walk_frame, one or more a frame. The file must not
 * change while it is open: what changed is recognised by its checksum and not drawn. Fails with
 * STRL_ERR_IO. */
STRL_API strl_status strl_source_open_file(const char *path, unsigned threads, strl_source **source, strl_error *err);

/* Bytes in memory, borrowed for the life of the source; they must not change. data may be NULL where size is 0. */
STRL_API strl_status strl_source_open_memory(const void *data, size_t size, strl_source **source, strl_error *err);

/* A source of your own: an archive, a data base, a network. Zero-initialise. */
typedef struct strl_source_callbacks {
    const char *name; /* for error sentences, "models/hall.stroll in pack.zip"; copied; NULL = none */
    uint64_t bytes;   /* size of the whole container */
    void *context;    /* handed to the callbacks; the library does not touch it */
    /* Fills data with exactly the `size` bytes from `offset`; the range lies within `bytes`. May wait.
     * Returns STRL_OK, or a failure whose sentence it has written (strl_error_set): that part of the model
     * stays coarse and is asked for again later. Called by the source's threads and, while a container is
     * opened and by its waiting calls, by the caller's thread, all at the same time: it must be thread-safe
     * where `threads` is not 0. It must not call back into the walk. */
    strl_status (*read)(void *context, uint64_t offset, void *data, size_t size, strl_error *err);
    /* Called once, on the thread that closes the source, when no read is under way any more. NULL is legal. */
    void (*close)(void *context);
} strl_source_callbacks;

/* `callbacks` is copied. threads as of strl_source_open_file. On failure close is not called. Fails with
 * STRL_ERR_ARGUMENT where there is no read. */
STRL_API strl_status strl_source_open_callbacks(const strl_source_callbacks *callbacks, unsigned threads, strl_source **source,
                                                strl_error *err);

/* For a source that was handed to nothing: whoever was opened with it closes it. NULL is legal. Waits for
 * reads under way. */
STRL_API void strl_source_close(strl_source *source);

#ifdef __cplusplus
}
#endif
#endif
