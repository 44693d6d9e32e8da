/* How much of its cell's side a splat hides, by the text of docs/algorithms/samples.md ("Bricks"): found again for
 * every splat of every brick from all triangles that the container stores, which is what the text speaks of, whatever
 * was drawn to where. Then by what is seen: rays through the cells. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/sample_tree.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RAYS 20u
#else
#define RAYS 40u /* along each side of a cell */
#endif
#define QUADS 128u   /* along a sheet */
#define SHEET 1.0    /* its side */
#define MOST_OFF 1.5 /* of coverage, in 255ths: rounding of it, and of the corners to the lattice */
#define PI 3.14159265358979323846

typedef struct splat_found {
    double side; /* of the cell, lattice units */
    int64_t cell[3];
    double walls; /* area of all that lies in the cell over that of its side */
    uint8_t coverage, parallel;
} splat_found;

typedef struct looked_at {
    sample_tree_triangle *triangle;
    uint64_t triangle_count;
    splat_found *splat;
    uint32_t splat_count, left_out;
} looked_at;

/* ---- looking */

static void cross_of(const int64_t corner[3][4], double cross[3])
{
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)(corner[1][k] - corner[0][k]);
        b[k] = (double)(corner[2][k] - corner[0][k]);
    }
    for (int k = 0; k < 3; k++)
        cross[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

/* The cell is that of the centroid, and holds what lies in the ball of one side round its middle. */
static bool is_of_cell(const int64_t corner[3][4], const splat_found *splat)
{
    double away[3] = {0};
    for (int k = 0; k < 3; k++) {
        double least = (double)splat->cell[k] * splat->side,
               centroid = (double)((corner[0][k] + corner[1][k] + corner[2][k]) / 3);
        if (centroid < least || centroid >= least + splat->side)
            return false;
        for (int c = 0; c < 3; c++) {
            double way = (double)corner[c][k] - least - splat->side / 2;
            away[c] += way * way;
        }
    }
    return fmax(away[0], fmax(away[1], away[2])) <= splat->side * splat->side;
}

static double walls_of(const looked_at *model, const splat_found *splat)
{
    double area = 0, cross[3];
    for (uint64_t t = 0; t < model->triangle_count; t++)
        if (is_of_cell(model->triangle[t], splat)) {
            cross_of(model->triangle[t], cross);
            area += sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]) / 2;
        }
    return area / (splat->side * splat->side);
}

/* Its place is told to half of a 32nd of the side: where that leads over a border, it is left out. */
static void add_splat(looked_at *model, const strl_node *node, const test_brick_splat *told)
{
    splat_found found = {.side = ldexp(1, told->side), .coverage = told->coverage, .parallel = told->parallel};
    for (int k = 0; k < 3; k++) {
        double at = (double)(node->anchor[k] + told->centre[k]) / found.side, within = at - floor(at);
        found.cell[k] = (int64_t)floor(at);
        if (within < 1. / 64 || within > 63. / 64) {
            model->left_out++;
            return;
        }
    }
    found.walls = walls_of(model, &found);
    model->splat[model->splat_count++] = found;
}

static looked_at look_at(const char *name)
{
    looked_at model = {0};
    built_model built;
    size_t size;
    uint8_t *file = built_read_file(built_path(name), &size);
    model.triangle = sample_tree_triangles(name, &model.triangle_count);
    built_open(&built, built_path(name));
    for (uint32_t id = 0; id < built.tree.node_count; id++) {
        const strl_node *node = &built.node[id];
        test_brick brick;
        test_brick_read(&brick, file + node->page.offset + node->payload_offset, node->payload_bytes);
        model.splat = realloc(model.splat, (model.splat_count + brick.splat_count + 1) * sizeof *model.splat);
        assert_non_null(model.splat);
        for (uint32_t i = 0; i < brick.splat_count; i++)
            add_splat(&model, node, &brick.splat[i]);
        test_brick_free(&brick);
    }
    built_close(&built);
    free(file);
    return model;
}

static void forget(looked_at *model)
{
    free(model->triangle);
    free(model->splat);
}

/* ---- what the text says */

/* parallel: from 0 to 1, as it is told to a 255th. */
static double expected_coverage(double walls, double parallel)
{
    double beside = fmax(0, 2 * parallel - 1);
    return beside * fmin(1, walls) + (1 - beside) * (1 - exp(-walls / 2));
}

static void check_all(const looked_at *model)
{
    for (uint32_t i = 0; i < model->splat_count; i++) {
        const splat_found *splat = &model->splat[i];
        double low = INFINITY, high = -INFINITY;
        for (int turn = -1; turn <= 1; turn++) { /* of its last bit */
            double covered =
                255 * expected_coverage(splat->walls, fmin(fmax(splat->parallel + turn / 2., 0), 255) / 255);
            low = fmin(low, covered);
            high = fmax(high, covered);
        }
        if (splat->coverage < low - MOST_OFF || splat->coverage > high + MOST_OFF)
            fail_msg(
                "a cell of %g at %lld %lld %lld has walls of %g sides, parallel %u: coverage %u, expected %g to %g",
                splat->side, (long long)splat->cell[0], (long long)splat->cell[1], (long long)splat->cell[2],
                splat->walls, splat->parallel, splat->coverage, low, high);
    }
}

static looked_at build_and_check(mesh_file *mesh)
{
    sample_tree_build("covered.ply", "covered.stroll", (strl_build_desc){0});
    looked_at model = look_at("covered.stroll");
    assert_int_equal(model.triangle_count, mesh->face_count);
    check_all(&model);
    assert_true(model.splat_count >= 64 && model.left_out <= model.splat_count / 4);
    mesh_file_free(mesh);
    return model;
}

static looked_at prove(mesh_file *mesh)
{
    mesh_file_write_ply(mesh, built_path("covered.ply"));
    return build_and_check(mesh);
}

/* ---- sheets */

typedef bool (*keeps_face)(uint32_t x, uint32_t y, uint32_t half);

static bool every_face(uint32_t x, uint32_t y, uint32_t half)
{
    (void)x, (void)y, (void)half;
    return true;
}

static bool one_half(uint32_t x, uint32_t y, uint32_t half)
{
    return half == (x ^ y) % 2;
}

static bool one_quarter(uint32_t x, uint32_t y, uint32_t half)
{
    return half == x / 2 % 2 && (x + y) % 2 == 0;
}

/* Of slopes that rise and fall by turns, `slope` degrees. Every second face is turned over. */
static void add_sheet(mesh_file *mesh, double height, double slope, keeps_face keeps)
{
    const uint32_t first = mesh->vertex_count, row = QUADS + 1;
    const double step = SHEET / QUADS, rise = step * tan(slope * PI / 180);
    for (uint32_t y = 0; y <= QUADS; y++)
        for (uint32_t x = 0; x <= QUADS; x++)
            mesh_file_add_vertex(mesh, x * step, y * step, height + x % 2 * rise);
    for (uint32_t y = 0; y < QUADS; y++)
        for (uint32_t x = 0; x < QUADS; x++)
            for (uint32_t half = 0; half < 2; half++) {
                uint32_t a = first + y * row + x, b = half ? a + row + 1 : a + 1, c = half ? a + row : a + row + 1;
                if (keeps(x, y, half))
                    mesh_file_add_face(mesh, a, (x + y) % 2 ? c : b, (x + y) % 2 ? b : c);
            }
}

/* Splats of cells that the sheet fills, as large as told. At its rim there may be others, of what is left over. */
static void check_sheet(const looked_at *model, double walls, double coverage, double parallel)
{
    uint32_t filled = 0;
    for (uint32_t i = 0; i < model->splat_count; i++) {
        const splat_found *splat = &model->splat[i];
        if (fabs(splat->walls - walls) > 0.001)
            continue;
        filled++;
        if (fabs(splat->coverage / 255. - coverage) > 0.008 || fabs(splat->parallel / 255. - parallel) > 0.004)
            fail_msg("walls of %g sides: coverage %u, parallel %u, expected %g, %g", splat->walls, splat->coverage,
                     splat->parallel, 255 * coverage, 255 * parallel);
    }
    if (filled < model->splat_count / 2)
        fail_msg("%u of %u cells have walls of %g sides", filled, model->splat_count, walls);
}

static void a_sheet_through_a_cell_is_a_wall_whichever_way_its_faces_are_turned(void **state)
{
    (void)state;
    mesh_file mesh = {0};
    add_sheet(&mesh, 0.3, 0, every_face);
    looked_at model = prove(&mesh);
    check_sheet(&model, 1, 1, 1);
    forget(&model);
}

static void a_part_of_a_sheet_covers_that_part(void **state)
{
    (void)state;
    const keeps_face parts[] = {one_half, one_quarter};
    for (unsigned i = 0; i < 2; i++) {
        mesh_file mesh = {0};
        add_sheet(&mesh, 0.3, 0, parts[i]);
        looked_at model = prove(&mesh);
        check_sheet(&model, i ? 0.25 : 0.5, i ? 0.25 : 0.5, 1);
        forget(&model);
    }
}

/* Parallel faces lie beside each other: two halves of a sheet are a wall, though one lies over the other. Two walls are
 * one. */
static void parallel_sheets_lie_beside_each_other(void **state)
{
    (void)state;
    for (unsigned whole = 0; whole < 2; whole++) {
        mesh_file mesh = {0};
        add_sheet(&mesh, 0.3, 0, whole ? every_face : one_half);
        add_sheet(&mesh, 0.3 + SHEET / 4096, 0, whole ? every_face : one_half);
        looked_at model = prove(&mesh);
        check_sheet(&model, whole ? 2 : 1, 1, 1);
        forget(&model);
    }
}

/* Roofs of 30 degrees: all faces to one side, their sum is cos 30 degrees as long as they are, so that 2 cos 30 - 1 of
 * them counts as parallel. */
static void slopes_lie_between_sheets_and_scattered_faces(void **state)
{
    (void)state;
    const double walls = 1 / cos(PI / 6), beside = 2 * cos(PI / 6) - 1;
    for (unsigned half = 0; half < 2; half++) {
        mesh_file mesh = {0};
        add_sheet(&mesh, 0.3, 30, half ? one_half : every_face);
        looked_at model = prove(&mesh);
        double area = half ? walls / 2 : walls, coverage = beside * fmin(1, area) + (1 - beside) * (1 - exp(-area / 2));
        check_sheet(&model, area, coverage, cos(PI / 6));
        forget(&model);
    }
}

/* ---- scattered faces */

static double random_unit(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

static void random_direction(uint64_t *random, double way[3])
{
    double around = 2 * PI * random_unit(random), z = 2 * random_unit(random) - 1;
    way[0] = sqrt(1 - z * z) * cos(around);
    way[1] = sqrt(1 - z * z) * sin(around);
    way[2] = z;
}

/* Equilateral, of that edge, in a cube of side 1, turned any way. */
static void add_scattered(mesh_file *mesh, uint32_t count, double edge, uint64_t seed)
{
    for (uint32_t i = 0; i < count; i++) {
        double at[3], across[3], other[3], up[3], length = 0, along = 0;
        uint32_t corner[3];
        random_direction(&seed, across);
        random_direction(&seed, other);
        for (int k = 0; k < 3; k++) {
            at[k] = edge + (1 - 2 * edge) * random_unit(&seed);
            along += across[k] * other[k];
        }
        for (int k = 0; k < 3; k++) {
            up[k] = other[k] - along * across[k];
            length += up[k] * up[k];
        }
        for (int c = 0; c < 3; c++) {
            double p[3], turn = 2 * PI * c / 3;
            for (int k = 0; k < 3; k++)
                p[k] = at[k] + edge / sqrt(3) * (cos(turn) * across[k] + sin(turn) * up[k] / sqrt(length));
            corner[c] = mesh_file_add_vertex(mesh, p[0], p[1], p[2]);
        }
        mesh_file_add_face(mesh, corner[0], corner[1], corner[2]);
    }
}

/* Of cells that have many and lie within the cube: (1 - exp(-w / 2)) and nothing else, and no more parallel than half.
 */
static void scattered_faces_hide_each_other(void **state)
{
    (void)state;
    const double edges[] = {0.01, 0.02, 0.03};
    double least = 1, most = 0;
    for (unsigned i = 0; i < sizeof edges / sizeof *edges; i++) {
        mesh_file mesh = {0};
        uint32_t many = 0;
        add_scattered(&mesh, 30000, edges[i], 7 + i);
        looked_at model = prove(&mesh);
        for (uint32_t k = 0; k < model.splat_count; k++) {
            const splat_found *splat = &model.splat[k];
            if (splat->parallel > 127)
                continue;
            many++;
            assert_true(fabs(splat->coverage / 255. - (1 - exp(-splat->walls / 2))) <= 0.5 / 255 + 1e-4);
            least = fmin(least, splat->coverage / 255.);
            most = fmax(most, splat->coverage / 255.);
        }
        assert_true(many > 8);
        forget(&model);
    }
    assert_true(least < 0.3 && most > 0.9);
}

static void each_face_counts_as_often_as_it_is_given(void **state)
{
    (void)state;
    double walls[2] = {0, 0};
    for (unsigned copies = 1; copies <= 2; copies++) {
        mesh_file mesh = {0};
        for (unsigned copy = 0; copy < copies; copy++)
            add_scattered(&mesh, 12000, 0.02, 3);
        looked_at model = prove(&mesh);
        for (uint32_t k = 0; k < model.splat_count; k++)
            walls[copies - 1] = fmax(walls[copies - 1], model.splat[k].walls * pow(model.splat[k].side, 2));
        forget(&model);
    }
    assert_true(fabs(walls[1] / walls[0] - 2) < 1e-6); /* of the largest cell, which has them all */
}

/* ---- what is seen */

/* A ray along `axis` at these other two coordinates. */
static bool is_hit(const int64_t corner[3][4], int axis, const double at[2])
{
    double sign[3];
    int a = (axis + 1) % 3, b = (axis + 2) % 3;
    for (int c = 0; c < 3; c++) {
        const int64_t *from = corner[c], *to = corner[(c + 1) % 3];
        sign[c] = (double)(to[a] - from[a]) * (at[1] - (double)from[b]) -
                  (double)(to[b] - from[b]) * (at[0] - (double)from[a]);
    }
    return (sign[0] >= 0 && sign[1] >= 0 && sign[2] >= 0) || (sign[0] <= 0 && sign[1] <= 0 && sign[2] <= 0);
}

/* Rays along an axis past all that is of the cell, a margin round it included: the area of what is hit over that of the
 * side. */
static double seen_share(const looked_at *model, const splat_found *splat, int axis)
{
    static bool hit[2 * RAYS][2 * RAYS];
    uint32_t hits = 0;
    double least[2], step = splat->side / RAYS;
    memset(hit, 0, sizeof hit);
    for (int k = 0; k < 2; k++)
        least[k] = ((double)splat->cell[(axis + 1 + k) % 3] - 0.5) * splat->side;
    for (uint64_t t = 0; t < model->triangle_count; t++) {
        if (!is_of_cell(model->triangle[t], splat))
            continue;
        for (uint32_t y = 0; y < 2 * RAYS; y++)
            for (uint32_t x = 0; x < 2 * RAYS; x++)
                if (!hit[y][x])
                    hit[y][x] = is_hit(model->triangle[t], axis,
                                       (const double[2]){least[0] + (x + 0.5) * step, least[1] + (y + 0.5) * step});
    }
    for (uint32_t i = 0; i < 4 * RAYS * RAYS; i++)
        hits += hit[i / (2 * RAYS)][i % (2 * RAYS)];
    return (double)hits / (RAYS * RAYS);
}

/* At the rim of the model cells are filled in part: that hides more of each other. */
static bool is_inside(const looked_at *model, const splat_found *splat)
{
    for (int k = 0; k < 3; k++) {
        int64_t least = INT64_MAX, most = INT64_MIN;
        for (uint64_t t = 0; t < model->triangle_count; t++) {
            least = model->triangle[t][0][k] < least ? model->triangle[t][0][k] : least;
            most = model->triangle[t][0][k] > most ? model->triangle[t][0][k] : most;
        }
        double margin = (double)(most - least) / 32, from = (double)splat->cell[k] * splat->side;
        if (from < (double)least + margin || from + splat->side > (double)most - margin)
            return false;
    }
    return true;
}

/* The mean over cells and axes: single ones differ by what happens to lie in them. A few hundred faces are by chance a
 * little parallel, so that somewhat more is told. */
static void scattered_faces_are_seen_as_told(void **state)
{
    (void)state;
    const uint32_t counts[] = {9000, 15000, 30000};
    for (unsigned i = 0; i < sizeof counts / sizeof *counts; i++) {
        mesh_file mesh = {0};
        double seen = 0, told = 0, due = 0;
        uint32_t looks = 0;
        add_scattered(&mesh, counts[i], 0.022, 21 + i);
        looked_at model = prove(&mesh);
        for (uint32_t k = 0; k < model.splat_count && looks < 30; k++) {
            const splat_found *splat = &model.splat[k];
            if (splat->walls < 0.2 * counts[i] / 30000 || splat->parallel > 150 || !is_inside(&model, splat))
                continue;
            for (int axis = 0; axis < 3; axis++, looks++) {
                seen += seen_share(&model, splat, axis);
                told += splat->coverage / 255.;
                due += 1 - exp(-splat->walls / 2);
            }
        }
        assert_true(looks >= 24);
        if (fabs(seen / due - 1) > 0.04 || fabs(seen / told - 1) > 0.1)
            fail_msg("%u faces: %g of a cell's side is seen, %g is due, %g is told", counts[i], seen / looks,
                     due / looks, told / looks);
        forget(&model);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sheet_through_a_cell_is_a_wall_whichever_way_its_faces_are_turned),
        cmocka_unit_test(a_part_of_a_sheet_covers_that_part),
        cmocka_unit_test(parallel_sheets_lie_beside_each_other),
        cmocka_unit_test(slopes_lie_between_sheets_and_scattered_faces),
        cmocka_unit_test(scattered_faces_hide_each_other),
        cmocka_unit_test(each_face_counts_as_often_as_it_is_given),
        cmocka_unit_test(scattered_faces_are_seen_as_told),
    };
    return cmocka_run_group_tests(tests, built_setup, built_teardown);
}
