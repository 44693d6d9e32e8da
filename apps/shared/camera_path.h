/* Camera paths: made from a model's bounds and what lies on its surface, or read from a file, or from one
 * specification. A path is the same for equal (bounds, up axis, seed, number of frames) and equal answers of `probe`.
 * `render` asks a container for those with the default error, whatever it then draws. A container and its input file
 * differ in them by that, so to render both with the same cameras save the path of one and load it for the other. */
#ifndef STRL_APPS_CAMERA_PATH_H
#define STRL_APPS_CAMERA_PATH_H

#include <stddef.h>
#include <stdint.h>

#include "stroll/error.h"
#include "stroll/frame.h"

typedef struct strl_path_frame {
    double eye[3], target[3], up[3];
} strl_path_frame;

typedef struct strl_camera_path {
    double fov_y_deg;
    size_t count;
    strl_path_frame *frames; /* owned */
} strl_camera_path;

/* What a path is made round. */
typedef struct strl_path_site {
    double bounds[6]; /* min xyz, max xyz */
    unsigned up_axis;
    double eye_height; /* of a walker, model units */
    /* Depth image of an orthographic camera (see strl_renderer_read_depth): where the model's surface is. */
    strl_status (*probe)(void *context, const strl_camera *camera, float *depth, strl_error *err);
    void *context;
} strl_path_site;

/* The bounding sphere of bounds. */
void strl_path_sphere(const double bounds[6], double centre[3], double *radius);

/* Round the bounding sphere's centre at 2 R, 20 degrees up. */
strl_status strl_path_orbit(const strl_path_site *site, size_t frames, strl_camera_path *path, strl_error *err);
/* On the surface as seen from above, round the middle, once. Fails where nothing lies below. */
strl_status strl_path_walk(const strl_path_site *site, size_t frames, uint64_t seed, strl_camera_path *path,
                           strl_error *err);
/* From 3 R through the model near its surface, and out. */
strl_status strl_path_flythrough(const strl_path_site *site, size_t frames, uint64_t seed, strl_camera_path *path,
                                 strl_error *err);

/* "eye x y z target x y z up x y z fov DEG", words in any order; what is missing looks at the model from the start of
 * its orbit. STRL_ERR_ARGUMENT names the word that is wrong. */
strl_status strl_path_parse(const strl_path_site *site, const char *spec, strl_camera_path *path, strl_error *err);

/* {"fov_y_deg":60,"frames":[{"eye":[x,y,z],"target":[x,y,z],"up":[x,y,z]}, ...]}. Loading: STRL_ERR_IO where there is
 * no such file. */
strl_status strl_path_load(const char *file, strl_camera_path *path, strl_error *err);
strl_status strl_path_save(const strl_camera_path *path, const char *file, strl_error *err);

void strl_path_deinit(strl_camera_path *path);
strl_camera strl_path_camera(const strl_camera_path *path, size_t frame, const uint32_t size[2]);
/* Why a frame's camera makes no view, half a sentence; NULL = it makes one. */
const char *strl_path_fault(const strl_camera_path *path, size_t frame);

#endif
