/* What of the model is shown: parts hidden, selected, or left alone with all others hidden. Places are those of the
 * part tree: the parts below one of its nodes are a range of them. */
#ifndef STRL_VIEWER_PARTS_H
#define STRL_VIEWER_PARTS_H

#include "viewer/part_tree.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_parts {
    strl_part_tree tree;
    uint8_t *hidden;                           /* [part_count] by place: not 0 = not drawn */
    uint8_t *selected;                         /* [part_count] by place */
    uint8_t *styles;                           /* [part_count] by part, strl_part_style: hidden before marked */
    uint32_t *hidden_before, *selected_before; /* [part_count + 1]: how many of the places before each one are */
    uint64_t version;                          /* of styles; grows */
    uint32_t hidden_count, selected_count;
} strl_parts;

strl_status strl_parts_init(strl_parts *parts, uint32_t part_count, strl_part_name_fn name, void *context,
                            strl_error *err);
void strl_parts_deinit(strl_parts *parts);

/* Ranges are cut to what there is. */
void strl_parts_select(strl_parts *parts, uint32_t first, uint32_t count); /* instead of what was; 0 = nothing */
void strl_parts_select_found(strl_parts *parts); /* by the tree's search; without one, nothing */
void strl_parts_hide(strl_parts *parts, uint32_t first, uint32_t count, bool hide);
void strl_parts_hide_selected(strl_parts *parts, bool hide);
/* Hides all others; where they are hidden already, shows them again. */
void strl_parts_isolate(strl_parts *parts, uint32_t first, uint32_t count);
void strl_parts_isolate_selected(strl_parts *parts);
void strl_parts_show_all(strl_parts *parts);
/* How many of a range are hidden, or selected. At once, however many they are. */
uint32_t strl_parts_hidden_in(const strl_parts *parts, uint32_t first, uint32_t count);
uint32_t strl_parts_selected_in(const strl_parts *parts, uint32_t first, uint32_t count);
/* The first place that is selected; UINT32_MAX = none is. */
uint32_t strl_parts_first_selected(const strl_parts *parts);

#ifdef __cplusplus
}
#endif
#endif
