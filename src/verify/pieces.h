/* Which part of the inputs each tree is of, and the placements that the inputs say. A model whose meshes are used again
 * and again is a tree for each of them, in the order of the inputs, behind the tree of all that is used once, where
 * there is any. */
#ifndef STRL_VERIFY_PIECES_H
#define STRL_VERIFY_PIECES_H

#include "readers/reader.h"
#include "verify/model.h"

#define STRL__EVERY_INPUT UINT32_MAX

typedef struct strl__vpiece {
    uint32_t input;      /* or STRL__EVERY_INPUT: of each what it uses once */
    uint32_t piece;      /* of the input */
    uint64_t placements; /* of the input; that are finite */
} strl__vpiece;

typedef struct strl__vpieces {
    strl__vpiece *items; /* [count], owned */
    uint32_t count;
    bool is_plain;      /* one, of all that the inputs have */
    uint32_t *first;    /* [inputs] of its pieces other than 0, owned */
    uint64_t nonfinite; /* triangles of placements that are not finite */
} strl__vpieces;

strl_status strl__v_open_input(strl__model *model, uint32_t input, strl_reader **reader, strl_error *err);
strl_status strl__v_pieces_list(strl__model *model, strl__vpieces *pieces, strl_error *err);
void strl__v_pieces_deinit(strl__vpieces *pieces);
/* Whether the container has a tree for each, and places it where the inputs do. False where trees cannot be compared.
 */
/* Whether the container numbers parts as the input does. */
bool strl__v_compares_parts(const strl__model *model);
strl_status strl__v_check_placements(strl__model *model, strl__vpieces *pieces, bool *comparable, strl_error *err);

#endif
