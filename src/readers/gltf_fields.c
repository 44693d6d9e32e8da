#include "readers/gltf_fields.h"

#include <inttypes.h>
#include <stdio.h>

#include "base/fail.h"
#include "readers/gltf_json.h"

void strl__fields_fail(strl__fields *fields, const char *key, const char *expected)
{
    char index[24] = "";
    if (fields->status)
        return;
    if (fields->index != STRL__JSON_WHOLE)
        snprintf(index, sizeof index, "[%" PRIu64 "]", fields->index);
    fields->status = strl__fail(fields->err, STRL_ERR_FORMAT, "%s, %s%s%s%s: expected %s", fields->path, fields->member,
                                index, *key ? "." : "", key, expected);
}

/* What was found in place of what was expected. */
static void fail_kind(strl__fields *fields, const char *key, const char *expected, const json_t *found)
{
    char sentence[120];
    const char *kind = json_is_object(found)    ? "an object"
                       : json_is_array(found)   ? "a list"
                       : json_is_string(found)  ? "a text"
                       : json_is_real(found)    ? "a number"
                       : json_is_boolean(found) ? "true or false"
                                                : "null";
    if (json_is_integer(found))
        snprintf(sentence, sizeof sentence, "%s, found %" JSON_INTEGER_FORMAT, expected, json_integer_value(found));
    else
        snprintf(sentence, sizeof sentence, "%s, found %s", expected, kind);
    strl__fields_fail(fields, key, sentence);
}

/* The member; fails where the object is none. */
static const json_t *member_of(strl__fields *fields, const json_t *object, const char *key)
{
    if (fields->status || !object)
        return NULL;
    if (!json_is_object(object)) {
        fail_kind(fields, "", "an object", object);
        return NULL;
    }
    return json_object_get(object, key);
}

void strl__fields_require(strl__fields *fields, const json_t *object, const char *key)
{
    if (!member_of(fields, object, key))
        strl__fields_fail(fields, key, "a value, found none");
}

static const double largest_count = 9007199254740992.; /* up to which doubles count by ones */

/* Some programs write 3.0 for 3. */
static bool is_count(const json_t *value, uint64_t *count)
{
    double number = json_is_real(value) ? json_real_value(value) : -1;
    *count = 0;
    if (json_is_integer(value) && json_integer_value(value) >= 0)
        *count = (uint64_t)json_integer_value(value);
    else if (number >= 0 && number <= largest_count && number == (double)(uint64_t)number)
        *count = (uint64_t)number;
    else
        return false;
    return true;
}

uint64_t strl__fields_count(strl__fields *fields, const json_t *object, const char *key, uint64_t absent)
{
    const json_t *value = member_of(fields, object, key);
    uint64_t count;
    if (!value)
        return absent;
    if (is_count(value, &count))
        return count;
    fail_kind(fields, key, "a whole number that is not negative", value);
    return absent;
}

static uint32_t to_index(strl__fields *fields, const json_t *value, const char *key)
{
    uint64_t count;
    if (is_count(value, &count) && count < STRL__NO_ITEM)
        return (uint32_t)count;
    fail_kind(fields, key, "an index", value);
    return STRL__NO_ITEM;
}

uint32_t strl__fields_index(strl__fields *fields, const json_t *object, const char *key)
{
    const json_t *value = member_of(fields, object, key);
    return value ? to_index(fields, value, key) : STRL__NO_ITEM;
}

uint32_t strl__fields_list_index(strl__fields *fields, const json_t *list, size_t at, const char *key)
{
    return to_index(fields, json_array_get(list, at), key);
}

double strl__fields_number(strl__fields *fields, const json_t *object, const char *key, double absent)
{
    const json_t *value = member_of(fields, object, key);
    if (value && !json_is_number(value))
        fail_kind(fields, key, "a number", value);
    return json_is_number(value) ? json_number_value(value) : absent;
}

bool strl__fields_bool(strl__fields *fields, const json_t *object, const char *key)
{
    const json_t *value = member_of(fields, object, key);
    if (value && !json_is_boolean(value))
        fail_kind(fields, key, "true or false", value);
    return json_is_true(value);
}

bool strl__fields_numbers(strl__fields *fields, const json_t *object, const char *key, double *numbers, unsigned count)
{
    const json_t *list = strl__fields_list(fields, object, key);
    bool good = json_array_size(list) == count;
    char expected[32];
    for (unsigned i = 0; list && good && i < count; i++)
        good = json_is_number(json_array_get(list, i));
    snprintf(expected, sizeof expected, "%u numbers", count);
    if (list && !good)
        strl__fields_fail(fields, key, expected);
    for (unsigned i = 0; list && good && i < count; i++)
        numbers[i] = json_number_value(json_array_get(list, i));
    return list && good;
}

const char *strl__fields_text(strl__fields *fields, const json_t *object, const char *key)
{
    const json_t *value = member_of(fields, object, key);
    if (value && !json_is_string(value))
        fail_kind(fields, key, "a text", value);
    return json_string_value(value);
}

const json_t *strl__fields_object(strl__fields *fields, const json_t *object, const char *key)
{
    const json_t *value = member_of(fields, object, key);
    if (value && !json_is_object(value))
        fail_kind(fields, key, "an object", value);
    return json_is_object(value) ? value : NULL;
}

const json_t *strl__fields_list(strl__fields *fields, const json_t *object, const char *key)
{
    const json_t *value = member_of(fields, object, key);
    if (value && !json_is_array(value))
        fail_kind(fields, key, "a list", value);
    return json_is_array(value) ? value : NULL;
}

const json_t *strl__fields_extension(strl__fields *fields, const json_t *object, const char *name)
{
    const json_t *extensions = strl__fields_object(fields, object, "extensions");
    return extensions ? strl__fields_object(fields, extensions, name) : NULL;
}
