#include "verify/pieces.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "verify/mesh.h"

/* What this process may grow by while a child reads for it. */
#define CHILD_RESERVE_BYTES (8u << 20)

static bool go_on(void *context)
{
    return strl__v_report(context, "read input", 0, 0, NULL) == STRL_OK;
}

/* What is left of the budget for a child that reads a foreign format while this process waits. */
static uint64_t child_bytes(const strl__model *model)
{
    const uint64_t held = strl_process_rss_bytes() + CHILD_RESERVE_BYTES;
    return model->memory_bytes > held ? model->memory_bytes - held : CHILD_RESERVE_BYTES;
}

strl_status strl__v_open_input(strl__model *model, uint32_t input, strl_reader **reader, strl_error *err)
{
    const strl_reader_desc desc = {
        .path = model->desc->inputs[input],
        .scratch_dir = model->desc->scratch_dir,
        .memory_bytes = model->memory_bytes / 4,
        .whole_bytes = model->memory_bytes,
        .most_pieces = STRL_READER_MOST_PIECES / model->desc->input_count,
        .child = {
            .importer = model->desc->importer, .memory_bytes = child_bytes(model), .go_on = go_on, .context = model}};
    return strl_reader_open(&desc, reader, err);
}

static strl_status add_input(strl__model *model, uint32_t input, strl__vpieces *pieces, bool *is_empty, strl_error *err)
{
    strl_reader *reader = NULL;
    strl_reader_piece rest;
    strl_status status = strl__v_open_input(model, input, &reader, err);
    if (status != STRL_OK)
        return status;
    uint32_t count = strl_reader_piece_count(reader);
    strl_reader_piece_get(reader, 0, &rest);
    *is_empty = *is_empty && rest.is_empty;
    pieces->first[input] = pieces->count;
    strl__vpiece *grown = strl__alloc_zero((size_t)pieces->count + count, sizeof *grown);
    if (grown) {
        memcpy(grown, pieces->items, pieces->count * sizeof *grown);
        strl__free(pieces->items);
        pieces->items = grown;
        for (uint32_t p = 1; p < count; p++)
            pieces->items[pieces->count++] = (strl__vpiece){.input = input, .piece = p};
    } else {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for %u pieces of the input", count);
    }
    strl_reader_close(reader);
    return status;
}

strl_status strl__v_pieces_list(strl__model *model, strl__vpieces *pieces, strl_error *err)
{
    const uint32_t inputs = model->desc->input_count;
    bool is_empty = true;
    *pieces = (strl__vpieces){.count = 1,
                              .items = strl__alloc_zero(1, sizeof *pieces->items),
                              .first = strl__alloc_zero(inputs, sizeof *pieces->first)};
    strl_status status =
        pieces->items && pieces->first ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for %u inputs", inputs);
    if (status == STRL_OK)
        pieces->items[0] = (strl__vpiece){.input = STRL__EVERY_INPUT, .placements = 1};
    for (uint32_t i = 0; status == STRL_OK && i < inputs; i++)
        status = add_input(model, i, pieces, &is_empty, err);
    if (status != STRL_OK)
        return status;
    pieces->is_plain = pieces->count == 1;
    if (is_empty && !pieces->is_plain) {
        memmove(pieces->items, pieces->items + 1, --pieces->count * sizeof *pieces->items);
        for (uint32_t i = 0; i < inputs; i++)
            pieces->first[i]--;
    }
    return STRL_OK;
}

void strl__v_pieces_deinit(strl__vpieces *pieces)
{
    strl__free(pieces->items);
    strl__free(pieces->first);
    *pieces = (strl__vpieces){0};
}

/* Parts of several inputs are numbered one input after the other, and how many an input has is known when it was read.
 */
bool strl__v_compares_parts(const strl__model *model)
{
    return model->desc->input_count == 1;
}

/* Adds what the input says of trees that hold a triangle: others are not placed. */
static strl_status sum_input(strl__model *model, strl__vpieces *pieces, uint32_t input, strl__hash128 *sum,
                             uint64_t *count, strl_error *err)
{
    strl_reader *reader = NULL;
    strl_reader_placement placement;
    bool found = true;
    strl_status status = strl__v_open_input(model, input, &reader, err);
    if (status == STRL_OK)
        status = strl_reader_begin_placements(reader, err);
    while (status == STRL_OK && found) {
        status = strl_reader_next_placement(reader, &placement, &found, err);
        if (status != STRL_OK || !found)
            break;
        uint32_t tree = pieces->first[input] + placement.piece - 1;
        pieces->items[tree].placements++;
        if (model->trees[tree].triangle_count == 0)
            continue;
        strl__hash_add(sum, strl__hash_placement(tree, strl__v_compares_parts(model) ? placement.part + 1 : 0,
                                                 placement.transform));
        ++*count;
    }
    if (status == STRL_OK) {
        strl_reader_drops drops;
        strl_reader_drops_get(reader, &drops);
        pieces->nonfinite += drops.nonfinite;
    }
    strl_reader_close(reader);
    return status;
}

strl_status strl__v_check_placements(strl__model *model, strl__vpieces *pieces, bool *comparable, strl_error *err)
{
    static const double as_it_is[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    strl__hash128 sum = {0, 0};
    uint64_t count = 0;
    strl__v_checked(model->checks, STRL_VERIFY_LEAVES, 1);
    *comparable = pieces->count == model->tree_count;
    if (!*comparable)
        strl__v_flaw(model->checks, STRL_VERIFY_LEAVES, 0, "the input makes %u trees, the container has %u",
                     pieces->count, model->tree_count);
    if (!*comparable)
        return STRL_OK;
    if (pieces->items[0].input == STRL__EVERY_INPUT && (pieces->is_plain || model->trees[0].triangle_count)) {
        strl__hash_add(&sum, strl__hash_placement(0, 0, as_it_is));
        count++;
    }
    strl_status status = STRL_OK;
    for (uint32_t i = 0; status == STRL_OK && !pieces->is_plain && i < model->desc->input_count; i++)
        status = sum_input(model, pieces, i, &sum, &count, err);
    if (status != STRL_OK)
        return status;
    strl__v_checked(model->checks, STRL_VERIFY_LEAVES, count);
    if (count != model->sections[STRL__PLACEMENTS].item_count)
        strl__v_flaw(model->checks, STRL_VERIFY_LEAVES, 0,
                     "the input has %" PRIu64 " placements, the container %" PRIu64, count,
                     model->sections[STRL__PLACEMENTS].item_count);
    else if (!strl__hash_same(sum, model->placements))
        strl__v_flaw(model->checks, STRL_VERIFY_LEAVES, 0, "the %" PRIu64 " placements are not those of the input",
                     count);
    return STRL_OK;
}
