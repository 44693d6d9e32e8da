/* Writer, reader and uniform cuts on containers that are whole. What is not: test_container_hostile.c. */
#include "fixture.h"

#include "container/cut.h"
#include "container/layout.h"
#include "container/treelet.h"

static void assert_ok(strl_status status, const strl_error *err)
{
    if (status != STRL_OK)
        fail_msg("%s", err->message);
}

static strl_container *open_fixture(const fixture *self)
{
    strl_error err;
    strl_container *container;
    assert_ok(strl_container_open_path(self->path, &container, &err), &err);
    return container;
}

/* The codec may begin a triangle with another corner. */
static void assert_same_triangle(const uint16_t a[3], const uint16_t b[3])
{
    unsigned turn = b[0] == a[0] ? 0 : b[1] == a[0] ? 1 : 2;
    for (unsigned k = 0; k < 3; k++)
        assert_int_equal(a[k], b[(k + turn) % 3]);
}

static void assert_same_mesh(const strl_pm *a, const strl_pm *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->triangle_count, b->triangle_count);
    assert_int_equal(a->step_count, b->step_count);
    assert_int_equal(a->palette_count, b->palette_count);
    assert_memory_equal(a->position, b->position, a->vertex_count * sizeof *a->position);
    assert_memory_equal(a->normal, b->normal, a->vertex_count * sizeof *a->normal);
    for (uint32_t t = 0; t < a->triangle_count; t++)
        assert_same_triangle(a->triangle[t], b->triangle[t]);
    assert_memory_equal(a->palette, b->palette, a->palette_count * sizeof *a->palette);
    assert_int_equal(a->colour != NULL, b->colour != NULL);
    if (a->colour)
        assert_memory_equal(a->colour, b->colour, a->vertex_count * 4);
    assert_memory_equal(a->geometric_error, b->geometric_error, (a->step_count + 1) * sizeof(float));
}

static void assert_same_record(const strl_node *expected, const strl_node *found)
{
    strl_node node = *expected;
    node.page = found->page;
    node.payload_offset = found->payload_offset;
    node.payload_bytes = found->payload_bytes;
    assert_memory_equal(&node, found, sizeof node);
}

static void every_record_and_mesh_comes_back_as_it_was_written(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 9, 3);
    assert_true(self.node_count > 1000 && self.node_count < 20000);
    assert_ok(fixture_write(&self, &err), &err);
    strl_container *container = open_fixture(&self);
    strl_arena arena;
    strl_arena_init(&arena, 0);
    for (uint32_t id = 0; id < self.node_count; id++) {
        strl_node node;
        strl_pm expected, found;
        strl_arena_mark mark = strl_arena_get_mark(&arena);
        assert_ok(strl_container_node(container, 0, id, &node, &err), &err);
        assert_same_record(&self.nodes[id], &node);
        assert_ok(strl_container_mesh(container, 0, &node, &arena, &found, &err), &err);
        fixture_mesh(&self.nodes[id], id, &arena, &expected);
        assert_same_mesh(&expected, &found);
        strl_arena_rewind(&arena, mark);
    }
    strl_arena_deinit(&arena);
    strl_container_close(container);
    fixture_teardown(&self);
}

static void the_last_node_is_found_first(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 9, 3);
    assert_ok(fixture_write(&self, &err), &err);
    strl_container *container = open_fixture(&self);
    for (uint32_t i = 0; i < 64; i++) {
        uint32_t id = self.node_count - 1 - i * (self.node_count / 64);
        strl_node node;
        assert_ok(strl_container_node(container, 0, id, &node, &err), &err);
        assert_same_record(&self.nodes[id], &node);
    }
    strl_container_close(container);
    fixture_teardown(&self);
}

static void facts_of_file_and_tree_come_back(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 4, 3);
    assert_ok(fixture_write(&self, &err), &err);
    strl_container *container = open_fixture(&self);
    const strl_container_info *info = strl_container_get_info(container);
    strl_file_info file;
    assert_ok(strl_path_stat(self.path, &file, &err), &err);
    assert_int_equal(info->version, 1);
    assert_true(info->file_bytes == file.bytes);
    assert_string_equal(info->unit, "mm");
    assert_int_equal(info->up_axis, 2);
    assert_true(info->has_colour && info->closed_hint == 1);
    assert_int_equal(info->tree_count, 1);
    assert_int_equal(info->part_count, FIXTURE_PARTS);
    assert_int_equal(info->material_count, FIXTURE_MATERIALS);
    assert_true(info->triangles_in == 1234 && info->dropped_degenerate == 3);
    const strl_tree *tree = strl_container_tree(container, 0);
    assert_null(strl_container_tree(container, 1));
    uint64_t triangles = 0, vertices = 0;
    int64_t low = INT64_MAX, high = INT64_MIN;
    uint32_t group = 0;
    for (uint32_t id = 0; id < self.node_count; id++) {
        const strl_node *node = &self.nodes[id];
        group = node->group > group ? node->group : group;
        if (node->child_count)
            continue;
        triangles += node->triangle_count;
        vertices += node->vertex_count;
        low = node->box_min[0] < low ? node->box_min[0] : low;
        high = node->box_max[0] > high ? node->box_max[0] : high;
    }
    assert_true(tree->triangle_count == triangles && tree->vertex_count == vertices);
    assert_true(tree->box_min[0] == low && tree->box_max[0] == high);
    assert_int_equal(tree->group_count, group + 1);
    assert_int_equal(tree->level_count, 5);
    assert_int_equal(tree->root_triangles, 1);
    /* The placement turns z to y and moves by 5 along x. */
    assert_true(info->bounds[0] == 10 + 0.25 * (double)low + 5 && info->bounds[3] == 10 + 0.25 * (double)high + 5);
    assert_true(info->bounds[1] == -(30 + 0.25 * (double)(((int64_t)1 << 40) + 48)));
    strl_container_close(container);
    fixture_teardown(&self);
}

static void placements_and_names_come_back(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 2, 2);
    assert_ok(fixture_write(&self, &err), &err);
    strl_container *container = open_fixture(&self);
    strl_placement placement;
    assert_ok(strl_container_placement(container, 0, &placement, &err), &err);
    assert_true(placement.tree == 0 && placement.transform[3] == 5 && placement.transform[6] == -1);
    assert_int_equal(strl_container_placement(container, 1, &placement, &err), STRL_ERR_ARGUMENT);
    char name[64];
    uint32_t rgba;
    assert_ok(strl_container_part(container, 4, name, sizeof name, &err), &err);
    assert_string_equal(name, "part 4 of the façade");
    assert_int_equal(strl_container_part(container, 5, name, sizeof name, &err), STRL_ERR_ARGUMENT);
    /* 17 bytes hold "part 4 of the fa" but not the two bytes of the next character. */
    assert_ok(strl_container_part(container, 4, name, 18, &err), &err);
    assert_string_equal(name, "part 4 of the fa");
    assert_ok(strl_container_material(container, 0, name, sizeof name, &rgba, &err), &err);
    assert_string_equal(name, "");
    assert_ok(strl_container_material(container, 2, name, sizeof name, &rgba, &err), &err);
    assert_string_equal(name, "steel");
    assert_true(rgba == 0xff112235);
    strl_container_close(container);
    fixture_teardown(&self);
}

/* Counts what a container asks of its source. */
typedef struct counting_source {
    strl_source base;
    strl_source *inner;
    uint64_t *read_bytes;
} counting_source;

static strl_status counting_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    counting_source *self = (counting_source *)source;
    *self->read_bytes += size;
    return strl_source_read(self->inner, offset, data, size, err);
}

static void counting_close(strl_source *source)
{
    strl_source_close(((counting_source *)source)->inner);
    free(source);
}

static uint64_t bytes_read_to_open(const char *path)
{
    static const strl_source_class klass = {.kind = "counting", .read = counting_read, .close = counting_close};
    strl_error err;
    uint64_t read_bytes = 0;
    counting_source *source = calloc(1, sizeof *source);
    assert_ok(strl_source_open_file(path, 0, &source->inner, &err), &err);
    source->base = (strl_source){.klass = &klass, .bytes = source->inner->bytes};
    source->read_bytes = &read_bytes;
    strl_container *container;
    assert_ok(strl_container_open(&source->base, &container, &err), &err);
    uint64_t opened = read_bytes;
    strl_container_close(container);
    return opened;
}

static void opening_reads_at_most_128_kib_even_with_512_trees(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 0, 1);
    const strl_container_writer_desc desc = fixture_desc(&self);
    strl_container_writer *writer;
    assert_ok(strl_container_writer_create(&desc, &writer, &err), &err);
    const strl_tree tree = fixture_tree(1);
    strl_node node = self.nodes[0];
    node.group = 0, node.group_size = 1;
    for (uint32_t i = 0; i < STRL__MAX_TREES; i++) {
        assert_ok(strl_container_writer_begin_tree(writer, &tree, &err), &err);
        assert_ok(fixture_add_node(writer, &node, &node, 0, &err), &err);
        assert_ok(strl_container_writer_end_tree(writer, &err), &err);
    }
    for (uint32_t i = 0; i < FIXTURE_PARTS * 4000; i++)
        assert_ok(strl_container_writer_add_part(writer, "a part with a name", &err), &err);
    uint64_t bytes;
    assert_ok(strl_container_writer_finish(writer, &bytes, &err), &err);
    strl_container_writer_destroy(writer);
    assert_true(bytes_read_to_open(self.path) <= 128 << 10);
    strl_container *container = open_fixture(&self);
    strl_placement placement;
    assert_ok(strl_container_placement(container, 511, &placement, &err), &err);
    assert_true(placement.tree == 511 && placement.transform[0] == 1);
    assert_ok(strl_container_node(container, 511, 0, &node, &err), &err);
    strl_container_close(container);
    fixture_teardown(&self);
}

static void equal_calls_make_equal_bytes_and_other_content_another_id(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    size_t sizes[3];
    uint8_t *files[3];
    fixture_setup(&self, 6, 3);
    for (int i = 0; i < 3; i++) {
        if (i == 2)
            self.nodes[self.node_count - 1].boundary_steps ^= 1;
        assert_ok(fixture_write(&self, &err), &err);
        files[i] = fixture_load(self.path, &sizes[i]);
    }
    assert_int_equal(sizes[0], sizes[1]);
    assert_memory_equal(files[0], files[1], sizes[0]);
    assert_memory_not_equal(files[0] + STRL__AT_MODEL_ID, files[2] + STRL__AT_MODEL_ID, 16);
    for (int i = 0; i < 3; i++)
        free(files[i]);
    fixture_teardown(&self);
}

static void a_file_gets_what_nobody_added(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 0, 1);
    const strl_container_writer_desc desc = fixture_desc(&self);
    strl_container_writer *writer;
    self.nodes[0].group = 0, self.nodes[0].group_size = 1;
    const strl_tree tree = fixture_tree(1);
    uint64_t bytes;
    assert_ok(strl_container_writer_create(&desc, &writer, &err), &err);
    assert_ok(strl_container_writer_begin_tree(writer, &tree, &err), &err);
    assert_ok(fixture_add_node(writer, &self.nodes[0], &self.nodes[0], 0, &err), &err);
    assert_ok(strl_container_writer_end_tree(writer, &err), &err);
    assert_ok(strl_container_writer_finish(writer, &bytes, &err), &err);
    assert_int_equal(strl_container_writer_finish(writer, &bytes, &err), STRL_ERR_ARGUMENT);
    strl_container_writer_destroy(writer);
    uint64_t digest;
    strl_container *container = open_fixture(&self);
    assert_ok(fixture_read_all(container, &digest, &err), &err);
    uint32_t rgba;
    char name[8];
    assert_ok(strl_container_material(container, 0, name, sizeof name, &rgba, &err), &err);
    assert_true(rgba == 0xffffffff && name[0] == 0);
    strl_container_close(container);
    assert_int_equal(fixture_files(&self), 1);
    fixture_teardown(&self);
}

static void a_writer_destroyed_before_finish_leaves_nothing(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 5, 3);
    const strl_container_writer_desc desc = fixture_desc(&self);
    strl_container_writer *writer;
    assert_ok(strl_container_writer_create(&desc, &writer, &err), &err);
    assert_int_equal(fixture_files(&self), 1); /* the spill has no name */
    assert_ok(fixture_add_all(&self, writer, &err), &err);
    strl_container_writer_destroy(writer);
    assert_int_equal(fixture_files(&self), 0);
    strl_container_writer_destroy(NULL);
    fixture_teardown(&self);
}

static void a_full_disk_at_any_write_is_a_sentence_and_no_file(void **state)
{
    (void)state;
    fixture self;
    strl_error err = {0};
    fixture_setup(&self, 5, 3);
    strl_status status = STRL_ERR_DISK_FULL;
    unsigned n = 0;
    while (status != STRL_OK && n < 1000) {
        strl_file_fail_writes_after(++n);
        status = fixture_write(&self, &err);
        strl_file_fail_writes_after(0);
        if (status == STRL_OK)
            break;
        assert_int_equal(status, STRL_ERR_DISK_FULL);
        assert_non_null(strstr(err.message, self.folder));
        assert_int_equal(fixture_files(&self), 0);
    }
    assert_int_equal(status, STRL_OK);
    assert_true(n > 5);
    fixture_teardown(&self);
}

static void a_failed_writer_refuses_to_finish(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 3, 3);
    const strl_container_writer_desc desc = fixture_desc(&self);
    strl_container_writer *writer;
    uint64_t bytes;
    assert_ok(strl_container_writer_create(&desc, &writer, &err), &err);
    assert_ok(fixture_add_all(&self, writer, &err), &err);
    const strl_placement nowhere = {.tree = 9};
    assert_int_equal(strl_container_writer_add_placement(writer, &nowhere, &err), STRL_ERR_ARGUMENT);
    assert_int_equal(strl_container_writer_finish(writer, &bytes, &err), STRL_ERR_ARGUMENT);
    assert_true(bytes == 0);
    strl_container_writer_destroy(writer);
    assert_int_equal(fixture_files(&self), 0);
    fixture_teardown(&self);
}

static void no_memory_at_any_allocation_is_an_error_and_no_file(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 2, 2);
    strl_status status = STRL_ERR_MEMORY;
    for (unsigned n = 1; status != STRL_OK && n < 1000; n++) {
        strl__alloc_fail_after(n);
        status = fixture_write(&self, &err);
        strl__alloc_fail_after(0);
        if (status != STRL_OK) {
            assert_int_equal(status, STRL_ERR_MEMORY);
            assert_int_equal(fixture_files(&self), 0);
        }
    }
    assert_int_equal(status, STRL_OK);
    size_t size;
    uint8_t *bytes = fixture_load(self.path, &size);
    status = STRL_ERR_MEMORY;
    for (unsigned n = 1; status != STRL_OK && n < 1000; n++) {
        uint64_t digest;
        strl__alloc_fail_after(n);
        status = fixture_try(bytes, size, &digest, &err);
        strl__alloc_fail_after(0);
        if (status != STRL_OK)
            assert_int_equal(status, STRL_ERR_MEMORY);
    }
    assert_int_equal(status, STRL_OK);
    free(bytes);
    fixture_teardown(&self);
}

static void a_million_names_take_no_memory(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 1, 2);
    const strl_container_writer_desc desc = fixture_desc(&self);
    strl_container_writer *writer;
    uint64_t bytes;
    char name[64], expected[64];
    assert_ok(strl_container_writer_create(&desc, &writer, &err), &err);
    assert_ok(fixture_add_all(&self, writer, &err), &err);
    /* From here on the heap refuses: a million names must not need it. */
    strl__alloc_fail_after(1);
    for (uint32_t i = FIXTURE_PARTS; i < 1000000; i++) {
        snprintf(name, sizeof name, "assembly/bolt number %u", i);
        assert_ok(strl_container_writer_add_part(writer, name, &err), &err);
    }
    strl__alloc_fail_after(0);
    assert_ok(strl_container_writer_finish(writer, &bytes, &err), &err);
    strl_container_writer_destroy(writer);
    assert_true(bytes > 5000000);
    assert_true(bytes_read_to_open(self.path) <= 128 << 10);
    strl_container *container = open_fixture(&self);
    assert_int_equal(strl_container_get_info(container)->part_count, 1000000);
    assert_ok(strl_container_part(container, 999999, name, sizeof name, &err), &err);
    strl__alloc_fail_after(1); /* nor does reading them */
    for (uint32_t i = FIXTURE_PARTS; i < 1000000; i += 1 + i / 3) {
        snprintf(expected, sizeof expected, "assembly/bolt number %u", i);
        assert_ok(strl_container_part(container, i, name, sizeof name, &err), &err);
        assert_string_equal(name, expected);
    }
    for (uint32_t i = 0; i < FIXTURE_PARTS; i++)
        assert_ok(strl_container_part(container, i, name, sizeof name, &err), &err);
    /* in any order, though each is told by others */
    for (uint32_t i = 0, at = 1; i < 300; i++, at = at * 1664525u + 1013904223u) {
        uint32_t part = FIXTURE_PARTS + at % (1000000 - FIXTURE_PARTS);
        snprintf(expected, sizeof expected, "assembly/bolt number %u", part);
        assert_ok(strl_container_part(container, part, name, sizeof name, &err), &err);
        assert_string_equal(name, expected);
    }
    strl__alloc_fail_after(0);
    strl_container_close(container);
    fixture_teardown(&self);
}

static void long_and_broken_names_are_stored_as_utf8(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 0, 1);
    self.nodes[0].group = 0, self.nodes[0].group_size = 1;
    const strl_container_writer_desc desc = fixture_desc(&self);
    const strl_tree tree = fixture_tree(1);
    strl_container_writer *writer;
    uint64_t bytes;
    static char name[40000], longest[32001];
    memset(longest, 'x', 32000);
    assert_ok(strl_container_writer_create(&desc, &writer, &err), &err);
    assert_ok(strl_container_writer_begin_tree(writer, &tree, &err), &err);
    assert_ok(fixture_add_node(writer, &self.nodes[0], &self.nodes[0], 0, &err), &err);
    assert_ok(strl_container_writer_end_tree(writer, &err), &err);
    for (int i = 0; i < 5000; i++)
        assert_ok(strl_container_writer_add_part(writer, longest, &err), &err);
    assert_ok(strl_container_writer_add_part(writer,
                                             "a\xff"
                                             "b\xc3(\xed\xa0\x80\xf0\x9f\x8f\xa0",
                                             &err),
              &err);
    assert_ok(strl_container_writer_finish(writer, &bytes, &err), &err);
    strl_container_writer_destroy(writer);
    strl_container *container = open_fixture(&self);
    assert_ok(strl_container_part(container, 4999, name, sizeof name, &err), &err);
    assert_string_equal(name, longest);
    assert_ok(strl_container_part(container, 5000, name, sizeof name, &err), &err);
    assert_string_equal(name, "a�b�(���🏠");
    strl_container_close(container);

    memset(name, 'y', 32001);
    name[32001] = 0;
    assert_ok(strl_container_writer_create(&desc, &writer, &err), &err);
    assert_int_equal(strl_container_writer_add_part(writer, name, &err), STRL_ERR_LIMIT);
    strl_container_writer_destroy(writer);
    fixture_teardown(&self);
}

static strl_status write_with(fixture *self, uint32_t id, const strl_node *node, strl_error *err)
{
    strl_node kept = self->nodes[id];
    self->nodes[id] = *node;
    strl_status status = fixture_write(self, err);
    self->nodes[id] = kept;
    assert_int_equal(fixture_files(self), 0);
    return status;
}

static void the_writer_refuses_records_that_the_format_forbids(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 4, 3);
    strl_node node = self.nodes[5];
    node.parent = 5;
    assert_int_equal(write_with(&self, 5, &node, &err), STRL_ERR_FORMAT);
    assert_string_equal(err.message, "node 5: parent is 5, expected a lower id");
    node = self.nodes[1];
    node.first_child++;
    assert_int_equal(write_with(&self, 1, &node, &err), STRL_ERR_ARGUMENT);
    node = self.nodes[1];
    node.geometric_max = node.geometric_min / 2;
    assert_int_equal(write_with(&self, 1, &node, &err), STRL_ERR_FORMAT);
    node = self.nodes[1];
    node.group_geometric = 0;
    assert_int_equal(write_with(&self, 1, &node, &err), STRL_ERR_FORMAT);
    node = self.nodes[1];
    node.box_min[2] = INT64_MIN;
    assert_int_equal(write_with(&self, 1, &node, &err), STRL_ERR_FORMAT);
    node = self.nodes[self.node_count - 1];
    node.level = 2;
    assert_int_equal(write_with(&self, self.node_count - 1, &node, &err), STRL_ERR_ARGUMENT);
    fixture_teardown(&self);
}

/* Whether id's group splits at the length (lattice units), from the fixture's own records. */
static bool is_active(const fixture *self, uint32_t id, double limit)
{
    const strl_node *node = &self->nodes[id];
    bool reached = id == 0 || (double)self->nodes[node->parent].group_geometric > limit;
    return reached && (node->child_count == 0 || (double)node->group_geometric <= limit);
}

static void a_uniform_cut_is_the_coarsest_front_within_the_length(void **state)
{
    (void)state;
    fixture self;
    strl_error err;
    fixture_setup(&self, 7, 3);
    assert_ok(fixture_write(&self, &err), &err);
    strl_container *container = open_fixture(&self);
    for (double limit = 0; limit < 18; limit += 0.5) {
        strl_cut cut;
        strl_cut_init(&cut, container, 0, limit * 0.25); /* the lattice step is 0.25 */
        uint32_t id, next = 0, leaves = 0;
        strl_node node;
        for (;; next = id + 1) {
            assert_ok(strl_cut_next(&cut, &id, &node, &err), &err);
            for (; next < self.node_count && next != id; next++)
                assert_false(is_active(&self, next, limit));
            if (id == STRL_NONE)
                break;
            assert_true(is_active(&self, id, limit));
            leaves += node.child_count == 0;
        }
        if (limit == 0)
            assert_true(leaves > 0);
    }
    strl_container_close(container);
    fixture_teardown(&self);
}

static void a_cut_draws_the_coarsest_state_within_the_length(void **state)
{
    (void)state;
    uint32_t vertex_end[] = {3, 4, 5};
    float errors[] = {4, 2, 1};
    uint16_t parent[] = {0, 0, 0, 2, 3}, map[5];
    const strl_pm mesh = {
        .vertex_count = 5, .step_count = 2, .vertex_end = vertex_end, .geometric_error = errors, .parent = parent};
    strl_cut cut = {.limit = 4};
    assert_int_equal(strl_cut_state(&cut, &mesh), 0);
    cut.limit = 3.9;
    assert_int_equal(strl_cut_state(&cut, &mesh), 1);
    cut.limit = 1;
    assert_int_equal(strl_cut_state(&cut, &mesh), 2);
    cut.limit = 0;
    assert_int_equal(strl_cut_state(&cut, &mesh), 2);
    strl_cut_resolve(&mesh, 0, map);
    assert_true(map[3] == 2 && map[4] == 2 && map[1] == 1);
    strl_cut_resolve(&mesh, 1, map);
    assert_true(map[3] == 3 && map[4] == 3);
}

static void the_stretch_of_a_transform_is_its_largest_singular_value(void **state)
{
    (void)state;
    const double identity[12] = {1, 0, 0, 9, 0, 1, 0, 9, 0, 0, 1, 9};
    assert_true(strl_transform_stretch(identity) == 1);
    const double turned[12] = {0, -3, 0, 0, 1, 0, 0, 0, 0, 0, 2, 0};
    assert_true(strl_transform_stretch(turned) == 3);
    const double shear[12] = {1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    assert_true(fabs(strl_transform_stretch(shear) - (1 + sqrt(5)) / 2) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_record_and_mesh_comes_back_as_it_was_written),
        cmocka_unit_test(the_last_node_is_found_first),
        cmocka_unit_test(facts_of_file_and_tree_come_back),
        cmocka_unit_test(placements_and_names_come_back),
        cmocka_unit_test(opening_reads_at_most_128_kib_even_with_512_trees),
        cmocka_unit_test(equal_calls_make_equal_bytes_and_other_content_another_id),
        cmocka_unit_test(a_file_gets_what_nobody_added),
        cmocka_unit_test(a_writer_destroyed_before_finish_leaves_nothing),
        cmocka_unit_test(a_full_disk_at_any_write_is_a_sentence_and_no_file),
        cmocka_unit_test(a_failed_writer_refuses_to_finish),
        cmocka_unit_test(no_memory_at_any_allocation_is_an_error_and_no_file),
        cmocka_unit_test(a_million_names_take_no_memory),
        cmocka_unit_test(long_and_broken_names_are_stored_as_utf8),
        cmocka_unit_test(the_writer_refuses_records_that_the_format_forbids),
        cmocka_unit_test(a_uniform_cut_is_the_coarsest_front_within_the_length),
        cmocka_unit_test(a_cut_draws_the_coarsest_state_within_the_length),
        cmocka_unit_test(the_stretch_of_a_transform_is_its_largest_singular_value),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
