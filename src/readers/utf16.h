/* Text in UTF-16, which some programs and shells write on Windows: decoded once, so that every reader of text sees
 * UTF-8. */
#ifndef STRL_READERS_UTF16_H
#define STRL_READERS_UTF16_H

#include "readers/internal.h"

/* Where the reader's file begins with the mark of UTF-16, in either order of bytes, its text as UTF-8 takes the place
 * of the file in reader->input: it lies in scratch, in a file without a name that *decoded owns from then on. Half a
 * pair of surrogates, and a last odd byte, become U+FFFD. *decoded is NULL for all other files, and on failure. */
strl_status strl__utf16_decode(strl_reader *reader, strl_file **decoded, strl_error *err);

#endif
