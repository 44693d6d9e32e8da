/* What the viewer remembers from one time to the next: one JSON file, written as a whole or not at all. What it does
 * not understand in it stays. */
#ifndef STRL_VIEWER_SETTINGS_H
#define STRL_VIEWER_SETTINGS_H

#include <jansson.h>

#include "stroll/error.h"
#include "viewer/bookmarks.h"

typedef struct strl_settings {
    uint32_t size[2]; /* of the window, screen units; 0 = not known yet, as all others */
    double error_px;
    uint64_t memory_bytes, gpu_memory_bytes;
    double text_scale; /* times what the system asks for */
    bool show_parts, orthographic;
    json_t *root; /* owned; all of the file */
    char *path;   /* owned; NULL = nothing is remembered */
} strl_settings;

/* path NULL: nothing is read and nothing will be written. A missing file is no failure. After a failure the file will
 * not be written: what somebody has in it is not lost to a slip of the keyboard. */
strl_status strl_settings_load(strl_settings *settings, const char *path, strl_error *err);
/* Before a change: another window may have written since. Takes the file as it is now, values and bookmarks; where it
 * cannot be read, what is known stays. */
void strl_settings_renew(strl_settings *settings);
/* Makes the folder, and its folder, where they are missing. */
strl_status strl_settings_save(const strl_settings *settings, strl_error *err);
void strl_settings_deinit(strl_settings *settings);

void strl_settings_get_bookmarks(const strl_settings *settings, const uint8_t model_id[16], strl_bookmarks *bookmarks);
void strl_settings_set_bookmarks(strl_settings *settings, const uint8_t model_id[16], const strl_bookmarks *bookmarks);

#endif
