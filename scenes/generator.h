/* What the generators share inside this folder. */
#ifndef STRL_SCENES_GENERATOR_H
#define STRL_SCENES_GENERATOR_H

#include "scenes/parts/writer.h"
#include "scenes/scene_mesh.h"
#include "scenes/scene.h"
#include "scenes/tile.h"

/* One run of strl_scene_write. desc is complete: every default is filled in, pool is not NULL. */
typedef struct strl__scene_run {
    const strl_scene_desc *desc;
    const strl_scene_progress *progress;
    strl__scene_mesh *writer;  /* of a scene of one mesh */
    strl__parts_writer *parts; /* of a scene of parts */
} strl__scene_run;

/* Reports progress; STRL_ERR_CANCELLED where the caller wants to stop. */
strl_status strl__scene_report(const strl__scene_run *run, const char *phase, uint64_t done, uint64_t total,
                               strl_error *err);

strl_status strl__scene_isosurface(strl__scene_run *run, strl_error *err);
strl_status strl__scene_painted_plane(strl__scene_run *run, strl_error *err);
strl_status strl__scene_plain_plane(strl__scene_run *run, strl_error *err);
strl_status strl__scene_boxes(strl__scene_run *run, strl_error *err);
strl_status strl__scene_chessboard(strl__scene_run *run, strl_error *err);
/* To run->parts, which is glTF. */
enum { STRL__CHESSBOARD_MATERIALS = 2 };
extern const strl__material strl__chessboard_materials[STRL__CHESSBOARD_MATERIALS];
strl_status strl__scene_chessboard_copies(strl__scene_run *run, strl_error *err);
strl_status strl__scene_landscape(strl__scene_run *run, strl_error *err);
strl_status strl__scene_plant(strl__scene_run *run, strl_error *err);

/* Copies of the model desc->of, whatever it is, onto one .gltf: not through a writer of meshes or parts (array.c). */
strl_status strl__scene_array(const strl__scene_run *run, strl_scene_result *result, strl_error *err);

/* Everything about an isosurface's extraction that does not depend on the tile. */
typedef struct strl__isosurface {
    strl__field field;
    strl__grid grid;
    strl__cube_table table;
    strl__tile_scratch *scratch; /* one per worker of the pool */
} strl__isosurface;

/* Sets levels and grid so that the surface has desc->triangles triangles, within 2 %. */
strl_status strl__isosurface_calibrate(const strl__scene_run *run, strl__isosurface *surface, strl_error *err);

#endif
