/* The picture of a renderer as a PNG file. */
#ifndef STRL_VIEWER_SCREENSHOT_H
#define STRL_VIEWER_SCREENSHOT_H

#include <stddef.h>

#include "stroll/render.h"

/* Writes the last image, without panel, to the first free folder/stroll_00000.png; makes the folder. Puts the file's
 * path into path, which is too long where it does not fit. */
strl_status strl_screenshot_write(strl_renderer *renderer, uint32_t width, uint32_t height, const char *folder,
                                  char *path, size_t path_size, strl_error *err);

#endif
