#include "viewer/bookmarks.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "viewer/journal.h"

/* Cut between two letters of UTF-8, not within one. */
static void copy_name(char out[STRL_BOOKMARK_NAME], const char *name)
{
    size_t bytes = strnlen(name, STRL_BOOKMARK_NAME);
    if (bytes == STRL_BOOKMARK_NAME)
        for (bytes--; bytes > 0 && ((unsigned char)name[bytes] & 0xc0) == 0x80;)
            bytes--;
    memcpy(out, name, bytes);
    out[bytes] = 0;
}

bool strl_bookmarks_add(strl_bookmarks *bookmarks, const char *name, const strl_navigator *navigator)
{
    if (bookmarks->count == STRL_MOST_BOOKMARKS)
        return false;
    strl_bookmark *made = &bookmarks->items[bookmarks->count++];
    *made = (strl_bookmark){.pose = strl_navigator_pose(navigator), .orthographic = navigator->orthographic};
    if (name[0])
        copy_name(made->name, name);
    else
        snprintf(made->name, sizeof made->name, "view %u", bookmarks->count);
    bookmarks->next = 0;
    return true;
}

uint32_t strl_bookmarks_find(const strl_bookmarks *bookmarks, const strl_bookmark *bookmark)
{
    uint32_t at = 0;
    for (; at < bookmarks->count; at++) {
        const strl_bookmark *other = &bookmarks->items[at];
        if (!strcmp(other->name, bookmark->name) && !memcmp(&other->pose, &bookmark->pose, sizeof other->pose) &&
            other->orthographic == bookmark->orthographic)
            break;
    }
    return at;
}

void strl_bookmarks_remove(strl_bookmarks *bookmarks, uint32_t index)
{
    if (index >= bookmarks->count)
        return;
    bookmarks->count--;
    memmove(&bookmarks->items[index], &bookmarks->items[index + 1],
            (bookmarks->count - index) * sizeof *bookmarks->items);
    bookmarks->next = 0;
}

const strl_bookmark *strl_bookmarks_next(strl_bookmarks *bookmarks)
{
    if (bookmarks->count == 0)
        return NULL;
    uint32_t at = bookmarks->next % bookmarks->count;
    bookmarks->next = at + 1;
    return &bookmarks->items[at];
}

json_t *strl_bookmarks_write(const strl_bookmarks *bookmarks)
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < bookmarks->count; i++) {
        const strl_bookmark *b = &bookmarks->items[i];
        json_array_append_new(array,
                              json_pack("{s:o,s:[f,f,f],s:f,s:f,s:f,s:b}", "name", strl_journal_text(b->name), "eye",
                                        b->pose.eye[0], b->pose.eye[1], b->pose.eye[2], "yaw", b->pose.yaw, "pitch",
                                        b->pose.pitch, "distance", b->pose.distance, "orthographic", b->orthographic));
    }
    return array;
}

static bool read_one(const json_t *object, strl_bookmark *out)
{
    const char *name = NULL;
    int orthographic = 0;
    strl_pose *pose = &out->pose;
    if (json_unpack((json_t *)object, "{s:s,s:[F,F,F],s:F,s:F,s:F,s?b}", "name", &name, "eye", &pose->eye[0],
                    &pose->eye[1], &pose->eye[2], "yaw", &pose->yaw, "pitch", &pose->pitch, "distance", &pose->distance,
                    "orthographic", &orthographic) != 0)
        return false;
    copy_name(out->name, name);
    out->orthographic = orthographic != 0;
    return fabs(pose->pitch) < M_PI / 2 && pose->distance > 0;
}

void strl_bookmarks_read(strl_bookmarks *bookmarks, const json_t *array)
{
    *bookmarks = (strl_bookmarks){0};
    for (size_t i = 0; i < json_array_size(array) && bookmarks->count < STRL_MOST_BOOKMARKS; i++)
        if (read_one(json_array_get(array, i), &bookmarks->items[bookmarks->count]))
            bookmarks->count++;
}
