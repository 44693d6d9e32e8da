/* From a file that was dropped to a container that can be viewed: a container is one at once, a mesh is built into one
 * by a thread of its own, which can be cancelled and is asked now and then how far it is. */
#ifndef STRL_VIEWER_OPENER_H
#define STRL_VIEWER_OPENER_H

#include <stdbool.h>

#include "stroll/error.h"

typedef struct strl_opener strl_opener;

typedef enum strl_opener_state {
    STRL_OPENER_IDLE,
    STRL_OPENER_BUILDS,
    STRL_OPENER_READY, /* once: then idle */
    STRL_OPENER_FAILED /* the same */
} strl_opener_state;

typedef struct strl_opener_news {
    strl_opener_state state;
    double share;         /* of the build, 0 to 1 */
    char text[200];       /* for people: what is done and how long it will take */
    char container[4096]; /* READY: what to open */
    char mesh[4096];      /* READY: what it was built of, now or before; "" where it was dropped itself */
    bool built_before;    /* READY: nothing was built */
    char warning[640];    /* READY, FAILED: what was amiss with the mesh, of several the first; "" = nothing */
    strl_error error;     /* FAILED; STRL_ERR_CANCELLED where that was asked for */
} strl_opener_news;

/* cache: the folder for containers of meshes whose own folder cannot be written; NULL = there is none. */
strl_status strl_opener_create(const char *cache, strl_opener **opener, strl_error *err);
void strl_opener_destroy(strl_opener *opener); /* cancels and waits; NULL is legal */

/* Refused while another file is being built. A mesh becomes FILE.stroll beside it; unless `again` is set, one that is
 * younger than the mesh and there already is taken instead. Whether files that the mesh names (images, buffers,
 * materials) are younger is not known without reading it. */
strl_status strl_opener_start(strl_opener *opener, const char *file, bool again, strl_error *err);
void strl_opener_cancel(strl_opener *opener);
void strl_opener_poll(strl_opener *opener, strl_opener_news *news);

#endif
