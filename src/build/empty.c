/* The tree of a model without a triangle: one node that holds nothing, at the origin. What readers have skipped is
 * counted in the header, which is all that such a model has to tell. */
#include "base/fail.h"
#include "build/container_facts.h"
#include "geometry/payload.h"
#include "geometry/sample_payload.h"

/* A mesh without a vertex still has one palette entry, of the unnamed part and material. */
static strl_status encode_nothing(strl_structure structure, strl_arena *arena, strl_writer *payload, strl_error *err)
{
    strl_pm pm = {.palette_count = 1};
    if (!strl_pm_create(&pm, false, false, false, arena))
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node");
    pm.vertex_end[0] = pm.triangle_end[0] = 0;
    pm.geometric_error[0] = pm.appearance_error[0] = 0;
    pm.palette[0] = (strl_palette_entry){.rgba = 0xffffffffu};
    const strl_brick_head head = {.level_count = 1};
    strl_status status = structure == STRL_STRUCTURE_SAMPLES ? strl_brick_head_write(&head, payload, err) : STRL_OK;
    return status ? status : strl_payload_encode(&pm, NULL, arena, payload, NULL, err);
}

strl_status strl_write_empty_tree(strl_container_writer *writer, strl_structure structure, strl_error *err)
{
    const strl_tree tree = {.structure = structure, .step = 1, .node_count = 1, .level_count = 1, .group_count = 1};
    const strl_node node = {.parent = STRL_NONE,
                            .first_child = STRL_NONE,
                            .decode_parent = STRL_NONE,
                            .group_size = 1,
                            .rung = structure == STRL_STRUCTURE_SAMPLES ? STRL_RUNG_SAMPLED : STRL_RUNG_TOPOLOGY};
    strl_arena arena = {0};
    strl_writer payload = {0};
    strl_status status = encode_nothing(structure, &arena, &payload, err);
    if (!status)
        status = strl_container_writer_begin_tree(writer, &tree, err);
    if (!status)
        status = strl_container_writer_add_node(writer, &node, payload.data, (uint32_t)payload.size, err);
    if (!status)
        status = strl_container_writer_end_tree(writer, err);
    strl__free(payload.data);
    strl_arena_deinit(&arena);
    return status;
}
