/* From one word of the command line to one value: sizes, counts, reals, image sizes. Every word is checked whole. */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "options.h"

#define STRL_CLI_IMAGE_SIDE_MOST 16384

/* The power of `thousand` that a suffix letter stands for; -1 = not a suffix. */
static int suffix_power(char letter)
{
    const char *letters = "KMGT";
    const char *found = letter ? strchr(letters, toupper((unsigned char)letter)) : NULL;
    return found ? (int)(found - letters) + 1 : -1;
}

/* Whole numbers go exactly through all 64 bits (a seed is one), so only a fraction takes the way over double. */
static bool read_fraction(const char *word, const char **end, double *value)
{
    char *stop = NULL;
    if (!strchr(word, '.') || strspn(word, "0123456789.") == 0)
        return false;
    *value = strtod(word, &stop);
    *end = word + strspn(word, "0123456789.");
    return stop == *end && isfinite(*value);
}

static bool read_scale(const char *suffix, unsigned thousand, uint64_t *scale)
{
    *scale = 1;
    if (!*suffix)
        return true;
    int power = suffix_power(suffix[0]);
    if (power < 0 || suffix[1])
        return false;
    while (power-- > 0)
        *scale *= thousand;
    return true;
}

bool strl_cli_read_scaled(const char *word, unsigned thousand, uint64_t *value)
{
    uint64_t scale = 1;
    double fraction = 0;
    const char *end = NULL;
    if (!isdigit((unsigned char)word[0]))
        return false;
    if (read_fraction(word, &end, &fraction)) {
        double scaled = 0;
        if (!read_scale(end, thousand, &scale) || (scaled = fraction * (double)scale) >= 9.0e18)
            return false;
        *value = (uint64_t)round(scaled);
        /* 1.3G is no whole number of bytes and still a budget; there is no half thread and no half byte. */
        return (thousand == 1024 && scale > 1) || fabs(scaled - round(scaled)) <= 1e-12 * scaled;
    }
    errno = 0;
    char *stop = NULL;
    uint64_t whole = strtoull(word, &stop, 10);
    if (errno || !read_scale(stop, thousand, &scale) || whole > UINT64_MAX / scale)
        return false;
    *value = whole * scale;
    return true;
}

void strl_cli_format_scaled(char text[32], double value, unsigned thousand)
{
    static const char *const suffixes[] = {"", "K", "M", "G", "T"};
    unsigned power = 0;
    while (power < 4 && value >= thousand && fmod(value, thousand) == 0) {
        value /= thousand;
        power++;
    }
    snprintf(text, 32, "%.15g%s", value, suffixes[power]);
}

void strl_cli_format_amount(char text[16], double amount)
{
    static const char *const scales[] = {"", " K", " M", " G", " T"};
    unsigned scale = 0;
    while (amount >= 1000 && scale < 4) {
        amount /= 1000;
        scale++;
    }
    int digits = scale == 0 || amount >= 100 ? 0 : amount >= 10 ? 1 : 2;
    snprintf(text, 16, "%.*f%s", digits, amount > 99999 ? 99999 : amount, scales[scale]);
}

bool strl_cli_read_real(const char *word, double *value)
{
    char *stop = NULL;
    if (!*word || isspace((unsigned char)word[0]))
        return false;
    double read = strtod(word, &stop);
    if (*stop || !isfinite(read))
        return false;
    *value = read;
    return true;
}

bool strl_cli_read_size(const char *word, uint32_t size[2])
{
    for (int side = 0; side < 2; side++) {
        if (!isdigit((unsigned char)word[0]))
            return false;
        char *stop = NULL;
        unsigned long pixels = strtoul(word, &stop, 10);
        if (pixels < 1 || pixels > STRL_CLI_IMAGE_SIDE_MOST)
            return false;
        if (side == 0 ? (*stop != 'x' && *stop != 'X') : *stop != '\0')
            return false;
        size[side] = (uint32_t)pixels;
        word = stop + 1;
    }
    return true;
}
