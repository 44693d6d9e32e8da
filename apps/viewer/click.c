/* What was clicked: pick, selection, and looking at it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "viewer/internal.h"

strl_pick_filter strl__viewer_filter(const strl__viewer *v)
{
    strl_pick_filter filter = {.part_styles = v->parts.styles, .part_count = v->parts.tree.part_count};
    strl_section_plane(&v->section, filter.section);
    return filter;
}

/* Names are for people: where one cannot be read, there is none. */
static void find_names(strl__viewer *v, strl_picked *picked)
{
    uint32_t rgba;
    snprintf(picked->part, sizeof picked->part, "%s", strl_part_tree_name(&v->parts.tree, picked->pick.part));
    if (picked->pick.material >= strl_container_get_info(v->model->container)->material_count ||
        strl_container_material(v->model->container, picked->pick.material, picked->material, sizeof picked->material,
                                &rgba, NULL) != STRL_OK)
        picked->material[0] = 0;
}

static void journal_pick(strl__viewer *v, const strl_picked *picked)
{
    double difference[3], distance = strl_picks_distance(&v->picks, difference);
    json_t *object = json_pack("{s:o,s:o,s:o,s:o,s:f}", "part", strl_journal_text(picked->part), "material",
                               strl_journal_text(picked->material), "point", strl_journal_vector(picked->pick.point),
                               "normal", strl_journal_vector(picked->pick.normal), "error", picked->pick.error);
    if (object && distance >= 0) {
        json_object_set_new(object, "distance", json_real(distance));
        json_object_set_new(object, "difference", strl_journal_vector(difference));
    }
    strl_journal_write(v->journal, "pick", object);
}

/* A model of one part is not tinted as a whole. */
static void select_part(strl__viewer *v, uint32_t part)
{
    if (part >= v->parts.tree.part_count || v->parts.tree.part_count < 2)
        return;
    strl_parts_select(&v->parts, v->parts.tree.places[part], 1);
    v->reveal = v->controls.parts ? strl_part_tree_reveal(&v->parts.tree, part) : UINT32_MAX;
}

void strl__viewer_click(strl__viewer *v, const strl_click *click)
{
    strl_ray ray;
    strl_picked picked;
    strl_pick_filter filter = strl__viewer_filter(v);
    if (!strl_ray_through(&v->camera, click->at[0] - 0.5, click->at[1] - 0.5, &ray))
        return;
    if (!strl_pick_list(&v->list, &ray, &filter, &picked.pick)) {
        strl_parts_select(&v->parts, 0, 0);
        strl_journal_write(v->journal, "pick", json_object());
        return;
    }
    if (click->twice) { /* the first of the two has picked */
        strl__viewer_look(v);
        return;
    }
    find_names(v, &picked);
    strl_picks_add(&v->picks, &picked);
    select_part(v, picked.pick.part);
    journal_pick(v, &picked);
}

static void look_at(strl__viewer *v, const double bounds[6])
{
    strl__viewer_end_replay(v);
    if (v->controls.mode == STRL_NAVIGATOR_WALK)
        v->controls.mode = STRL_NAVIGATOR_ORBIT;
    strl_pose pose = strl_navigator_pose_on(&v->navigator, bounds);
    strl_navigator_go(&v->navigator, &pose, STRL__GO_SECONDS);
}

/* A model of one part, or without any: what lies round the newest pick. */
static void look_at_pick(strl__viewer *v)
{
    const strl_picked *newest = strl_picks_newest(&v->picks);
    double bounds[6];
    if (!newest) {
        strl__viewer_say(v, "nothing is selected: click a part, or a line of the list");
        return;
    }
    for (int i = 0; i < 3; i++) {
        bounds[i] = newest->pick.point[i] - newest->pick.distance / 8;
        bounds[3 + i] = newest->pick.point[i] + newest->pick.distance / 8;
    }
    look_at(v, bounds);
}

static bool find_drawn(const strl__viewer *v, double bounds[6])
{
    return strl_pick_style_bounds(&v->list, v->parts.styles, v->parts.tree.part_count, STRL_PART_MARKED, bounds);
}

/* The index is read once; what is not drawn now will be asked for again. */
static void look_by_index(strl__viewer *v)
{
    strl_error err = {0};
    double bounds[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};
    bool found = false;
    v->look_waits = false;
    if (strl_part_index_status(v->index, &err) != STRL_OK) {
        strl__viewer_drop_index(v); /* a failure may pass, as that of a network: the next look begins anew */
        strl__viewer_say(v, "%s", err.message);
        return;
    }
    for (uint32_t place = 0; place < v->parts.tree.part_count; place++)
        if (v->parts.selected[place])
            found |= strl_part_index_widen(v->index, v->parts.tree.order[place], bounds);
    if (found)
        look_at(v, bounds);
    else
        strl__viewer_say(v, "the selection has no triangle");
}

void strl__viewer_poll_index(strl__viewer *v)
{
    double share;
    if (!v->look_waits || !v->index)
        return;
    v->message_end_ns = UINT64_MAX;
    if (!strl_part_index_is_done(v->index, &share)) {
        snprintf(v->message, sizeof v->message, "looking for it in the whole model: %.0f %%", 100 * share);
        return;
    }
    v->message_end_ns = 0;
    v->frames_left = STRL__FRAMES_AFTER_INPUT;
    look_by_index(v);
}

void strl__viewer_drop_index(strl__viewer *v)
{
    strl_part_index_destroy(v->index);
    v->index = NULL;
    if (v->look_waits)
        v->message_end_ns = 0; /* it would stay until what it waits for had ended */
    v->look_waits = false;
}

void strl__viewer_look(strl__viewer *v)
{
    double bounds[6], share;
    strl_error err = {0};
    const strl_location location = strl__viewer_locate(v, v->path);
    if (v->parts.selected_count == 0) {
        look_at_pick(v);
    } else if (v->index && strl_part_index_is_done(v->index, &share)) {
        look_by_index(v);
    } else if (find_drawn(v, bounds)) {
        look_at(v, bounds);
    } else if (v->index || strl_part_index_create(&location, v->parts.tree.part_count, &v->index, &err) == STRL_OK) {
        v->look_waits = true;
        strl__viewer_say(v, "looking for it in the whole model");
    } else {
        strl__viewer_say(v, "%s", err.message);
    }
}
