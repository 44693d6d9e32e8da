/* Dates of HTTP: RFC 9110, 5.6.7. The calendar is reckoned here, because the C library's depends on time zones. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "serve/parse.h"

#define DAY_S 86400
#define FIRST_S INT64_C(-62135596800) /* 1 January 1 */
#define LAST_S INT64_C(253402300799)  /* 31 December 9999 */

typedef struct calendar {
    int64_t year;
    unsigned month, day; /* from 1 on */
    unsigned hour, minute, second;
} calendar;

static const char month_names[12][4] = {"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                        "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
static const char day_names[7][4] = {"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};

/* Days since 1970 of the proleptic Gregorian calendar. A year begins with March here, so that a leap day ends it. */
static int64_t days_of(int64_t year, unsigned month, unsigned day)
{
    year -= month <= 2;
    int64_t era = (year >= 0 ? year : year - 399) / 400;
    int64_t of_era = year - era * 400;
    int64_t of_year = (153 * (int64_t)(month > 2 ? month - 3 : month + 9) + 2) / 5 + day - 1;
    return era * 146097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719468;
}

static calendar calendar_of(int64_t unix_s)
{
    int64_t days = unix_s / DAY_S - (unix_s % DAY_S < 0);
    unsigned left = (unsigned)(unix_s - days * DAY_S);
    int64_t shifted = days + 719468;
    int64_t era = (shifted >= 0 ? shifted : shifted - 146096) / 146097;
    int64_t of_era = shifted - era * 146097;
    int64_t year_of_era = (of_era - of_era / 1460 + of_era / 36524 - of_era / 146096) / 365;
    unsigned of_year = (unsigned)(of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100));
    unsigned month = (5 * of_year + 2) / 153;
    calendar made = {.day = of_year - (153 * month + 2) / 5 + 1, .month = month < 10 ? month + 3 : month - 9};
    made.year = year_of_era + era * 400 + (made.month <= 2);
    made.hour = left / 3600;
    made.minute = left / 60 % 60;
    made.second = left % 60;
    return made;
}

void strl__format_date(int64_t unix_s, char text[STRL__DATE_BYTES])
{
    unix_s = unix_s < FIRST_S ? FIRST_S : unix_s > LAST_S ? LAST_S : unix_s;
    calendar at = calendar_of(unix_s);
    int64_t days = days_of(at.year, at.month, at.day);
    snprintf(text, STRL__DATE_BYTES, "%s, %02u %s %04u %02u:%02u:%02u GMT", day_names[((days + 4) % 7 + 7) % 7],
             at.day % 100, month_names[at.month - 1], (unsigned)at.year % 10000, at.hour % 100, at.minute % 100,
             at.second % 100);
}

void strl__format_time(uint64_t unix_ns, char text[STRL__DATE_BYTES])
{
    int64_t unix_s = (int64_t)(unix_ns / 1000000000u);
    calendar at = calendar_of(unix_s < LAST_S ? unix_s : LAST_S);
    snprintf(text, STRL__DATE_BYTES, "%04u-%02u-%02uT%02u:%02u:%02u.%03uZ", (unsigned)at.year % 10000, at.month % 100,
             at.day % 100, at.hour % 100, at.minute % 100, at.second % 100, (unsigned)(unix_ns / 1000000u % 1000));
}

/* ---- reading ---- */

/* Exactly so many digits, or (blank) a space and one less; false where they are not there. */
static bool take_digits(const char **at, unsigned count, bool blank, unsigned *number)
{
    *number = 0;
    for (unsigned i = 0; i < count; i++, ++*at) {
        if (i == 0 && blank && **at == ' ')
            continue;
        if (**at < '0' || **at > '9')
            return false;
        *number = *number * 10 + (unsigned)(**at - '0');
    }
    return true;
}

static bool take_text(const char **at, const char *text)
{
    size_t length = strlen(text);
    bool same = strncmp(*at, text, length) == 0;
    *at += same ? length : 0;
    return same;
}

static bool take_month(const char **at, unsigned *month)
{
    for (*month = 1; *month <= 12; ++*month)
        if (take_text(at, month_names[*month - 1]))
            return true;
    return false;
}

static bool take_clock(const char **at, calendar *date)
{
    return take_digits(at, 2, false, &date->hour) && take_text(at, ":") && take_digits(at, 2, false, &date->minute) &&
           take_text(at, ":") && take_digits(at, 2, false, &date->second);
}

/* "06 Nov 1994 08:49:37 GMT", behind the name of the day. */
static bool take_fixed(const char *at, calendar *date)
{
    unsigned year;
    bool good = take_digits(&at, 2, false, &date->day) && take_text(&at, " ") && take_month(&at, &date->month) &&
                take_text(&at, " ") && take_digits(&at, 4, false, &year) && take_text(&at, " ") &&
                take_clock(&at, date) && take_text(&at, " GMT") && *at == 0;
    date->year = good ? year : 0;
    return good;
}

/* "06-Nov-94 08:49:37 GMT": years from 70 on are of the last century. */
static bool take_dashed(const char *at, calendar *date)
{
    unsigned year;
    bool good = take_digits(&at, 2, false, &date->day) && take_text(&at, "-") && take_month(&at, &date->month) &&
                take_text(&at, "-") && take_digits(&at, 2, false, &year) && take_text(&at, " ") &&
                take_clock(&at, date) && take_text(&at, " GMT") && *at == 0;
    date->year = good ? (year < 70 ? 2000 : 1900) + (int64_t)year : 0;
    return good;
}

/* "Nov  6 08:49:37 1994". */
static bool take_asctime(const char *at, calendar *date)
{
    unsigned year;
    bool good = take_month(&at, &date->month) && take_text(&at, " ") && take_digits(&at, 2, true, &date->day) &&
                take_text(&at, " ") && take_clock(&at, date) && take_text(&at, " ") &&
                take_digits(&at, 4, false, &year) && *at == 0;
    date->year = good ? year : 0;
    return good;
}

bool strl__parse_date(const char *text, int64_t *unix_s)
{
    calendar date = {0};
    *unix_s = 0;
    size_t name = strspn(text, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz");
    if (name < 3 || (text[name] != ',' && text[name] != ' '))
        return false;
    const char *rest = text + name + 1;
    bool good = text[name] == ' ' ? take_asctime(rest, &date)
                                  : *rest == ' ' && (take_fixed(rest + 1, &date) || take_dashed(rest + 1, &date));
    if (!good || date.year < 1 || date.day < 1 || date.day > 31 || date.hour > 23 || date.minute > 59 ||
        date.second > 60)
        return false;
    *unix_s = days_of(date.year, date.month, date.day) * DAY_S + date.hour * 3600 + date.minute * 60 + date.second;
    return true;
}
