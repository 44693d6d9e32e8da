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
    json_t *object = json_pack("{s:s,s:s,s:o,s:o,s:f}", "part", picked->part, "material", picked->material, "point",
                               strl_journal_vector(picked->pick.point), "normal",
                               strl_journal_vector(picked->pick.normal), "error", picked->pick.error);
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

/* What to look at: the selected parts where they are drawn, else the surroundings of the newest pick. */
static bool find_bounds(const strl__viewer *v, double bounds[6])
{
    const strl_picked *newest = strl_picks_newest(&v->picks);
    if (v->parts.selected_count > 0 &&
        strl_pick_style_bounds(&v->list, v->parts.styles, v->parts.tree.part_count, STRL_PART_MARKED, bounds))
        return true;
    if (!newest)
        return false;
    for (int i = 0; i < 3; i++) {
        bounds[i] = newest->pick.point[i] - newest->pick.distance / 8;
        bounds[3 + i] = newest->pick.point[i] + newest->pick.distance / 8;
    }
    return true;
}

void strl__viewer_look(strl__viewer *v)
{
    double bounds[6];
    if (!find_bounds(v, bounds)) {
        strl__viewer_say(v, v->parts.selected_count > 0
                                ? "nothing of the selection is drawn from here: it is hidden, or too small to be seen"
                                : "nothing is selected: click a part, or a line of the list");
        return;
    }
    strl_recorder_stop(&v->recorder);
    if (v->controls.mode == STRL_NAVIGATOR_WALK)
        v->controls.mode = STRL_NAVIGATOR_ORBIT;
    strl_pose pose = strl_navigator_pose_on(&v->navigator, bounds);
    strl_navigator_go(&v->navigator, &pose, STRL__GO_SECONDS);
}
