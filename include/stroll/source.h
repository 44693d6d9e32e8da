/* Where a container's bytes come from: a file, memory, a web server, or callbacks of yours. A walk and a
 * container own the source that they are opened with. They check every byte before they use it, so a source
 * may be wrong, late or hostile. */
#ifndef STROLL_SOURCE_H
#define STROLL_SOURCE_H

#include <stdbool.h>
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
STRL_API strl_status strl_source_open_callbacks(const strl_source_callbacks *callbacks, unsigned threads,
                                                strl_source **source, strl_error *err);

/* How to reach a model behind an address. Zero-initialise: every 0 takes its default. */
typedef struct strl_http_desc {
    /* a folder that keeps what was read, for another time and for other processes; made where it is missing, but not
     * the folders above it; copied; NULL = nothing is kept */
    const char *cache;
    uint64_t cache_bytes; /* that our files in it take at most; 0 = 1 GiB */
    /* a file of PEM: who may vouch for a server of https, nobody else; copied; NULL = whom libcurl was built to trust
     */
    const char *certificates;
    uint32_t connections; /* at a time, at most; 0 = 6; at most 32 */
    uint32_t attempts;    /* at a read, the first included, before it has failed; 0 = 4 */
    uint32_t connect_ms;  /* until a connection is given up; 0 = 10000 */
    /* a transfer that brings less than 1 KiB in this time is given up; sooner where a later request was answered and
     * this is not its last attempt; 0 = 15000 */
    uint32_t stall_ms;
    uint32_t backoff_ms; /* about the wait before the second attempt; it doubles with each; 0 = 250 */
} strl_http_desc;

/* A file on any web server that answers byte ranges: http:// or https://, redirects within these followed. desc may
 * be NULL. Reads on threads of its own: one for the network, one for the cache. Reads that wait are taken by urgency,
 * those near to each other as one request; what fails is tried again, then answered with STRL_ERR_NETWORK. Waits for
 * the server's first answer. The model must not change while it is open: from the answer on that tells of it, each read
 * fails with a sentence that says so. A cache that cannot be used is done without. Proxies are libcurl's, which reads
 * http_proxy, https_proxy and no_proxy from the environment; HTTP/2 is spoken over https where the server does. Fails
 * with STRL_ERR_ARGUMENT where it is no such address, with STRL_ERR_NETWORK where the server is not reached or does not
 * give ranges of the file. */
STRL_API strl_status strl_source_open_http(const char *url, const strl_http_desc *desc, strl_source **source,
                                           strl_error *err);

/* What a remote source has done since it was opened. */
typedef struct strl_network_stats {
    /* sent, the repeated ones included, and those that look whether the server answers again */
    uint64_t requests;
    uint64_t reads;        /* answered with bytes from the network */
    uint64_t merged_reads; /* of them: shared a request with others */
    uint64_t retries;      /* requests whose failure was tried again */
    uint64_t failures;     /* reads that failed for good; they may be asked for anew */
    uint64_t bytes;        /* of content received, gaps between merged reads included */
    uint64_t cache_hits;   /* reads answered from the cache */
    uint64_t cache_bytes;  /* of these */
    /* from a request to the first byte of its answer, about the least of late; 0 = not known yet */
    uint64_t latency_ns;
    double bytes_per_second; /* while bytes were coming, smoothed; 0 = not known yet */
} strl_network_stats;

/* False, and zeros, where the source is not remote. Legal on any thread until the source, or what owns it, is closed.
 */
STRL_API bool strl_source_get_network_stats(const strl_source *source, strl_network_stats *stats);

/* For a source that was handed to nothing: whoever was opened with it closes it. NULL is legal. Waits for
 * reads under way. */
STRL_API void strl_source_close(strl_source *source);

#ifdef __cplusplus
}
#endif
#endif
