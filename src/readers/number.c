/* Reading decimal numbers. Three roads, each correctly rounded:
 *  - up to 2^53 and a power of ten up to 10^22, both exact as doubles: one division or product
 * (Clinger 1990, "How to read floating point numbers accurately");
 *  - up to 19 digits and powers up to 10^27: the exact quotient or product in 128-bit integers,
 * rounded once;
 *  - all else: the C library's strtod in the "C" locale, after the syntax was checked here. */
#include "readers/number.h"

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define DIGITS_MAX 19       /* the longest run of digits that always fits 64 bits */
#define EXACT_POWER_MAX 22  /* 10^22 is the last power of ten that is a double */
#define WIDE_POWER_MAX 27   /* 5^27 is the last power of five that fits 63 bits */
#define EXPONENT_CAP 100000 /* beyond any double; keeps the sum of exponents inside int */

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static double power_of_two(int exponent)
{
    uint64_t bits = (uint64_t)(exponent + 1023) << 52;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* (wide + a little, if sticky) * 2^exponent, rounded to nearest even. wide > 0; the result is a
 * normal double. */
static double round_wide(unsigned __int128 wide, bool sticky, int exponent)
{
    uint64_t high = (uint64_t)(wide >> 64);
    int bits = high ? 128 - __builtin_clzll(high) : 64 - __builtin_clzll((uint64_t)wide);
    if (bits <= 53)
        return (double)(uint64_t)wide * power_of_two(exponent); /* callers keep sticky out of this case */
    int shift = bits - 53;
    uint64_t mantissa = (uint64_t)(wide >> shift);
    unsigned __int128 rest = wide & (((unsigned __int128)1 << shift) - 1);
    unsigned __int128 half = (unsigned __int128)1 << (shift - 1);
    if (rest > half || (rest == half && (sticky || (mantissa & 1))))
        mantissa++; /* at most 2^53, still exact */
    return (double)mantissa * power_of_two(exponent + shift);
}

static double scale_wide(uint64_t digits, int power)
{
    static const uint64_t fives[WIDE_POWER_MAX + 1] = {
        1u,
        5u,
        25u,
        125u,
        625u,
        3125u,
        15625u,
        78125u,
        390625u,
        1953125u,
        9765625u,
        48828125u,
        244140625u,
        1220703125u,
        6103515625u,
        30517578125u,
        152587890625u,
        762939453125u,
        3814697265625u,
        19073486328125u,
        95367431640625u,
        476837158203125u,
        2384185791015625u,
        11920928955078125u,
        59604644775390625u,
        298023223876953125u,
        1490116119384765625u,
        7450580596923828125u,
    };
    if (power >= 0)
        return round_wide((unsigned __int128)digits * fives[power], false, power);
    int shift = __builtin_clzll(digits) + 64; /* the quotient then has at least 64 bits */
    unsigned __int128 dividend = (unsigned __int128)digits << shift;
    uint64_t divisor = fives[-power];
    unsigned __int128 quotient = dividend / divisor;
    return round_wide(quotient, dividend % divisor != 0, power - shift);
}

static double scale_by_library(const char *token)
{
    locale_t plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (!plain)
        return strtod(token, NULL);
    double value = strtod_l(token, NULL, plain);
    freelocale(plain);
    return value;
}

static double scale(const char *token, uint64_t digits, int power, bool digits_dropped)
{
    static const double tens[EXACT_POWER_MAX + 1] = {
        1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
        1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
    };
    if (digits == 0 && !digits_dropped)
        return 0;
    if (digits_dropped || power < -WIDE_POWER_MAX || power > WIDE_POWER_MAX)
        return scale_by_library(token);
    if (digits <= (uint64_t)1 << 53 && power >= -EXACT_POWER_MAX && power <= EXACT_POWER_MAX)
        return power < 0 ? (double)digits / tens[-power] : (double)digits * tens[power];
    return scale_wide(digits, power);
}

/* Compares without regard to case; a zero byte in `at` ends the comparison. */
static bool starts_with(const char *at, const char *lower)
{
    for (; *lower; at++, lower++)
        if ((*at | 0x20) != *lower)
            return false;
    return true;
}

static const char *parse_word(const char *at, bool negative, double *value)
{
    if (starts_with(at, "nan")) {
        *value = __builtin_nan("");
        at += 3;
        if (*at == '(') { /* nan(ind) and its like */
            const char *close = at + 1;
            while (is_digit(*close) || ((*close | 0x20) >= 'a' && (*close | 0x20) <= 'z'))
                close++;
            at = *close == ')' ? close + 1 : at;
        }
        return at;
    }
    if (!starts_with(at, "inf"))
        return NULL;
    *value = negative ? -__builtin_inf() : __builtin_inf();
    return at + (starts_with(at, "infinity") ? 8 : 3);
}

/* "1.#QNAN0" and its like: what stands after "1." */
static const char *parse_microsoft_word(const char *at, bool negative, double *value)
{
    bool infinite = starts_with(at + 1, "inf");
    if (!infinite && !starts_with(at + 1, "qnan") && !starts_with(at + 1, "snan") && !starts_with(at + 1, "ind"))
        return NULL;
    *value = !infinite ? __builtin_nan("") : negative ? -__builtin_inf() : __builtin_inf();
    at++;
    while (is_digit(*at) || ((*at | 0x20) >= 'a' && (*at | 0x20) <= 'z'))
        at++;
    return at;
}

static const char *parse_exponent(const char *at, int *exponent)
{
    bool negative = *at == '-';
    if (*at == '-' || *at == '+')
        at++;
    if (!is_digit(*at))
        return NULL;
    int value = 0;
    for (; is_digit(*at); at++)
        if (value < EXPONENT_CAP)
            value = value * 10 + (*at - '0');
    *exponent = negative ? -value : value;
    return at;
}

static inline const char *read_digits(const char *at, uint64_t *digits)
{
    uint64_t value = *digits;
    for (unsigned digit; (digit = (unsigned)(unsigned char)*at - '0') < 10; at++)
        value = value * 10 + digit;
    *digits = value;
    return at;
}

static ptrdiff_t leading_zeros(const char *at)
{
    ptrdiff_t count = 0;
    for (; *at == '0' || *at == '.'; at++)
        count += *at == '0';
    return count;
}

const char *strl__number_parse(const char *at, double *value)
{
    const char *token = at;
    bool negative = *at == '-';
    if (*at == '-' || *at == '+')
        at++;
    if (!is_digit(*at) && *at != '.')
        return parse_word(at, negative, value);
    uint64_t digits = 0;
    const char *start = at;
    at = read_digits(at, &digits);
    ptrdiff_t digit_count = at - start;
    ptrdiff_t fraction_count = 0;
    if (*at == '.') {
        const char *fraction = ++at;
        if (*at == '#' && digit_count == 1)
            return parse_microsoft_word(at, negative, value);
        at = read_digits(at, &digits);
        fraction_count = at - fraction;
    }
    digit_count += fraction_count;
    if (digit_count == 0)
        return NULL;
    int exponent = 0;
    if (*at == 'e' || *at == 'E') {
        at = parse_exponent(at + 1, &exponent);
        if (!at)
            return NULL;
    }
    const char *unsigned_token = token + (*token == '-' || *token == '+');
    bool dropped = (digit_count > DIGITS_MAX && digit_count - leading_zeros(unsigned_token) > DIGITS_MAX) ||
                   fraction_count > EXPONENT_CAP;
    double magnitude = scale(unsigned_token, digits, dropped ? 0 : exponent - (int)fraction_count, dropped);
    *value = negative ? -magnitude : magnitude;
    return at;
}

const char *strl__integer_parse(const char *at, int64_t *value)
{
    bool negative = *at == '-';
    if (*at == '-' || *at == '+')
        at++;
    if (!is_digit(*at))
        return NULL;
    const char *start = at;
    while (*at == '0')
        at++, start++;
    uint64_t digits = 0;
    at = read_digits(at, &digits);
    if (at - start > 18)
        return NULL;
    *value = negative ? -(int64_t)digits : (int64_t)digits;
    return at;
}
