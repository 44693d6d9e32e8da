/* What a server's answer and the cache's folder may say: lines of a header with the verdict on them, names and
 * bytes of cache entries. The first byte chooses. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "source/cache_entry.h"
#include "source/http_answer.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check(bool holds)
{
    if (!holds)
        abort();
}

static void check_identity(const strl__http_identity *identity)
{
    size_t length = strnlen(identity->etag, sizeof identity->etag);
    check(length < sizeof identity->etag &&
          strnlen(identity->modified, sizeof identity->modified) < sizeof identity->modified);
    check(length == 0 || (length >= 2 && identity->etag[0] == '"' && identity->etag[length - 1] == '"'));
    for (size_t i = 0; i < length; i++) /* it goes into the next request's header */
        check((unsigned char)identity->etag[i] > 0x20 && identity->etag[i] != 0x7f);
    for (const char *at = identity->modified; *at; at++)
        check(*at >= 0x20 && *at < 0x7f);
}

static void check_answer(const char *text, size_t size)
{
    const strl__http_asked asked = {.first = 100, .last = 199, .identity = {.total = 1000, .etag = "\"a\""}};
    const strl__http_asked opening = {.last = 4095, .opening = true};
    strl__http_fields fields = {0};
    for (size_t at = 0; at < size;) {
        const char *end = memchr(text + at, '\n', size - at);
        size_t line = end ? (size_t)(end - (text + at)) + 1 : size - at;
        strl__http_fields_line(&fields, text + at, line);
        at += line;
    }
    check_identity(&fields.identity);
    check(!fields.range_known || (fields.first <= fields.last && fields.last < fields.identity.total));
    check(strnlen(fields.encoding, sizeof fields.encoding) < sizeof fields.encoding);
    strl_error err = {0};
    bool good = strl__http_judge(&asked, &fields, &err) == STRL__HTTP_GOOD;
    check(good == !err.message[0]);
    check(!good || (fields.first == 100 && fields.last == 199 && fields.identity.total == 1000));
    err.message[0] = 0;
    good = strl__http_judge(&opening, &fields, &err) == STRL__HTTP_GOOD;
    check(good == !err.message[0]);
    check(!good || (fields.first == 0 && fields.last < 4096 && fields.identity.total > fields.last));
}

static void check_name(const char *text, size_t size)
{
    char name[256], again[STRL__CACHE_NAME_BYTES];
    strl__cache_key key;
    if (size >= sizeof name)
        return;
    memcpy(name, text, size);
    name[size] = 0;
    strl__cache_name kind = strl__cache_parse_name(name, &key);
    if (kind == STRL__CACHE_FOREIGN)
        return;
    strl__cache_entry_name(&key, again);
    check(strncmp(name, again, strlen(again)) == 0);
    check((kind == STRL__CACHE_ENTRY) == (strlen(name) == strlen(again)));
}

static uint64_t number_at(const uint8_t *bytes)
{
    uint64_t value = 0;
    for (unsigned i = 8; i-- > 0;)
        value = value << 8 | bytes[i];
    return value;
}

/* An entry that is taken says what it is, by its layout; the one that is written is taken, and not with any bit of it
 * another. */
static void check_entry(const uint8_t *data, size_t size)
{
    strl__cache_key key = {.offset = 0x1234};
    uint8_t head[STRL__CACHE_HEAD_BYTES];
    if (size < sizeof head)
        return;
    const uint8_t *content = data + sizeof head;
    key.size = (uint32_t)(size - sizeof head);
    memcpy(key.model, data + 16, sizeof key.model);
    if (strl__cache_entry_check(&key, data, content))
        check(memcmp(data, "stroll cache 1\n", 16) == 0 && number_at(data + 32) == 0x1234 &&
              number_at(data + 40) == size - sizeof head && number_at(data + 56) == 0);
    strl__cache_entry_head(&key, content, head);
    check(memcmp(head + 16, data + 16, 16) == 0 && number_at(head + 32) == 0x1234);
    check(strl__cache_entry_check(&key, head, content));
    head[data[0] % sizeof head] ^= (uint8_t)(1u << data[1] % 8);
    check(!strl__cache_entry_check(&key, head, content));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size == 0)
        return 0;
    if (data[0] % 4 < 2)
        check_answer((const char *)data + 1, size - 1);
    else if (data[0] % 4 == 2)
        check_name((const char *)data + 1, size - 1);
    else
        check_entry(data + 1, size - 1);
    return 0;
}
