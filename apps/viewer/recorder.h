/* A path that the visitor takes, to be taken again: cameras at equal times, as `render --path FILE` reads them. */
#ifndef STRL_VIEWER_RECORDER_H
#define STRL_VIEWER_RECORDER_H

#include <stdbool.h>

#include "shared/camera_path.h"

#ifdef __cplusplus
extern "C" {
#endif

#define STRL_RECORDER_RATE 30.0 /* cameras a second */

typedef enum strl_recorder_state {
    STRL_RECORDER_IDLE,
    STRL_RECORDER_RECORDS,
    STRL_RECORDER_REPLAYS
} strl_recorder_state;

typedef struct strl_recorder {
    strl_recorder_state state;
    strl_camera_path path; /* owned; the last one recorded or read */
    size_t capacity;
    strl_path_frame
        newest;      /* where the camera was last; a path ends there, however short the time since its last camera */
    double clock;    /* cameras since the path began, with fraction */
    bool last_shown; /* of a replay */
} strl_recorder;

void strl_recorder_deinit(strl_recorder *recorder);
void strl_recorder_start(strl_recorder *recorder, double fov_y_deg); /* forgets the path before */
/* The camera is here now, `seconds` after the one before. Time in which nothing moves is the caller's to leave out.
 * False: no memory, or the path is as long as one can be; recording has stopped. */
bool strl_recorder_add(strl_recorder *recorder, const strl_camera *camera, double seconds);
void strl_recorder_stop(strl_recorder *recorder); /* recording or replaying */

/* False where there is no path. */
bool strl_recorder_replay(strl_recorder *recorder);
/* Where the camera is now, `seconds` after the call before; the first camera, whatever the time, and the last one are
 * always given. False: the replay is over. */
bool strl_recorder_next(strl_recorder *recorder, double seconds, const uint32_t size[2], strl_camera *camera);

/* To the first free folder/stroll_path_00000.json. Puts the file's path into path. */
strl_status strl_recorder_save(const strl_recorder *recorder, const char *folder, char *path, size_t path_size,
                               strl_error *err);
/* Instead of what was recorded; on failure that stays. */
strl_status strl_recorder_load(strl_recorder *recorder, const char *file, strl_error *err);

#ifdef __cplusplus
}
#endif
#endif
