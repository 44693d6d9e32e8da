#include "readers/names.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define NAME_OVERHEAD_BYTES 32u /* about what the heap adds to a block */

void strl__names_init(strl__names *names, size_t limit_bytes, const char *advice)
{
    *names = (strl__names){.limit_bytes = limit_bytes, .advice = advice};
}

void strl__names_deinit(strl__names *names)
{
    for (size_t i = 0; i < names->count; i++)
        strl__free(names->items[i].text);
    strl__free(names->items);
    strl__free(names->slots);
    *names = (strl__names){0};
}

size_t strl__utf8_sequence(const unsigned char *text, size_t left)
{
    unsigned char lead = text[0];
    if (lead < 0x80)
        return 1;
    size_t bytes = lead >= 0xc2 && lead < 0xe0   ? 2
                   : lead >= 0xe0 && lead < 0xf0 ? 3
                   : lead >= 0xf0 && lead < 0xf5 ? 4
                                                 : 0;
    if (bytes == 0 || bytes > left)
        return 0;
    for (size_t i = 1; i < bytes; i++)
        if ((text[i] & 0xc0) != 0x80)
            return 0;
    bool overlong = (lead == 0xe0 && text[1] < 0xa0) || (lead == 0xf0 && text[1] < 0x90);
    bool surrogate = lead == 0xed && text[1] >= 0xa0;
    bool beyond = lead == 0xf4 && text[1] >= 0x90;
    return overlong || surrogate || beyond ? 0 : bytes;
}

/* Control characters become spaces, so that a name is one line wherever it is printed. */
static size_t clean(const char *text, size_t length, char out[STRL__NAME_BYTES_MAX + 1])
{
    const unsigned char *bytes = (const unsigned char *)text;
    size_t used = 0;
    for (size_t i = 0; i < length;) {
        size_t sequence = strl__utf8_sequence(bytes + i, length - i);
        if (used + (sequence ? sequence : 2) > STRL__NAME_BYTES_MAX)
            break;
        if (sequence == 0) {
            out[used++] = (char)(0xc0 | bytes[i] >> 6);
            out[used++] = (char)(0x80 | (bytes[i] & 0x3f));
        } else if (sequence == 1) {
            out[used++] = bytes[i] < 0x20 || bytes[i] == 0x7f ? ' ' : (char)bytes[i];
        } else {
            memcpy(out + used, bytes + i, sequence);
            used += sequence;
        }
        i += sequence ? sequence : 1;
    }
    out[used] = 0;
    return used;
}

static uint32_t find_clean(const strl__names *names, const char *text, size_t length)
{
    if (names->slot_count == 0)
        return UINT32_MAX;
    size_t slot = (size_t)strl__checksum(text, length) & (names->slot_count - 1);
    for (; names->slots[slot]; slot = (slot + 1) & (names->slot_count - 1))
        if (strcmp(names->items[names->slots[slot] - 1].text, text) == 0)
            return names->slots[slot] - 1;
    return UINT32_MAX;
}

uint32_t strl__names_find(const strl__names *names, const char *text, size_t length)
{
    char cleaned[STRL__NAME_BYTES_MAX + 1];
    return find_clean(names, cleaned, clean(text, length, cleaned));
}

static void fill_slot(strl__names *names, uint32_t index)
{
    const char *text = names->items[index].text;
    size_t slot = (size_t)strl__checksum(text, strlen(text)) & (names->slot_count - 1);
    while (names->slots[slot])
        slot = (slot + 1) & (names->slot_count - 1);
    names->slots[slot] = index + 1;
}

static bool grow_slots(strl__names *names)
{
    if (2 * (names->count + 1) <= names->slot_count)
        return true;
    size_t wanted = names->slot_count ? 2 * names->slot_count : 64;
    uint32_t *slots = strl__alloc_zero(wanted, sizeof *slots);
    if (!slots)
        return false;
    strl__free(names->slots);
    names->slots = slots;
    names->slot_count = wanted;
    for (size_t i = 0; i < names->count; i++)
        fill_slot(names, (uint32_t)i);
    return true;
}

strl_status strl__names_add(strl__names *names, const char *text, size_t length, uint32_t *index, strl_error *err)
{
    char cleaned[STRL__NAME_BYTES_MAX + 1];
    size_t used = clean(text, length, cleaned);
    *index = find_clean(names, cleaned, used);
    if (*index != UINT32_MAX)
        return STRL_OK;
    size_t held = names->text_bytes + used + 2 * names->capacity * sizeof *names->items +
                  3 * names->slot_count * sizeof *names->slots;
    if (held > names->limit_bytes || names->count >= UINT32_MAX - 1)
        return strl__fail(err, STRL_ERR_LIMIT, "expected at most %zu bytes of names, found more than %zu names: %s",
                          names->limit_bytes, names->count, names->advice);
    if (!strl__grow(&names->items, &names->capacity, names->count + 1, sizeof *names->items) || !grow_slots(names))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu names", names->count + 1);
    char *copy = strl__strdup(cleaned);
    if (!copy)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a name of %zu bytes", used);
    names->text_bytes += used + NAME_OVERHEAD_BYTES;
    names->items[names->count] = (strl__name){.text = copy,
                                              .rgba = 0xffffffffu,
                                              .texture = UINT32_MAX,
                                              .least = {INFINITY, INFINITY},
                                              .most = {-INFINITY, -INFINITY}};
    fill_slot(names, (uint32_t)names->count);
    *index = (uint32_t)names->count++;
    return STRL_OK;
}
