/* Where the camera is: the visitor's hand, a transition, a replay, the ground under a walker's feet. */
#include <math.h>
#include <string.h>

#include "viewer/internal.h"

/* A step of flying never covers more than this, however long a frame took. */
#define MOST_STEP_SECONDS 0.1
/* Of a walker's height: what a foot steps onto. */
#define STEP_SHARE 0.2
/* How much the ground rises at most, of the way. */
#define STEEPEST 4.0

/* ---- walking */

/* The surface below a point, or no more than `rise` above it where nothing is below: a coordinate on the up axis. */
static bool find_ground(const strl__viewer *v, const double point[3], double rise, double *ground)
{
    unsigned up = v->model->up_axis;
    strl_pick_filter filter = strl__viewer_filter(v);
    strl_pick pick;
    for (int turn = 0; turn < 2; turn++) {
        strl_ray ray = {.way = {0}};
        memcpy(ray.from, point, sizeof ray.from);
        ray.way[up] = turn ? 1 : -1;
        if (strl_pick_list(&v->list, &ray, &filter, &pick) && (turn == 0 || pick.distance <= rise)) {
            *ground = pick.point[up];
            return true;
        }
    }
    return false;
}

/* went: how far in this frame. A roof over one who has left the ground behind is no ground that has risen. */
static bool stand(strl__viewer *v, double went, double seconds)
{
    double foot[3], ground, over_ground = (1 + STEP_SHARE) * v->navigator.eye_height;
    memcpy(foot, v->navigator.eye, sizeof foot);
    foot[v->model->up_axis] += STEP_SHARE * v->navigator.eye_height;
    return find_ground(v, foot, STEEPEST * went - over_ground, &ground) &&
           strl_navigator_stand(&v->navigator, ground, seconds);
}

/* Where to walk: here, at the newest pick, or in the middle of the model. */
static bool find_start(const strl__viewer *v, double point[3])
{
    unsigned up = v->model->up_axis;
    const strl_picked *newest = strl_picks_newest(&v->picks);
    double ground;
    memcpy(point, v->navigator.eye, 3 * sizeof *point);
    bool found = find_ground(v, point, INFINITY, &ground);
    if (!found && newest) {
        memcpy(point, newest->pick.point, 3 * sizeof *point);
        ground = point[up];
        found = true;
    }
    if (!found) {
        memcpy(point, v->navigator.centre, 3 * sizeof *point);
        point[up] = v->model->bounds[3 + up] + v->navigator.radius;
        found = find_ground(v, point, INFINITY, &ground);
    }
    if (found)
        point[up] = ground + v->navigator.eye_height;
    return found;
}

void strl__viewer_walk(strl__viewer *v)
{
    double point[3], ahead[3];
    if (!find_start(v, point)) {
        strl__viewer_say(v, "there is nothing to walk on");
        return;
    }
    for (unsigned i = 0; i < 3; i++)
        ahead[i] = point[i];
    unsigned a = (v->model->up_axis + 1) % 3, b = (v->model->up_axis + 2) % 3;
    ahead[a] += v->navigator.radius * cos(v->navigator.yaw);
    ahead[b] += v->navigator.radius * sin(v->navigator.yaw);
    strl_pose pose = strl_navigator_pose_at(&v->navigator, point, ahead);
    strl_navigator_go(&v->navigator, &pose, STRL__GO_SECONDS);
}

/* ---- paths */

static void save_path(strl__viewer *v)
{
    char path[4096];
    strl_error err = {0};
    strl_recorder_stop(&v->recorder);
    if (strl_recorder_save(&v->recorder, v->desc.screenshots, path, sizeof path, &err) != STRL_OK) {
        strl__viewer_say(v, "%s", err.message);
        return;
    }
    strl__viewer_say(v, "saved %.300s", path);
    strl_journal_write(v->journal, "path",
                       json_pack("{s:o,s:i}", "file", strl_journal_text(path), "frames", (int)v->recorder.path.count));
}

void strl__viewer_end_recording(strl__viewer *v)
{
    if (v->recorder.state == STRL_RECORDER_RECORDS)
        save_path(v);
}

void strl__viewer_end_replay(strl__viewer *v)
{
    if (v->recorder.state == STRL_RECORDER_REPLAYS)
        strl_recorder_stop(&v->recorder);
}

void strl__viewer_toggle_record(strl__viewer *v)
{
    if (v->recorder.state == STRL_RECORDER_RECORDS) {
        v->path_ends = true;
    } else if (v->controls.orthographic) {
        strl__viewer_say(v, "a path has a perspective camera: switch back to it to record one");
    } else {
        strl_recorder_start(&v->recorder, v->navigator.fov_y_deg);
        strl__viewer_say(v, "recording: M ends it");
    }
}

void strl__viewer_toggle_replay(strl__viewer *v)
{
    strl__viewer_end_recording(v);
    if (v->recorder.state == STRL_RECORDER_REPLAYS) {
        strl_recorder_stop(&v->recorder);
    } else if (!strl_recorder_replay(&v->recorder)) {
        strl__viewer_say(v, "there is no path yet: M records one");
    } else {
        v->controls.orthographic = false;
        strl_journal_write(v->journal, "replay", json_pack("{s:b}", "begins", 1));
    }
}

/* The navigator follows, so that the visitor goes on from where a replay ends. */
static bool replay(strl__viewer *v, double seconds)
{
    bool replayed = v->recorder.state == STRL_RECORDER_REPLAYS;
    bool given = strl_recorder_next(&v->recorder, seconds, v->size, &v->camera);
    if (replayed && !given)
        strl_journal_write(v->journal, "replay", json_pack("{s:b}", "begins", 0));
    if (!given)
        return false;
    strl_pose pose = strl_navigator_pose_at(&v->navigator, v->camera.eye, v->camera.target);
    strl_navigator_go(&v->navigator, &pose, 0);
    return true;
}

/* A path's cameras are perspective ones: it ends where the visitor turns to another kind. */
static void record(strl__viewer *v, double seconds)
{
    if (v->recorder.state == STRL_RECORDER_RECORDS && v->navigator.orthographic)
        v->path_ends = true;
    else if (!strl_recorder_add(&v->recorder, &v->camera, seconds)) /* as long as one can be */
        save_path(v);
    if (v->path_ends)
        strl__viewer_end_recording(v);
    v->path_ends = false;
}

/* ---- the hand */

static bool hand_moves(const strl_window_input *input)
{
    return input->left[0] != 0 || input->left[1] != 0 || input->right[0] != 0 || input->right[1] != 0 ||
           input->wheel != 0 || input->way[0] != 0 || input->way[1] != 0 || input->way[2] != 0;
}

static void follow_controls(strl__viewer *v)
{
    bool begins_walk = v->controls.mode == STRL_NAVIGATOR_WALK && v->navigator.mode != STRL_NAVIGATOR_WALK;
    v->navigator.view_height = v->size[1];
    v->navigator.orthographic = v->controls.orthographic;
    strl_navigator_set_mode(&v->navigator, v->controls.mode);
    if (begins_walk)
        strl__viewer_walk(v);
}

bool strl__viewer_move(strl__viewer *v, const strl_window_input *input, double seconds)
{
    double step = fmin(seconds, MOST_STEP_SECONDS);
    bool was_going = v->navigator.going > 0;
    if (hand_moves(input))
        strl__viewer_end_replay(v);
    follow_controls(v);
    strl_navigator_drag_left(&v->navigator, input->left[0], input->left[1]);
    strl_navigator_drag_right(&v->navigator, input->right[0], input->right[1]);
    strl_navigator_wheel(&v->navigator, input->wheel);
    double before[3], went = 0;
    memcpy(before, v->navigator.eye, sizeof before);
    strl_navigator_move(&v->navigator, input->way, input->fast, step);
    for (int i = 0; i < 3; i++)
        went = hypot(went, v->navigator.eye[i] - before[i]);
    bool goes = strl_navigator_step(&v->navigator, step);
    if (was_going && !goes)
        strl_journal_write(v->journal, "arrived", json_pack("{s:o}", "eye", strl_journal_vector(v->navigator.eye)));
    bool replays = replay(v, seconds);
    bool falls = !goes && !replays && v->navigator.mode == STRL_NAVIGATOR_WALK && stand(v, went, step);
    if (!replays)
        v->camera = strl_navigator_camera(&v->navigator, v->size[0], v->size[1]);
    record(v, seconds);
    return goes || falls || replays || v->recorder.state == STRL_RECORDER_RECORDS;
}
