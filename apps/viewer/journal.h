/* What happened in the window, one JSON object a line, for people who keep what they measured and for scripts that wait
 * for something: opened, pick, section, hidden, screenshot, path, replay, arrived, rest, build, said. */
#ifndef STRL_VIEWER_JOURNAL_H
#define STRL_VIEWER_JOURNAL_H

#include <jansson.h>
#include <stdio.h>

#include "stroll/error.h"

/* Empties the file. path NULL: no journal, *journal is NULL, which is legal below. */
strl_status strl_journal_open(const char *path, FILE **journal, strl_error *err);
void strl_journal_close(FILE *journal);
/* Adds "event":name to the object, which it takes over (NULL: no memory, nothing is written), and writes it at once. */
void strl_journal_write(FILE *journal, const char *name, json_t *object);
/* Paths and cut sentences need not be UTF-8, which JSON is: what is not becomes '?'. */
json_t *strl_journal_text(const char *text);
json_t *strl_journal_vector(const double v[3]);

#endif
