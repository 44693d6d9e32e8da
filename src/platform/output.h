/* A file that appears under its name only when it is whole: what writes files of the user does it through this. The
 * bytes go to a temporary file that is created for this purpose, under a name that nothing had, beside the file to be
 * written; finish gives it its name, which replaces an older file at once. A link is followed: the file that it leads
 * to is replaced, the link stays. */
#ifndef STRL_PLATFORM_OUTPUT_H
#define STRL_PLATFORM_OUTPUT_H

#include <stdbool.h>
#include <stdio.h>

#include "platform/file.h"

typedef struct strl_output strl_output;

/* Whether a file can be written under this name, without writing anything: for before the work. Refused are an empty
 * name, a folder, a device, a pipe, a socket, a missing folder, and what the user may not write. */
strl_status strl_output_check(const char *path, strl_error *err);
/* The same, and what the name stands for once links are followed; owned by the caller (strl__free). */
strl_status strl_output_target(const char *path, char **target, strl_error *err);

/* Checks, then creates the temporary file: beside the file to be written, or in `scratch`, where that is a folder
 * beside it (so that who clears scratch clears it too). NULL = no such folder. */
strl_status strl_output_open(const char *path, const char *scratch, strl_output **output, strl_error *err);
strl_file *strl_output_file(strl_output *output); /* borrowed; its sentences name the path, not the temporary file */
/* A buffered stream onto the file, for libraries that write to one; borrowed, and finish closes it. */
strl_status strl_output_stream(strl_output *output, FILE **stream, strl_error *err);
/* A file without a name beside the output, for what must wait; the caller's. */
strl_status strl_output_spill(strl_output *output, strl_file **spill, strl_error *err);
/* Told the bytes done, now and then; what it returns ends the work. */
typedef strl_status (*strl_output_report)(void *context, uint64_t done, uint64_t total, strl_error *err);
/* Puts all of the spill after the file's last byte and gives the spill's blocks back meanwhile. report may be NULL. */
strl_status strl_output_append(strl_output *output, strl_file *spill, strl_output_report report, void *context,
                               strl_error *err);
/* Closes the file and gives it its name. durable: it is on disk afterwards, under that name. Once. */
strl_status strl_output_finish(strl_output *output, bool durable, strl_error *err);
/* After finish, or instead of it: then the temporary file is removed. NULL is legal. */
void strl_output_close(strl_output *output);

#endif
