/* Runs of placements: what those of one page look like from outside, so that who walks reads the pages that he comes
 * near. */
#include <inttypes.h>
#include <math.h>

#include "base/fail.h"
#include "container/cut.h"
#include "container/writing.h"

/* A piece of what has been written. *data is the caller's. */
static strl_status read_back(strl_container_writer *writer, uint64_t offset, uint32_t bytes, uint8_t **data,
                             strl_error *err)
{
    *data = strl__alloc(bytes, 1);
    if (!*data)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to read %" PRIu32 " bytes of the container back", bytes);
    return strl_file_read(writer->sink.file, offset, *data, bytes, err);
}

static strl_status find_far(strl_container_writer *writer, strl__written_tree *tree, strl_error *err)
{
    uint8_t *treelet = NULL, *page = NULL;
    strl_node root;
    if (tree->has_far)
        return STRL_OK;
    strl_status status = read_back(writer, tree->root.offset, tree->root.bytes, &treelet, err);
    if (status == STRL_OK)
        status = strl__node_decode(treelet + STRL__TREELET_HEAD_BYTES, 0, &root, err);
    if (status == STRL_OK)
        status = read_back(writer, root.page.offset, root.page.bytes, &page, err);
    if (status == STRL_OK)
        status = strl_page_far(&root, page, root.page.bytes, &tree->far, err);
    tree->has_far = status == STRL_OK;
    strl__free(treelet);
    strl__free(page);
    return status;
}

static strl_status find_facts(strl_container_writer *writer, strl_run *facts, strl_error *err)
{
    strl_far_sums sums = {0};
    *facts = (strl_run){.box_min = {INFINITY, INFINITY, INFINITY}, .box_max = {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t i = 0; i < writer->run_count; i++) {
        const strl_placement *placement = &writer->run[i];
        strl__written_tree *tree = &writer->trees[placement->tree];
        strl_status status = find_far(writer, tree, err);
        if (status != STRL_OK)
            return status;
        double low[3], high[3];
        strl_placed_box(&tree->facts, placement->transform, tree->facts.box_min, tree->facts.box_max, low, high);
        for (int axis = 0; axis < 3; axis++) {
            if (!isfinite(low[axis]) || !isfinite(high[axis]))
                return strl__fail(err, STRL_ERR_LIMIT,
                                  "the placed model reaches beyond the numbers of a double on axis %d", axis);
            facts->box_min[axis] = fmin(facts->box_min[axis], low[axis]);
            facts->box_max[axis] = fmax(facts->box_max[axis], high[axis]);
        }
        double stretch = strl_transform_stretch(placement->transform) * tree->facts.step;
        const strl_far far = strl_far_place(&tree->far, placement->transform, stretch);
        strl_far_add(&sums, &far);
    }
    facts->far = strl_far_end(&sums);
    return STRL_OK;
}

strl_status strl__writing_end_run(strl_container_writer *writer, strl_error *err)
{
    uint8_t bytes[STRL__RUN_BYTES];
    strl_writer out = {.data = bytes, .capacity = sizeof bytes};
    strl_run facts;
    strl_status status = find_facts(writer, &facts, err);
    if (status == STRL_OK)
        status = strl__page_table_writer_end_page(writer->placements, &writer->sink, &facts.page, err);
    if (status != STRL_OK)
        return status;
    for (int axis = 0; axis < 3; axis++)
        strl_writer_f64(&out, facts.box_min[axis]);
    for (int axis = 0; axis < 3; axis++)
        strl_writer_f64(&out, facts.box_max[axis]);
    strl_writer_f32(&out, facts.far.area);
    strl_writer_u32(&out, facts.far.rgba);
    strl_writer_u16(&out, (uint16_t)(facts.far.normal[0] | facts.far.spread << STRL__RUN_SPREAD_SHIFT));
    strl_writer_u16(&out, facts.far.normal[1]);
    strl_writer_u32(&out, facts.page.bytes);
    strl_writer_u64(&out, facts.page.offset);
    strl_writer_u64(&out, facts.page.checksum);
    writer->run_count = 0;
    return strl__page_table_writer_add(writer->runs, &writer->sink, bytes, sizeof bytes, NULL, 0, err);
}
