/* One entry of the cache on disk: its name and its bytes. Pure; what comes from the disk is hostile until checked.
 *
 *     name    stroll-MODEL-OFFSET-SIZE.page, in hex: 32, 16 and 8 digits; while it is written with .XXXXXXXX.part
 *     bytes   signature[16] model[16] offset:u64 size:u64 checksum:u64 0:u64, little-endian, then `size` bytes of
 *             the model, of which checksum is the XXH3 */
#ifndef STRL_SOURCE_CACHE_ENTRY_H
#define STRL_SOURCE_CACHE_ENTRY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define STRL__CACHE_HEAD_BYTES 64u
#define STRL__CACHE_SIGNATURE_BYTES 16u
#define STRL__CACHE_NAME_BYTES 72u /* with the zero, without .part */

/* Which bytes of which model. */
typedef struct strl__cache_key {
    uint8_t model[16];
    uint64_t offset;
    uint32_t size;
} strl__cache_key;

typedef enum strl__cache_name {
    STRL__CACHE_FOREIGN, /* not a name of ours */
    STRL__CACHE_ENTRY,
    STRL__CACHE_PART /* on its way to become an entry, or left behind by a kill */
} strl__cache_name;

extern const uint8_t strl__cache_signature[STRL__CACHE_SIGNATURE_BYTES];

/* The model of which these are the first bytes, `size` of them, and `total` in all. */
void strl__cache_model(const void *head, size_t size, uint64_t total, uint8_t model[16]);
void strl__cache_entry_name(const strl__cache_key *key, char name[STRL__CACHE_NAME_BYTES]);
/* key may be NULL. */
strl__cache_name strl__cache_parse_name(const char *name, strl__cache_key *key);
void strl__cache_entry_head(const strl__cache_key *key, const void *data, uint8_t head[STRL__CACHE_HEAD_BYTES]);
/* Whether head and the key->size bytes behind it are this entry, whole. */
bool strl__cache_entry_check(const strl__cache_key *key, const uint8_t head[STRL__CACHE_HEAD_BYTES], const void *data);

#endif
