/* Places of one model that the visitor wants to find again, with a name each. */
#ifndef STRL_VIEWER_BOOKMARKS_H
#define STRL_VIEWER_BOOKMARKS_H

#include <jansson.h>

#include "stroll/error.h"
#include "viewer/navigator.h"

#ifdef __cplusplus
extern "C" {
#endif

#define STRL_BOOKMARK_NAME 48u
#define STRL_MOST_BOOKMARKS 256u

typedef struct strl_bookmark {
    char name[STRL_BOOKMARK_NAME];
    strl_pose pose;
    bool orthographic;
} strl_bookmark;

typedef struct strl_bookmarks {
    strl_bookmark items[STRL_MOST_BOOKMARKS];
    uint32_t count;
    uint32_t next; /* the one that strl_bookmarks_next gives */
} strl_bookmarks;

/* An empty name becomes "view N". False where there is no room. */
bool strl_bookmarks_add(strl_bookmarks *bookmarks, const char *name, const strl_navigator *navigator);
/* Which one is the same in all; count where none is. */
uint32_t strl_bookmarks_find(const strl_bookmarks *bookmarks, const strl_bookmark *bookmark);
void strl_bookmarks_remove(strl_bookmarks *bookmarks, uint32_t index);
/* One after the other, round and round; NULL where there is none. */
const strl_bookmark *strl_bookmarks_next(strl_bookmarks *bookmarks);

/* An array of objects. Reading takes what it understands and leaves out the rest. */
json_t *strl_bookmarks_write(const strl_bookmarks *bookmarks);
void strl_bookmarks_read(strl_bookmarks *bookmarks, const json_t *array);

#ifdef __cplusplus
}
#endif
#endif
