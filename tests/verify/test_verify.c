/* A good container passes every check; each planted fault is found by the check that is meant to find it. */
#include "verify/planted.h"

#include "base/cursor.h"
#include "container/reseal.h"

static model torus, sheet;

static strl_verify_report check(const model *self, const char *path, bool against)
{
    strl_error err = {0};
    strl_verify_report report;
    const char *inputs[] = {self->input};
    const strl_verify_desc desc = {.model = path,
                                   .inputs = inputs,
                                   .input_count = against,
                                   .scratch_dir = self->folder,
                                   .memory_bytes = 256u << 20,
                                   .jobs = 2,
                                   .cuts = path == self->good ? 200 : 50};
    if (strl_verify_run(&desc, &report, &err) != STRL_OK)
        fail_msg("%s", err.message);
    return report;
}

static void assert_good(const strl_verify_report *report)
{
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        if (report->checks[kind].failures)
            fail_msg("%s: %s", strl_verify_name((strl_verify_kind)kind), report->checks[kind].first);
    assert_true(report->ok);
}

static void assert_found(const strl_verify_report *report, strl_verify_kind kind)
{
    assert_false(report->ok);
    assert_true(report->checks[kind].failures > 0);
    assert_true(strlen(report->checks[kind].first) > 10);
}

static void test_a_closed_model_passes_every_check(void **state)
{
    (void)state;
    strl_verify_report report = check(&torus, torus.good, true);
    assert_good(&report);
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        assert_true(report.checks[kind].done == (kind != STRL_VERIFY_CONES)); /* of sample trees alone */
    assert_true(report.closed);
    assert_int_equal(report.open_edges, 0);
    assert_int_equal(report.cuts, 200);
    assert_int_equal(report.cracked_cuts, 0);
    assert_true(report.cut_triangles > report.triangles_leaf);
    assert_int_equal(report.uniform_count, STRL_VERIFY_UNIFORM_CUTS);
    assert_true(report.levels && report.level_count > 1);
    assert_true(report.claimed_over_measured_median >= 1);
    for (unsigned i = 0; i < report.uniform_count; i++) {
        assert_true(report.uniform[i].claimed <= report.uniform[i].error * (1 + 1e-9));
        assert_true(report.uniform[i].from_input > 0 && report.uniform[i].to_input > 0);
        assert_true(i == 0 || report.uniform[i].triangles <= report.uniform[i - 1].triangles);
        assert_true(report.uniform[i].points >= report.triangles_leaf);
    }
    assert_int_equal(report.uniform[0].triangles > report.triangles_leaf / 2, 1);
    strl_verify_report_deinit(&report);
}

static void test_an_open_model_has_no_crack_inside(void **state)
{
    (void)state;
    strl_verify_report report = check(&sheet, sheet.good, true);
    assert_good(&report);
    assert_false(report.closed);
    assert_int_equal(report.open_edges, 2 * (90 - 1) + 2 * (110 - 1));
    strl_verify_report_deinit(&report);
}

static void test_reports_do_not_depend_on_threads_or_memory(void **state)
{
    (void)state;
    const char *inputs[] = {sheet.input};
    strl_verify_report a, b;
    strl_verify_desc desc = {
        .model = sheet.good, .inputs = inputs, .input_count = 1, .scratch_dir = sheet.folder, .jobs = 1};
    assert_int_equal(strl_verify_run(&desc, &a, NULL), STRL_OK);
    desc.jobs = 3;
    assert_int_equal(strl_verify_run(&desc, &b, NULL), STRL_OK);
    assert_int_equal(a.cut_triangles, b.cut_triangles);
    for (unsigned kind = 0; kind < STRL_VERIFY_KINDS; kind++)
        assert_int_equal(a.checks[kind].count, b.checks[kind].count);
    strl_verify_report_deinit(&b);
    desc.memory_bytes = STRL_VERIFY_LEAST_MEMORY;
    assert_int_equal(strl_verify_run(&desc, &b, NULL), STRL_OK);
    assert_true(b.ok);
    strl_verify_report_deinit(&a);
    strl_verify_report_deinit(&b);
}

/* ---- faults of bytes ---- */

static uint8_t *load(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    *size = (size_t)ftell(file);
    rewind(file);
    uint8_t *bytes = malloc(*size);
    assert_non_null(bytes);
    assert_int_equal(fread(bytes, 1, *size, file), *size);
    fclose(file);
    return bytes;
}

static void store(const char *path, const uint8_t *bytes, size_t size)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static void test_a_wrong_byte_anywhere_is_found(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = load(torus.good, &size);
    /* Header, a payload page, and the last meaningful byte: that of the trees section. */
    const size_t at[] = {20, 90, 700, 4096, 5000, size - 1};
    for (unsigned i = 0; i < sizeof at / sizeof *at; i++) {
        bytes[at[i]] ^= 0x10;
        store(torus.bad, bytes, size);
        bytes[at[i]] ^= 0x10;
        strl_verify_report report = check(&torus, torus.bad, false);
        assert_false(report.ok);
        assert_true(report.checks[STRL_VERIFY_CHECKSUMS].failures > 0 ||
                    report.checks[STRL_VERIFY_HEADER].failures > 0);
        strl_verify_report_deinit(&report);
    }
    free(bytes);
}

static void test_a_truncated_file_is_found(void **state)
{
    (void)state;
    size_t size;
    uint8_t *bytes = load(torus.good, &size);
    const size_t lengths[] = {0, 7, 4095, 4096, 5000, size / 2, size - 1};
    for (unsigned i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        store(torus.bad, bytes, lengths[i]);
        strl_verify_report report = check(&torus, torus.bad, false);
        assert_found(&report, STRL_VERIFY_HEADER);
        strl_verify_report_deinit(&report);
    }
    free(bytes);
}

#if defined(__SANITIZE_ADDRESS__)
#define DAMAGED_FILES 60
#else
#define DAMAGED_FILES 120
#endif

/* Hostile files: every checksum is right, a byte is not. Nothing is claimed about the result but that there is one. */
static void test_damage_behind_right_checksums_does_no_harm(void **state)
{
    (void)state;
    size_t size;
    unsigned found = 0, tried = 0;
    uint8_t *bytes = load(torus.good, &size);
    for (unsigned i = 0; i < DAMAGED_FILES; i++) {
        uint64_t r = strl__mix64(i + 1);
        /* Header, then node records and tables at the end, then payloads. */
        size_t at = i % 3 == 0 ? r % 400 : i % 3 == 1 ? size - 1 - r % 5000 : r % size;
        uint8_t *copy = malloc(size);
        assert_non_null(copy);
        memcpy(copy, bytes, size);
        copy[at] ^= (uint8_t)(1u << (r >> 50) % 8);
        reseal_all(copy, size, NULL, NULL);
        store(torus.bad, copy, size);
        free(copy);
        strl_verify_report report;
        const strl_verify_desc desc = {.model = torus.bad, .memory_bytes = 64u << 20, .jobs = 1, .cuts = 4};
        if (strl_verify_run(&desc, &report, NULL) == STRL_OK)
            found += !report.ok;
        tried++;
        strl_verify_report_deinit(&report);
    }
    free(bytes);
    assert_true(found > tried / 3);
}

/* ---- faults of meaning ---- */

typedef struct fault {
    uint32_t node;
} fault;

static strl_verify_report plant(const model *self, uint32_t level, model_fault change, bool against)
{
    fault context = {model_node_of_level(self, level)};
    assert_true(context.node != UINT32_MAX);
    model_plant(self, change, &context);
    return check(self, self->bad, against);
}

static void change_nothing(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)context, (void)id, (void)record, (void)mesh, (void)arena;
}

static void test_a_copy_without_a_fault_passes(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 0, change_nothing, true);
    assert_good(&report);
    strl_verify_report_deinit(&report);
}

static void widen_box(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)mesh, (void)arena;
    if (id == ((fault *)context)->node)
        record->box_max[2] += 1000000;
}

static void test_a_box_that_does_not_nest_is_found(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 1, widen_box, false);
    assert_found(&report, STRL_VERIFY_BOXES);
    strl_verify_report_deinit(&report);
}

static void narrow_group_box(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)mesh, (void)arena;
    if (id == ((fault *)context)->node)
        record->group_box_min[0] += 1;
}

static void test_a_group_box_that_members_do_not_share_is_found(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 0, narrow_group_box, false);
    assert_false(report.ok);
    assert_true(report.checks[STRL_VERIFY_BOXES].failures + report.checks[STRL_VERIFY_GROUPS].failures > 0);
    strl_verify_report_deinit(&report);
}

static void shrink_errors(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)arena;
    if (id != ((fault *)context)->node)
        return;
    for (uint32_t s = 0; s <= mesh->step_count; s++)
        mesh->geometric_error[s] = 1;
    record->geometric_min = record->geometric_max = 1;
}

static void test_an_error_that_shrinks_to_the_root_is_found(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 1, shrink_errors, true);
    assert_found(&report, STRL_VERIFY_ERRORS);
    assert_found(&report, STRL_VERIFY_DISTANCES); /* and the claim is not true either */
    strl_verify_report_deinit(&report);
}

static void scale_errors(strl_node *record, strl_pm *mesh, float factor)
{
    for (uint32_t s = 0; s <= mesh->step_count; s++)
        mesh->geometric_error[s] *= factor;
    record->geometric_min *= factor;
    record->geometric_max *= factor;
    record->group_geometric *= factor;
}

static void claim_less(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)context, (void)id, (void)arena;
    scale_errors(record, mesh, 0x1p-3f);
}

static void claim_more(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)context, (void)id, (void)arena;
    scale_errors(record, mesh, 0x1p3f);
}

static void test_claims_too_small_are_broken_and_claims_too_large_are_told(void **state)
{
    (void)state;
    strl_verify_report good = check(&torus, torus.good, true), less = plant(&torus, 0, claim_less, true);
    strl_verify_report more = plant(&torus, 0, claim_more, true);
    double most = good.most_claimed_over_measured_of_levels;
    assert_found(&less, STRL_VERIFY_DISTANCES);
    assert_good(&more);
    assert_true(most >= 1 && most <= 4);
    assert_true(fabs(more.most_claimed_over_measured_of_levels - 8 * most) < 0.01 * most);
    strl_verify_report_deinit(&good);
    strl_verify_report_deinit(&less);
    strl_verify_report_deinit(&more);
}

static void raise_group_error(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)mesh, (void)arena;
    if (id == ((fault *)context)->node)
        record->group_geometric *= 1e6f;
}

static void test_a_group_error_above_the_parents_is_found(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 0, raise_group_error, false);
    assert_found(&report, STRL_VERIFY_ERRORS);
    strl_verify_report_deinit(&report);
}

static void remove_triangle(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)record, (void)arena;
    if (id != ((fault *)context)->node)
        return;
    mesh->triangle_count--;
    for (uint32_t s = 0; s <= mesh->step_count; s++)
        if (mesh->triangle_end[s] > mesh->triangle_count)
            mesh->triangle_end[s] = mesh->triangle_count;
}

static void test_a_missing_leaf_triangle_is_found(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 0, remove_triangle, true);
    assert_found(&report, STRL_VERIFY_COUNTS);
    assert_found(&report, STRL_VERIFY_LEAVES);
    assert_false(report.closed);
    assert_int_equal(report.open_edges, 3);
    strl_verify_report_deinit(&report);
}

/* The other side of a triangle is another triangle. */
static void turn_triangle(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)record, (void)arena;
    if (id != ((fault *)context)->node)
        return;
    uint16_t corner = mesh->triangle[0][0];
    mesh->triangle[0][0] = mesh->triangle[0][1];
    mesh->triangle[0][1] = corner;
}

static void test_a_turned_leaf_triangle_is_found(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 0, turn_triangle, true);
    assert_found(&report, STRL_VERIFY_LEAVES);
    assert_int_equal(report.checks[STRL_VERIFY_CRACKS].failures, 0);
    strl_verify_report_deinit(&report);
}

/* Parents whose group has simplified shared vertices first are not compared: so one whose group has not. */
static void turn_under_plain_parent(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    fault *self = context;
    if (record->child_count && record->boundary_steps == 0 && self->node == UINT32_MAX)
        self->node = record->first_child;
    turn_triangle(context, id, record, mesh, arena);
}

static void test_a_base_mesh_that_is_not_in_the_parent_is_found(void **state)
{
    (void)state;
    fault context = {UINT32_MAX};
    model_plant(&torus, turn_under_plain_parent, &context);
    strl_verify_report report = check(&torus, torus.bad, false);
    assert_found(&report, STRL_VERIFY_UNIONS);
    strl_verify_report_deinit(&report);
}

/* A spike: the vertex of a step in the middle, which the finest cuts draw and the coarsest do not, goes to the
 * middle of the box. */
static void move_vertex(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)arena;
    if (id != ((fault *)context)->node)
        return;
    uint32_t step = mesh->step_count / 2;
    for (uint32_t v = mesh->vertex_end[step - 1]; v < mesh->vertex_end[step]; v++)
        for (int k = 0; k < 3; k++)
            mesh->position[v][k] = (int32_t)((record->box_min[k] + record->box_max[k]) / 2 - record->anchor[k]);
}

/* The same with a vertex of the base mesh. */
static void move_base_vertex(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)arena;
    uint32_t v = mesh->triangle[0][0];
    while (v >= mesh->vertex_end[0])
        v = mesh->parent[v];
    for (int k = 0; k < 3 && id == ((fault *)context)->node; k++)
        mesh->position[v][k] = (int32_t)((record->box_min[k] + record->box_max[k]) / 2 - record->anchor[k]);
}

static void test_a_moved_vertex_is_above_the_claim(void **state)
{
    (void)state;
    const model_fault faults[] = {move_vertex, move_base_vertex, move_base_vertex};
    for (uint32_t level = 0; level < 3; level++) {
        strl_verify_report report = plant(&torus, level, faults[level], true);
        assert_found(&report, STRL_VERIFY_DISTANCES);
        strl_verify_report_deinit(&report);
    }
}

/* An edge that one triangle of the base mesh uses: its ends are on the border of the node. Vertices are
 * compared by position. */
static bool same_position(const strl_pm *mesh, uint32_t a, uint32_t b)
{
    return memcmp(mesh->position[a], mesh->position[b], sizeof *mesh->position) == 0;
}

static uint32_t uses_of_edge(const strl_pm *mesh, uint32_t a, uint32_t b)
{
    uint32_t uses = 0;
    for (uint32_t t = 0; t < mesh->triangle_end[0]; t++)
        for (unsigned k = 0; k < 3; k++) {
            uint32_t c = mesh->triangle[t][k], d = mesh->triangle[t][(k + 1) % 3];
            c = c < mesh->vertex_end[0] ? c : UINT32_MAX;
            if (c == UINT32_MAX || d >= mesh->vertex_end[0])
                continue;
            uses += (same_position(mesh, a, c) && same_position(mesh, b, d)) ||
                    (same_position(mesh, a, d) && same_position(mesh, b, c));
        }
    return uses;
}

/* The node becomes its base mesh alone. */
static void forget_steps(strl_pm *mesh)
{
    uint16_t map[65536];
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        map[v] = v < mesh->vertex_end[0] ? (uint16_t)v : map[mesh->parent[v]];
    for (uint32_t t = 0; t < mesh->triangle_end[0]; t++)
        for (unsigned k = 0; k < 3; k++)
            mesh->triangle[t][k] = map[mesh->triangle[t][k]];
    mesh->vertex_count = mesh->vertex_end[0];
    mesh->triangle_count = mesh->triangle_end[0];
    mesh->step_count = 0;
}

/* Collapses a vertex on the node's border onto its neighbour there, in this node alone. */
static void collapse_border_vertex(strl_pm *mesh)
{
    uint32_t from = UINT32_MAX, to = 0;
    for (uint32_t t = 0; from == UINT32_MAX && t < mesh->triangle_count; t++)
        for (unsigned k = 0; from == UINT32_MAX && k < 3; k++)
            if (uses_of_edge(mesh, mesh->triangle[t][k], mesh->triangle[t][(k + 1) % 3]) == 1) {
                from = mesh->triangle[t][k];
                to = mesh->triangle[t][(k + 1) % 3];
            }
    assert_true(from != UINT32_MAX);
    int32_t gone[3];
    memcpy(gone, mesh->position[from], sizeof gone);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        if (memcmp(mesh->position[v], gone, sizeof gone) == 0)
            memcpy(mesh->position[v], mesh->position[to], sizeof gone);
    uint32_t kept = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint16_t *c = mesh->triangle[t];
        if (!same_position(mesh, c[0], c[1]) && !same_position(mesh, c[1], c[2]) && !same_position(mesh, c[2], c[0]))
            memmove(mesh->triangle[kept++], c, sizeof *mesh->triangle);
    }
    mesh->triangle_count = mesh->triangle_end[0] = kept;
}

static void crack_node(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)arena, (void)record;
    if (id != ((fault *)context)->node)
        return;
    mesh->geometric_error[0] = record->geometric_min;
    mesh->appearance_error[0] = record->appearance_min;
    forget_steps(mesh);
    collapse_border_vertex(mesh);
}

static void test_a_border_vertex_missing_in_one_node_is_a_crack(void **state)
{
    (void)state;
    const model *models[] = {&torus, &sheet};
    for (unsigned i = 0; i < 2; i++) {
        strl_verify_report report = plant(models[i], 1, crack_node, false);
        assert_found(&report, STRL_VERIFY_CRACKS);
        assert_true(report.cracked_cuts > 0 && report.cracked_cuts < report.cuts);
        assert_true(report.cracks > 0);
        assert_non_null(strstr(report.checks[STRL_VERIFY_CRACKS].first, "open where the input is closed"));
        strl_verify_report_deinit(&report);
    }
}

static void crack_clustered_node(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    crack_node(context, id, record, mesh, arena);
    if (id == ((fault *)context)->node)
        record->rung = STRL_RUNG_CLUSTERING;
}

static void test_nodes_of_the_last_rung_are_counted_apart(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 1, crack_clustered_node, false);
    assert_int_equal(report.checks[STRL_VERIFY_CRACKS].failures, 0);
    assert_int_equal(report.clustered_nodes, 1);
    assert_true(report.excluded_edges > 0);
    strl_verify_report_deinit(&report);
}

static void change_group(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)mesh, (void)arena;
    if (id == ((fault *)context)->node)
        record->group = record->group ? record->group - 1 : 1;
}

static void change_group_size(void *context, uint32_t id, strl_node *record, strl_pm *mesh, strl_arena *arena)
{
    (void)mesh, (void)arena;
    if (id == ((fault *)context)->node)
        record->group_size++;
}

static void test_a_wrong_group_is_found(void **state)
{
    (void)state;
    strl_verify_report report = plant(&torus, 0, change_group, false);
    assert_found(&report, STRL_VERIFY_GROUPS);
    strl_verify_report_deinit(&report);
    report = plant(&torus, 0, change_group_size, false);
    assert_found(&report, STRL_VERIFY_GROUPS);
    strl_verify_report_deinit(&report);
}

static void test_another_input_is_recognised(void **state)
{
    (void)state;
    const char *inputs[] = {sheet.input};
    strl_verify_report report;
    const strl_verify_desc desc = {
        .model = torus.good, .inputs = inputs, .input_count = 1, .scratch_dir = torus.folder};
    assert_int_equal(strl_verify_run(&desc, &report, NULL), STRL_OK);
    assert_found(&report, STRL_VERIFY_LEAVES);
    assert_found(&report, STRL_VERIFY_DISTANCES);
    strl_verify_report_deinit(&report);
}

static void test_what_cannot_be_read_is_a_failure_of_the_call(void **state)
{
    (void)state;
    strl_error err;
    strl_verify_report report;
    strl_verify_desc desc = {.model = "/nonexistent/model.stroll"};
    assert_int_equal(strl_verify_run(&desc, &report, &err), STRL_ERR_IO);
    assert_false(report.ok);
    const char *inputs[] = {"/nonexistent/input.ply"};
    desc = (strl_verify_desc){.model = torus.good, .inputs = inputs, .input_count = 1, .scratch_dir = torus.folder};
    assert_int_equal(strl_verify_run(&desc, &report, &err), STRL_ERR_IO);
    strl_verify_report_deinit(&report);
    desc.scratch_dir = NULL;
    assert_int_equal(strl_verify_run(&desc, &report, &err), STRL_ERR_ARGUMENT);
    desc = (strl_verify_desc){.model = torus.good, .memory_bytes = 1 << 20};
    assert_int_equal(strl_verify_run(&desc, &report, &err), STRL_ERR_ARGUMENT);
}

static int setup(void **state)
{
    (void)state;
    model_setup(&torus, 160, 110, true);
    model_setup(&sheet, 90, 110, false);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    model_teardown(&torus);
    model_teardown(&sheet);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_closed_model_passes_every_check),
        cmocka_unit_test(test_an_open_model_has_no_crack_inside),
        cmocka_unit_test(test_reports_do_not_depend_on_threads_or_memory),
        cmocka_unit_test(test_a_wrong_byte_anywhere_is_found),
        cmocka_unit_test(test_a_truncated_file_is_found),
        cmocka_unit_test(test_damage_behind_right_checksums_does_no_harm),
        cmocka_unit_test(test_a_copy_without_a_fault_passes),
        cmocka_unit_test(test_a_box_that_does_not_nest_is_found),
        cmocka_unit_test(test_a_group_box_that_members_do_not_share_is_found),
        cmocka_unit_test(test_an_error_that_shrinks_to_the_root_is_found),
        cmocka_unit_test(test_a_group_error_above_the_parents_is_found),
        cmocka_unit_test(test_a_missing_leaf_triangle_is_found),
        cmocka_unit_test(test_a_turned_leaf_triangle_is_found),
        cmocka_unit_test(test_a_base_mesh_that_is_not_in_the_parent_is_found),
        cmocka_unit_test(test_a_moved_vertex_is_above_the_claim),
        cmocka_unit_test(test_claims_too_small_are_broken_and_claims_too_large_are_told),
        cmocka_unit_test(test_a_border_vertex_missing_in_one_node_is_a_crack),
        cmocka_unit_test(test_nodes_of_the_last_rung_are_counted_apart),
        cmocka_unit_test(test_a_wrong_group_is_found),
        cmocka_unit_test(test_another_input_is_recognised),
        cmocka_unit_test(test_what_cannot_be_read_is_a_failure_of_the_call),
    };
#if defined(__SANITIZE_THREAD__)
    const struct CMUnitTest threaded[] = {tests[0], tests[1], tests[2]}; /* the rest puts threads to no other use */
    return cmocka_run_group_tests(threaded, setup, teardown);
#else
    return cmocka_run_group_tests(tests, setup, teardown);
#endif
}
