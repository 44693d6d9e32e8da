/* Writes a container in one pass, in constant memory: nodes in id order, then names, then finish. The file appears
 * under its name only when whole (platform/output.h). */
#ifndef STRL_CONTAINER_WRITER_H
#define STRL_CONTAINER_WRITER_H

#include "container/container.h"

typedef struct strl_container_writer strl_container_writer;

typedef struct strl_container_writer_desc {
    const char *path;        /* final name; borrowed during create */
    const char *scratch_dir; /* an existing folder for node records until they are placed; borrowed during create */
    /* an existing folder for the unfinished file, taken where it is beside the path; NULL = scratch_dir; borrowed
     * during create */
    const char *part_dir;
    /* version, file_bytes, model_id, bounds and all counts but those of input and drops are filled in by the writer */
    strl_container_info info;
} strl_container_writer_desc;

strl_status strl_container_writer_create(const strl_container_writer_desc *desc, strl_container_writer **writer,
                                         strl_error *err);
/* Begins the next tree. structure, origin, step, node_count and leaf_geometric are taken; the other counts and the box
 * are computed from the records. */
strl_status strl_container_writer_begin_tree(strl_container_writer *writer, const strl_tree *tree, strl_error *err);
/* The next node in id order. The page fields, payload_offset and payload_bytes of the record are filled in here, and
 * its errors are rounded up to the scale of the payload's. A record that docs/format.md forbids is refused. */
strl_status strl_container_writer_add_node(strl_container_writer *writer, const strl_node *record, const void *payload,
                                           uint32_t payload_bytes, strl_error *err);
strl_status strl_container_writer_end_tree(strl_container_writer *writer, strl_error *err);
/* Placements, parts and materials may be added at any time, a placement after its tree has ended. Where none is added,
 * the file gets every tree placed once as it is, one unnamed part, one unnamed white material. Bytes of a name that are
 * not UTF-8 become U+FFFD. */
strl_status strl_container_writer_add_placement(strl_container_writer *writer, const strl_placement *placement,
                                                strl_error *err);
strl_status strl_container_writer_add_part(strl_container_writer *writer, const char *name, strl_error *err);
strl_status strl_container_writer_add_material(strl_container_writer *writer, const char *name, uint32_t rgba,
                                               strl_error *err);
/* Of the next material, in their order; of none, or of each one (a zeroed one where it has no image). */
strl_status strl_container_writer_add_image(strl_container_writer *writer, const strl_material_image *image,
                                            strl_error *err);
/* Of info what the desc could not know yet: colour, the counts of input and drops. Before finish. */
void strl_container_writer_describe(strl_container_writer *writer, const strl_container_info *info);
/* Completes the file and renames it into place. *bytes_out: its size. Refused after any call that failed. */
strl_status strl_container_writer_finish(strl_container_writer *writer, uint64_t *bytes_out, strl_error *err);
/* After finish, or instead of it (then nothing is left behind). NULL is legal. */
void strl_container_writer_destroy(strl_container_writer *writer);

#endif
