/* The tree of parts, and what of them is shown. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "base/fail.h"
#include "base/memory.h"
#include "platform/thread.h"
#include "stroll/render.h"
#include "viewer/parts.h"

static const char *const names[] = {"house/roof",
                                    "house/wall/north",
                                    "tree",
                                    "house/wall/south",
                                    "house/wall",
                                    "house-old",
                                    "House/wall/west",
                                    "house/wall/south",
                                    "",
                                    "a//b"};
#define PART_COUNT ((uint32_t)(sizeof names / sizeof *names))

static strl_status name_part(void *context, uint32_t part, char *name, size_t size, strl_error *err)
{
    const char *const *all = context;
    (void)err;
    snprintf(name, size, "%s", all[part]);
    return STRL_OK;
}

static strl_parts make(void)
{
    strl_parts parts;
    strl_error err = {0};
    if (strl_parts_init(&parts, PART_COUNT, name_part, (void *)names, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return parts;
}

static uint32_t find_node(const strl_part_tree *tree, const char *name, uint16_t depth)
{
    for (uint32_t n = 0; n < tree->node_count; n++)
        if (tree->nodes[n].depth == depth && tree->nodes[n].name_bytes == strlen(name) &&
            !memcmp(tree->text + tree->nodes[n].name, name, strlen(name)))
            return n;
    fail_msg("there is no node %s at depth %u", name, depth);
    return 0;
}

/* A node's parts are all those whose name begins with its path, and no others; children lie within their parent. */
static void every_part_is_below_the_steps_of_its_path(void **state)
{
    (void)state;
    strl_parts parts = make();
    const strl_part_tree *tree = &parts.tree;
    uint32_t own = 0;
    for (uint32_t n = 0; n < tree->node_count; n++) {
        const strl_part_node *node = &tree->nodes[n];
        assert_true(node->part_count > 0 && node->end > n && node->end <= tree->node_count);
        own += node->is_part;
        for (uint32_t child = n + 1; child < node->end; child++) {
            const strl_part_node *below = &tree->nodes[child];
            assert_true(below->end <= node->end && below->depth > node->depth);
            assert_true(below->first_part >= node->first_part &&
                        below->first_part + below->part_count <= node->first_part + node->part_count);
        }
    }
    assert_int_equal(own, PART_COUNT);
    const strl_part_node *house = &tree->nodes[find_node(tree, "house", 0)];
    assert_int_equal(house->part_count, 5); /* not house-old, not House */
    const strl_part_node *wall = &tree->nodes[find_node(tree, "wall", 1)];
    assert_true(strcmp(strl_part_tree_name(tree, tree->order[wall->first_part]), "House/wall/west") == 0);
    for (uint32_t part = 0; part < PART_COUNT; part++)
        assert_int_equal(tree->order[tree->places[part]], part);
    assert_string_equal(strl_part_tree_name(tree, 3), "house/wall/south");
    assert_string_equal(strl_part_tree_name(tree, PART_COUNT), "");
    strl_parts_deinit(&parts);
}

static void rows_are_what_is_open_or_found(void **state)
{
    (void)state;
    strl_parts parts = make();
    strl_part_tree *tree = &parts.tree;
    uint32_t closed = tree->row_count;
    for (uint32_t r = 0; r < closed; r++)
        assert_int_equal(tree->nodes[tree->rows[r]].depth, 0);
    uint32_t house = find_node(tree, "house", 0);
    strl_part_tree_toggle(tree, house);
    assert_int_equal(tree->row_count, closed + 2); /* roof and wall */
    strl_part_tree_toggle(tree, house);
    assert_int_equal(tree->row_count, closed);

    strl_part_tree_search(tree, "WALL/so");
    assert_int_equal(tree->row_count, 4); /* house, wall, and two of one name */
    strl_part_tree_search(tree, "nowhere");
    assert_int_equal(tree->row_count, 0);
    strl_part_tree_search(tree, "");
    assert_int_equal(tree->row_count, closed);

    uint32_t row = strl_part_tree_reveal(tree, 1);
    assert_true(row < tree->row_count);
    assert_int_equal(tree->order[tree->nodes[tree->rows[row]].first_part], 1);
    assert_true(tree->row_count == closed + 2 + 3);
    assert_int_equal(strl_part_tree_reveal(tree, PART_COUNT), UINT32_MAX);
    strl_parts_deinit(&parts);
}

static void styles_follow_what_is_hidden_and_selected(void **state)
{
    (void)state;
    strl_parts parts = make();
    const strl_part_node house = parts.tree.nodes[find_node(&parts.tree, "house", 0)];
    uint64_t version = parts.version;
    strl_parts_select(&parts, parts.tree.places[2], 1);
    assert_int_equal(parts.styles[2], STRL_PART_MARKED);
    assert_true(parts.version > version);
    strl_parts_hide(&parts, house.first_part, house.part_count, true);
    assert_int_equal(parts.hidden_count, 5);
    assert_int_equal(parts.styles[0], STRL_PART_HIDDEN);
    assert_int_equal(parts.styles[5], STRL_PART_PLAIN);
    strl_parts_isolate(&parts, house.first_part, house.part_count);
    assert_int_equal(parts.hidden_count, PART_COUNT - 5);
    assert_int_equal(parts.styles[2], STRL_PART_HIDDEN); /* selected, but hidden */
    strl_parts_isolate(&parts, house.first_part, house.part_count);
    assert_int_equal(parts.hidden_count, 0);
    strl_parts_hide(&parts, PART_COUNT - 1, UINT32_MAX, true); /* cut to what there is */
    assert_int_equal(parts.hidden_count, 1);
    strl_parts_hide(&parts, PART_COUNT, 1, true);
    strl_parts_select(&parts, PART_COUNT + 7, 1);
    assert_int_equal(parts.selected_count, 0);
    strl_parts_show_all(&parts);
    assert_int_equal(parts.hidden_count, 0);
    strl_parts_deinit(&parts);
}

/* Of any places, not of a range alone. */
static void what_is_found_is_selected_hidden_and_left_alone(void **state)
{
    (void)state;
    strl_parts parts = make();
    strl_part_tree_search(&parts.tree, "so"); /* two of one name */
    assert_int_equal(strl_part_tree_found_in(&parts.tree, 0, PART_COUNT), 2);
    strl_part_tree_search(&parts.tree, "O");
    uint32_t found = strl_part_tree_found_in(&parts.tree, 0, PART_COUNT), told = 0;
    for (uint32_t part = 0; part < PART_COUNT; part++)
        told += strchr(names[part], 'o') || strchr(names[part], 'O');
    assert_int_equal(found, told);
    strl_parts_select_found(&parts);
    assert_int_equal(parts.selected_count, found);
    assert_int_equal(strl_parts_first_selected(&parts), parts.tree.places[6]); /* House */
    for (uint32_t part = 0; part < PART_COUNT; part++)
        assert_int_equal(parts.styles[part], strchr(names[part], 'o') ? STRL_PART_MARKED : STRL_PART_PLAIN);
    const strl_part_node wall = parts.tree.nodes[find_node(&parts.tree, "wall", 1)];
    assert_int_equal(strl_parts_selected_in(&parts, wall.first_part, wall.part_count), wall.part_count);
    strl_parts_hide_selected(&parts, true);
    assert_int_equal(parts.hidden_count, found);
    assert_int_equal(strl_parts_hidden_in(&parts, wall.first_part, wall.part_count), wall.part_count);
    strl_parts_hide_selected(&parts, false);
    strl_parts_isolate_selected(&parts);
    assert_int_equal(parts.hidden_count, PART_COUNT - found);
    assert_int_equal(parts.styles[2], STRL_PART_HIDDEN);
    strl_parts_isolate_selected(&parts);
    assert_int_equal(parts.hidden_count, 0);
    strl_part_tree_search(&parts.tree, "");
    strl_parts_select_found(&parts);
    assert_int_equal(parts.selected_count, 0);
    strl_parts_isolate_selected(&parts); /* nothing is meant: nothing happens */
    assert_int_equal(parts.hidden_count, 0);
    assert_int_equal(strl_parts_first_selected(&parts), UINT32_MAX);
    strl_parts_deinit(&parts);
}

static strl_status refuse_fifth(void *context, uint32_t part, char *name, size_t size, strl_error *err)
{
    (void)context;
    snprintf(name, size, "x");
    return part == 4 ? strl__fail(err, STRL_ERR_FORMAT, "no fifth name") : STRL_OK;
}

static void a_failure_leaves_nothing(void **state)
{
    (void)state;
    strl_parts parts;
    strl_error err = {0};
    assert_int_equal(strl_parts_init(&parts, PART_COUNT, refuse_fifth, NULL, &err), STRL_ERR_FORMAT);
    assert_string_equal(err.message, "no fifth name");
    for (uint64_t n = 1; n < 60; n++) {
        strl__alloc_fail_after(n);
        strl_status status = strl_parts_init(&parts, PART_COUNT, name_part, (void *)names, &err);
        strl__alloc_fail_after(0);
        if (status == STRL_OK) {
            strl_parts_deinit(&parts);
            return;
        }
        assert_int_equal(status, STRL_ERR_MEMORY);
    }
    fail_msg("a tree of ten parts allocates sixty times");
}

static strl_status name_many(void *context, uint32_t part, char *name, size_t size, strl_error *err)
{
    (void)context, (void)err;
    snprintf(name, size, "plant/unit %u/area %u/line %u/pipe %u", part % 5, part % 37, part % 411, part);
    return STRL_OK;
}

/* Fluent: what a keystroke in the search field or a click costs. */
static void many_parts_stay_quick(void **state)
{
    (void)state;
    enum { MANY = 100000 };
    strl_parts parts;
    assert_int_equal(strl_parts_init(&parts, MANY, name_many, NULL, NULL), STRL_OK);
    uint64_t start = strl_clock_cpu_ns();
    strl_part_tree_search(&parts.tree, "pipe 9999");
    assert_true(parts.tree.row_count > 11);
    strl_part_tree_search(&parts.tree, "");
    assert_true(strl_part_tree_reveal(&parts.tree, MANY / 2) < UINT32_MAX);
    strl_parts_hide(&parts, 17, MANY / 3, true);
    /* A thousand times what a quiet machine needs: only work that grows with the square is caught. */
    assert_true(strl_clock_cpu_ns() - start < 20000000000u);
    strl_parts_deinit(&parts);
}

/* Names share beginnings in a file, which can hold far more of them than memory should. */
static strl_status name_deep(void *context, uint32_t part, char *name, size_t size, strl_error *err)
{
    (void)context, (void)err;
    int used = snprintf(name, size, "%05u", part);
    while ((size_t)used + 3 < size && used < 405) {
        memcpy(name + used, "/x", 3);
        used += 2;
    }
    return STRL_OK;
}

static void names_and_nodes_keep_to_their_bytes(void **state)
{
    (void)state;
    enum { MANY = 10000, BYTES = 4 << 20, LEAST = 64 };
    strl_part_tree tree;
    assert_int_equal(strl_part_tree_init(&tree, MANY, BYTES, name_deep, NULL, NULL), STRL_OK);
    assert_true(tree.text_bytes + tree.node_count * sizeof *tree.nodes <= BYTES + (size_t)LEAST * MANY);
    assert_true(tree.text_bytes > BYTES / 3 && tree.node_count * sizeof *tree.nodes > BYTES / 3);
    uint32_t own = 0;
    for (uint32_t n = 0; n < tree.node_count; n++)
        own += tree.nodes[n].is_part;
    assert_int_equal(own, MANY);
    assert_int_equal(strlen(strl_part_tree_name(&tree, 0)), 405);
    assert_string_equal(strl_part_tree_name(&tree, MANY - 1), "");
    for (uint32_t part = 0; part < MANY; part += 999) { /* with a name or without, split or not */
        uint32_t row = strl_part_tree_reveal(&tree, part);
        assert_true(row < tree.row_count && tree.order[tree.nodes[tree.rows[row]].first_part] == part);
    }
    strl_part_tree_deinit(&tree);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_part_is_below_the_steps_of_its_path),
        cmocka_unit_test(rows_are_what_is_open_or_found),
        cmocka_unit_test(styles_follow_what_is_hidden_and_selected),
        cmocka_unit_test(what_is_found_is_selected_hidden_and_left_alone),
        cmocka_unit_test(a_failure_leaves_nothing),
        cmocka_unit_test(many_parts_stay_quick),
        cmocka_unit_test(names_and_nodes_keep_to_their_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
