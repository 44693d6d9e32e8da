/* Where findings go: for each kind of check how many things were looked at, how many failed, and the sentence
 * of the failure with the lowest key, so that the report does not depend on the threads. */
#ifndef STRL_VERIFY_CHECKS_H
#define STRL_VERIFY_CHECKS_H

#include <stdatomic.h>

#include "platform/thread.h"
#include "verify/verify.h"

typedef struct strl__checks {
    _Atomic uint64_t count[STRL_VERIFY_KINDS];
    strl_mutex mutex; /* guards what follows */
    uint64_t failures[STRL_VERIFY_KINDS];
    uint64_t first_key[STRL_VERIFY_KINDS];
    char first[STRL_VERIFY_KINDS][480];
} strl__checks;

void strl__v_checks_init(strl__checks *checks);
void strl__v_checks_deinit(strl__checks *checks);
/* So many more things were looked at. Thread-safe. */
void strl__v_checked(strl__checks *checks, strl_verify_kind kind, uint64_t count);
/* One of them is wrong. key: its place, for instance a node's id. Thread-safe. */
void strl__v_flaw(strl__checks *checks, strl_verify_kind kind, uint64_t key, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
bool strl__v_flawed(strl__checks *checks, strl_verify_kind kind);
void strl__v_checks_report(strl__checks *checks, strl_verify_report *report);

#endif
