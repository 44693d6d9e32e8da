#include "source/cache_entry.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/cursor.h"
#include "base/hash.h"

#define MODEL_HEAD_BYTES 4096u
#define PART_CHARACTERS 8u

const uint8_t strl__cache_signature[STRL__CACHE_SIGNATURE_BYTES] = "stroll cache 1\n";

void strl__cache_model(const void *head, size_t size, uint64_t total, uint8_t model[16])
{
    uint8_t bytes[MODEL_HEAD_BYTES + 8] = {0};
    memcpy(bytes, head, size < MODEL_HEAD_BYTES ? size : MODEL_HEAD_BYTES);
    strl__store_le(bytes + MODEL_HEAD_BYTES, 8, total);
    strl__digest(bytes, sizeof bytes, model);
}

void strl__cache_entry_name(const strl__cache_key *key, char name[STRL__CACHE_NAME_BYTES])
{
    char model[33];
    for (unsigned i = 0; i < 16; i++)
        snprintf(model + 2 * i, 3, "%02x", key->model[i]);
    snprintf(name, STRL__CACHE_NAME_BYTES, "stroll-%s-%016" PRIx64 "-%08" PRIx32 ".page", model, key->offset,
             key->size);
}

/* Lower-case digits; NULL where there are others. */
static const char *take_hex(const char *at, unsigned digits, uint64_t *value)
{
    *value = 0;
    for (unsigned i = 0; i < digits; i++, at++) {
        if (!((*at >= '0' && *at <= '9') || (*at >= 'a' && *at <= 'f')))
            return NULL;
        *value = *value << 4 | (uint64_t)(*at <= '9' ? *at - '0' : *at - 'a' + 10);
    }
    return at;
}

static const char *take_word(const char *at, const char *word)
{
    size_t length = strlen(word);
    return at && strncmp(at, word, length) == 0 ? at + length : NULL;
}

static const char *take_key(const char *at, strl__cache_key *key)
{
    uint64_t value = 0;
    for (unsigned i = 0; at && i < 16; i++) {
        at = take_hex(at, 2, &value);
        key->model[i] = (uint8_t)value;
    }
    at = take_word(at, "-");
    at = at ? take_hex(at, 16, &key->offset) : NULL;
    at = take_word(at, "-");
    at = at ? take_hex(at, 8, &value) : NULL;
    key->size = (uint32_t)value;
    return at;
}

static bool is_part_ending(const char *at)
{
    if (*at++ != '.')
        return false;
    for (unsigned i = 0; i < PART_CHARACTERS; i++, at++)
        if (!((*at >= '0' && *at <= '9') || (*at >= 'a' && *at <= 'z')))
            return false;
    return strcmp(at, ".part") == 0;
}

strl__cache_name strl__cache_parse_name(const char *name, strl__cache_key *key)
{
    strl__cache_key found;
    const char *at = take_word(name, "stroll-");
    at = at ? take_key(at, &found) : NULL;
    at = take_word(at, ".page");
    if (!at || (*at && !is_part_ending(at)))
        return STRL__CACHE_FOREIGN;
    if (key)
        *key = found;
    return *at ? STRL__CACHE_PART : STRL__CACHE_ENTRY;
}

void strl__cache_entry_head(const strl__cache_key *key, const void *data, uint8_t head[STRL__CACHE_HEAD_BYTES])
{
    memset(head, 0, STRL__CACHE_HEAD_BYTES);
    memcpy(head, strl__cache_signature, STRL__CACHE_SIGNATURE_BYTES);
    memcpy(head + 16, key->model, 16);
    strl__store_le(head + 32, 8, key->offset);
    strl__store_le(head + 40, 8, key->size);
    strl__store_le(head + 48, 8, strl__checksum(data, key->size));
}

bool strl__cache_entry_check(const strl__cache_key *key, const uint8_t head[STRL__CACHE_HEAD_BYTES], const void *data)
{
    uint8_t expected[STRL__CACHE_HEAD_BYTES];
    strl__cache_entry_head(key, data, expected);
    return memcmp(head, expected, sizeof expected) == 0;
}
