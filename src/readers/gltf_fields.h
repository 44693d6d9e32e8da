/* Typed members of a JSON object with sticky failure: a parser reads them all and checks once. */
#ifndef STRL_READERS_GLTF_FIELDS_H
#define STRL_READERS_GLTF_FIELDS_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"

#define STRL__NO_ITEM UINT32_MAX /* no index was given */

typedef struct strl__fields {
    const char *path;   /* of the file; borrowed */
    const char *member; /* of the file's JSON, and the index in it: for sentences */
    uint64_t index;
    strl_error *err;
    strl_status status; /* the first failure; then all that is read is the value for absence */
} strl__fields;

/* A sentence "PATH, MEMBER[INDEX].key: expected WHAT". */
void strl__fields_fail(strl__fields *fields, const char *key, const char *expected);
/* Fails where a member is absent. */
void strl__fields_require(strl__fields *fields, const json_t *object, const char *key);

/* Each of these gives `absent` (NULL, STRL__NO_ITEM, false) where there is no such member. */
uint64_t strl__fields_count(strl__fields *fields, const json_t *object, const char *key, uint64_t absent);
uint32_t strl__fields_index(strl__fields *fields, const json_t *object, const char *key);
double strl__fields_number(strl__fields *fields, const json_t *object, const char *key, double absent);
bool strl__fields_bool(strl__fields *fields, const json_t *object, const char *key);
/* Exactly `count` numbers; false where they are absent, and `numbers` is left as it is. */
bool strl__fields_numbers(strl__fields *fields, const json_t *object, const char *key, double *numbers, unsigned count);
const char *strl__fields_text(strl__fields *fields, const json_t *object, const char *key);
const json_t *strl__fields_object(strl__fields *fields, const json_t *object, const char *key);
const json_t *strl__fields_list(strl__fields *fields, const json_t *object, const char *key);
/* Of extensions; NULL where the object has not this one. */
const json_t *strl__fields_extension(strl__fields *fields, const json_t *object, const char *name);
/* An element of a list as an index. */
uint32_t strl__fields_list_index(strl__fields *fields, const json_t *list, size_t at, const char *key);

#endif
