#include "viewer/recorder.h"

#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "viewer/free_name.h"

/* As many as a path file may have. */
#define MOST_FRAMES 1000000u
/* A step that took longer is not stretched: the visitor looked elsewhere. */
#define MOST_STEP_SECONDS 2.0

void strl_recorder_deinit(strl_recorder *recorder)
{
    strl_path_deinit(&recorder->path);
    *recorder = (strl_recorder){0};
}

void strl_recorder_start(strl_recorder *recorder, double fov_y_deg)
{
    strl_recorder_deinit(recorder);
    recorder->path.fov_y_deg = fov_y_deg;
    recorder->state = STRL_RECORDER_RECORDS;
}

static strl_path_frame frame_of(const strl_camera *camera)
{
    strl_path_frame frame;
    memcpy(frame.eye, camera->eye, sizeof frame.eye);
    memcpy(frame.target, camera->target, sizeof frame.target);
    memcpy(frame.up, camera->up, sizeof frame.up);
    return frame;
}

static void between(const strl_path_frame *a, const strl_path_frame *b, double share, strl_path_frame *out)
{
    for (int i = 0; i < 3; i++) {
        out->eye[i] = a->eye[i] + share * (b->eye[i] - a->eye[i]);
        out->target[i] = a->target[i] + share * (b->target[i] - a->target[i]);
        out->up[i] = a->up[i] + share * (b->up[i] - a->up[i]);
    }
}

static bool append(strl_recorder *recorder, const strl_path_frame *frame)
{
    strl_camera_path *path = &recorder->path;
    if (path->count == MOST_FRAMES ||
        !strl__grow(&path->frames, &recorder->capacity, path->count + 1, sizeof *path->frames)) {
        recorder->state = STRL_RECORDER_IDLE;
        return false;
    }
    path->frames[path->count++] = *frame;
    return true;
}

void strl_recorder_stop(strl_recorder *recorder)
{
    const strl_camera_path *path = &recorder->path;
    bool records = recorder->state == STRL_RECORDER_RECORDS;
    recorder->state = STRL_RECORDER_IDLE;
    if (records && path->count > 0 &&
        memcmp(&path->frames[path->count - 1], &recorder->newest, sizeof recorder->newest))
        append(recorder, &recorder->newest);
}

bool strl_recorder_add(strl_recorder *recorder, const strl_camera *camera, double seconds)
{
    strl_path_frame now = frame_of(camera), before, mid;
    if (recorder->state != STRL_RECORDER_RECORDS)
        return true;
    recorder->newest = now;
    if (recorder->path.count == 0)
        return append(recorder, &now);
    before = recorder->path.frames[recorder->path.count - 1];
    recorder->clock += fmin(seconds, MOST_STEP_SECONDS) * STRL_RECORDER_RATE;
    double steps = floor(recorder->clock);
    recorder->clock -= steps;
    /* A slow frame stands for several: they lie on the way to it. */
    for (double s = 1; s <= steps; s++) {
        between(&before, &now, s / steps, &mid);
        if (!append(recorder, &mid))
            return false;
    }
    return true;
}

bool strl_recorder_replay(strl_recorder *recorder)
{
    strl_recorder_stop(recorder);
    if (recorder->path.count == 0)
        return false;
    recorder->state = STRL_RECORDER_REPLAYS;
    recorder->clock = -1;
    recorder->last_shown = false;
    return true;
}

bool strl_recorder_next(strl_recorder *recorder, double seconds, const uint32_t size[2], strl_camera *camera)
{
    double last = (double)(recorder->path.count - 1);
    if (recorder->state != STRL_RECORDER_REPLAYS)
        return false;
    if (recorder->last_shown) {
        strl_recorder_stop(recorder);
        return false;
    }
    recorder->clock = recorder->clock < 0 ? 0 : fmin(recorder->clock + seconds * STRL_RECORDER_RATE, last);
    recorder->last_shown = recorder->clock >= last;
    *camera = strl_path_camera(&recorder->path, (size_t)recorder->clock, size);
    return true;
}

strl_status strl_recorder_save(const strl_recorder *recorder, const char *folder, char *path, size_t path_size,
                               strl_error *err)
{
    if (recorder->path.count == 0)
        return strl__fail(err, STRL_ERR_ARGUMENT, "there is no path to save");
    strl_status status = strl_free_name(folder, "stroll_path_", ".json", path, path_size, err);
    return status == STRL_OK ? strl_path_save(&recorder->path, path, err) : status;
}

strl_status strl_recorder_load(strl_recorder *recorder, const char *file, strl_error *err)
{
    strl_camera_path path;
    strl_status status = strl_path_load(file, &path, err);
    if (status != STRL_OK)
        return status;
    strl_recorder_deinit(recorder);
    recorder->path = path;
    recorder->capacity = path.count;
    return STRL_OK;
}
