/* Decimal numbers in text: correctly rounded, independent of the locale, allocation-free. */
#ifndef STRL_READERS_NUMBER_H
#define STRL_READERS_NUMBER_H

#include <stdint.h>

/* Reads the number that starts at `at`: [+-] digits [. digits] [e [+-] digits], nan, inf, and the
 * forms that old Microsoft runtimes print (1.#QNAN, -1.#IND, 1.#INF). Returns the first character
 * after it, or NULL where there is no number. Some character after the number must be readable and
 * must not belong to it (a zero, for instance). Thread-safe. */
const char *strl__number_parse(const char *at, double *value);

/* Reads [+-] digits. NULL where there are none or where the value does not fit. Same demand on the
 * end. Thread-safe. */
const char *strl__integer_parse(const char *at, int64_t *value);

#endif
