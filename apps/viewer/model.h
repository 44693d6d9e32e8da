/* A container opened for walking: source, decoding threads and walk; and for asking, by a reader that may wait. */
#ifndef STRL_VIEWER_MODEL_H
#define STRL_VIEWER_MODEL_H

#include "container/container.h"
#include "jobs/pool.h"
#include "shared/location.h"
#include "stroll/walk.h"

typedef struct strl_viewer_model {
    strl_container *container; /* the walk's; for names */
    strl_walk *walk;
    strl_pool *pool; /* decodes */
    strl_executor executor;
    double bounds[6];
    unsigned up_axis;
    double unit_metres; /* 0 = unknown */
    uint64_t triangles,
        placed; /* of the finest level: each tree's once, and as often as it is placed; placed 0 = unknown */
} strl_viewer_model;

/* The model stays where it is until strl_viewer_model_close; executor and labels of how it is walked are its own.
 * STRL_ERR_ARGUMENT where the file is no container. */
strl_status strl_viewer_model_open(strl_viewer_model *model, const strl_location *location, const strl_walk_desc *how,
                                   strl_error *err);
void strl_viewer_model_close(strl_viewer_model *model);

/* Near and far of a list as seen by another camera than the walk's. False where nothing visible lies before it. */
bool strl_viewer_set_range(strl_draw_list *list, const strl_camera *camera);

#endif
