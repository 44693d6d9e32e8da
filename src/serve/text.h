/* Text of strangers, escaped for where it goes. Each appends to a writer, whose sticky failure the caller checks.
 * Internal. */
#ifndef STRL_SERVE_TEXT_H
#define STRL_SERVE_TEXT_H

#include "base/cursor.h"

void strl__put(strl_writer *out, const char *text);
void strl__put_format(strl_writer *out, const char *format, ...) __attribute__((format(printf, 2, 3)));
void strl__put_html(strl_writer *out, const char *text);
/* With its quotes. What is not UTF-8 must not come here. */
void strl__put_json(strl_writer *out, const char *text);
/* A path: what is not unreserved, and no slash, is percent-encoded. */
void strl__put_url(strl_writer *out, const char *path);
/* For a line of a log: blanks, quotes, backslashes and all that is not printable ASCII become \xNN; "-" for "". */
void strl__put_log(strl_writer *out, const char *text);
/* The same into room of the caller's, cut where it is too small. */
void strl__log_text(const char *text, char *out, size_t size);

#endif
