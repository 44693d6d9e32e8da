/* Queries against containers that lie: what they claim costs no memory, what contradicts itself is refused, and what is
 * found out is not forgotten where a query may read no more. */
#include "container/fixture.h"

#include "container/reseal.h"
#include "serve/models.h"
#include "serve/select.h"

typedef struct served {
    fixture fixture;
    strl__models models;
    strl_file *file;
    strl_file_info info;
} served;

static void open_file(served *self)
{
    strl_error err;
    assert_int_equal(strl_file_open(self->fixture.path, &self->file, &err), STRL_OK);
    assert_int_equal(strl_file_stat(self->file, &self->info, &err), STRL_OK);
}

static served *make_served(uint32_t levels, uint32_t fan)
{
    served *self = calloc(1, sizeof *self);
    strl_error err;
    assert_non_null(self);
    fixture_setup(&self->fixture, levels, fan);
    assert_int_equal(fixture_write(&self->fixture, &err), STRL_OK);
    strl__models_init(&self->models);
    open_file(self);
    return self;
}

static void drop_served(served *self)
{
    strl_file_close(self->file, NULL);
    strl__models_deinit(&self->models);
    fixture_teardown(&self->fixture);
    free(self);
}

/* The bytes of the container are handed to `change` and written back with right checksums. */
static void rewrite(served *self, void (*change)(uint8_t *data, size_t size), uint64_t file_bytes)
{
    size_t size;
    strl_error err;
    uint8_t *bytes = fixture_load(self->fixture.path, &size);
    change(bytes, size);
    if (file_bytes)
        strl__store_le(bytes + STRL__AT_FILE_BYTES, 8, file_bytes);
    reseal_all(bytes, size, NULL, NULL);
    strl_file_close(self->file, NULL);
    assert_int_equal(strl_file_create(self->fixture.path, &self->file, &err), STRL_OK);
    assert_int_equal(strl_file_write(self->file, 0, bytes, size, &err), STRL_OK);
    strl_file_close(self->file, NULL);
    if (file_bytes)
        assert_int_equal(truncate(self->fixture.path, (off_t)file_bytes), 0);
    open_file(self);
    free(bytes);
}

static strl__query *query_of(uint32_t node, uint32_t depth)
{
    static strl__query query;
    query.kind = STRL__QUERY_SUBTREES;
    query.tree = 0;
    query.count = 1;
    query.items[0] = (strl__query_item){node, depth};
    return &query;
}

/* In one go; where no more may be read what is there is all. */
static strl_status select_all(strl_container *container, const strl__query *query, uint64_t most_bytes,
                              strl__selection *selection, strl_error *err)
{
    strl__selecting *selecting;
    bool is_done;
    *selection = (strl__selection){.next_node = STRL_NONE};
    strl_status status = strl__selecting_create(container, query, most_bytes, &selecting, err);
    if (status != STRL_OK)
        return status;
    status = strl__selecting_step(selecting, container, UINT32_MAX, &is_done, err);
    if (status == STRL_ERR_LIMIT && strl__selecting_cut(selecting))
        status = STRL_OK;
    if (status == STRL_OK)
        strl__selecting_take(selecting, selection);
    strl__selecting_destroy(selecting);
    return status;
}

static strl_status select_one(served *self, uint32_t node, uint32_t depth, strl__selection *selection, strl_error *err)
{
    strl__model *model;
    *selection = (strl__selection){0};
    strl_status status = strl__models_borrow(&self->models, self->file, &self->info, &model, NULL, err);
    if (status == STRL_OK)
        status = select_all(model->container, query_of(node, depth), UINT64_C(1) << 40, selection, err);
    strl__models_return(&self->models, model);
    return status;
}

static void a_subtree_is_all_below(void **state)
{
    (void)state;
    served *self = make_served(9, 3);
    strl__selection selection;
    strl_error err;
    assert_int_equal(select_one(self, 0, 65535, &selection, &err), STRL_OK);
    assert_int_equal(selection.node_count, self->fixture.node_count);
    assert_false(selection.cut);
    for (size_t i = 1; i < selection.count; i++)
        assert_true(selection.pieces[i - 1].offset + selection.pieces[i - 1].bytes <= selection.pieces[i].offset);
    strl__selection_deinit(&selection);
    assert_int_equal(select_one(self, 0, 1, &selection, &err), STRL_OK);
    assert_int_equal(selection.node_count, 1 + self->fixture.nodes[0].child_count);
    strl__selection_deinit(&selection);
    drop_served(self);
}

static uint64_t trees_offset(const uint8_t *data)
{
    return strl__load_le(data + STRL__AT_SECTIONS + 16, 8);
}

static void claim_all_nodes(uint8_t *data, size_t size)
{
    (void)size;
    strl__store_le(data + trees_offset(data) + 8, 4, UINT32_MAX - 1);
}

static void a_claim_of_billions_of_nodes_costs_no_memory(void **state)
{
    (void)state;
    served *self = make_served(3, 3);
    strl__selection selection;
    strl_error err = {0};
    rewrite(self, claim_all_nodes, UINT64_C(1) << 40); /* a hole of a terabyte */
    uint64_t before = strl_process_rss_bytes();
    assert_int_equal(select_one(self, 0, 0, &selection, &err), STRL_ERR_UNSUPPORTED);
    assert_non_null(strstr(err.message, "memory"));
    assert_true(strl_process_rss_bytes() < before + (UINT64_C(64) << 20));
    strl__model_facts facts; /* its facts are told all the same */
    strl__models_facts(&self->models, self->file, &self->info, &facts);
    assert_true(facts.is_container);
    drop_served(self);
}

/* The children of the second node are said to be the third's. */
static void move_children(uint8_t *data, size_t size)
{
    (void)size;
    uint64_t root = strl__load_le(data + trees_offset(data) + 120, 8) + STRL__TREELET_HEAD_BYTES;
    uint64_t first = strl__load_le(data + root + 4, 4);
    for (uint64_t id = 1; id < 4; id++)
        strl__store_le(data + root + id * STRL__NODE_BYTES + 4, 4, first + 1 + id);
}

static void children_out_of_order_are_refused(void **state)
{
    (void)state;
    served *self = make_served(4, 3);
    strl__selection selection;
    strl_error err = {0};
    rewrite(self, move_children, 0);
    assert_int_equal(select_one(self, 0, 9, &selection, &err), STRL_ERR_FORMAT);
    assert_true(err.message[0]);
    assert_null(selection.pieces);
    drop_served(self);
}

static void a_query_that_may_read_no_more_goes_on_next_time(void **state)
{
    (void)state;
    served *self = make_served(9, 3);
    strl__model *model;
    strl__selection selection;
    strl_error err = {0};
    strl_status status = STRL_ERR_LIMIT;
    unsigned tries = 0;
    for (; status == STRL_ERR_LIMIT && tries < 1000; tries++) {
        assert_int_equal(strl__models_borrow(&self->models, self->file, &self->info, &model, NULL, &err), STRL_OK);
        model->left_bytes = STRL__MAX_TREELET_BYTES;
        status = select_all(model->container, query_of(self->fixture.node_count - 1, 0), 1 << 20, &selection, &err);
        strl__models_return(&self->models, model);
    }
    assert_int_equal(status, STRL_OK);
    assert_int_equal(selection.node_count, 1);
    assert_true(tries > 1);
    strl__selection_deinit(&selection);
    drop_served(self);
}

/* Nodes of many treelets, more than one query may read; those that were read are at hand for the next one. */
static void a_query_that_may_read_no_more_is_cut(void **state)
{
    (void)state;
    served *self = make_served(9, 3);
    strl__model *model;
    strl__selection selection;
    strl_error err = {0};
    uint32_t first = 0, answers = 0, nodes = 0;
    while (first != STRL_NONE && answers < 1000) {
        assert_int_equal(strl__models_borrow(&self->models, self->file, &self->info, &model, NULL, &err), STRL_OK);
        model->left_bytes = 3 * STRL__MAX_TREELET_BYTES;
        strl__query *query = query_of(0, 0);
        for (query->count = 0; first + query->count < self->fixture.node_count && query->count < STRL__QUERY_ITEMS;
             query->count++)
            query->items[query->count] = (strl__query_item){first + query->count, 0};
        assert_int_equal(select_all(model->container, query, UINT64_C(1) << 40, &selection, &err), STRL_OK);
        strl__models_return(&self->models, model);
        assert_true(selection.node_count > 0 && selection.cut == (selection.next_node != STRL_NONE));
        nodes += selection.node_count;
        first = selection.next_node;
        answers++;
        strl__selection_deinit(&selection);
    }
    assert_int_equal(nodes, self->fixture.node_count);
    assert_true(answers > 1);
    drop_served(self);
}

/* In steps of so many nodes, each of which may read little; others are at work in between. Returns how many there were.
 */
static unsigned select_in_steps(served *self, const strl__query *query, uint64_t most_bytes, uint32_t step,
                                strl__selection *selection)
{
    strl__selecting *selecting = NULL;
    strl_error err = {0};
    bool is_done = false;
    unsigned steps = 0;
    for (; !is_done && steps < 100000; steps++) {
        strl__model *model;
        assert_int_equal(strl__models_borrow(&self->models, self->file, &self->info, &model, NULL, &err), STRL_OK);
        if (!selecting)
            assert_int_equal(strl__selecting_create(model->container, query, most_bytes, &selecting, &err), STRL_OK);
        model->left_bytes = 2 * STRL__MAX_TREELET_BYTES;
        uint32_t before = strl__selecting_visited(selecting);
        strl_status status = strl__selecting_step(selecting, model->container, step, &is_done, &err);
        assert_true(status == STRL_OK || (status == STRL_ERR_LIMIT && !is_done));
        assert_true(strl__selecting_visited(selecting) - before <= step);
        strl__models_return(&self->models, model);
        if (steps % 16 == 3)
            strl__models_forget(&self->models, 0);
    }
    assert_true(is_done);
    strl__selecting_take(selecting, selection);
    strl__selecting_destroy(selecting);
    return steps;
}

static void a_selection_in_steps_is_that_of_one_go(void **state)
{
    (void)state;
    served *self = make_served(8, 3);
    strl__query *query = query_of(0, 0);
    for (query->count = 0; query->count < 100; query->count++) /* they overlap */
        query->items[query->count] = (strl__query_item){query->count * 3, 65535};
    for (unsigned cut = 0; cut < 2; cut++) {
        strl__model *model;
        strl__selection whole, parts;
        strl_error err = {0};
        uint64_t most = cut ? 20000 : UINT64_C(1) << 40;
        assert_int_equal(strl__models_borrow(&self->models, self->file, &self->info, &model, NULL, &err), STRL_OK);
        assert_int_equal(select_all(model->container, query, most, &whole, &err), STRL_OK);
        strl__models_return(&self->models, model);
        assert_int_equal(whole.cut, cut);
        for (uint32_t step = 1; step < 10000; step = step * 7 + 1) {
            assert_true(select_in_steps(self, query, most, step, &parts) >= whole.visited / step);
            assert_int_equal(parts.node_count, whole.node_count);
            assert_int_equal(parts.visited, whole.visited);
            assert_int_equal(parts.next_node, whole.next_node);
            assert_int_equal(parts.bytes, whole.bytes);
            assert_int_equal(parts.count, whole.count);
            assert_memory_equal(parts.pieces, whole.pieces, whole.count * sizeof *whole.pieces);
            strl__selection_deinit(&parts);
        }
        strl__selection_deinit(&whole);
    }
    drop_served(self);
}

static void no_memory_is_a_failure_and_no_more(void **state)
{
    (void)state;
    served *self = make_served(4, 3);
    strl_status status = STRL_ERR_MEMORY;
    for (uint64_t n = 1; status != STRL_OK && n < 1000; n++) {
        strl__selection selection;
        strl_error err;
        strl__alloc_fail_after(n);
        status = select_one(self, 0, 9, &selection, &err);
        strl__alloc_fail_after(0);
        assert_true(status == STRL_OK || status == STRL_ERR_MEMORY);
        strl__selection_deinit(&selection);
    }
    assert_int_equal(status, STRL_OK);
    drop_served(self);
}

static void a_container_at_work_keeps_nobody_waiting(void **state)
{
    (void)state;
    served *self = make_served(3, 3);
    strl__model *model, *other;
    strl__selection selection;
    strl_error err = {0};
    assert_int_equal(strl__models_borrow(&self->models, self->file, &self->info, &model, NULL, &err), STRL_OK);
    assert_int_equal(strl__models_borrow(&self->models, self->file, &self->info, &other, NULL, &err),
                     STRL_ERR_CANCELLED);
    assert_null(other);
    assert_int_equal(model->users, 1);
    strl__models_return(&self->models, model);
    assert_int_equal(select_one(self, 0, 9, &selection, &err), STRL_OK);
    assert_int_equal(selection.capacity, selection.count); /* what is kept until all is sent has no room to spare */
    assert_true(selection.visited >= selection.node_count);
    strl__selection_deinit(&selection);
    drop_served(self);
}

static void what_is_idle_is_closed(void **state)
{
    (void)state;
    served *self = make_served(3, 3);
    strl__selection selection;
    strl_error err;
    assert_int_equal(select_one(self, 0, 9, &selection, &err), STRL_OK);
    strl__selection_deinit(&selection);
    assert_int_equal(strl__models_open_count(&self->models), 1);
    strl__models_forget(&self->models, UINT64_C(3600) * 1000000000);
    assert_int_equal(strl__models_open_count(&self->models), 1);
    strl__models_forget(&self->models, 0);
    assert_int_equal(strl__models_open_count(&self->models), 0);
    assert_int_equal(select_one(self, 0, 9, &selection, &err), STRL_OK);
    strl__selection_deinit(&selection);
    drop_served(self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_subtree_is_all_below),
        cmocka_unit_test(a_claim_of_billions_of_nodes_costs_no_memory),
        cmocka_unit_test(children_out_of_order_are_refused),
        cmocka_unit_test(a_query_that_may_read_no_more_goes_on_next_time),
        cmocka_unit_test(a_query_that_may_read_no_more_is_cut),
        cmocka_unit_test(a_selection_in_steps_is_that_of_one_go),
        cmocka_unit_test(no_memory_is_a_failure_and_no_more),
        cmocka_unit_test(a_container_at_work_keeps_nobody_waiting),
        cmocka_unit_test(what_is_idle_is_closed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
