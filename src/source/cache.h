/* Bytes of models on disk, one file an entry, for another time and for other processes. Nothing here is a failure: what
 * cannot be read is a miss, what cannot be written is not kept. Only files of ours are ever removed, which their
 * name and their signature tell. One thread at a time; several caches, also of other processes, may be over one
 * folder. */
#ifndef STRL_SOURCE_CACHE_H
#define STRL_SOURCE_CACHE_H

#include "source/cache_entry.h"
#include "stroll/error.h"

typedef struct strl__cache strl__cache;

/* Makes the folder where it is missing. most_bytes: what our files in it may take. Each process holds to that by
 * what it has last counted: several may together pass it for a while, each by a sixteenth at most. */
strl_status strl__cache_open(const char *folder, uint64_t most_bytes, strl__cache **cache, strl_error *err);
void strl__cache_close(strl__cache *cache); /* NULL is legal */

/* Counts what is there; what is beyond the cap goes. put does the same now and then. */
void strl__cache_trim(strl__cache *cache);
/* A small step of that, for who must not be kept waiting; false when it is done. The next call begins anew. */
bool strl__cache_trim_step(strl__cache *cache);
/* A step of what put would do before it writes so many bytes; false when nothing is left of that. */
bool strl__cache_room_step(strl__cache *cache, uint32_t size);
/* Fills key->size bytes. An entry that is not whole is removed. */
bool strl__cache_get(strl__cache *cache, const strl__cache_key *key, void *data);
/* After the first write that fails (full disk, folder that cannot be written), and where the folder cannot be brought
 * below the cap, nothing is written any more. */
void strl__cache_put(strl__cache *cache, const strl__cache_key *key, const void *data);
void strl__cache_drop(strl__cache *cache, const strl__cache_key *key);

#endif
