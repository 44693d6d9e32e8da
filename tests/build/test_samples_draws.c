/* Samples are drawn in proportion to area, at every height and not twice so; of the size that Theorem 1 of Klein et al.
 * (2005) asks for; and a triangle lies in the smallest cell that holds it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "build/ingest/buckets.h"
#include "build/samples/octree.h"

#define CLASSES 3u
#define HEIGHTS 4u
#define DEEPEST 3u                 /* of the cells that are sampled from leaves */
#define CELLS 512u                 /* 8^DEEPEST */
#define SHIFT 9u                   /* lattice coordinates: 30 bits */
#define COUPONS 13.815510557964274 /* of a probability of 1 - 1e-6: -ln(-ln P) */
#define ROUNDS 6u

static const strl_palette_entry palette[1] = {{.rgba = 0xffffffffu}};

static strl_ingest make_ingest(void)
{
    return (strl_ingest){.step = 1, .curve_shift = SHIFT, .palette = (strl_palette_entry *)palette, .palette_count = 1};
}

static double random_unit(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

/* ---- foliage: few large leaves, many small ones, anywhere in 8^3 cells */

typedef struct foliage {
    uint32_t each[CLASSES]; /* triangles of a class in one cell */
    double edge[CLASSES];   /* shares of the cell's side */
    uint32_t count;
    uint8_t *kind; /* [count] in the order of the octree */
    strl_octree octree;
    uint32_t root;
} foliage;

static double area_of(const strl_soup_triangle *triangle)
{
    double a[3], b[3], sum = 0;
    for (int k = 0; k < 3; k++) {
        a[k] = (double)triangle->corner[1].position[k] - triangle->corner[0].position[k];
        b[k] = (double)triangle->corner[2].position[k] - triangle->corner[0].position[k];
    }
    for (int k = 0; k < 3; k++) {
        double n = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
        sum += n * n;
    }
    return sqrt(sum) / 2;
}

/* A right angle along two axes; its centroid well within the cell, so that the key is the cell's. */
static strl_soup_triangle make_leaf(uint32_t cell, double side, double edge, uint64_t *random)
{
    strl_soup_triangle triangle = {0};
    int first = (int)(3 * random_unit(random)), second = (first + 1) % 3;
    for (int k = 0; k < 3; k++) {
        uint32_t number = (cell >> (3 * 2 + k) & 1) << 2 | (cell >> (3 * 1 + k) & 1) << 1 | (cell >> k & 1);
        double at = (number + 0.05 + (0.9 - edge) * random_unit(random)) * side;
        for (int c = 0; c < 3; c++)
            triangle.corner[c].position[k] = (uint32_t)at;
    }
    triangle.corner[1].position[first] += (uint32_t)(edge * side);
    triangle.corner[2].position[second] += (uint32_t)(edge * side);
    for (int c = 0; c < 3; c++)
        triangle.corner[c].colour = 0xffffffffu;
    return triangle;
}

typedef struct sortable {
    strl_soup_triangle triangle;
    uint64_t key;
    uint8_t kind;
} sortable;

static int compare_keys(const void *a, const void *b)
{
    const sortable *x = a, *y = b;
    return x->key < y->key ? -1 : x->key > y->key;
}

/* dense: of cell 0 mod 8 there is four times as much. */
static void grow_foliage(foliage *self, const strl_ingest *ingest, bool dense, uint64_t seed)
{
    uint32_t most = 0;
    double side = strl_octree_side(ingest, DEEPEST);
    for (uint32_t k = 0; k < CLASSES; k++)
        most += 4 * CELLS * self->each[k];
    sortable *item = malloc(most * sizeof *item);
    assert_non_null(item);
    self->count = 0;
    for (uint32_t cell = 0; cell < CELLS; cell++)
        for (uint32_t k = 0; k < CLASSES; k++)
            for (uint32_t i = 0, count = self->each[k] * (dense && cell % 8 == 0 ? 4 : 1); i < count; i++) {
                sortable *to = &item[self->count++];
                to->triangle = make_leaf(cell, side, self->edge[k], &seed);
                to->key = strl__curve_key_of_triangle(ingest, &to->triangle);
                to->kind = (uint8_t)k;
                assert_int_equal(to->key >> 3 * (STRL_OCTREE_DEPTH - DEEPEST), cell);
            }
    qsort(item, self->count, sizeof *item, compare_keys);
    strl_error err = {0};
    self->octree = (strl_octree){.leaf_triangles = 16, .coupons = COUPONS};
    assert_int_equal(strl_octree_create(&self->octree, ingest, self->count, &err), STRL_OK);
    self->kind = malloc(self->count);
    uint32_t *order = malloc(self->count * sizeof *order);
    assert_true(self->kind && order);
    for (uint32_t i = 0; i < self->count; i++) {
        self->octree.triangle[i] = item[i].triangle;
        self->octree.key[i] = item[i].key;
        self->octree.limit[i] = strl_octree_limit(ingest, &item[i].triangle, item[i].key);
        self->kind[i] = item[i].kind;
        order[i] = i;
    }
    assert_int_equal(strl_octree_build(&self->octree, order, self->count, 0, &self->root, &err), STRL_OK);
    free(order);
    free(item);
}

static void fell(foliage *self)
{
    strl_octree_deinit(&self->octree);
    free(self->kind);
}

/* ---- sums over all cells of one depth */

typedef struct tally {
    double draws;             /* that the cells of the depth should make */
    double drawn[CLASSES];    /* times that a triangle of the class was drawn */
    double stored[CLASSES];   /* triangles in the samples: stored there or above */
    double expected[CLASSES]; /* of drawn: draws by share of area */
} tally;

/* As the text has it: q ln q + c q, q rounded up. */
static double draws_of(double area, double side)
{
    double q = ceil(area / (side * side));
    return ceil(q * log(q) + COUPONS * q);
}

static uint32_t cell_of(const foliage *self, uint32_t triangle, uint32_t depth)
{
    return (uint32_t)(self->octree.key[triangle] >> 3 * (STRL_OCTREE_DEPTH - depth));
}

/* Shares of area come from the triangles themselves. */
static void add_expected(const foliage *self, const strl_ingest *ingest, uint32_t depth, tally *t)
{
    double side = strl_octree_side(ingest, depth);
    double(*area)[CLASSES] = calloc(CELLS, sizeof *area);
    assert_non_null(area);
    for (uint32_t i = 0; i < self->count; i++)
        area[cell_of(self, i, depth)][self->kind[i]] += area_of(&self->octree.triangle[i]);
    for (uint32_t cell = 0; cell < 1u << 3 * depth; cell++) {
        double total = area[cell][0] + area[cell][1] + area[cell][2], draws = draws_of(total, side);
        t->draws += draws;
        for (uint32_t k = 0; k < CLASSES; k++)
            t->expected[k] += draws * area[cell][k] / total;
    }
    free(area);
}

static void add_found(const foliage *self, uint32_t depth, tally *t)
{
    const strl_octree *octree = &self->octree;
    uint32_t cells = 0;
    for (size_t o = 0; o < octree->octant_count; o++) {
        const strl_octant *octant = &octree->octant[o];
        if (octant->depth != depth || octant->is_leaf)
            continue;
        cells++;
        for (uint32_t i = 0; i < octant->item_count; i++) {
            const strl_sample_item *item = &octree->item[octant->first_item + i];
            t->drawn[self->kind[item->triangle]] += (double)item->weight;
        }
    }
    assert_int_equal(cells, 1u << 3 * depth);
    for (uint32_t i = 0; i < self->count; i++) {
        const strl_octant *owner = &octree->octant[octree->owner[i]];
        t->stored[self->kind[i]] += !owner->is_leaf && owner->depth <= depth;
    }
}

static void tally_foliage(foliage *self, bool dense, tally t[HEIGHTS])
{
    strl_ingest ingest = make_ingest();
    memset(t, 0, HEIGHTS * sizeof *t);
    for (uint32_t round = 0; round < ROUNDS; round++) {
        grow_foliage(self, &ingest, dense, round + 1);
        for (uint32_t depth = 0; depth <= DEEPEST; depth++) {
            add_expected(self, &ingest, depth, &t[depth]);
            add_found(self, depth, &t[depth]);
        }
        fell(self);
    }
}

/* Draws of one depth come from those of the next, so what they deviate by adds up: the variance of a share p is p (1 -
 * p) times the sum of 1 / draws over the depths. Five deviations: one false alarm in some million. */
static double five_deviations(const tally *t, uint32_t depth, double share)
{
    double sum = 0;
    for (uint32_t d = depth; d <= DEEPEST; d++)
        sum += 1 / t[d].draws;
    return 5 * sqrt(share * (1 - share) * sum);
}

/* Areas are as 1 to 9 to 81, numbers as 27 to 9 to 1: of what is drawn a fifth, a fifth and three fifths are due. Were
 * area counted once more on the way up, small ones would be gone at the root. */
static void triangles_are_drawn_by_area_at_every_height(void **state)
{
    (void)state;
    for (int dense = 0; dense < 2; dense++) {
        tally t[HEIGHTS];
        foliage self = {.each = {108, 36, 4}, .edge = {0.01, 0.03, 0.09}};
        tally_foliage(&self, dense, t);
        for (uint32_t depth = 0; depth <= DEEPEST; depth++) {
            double drawn = t[depth].drawn[0] + t[depth].drawn[1] + t[depth].drawn[2];
            assert_true(drawn == t[depth].draws);
            for (uint32_t k = 0; k < CLASSES; k++) {
                double found = t[depth].drawn[k] / drawn, wanted = t[depth].expected[k] / t[depth].draws;
                if (!(fabs(found - wanted) <= five_deviations(t, depth, wanted)))
                    fail_msg("depth %u: class %u has %.4f of %.0f draws, expected %.4f", depth, k, found, drawn,
                             wanted);
            }
        }
    }
}

/* What is stored in a cell or above it, of those below it: with so many triangles that one is hardly ever drawn twice
 * by one cell, frequencies are as areas. Draws from the same few draws of a child fall together now and then, whatever
 * the area: 14 of 112. */
static void frequencies_of_being_stored_are_as_areas(void **state)
{
    (void)state;
    tally t[HEIGHTS];
    foliage self = {.each = {240, 120, 60}, .edge = {0.01, 0.02, 0.03}};
    tally_foliage(&self, false, t);
    for (uint32_t depth = 1; depth <= DEEPEST; depth++) {
        double stored = t[depth].stored[0] + t[depth].stored[1] + t[depth].stored[2];
        assert_true(stored <= t[depth].draws + ROUNDS * (depth > 1 ? 14 * 8 + 14 : 14)); /* and those above */
        assert_true(stored >= 0.8 * t[depth].draws);
        for (uint32_t k = 0; k < CLASSES; k++) {
            double found = t[depth].stored[k] / stored, wanted = t[depth].expected[k] / t[depth].draws;
            if (!(fabs(found - wanted) <= five_deviations(t, depth, wanted) + 0.02))
                fail_msg("depth %u: class %u is %.4f of %.0f, expected %.4f", depth, k, found, stored, wanted);
        }
    }
}

/* Where they lie counts as well: by area each of eight children gets its share of the root's draws. */
static void children_get_their_share_of_the_draws(void **state)
{
    (void)state;
    strl_ingest ingest = make_ingest();
    double square = 0;
    for (uint32_t round = 0; round < ROUNDS; round++) {
        foliage self = {.each = {30, 10, 4}, .edge = {0.05, 0.1, 0.3}};
        double area[8] = {0}, drawn[8] = {0}, total = 0, draws = 0;
        grow_foliage(&self, &ingest, false, 100 + round);
        for (uint32_t i = 0; i < self.count; i++)
            area[cell_of(&self, i, 1)] += area_of(&self.octree.triangle[i]);
        const strl_octant *root = &self.octree.octant[self.root];
        for (uint32_t i = 0; i < root->item_count; i++) {
            const strl_sample_item *item = &self.octree.item[root->first_item + i];
            drawn[cell_of(&self, item->triangle, 1)] += (double)item->weight;
        }
        for (int c = 0; c < 8; c++)
            total += area[c], draws += drawn[c];
        for (int c = 0; c < 8; c++) {
            double wanted = draws * area[c] / total;
            assert_true(wanted > 5);
            square += (drawn[c] - wanted) * (drawn[c] - wanted) / wanted;
        }
        fell(&self);
    }
    assert_true(square < 90); /* chi square of 7 * 6 degrees of freedom: above with a chance of 3e-5 */
    assert_true(square > 15); /* below with one of 5e-5: they are drawn, not shared out */
}

/* ---- sums */

static void sums_of_a_cell_are_those_of_its_triangles(void **state)
{
    (void)state;
    strl_ingest ingest = make_ingest();
    foliage self = {.each = {30, 10, 4}, .edge = {0.01, 0.1, 0.6}};
    grow_foliage(&self, &ingest, true, 77);
    uint32_t seen = 0;
    for (size_t o = 0; o < self.octree.octant_count; o++) {
        const strl_octant *octant = &self.octree.octant[o];
        double area = 0, centre[3] = {0};
        uint32_t count = 0;
        if (octant->is_leaf || octant->depth > DEEPEST)
            continue;
        for (uint32_t i = 0; i < self.count; i++) {
            const strl_soup_triangle *triangle = &self.octree.triangle[i];
            if (self.octree.key[i] >> 3 * (STRL_OCTREE_DEPTH - octant->depth) != octant->prefix ||
                self.octree.limit[i] < octant->depth)
                continue;
            double own = area_of(triangle);
            area += own;
            count++;
            for (int k = 0; k < 3; k++)
                centre[k] += own *
                             ((double)triangle->corner[0].position[k] + triangle->corner[1].position[k] +
                              triangle->corner[2].position[k]) /
                             3;
        }
        seen++;
        assert_int_equal(octant->total, count);
        assert_true(fabs(octant->sums.area - area) <= 1e-9 * area);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(octant->sums.centre[k] - centre[k]) <= 1e-9 * centre[k]);
        assert_true(fabs(octant->sums.linear[0] - area) <= 1e-5 * area &&
                    fabs(octant->sums.linear[3] - area) <= 1e-5 * area);
    }
    assert_true(seen > 64);
    fell(&self);
}

/* ---- sizes */

static void samples_are_as_large_as_the_theorem_says(void **state)
{
    (void)state;
    const double probabilities[] = {0.5, 0.9, 0.99, 1 - 1e-6, 1 - 1e-12},
                 squares[] = {1e-6, 0.3, 0.999, 1, 1.001, 2, 3.7, 10, 100, 200};
    strl_ingest ingest = make_ingest();
    for (size_t p = 0; p < sizeof probabilities / sizeof *probabilities; p++) {
        strl_octree octree = {.ingest = &ingest, .coupons = -log(-log(probabilities[p]))};
        for (uint32_t depth = 0; depth <= STRL_OCTREE_DEPTH; depth += 7)
            for (size_t s = 0; s < sizeof squares / sizeof *squares; s++) {
                double side = ldexp(1, (int)(SHIFT + STRL_OCTREE_DEPTH - depth)), q = ceil(squares[s]);
                double wanted = q * log(q) + octree.coupons * q;
                uint32_t found = strl_octree_draws(&octree, depth, squares[s] * side * side);
                if (!(found >= wanted - 1e-6 && found < wanted + 2))
                    fail_msg("%g squares, probability %g: %u draws, expected %g", squares[s], probabilities[p], found,
                             wanted);
            }
    }
}

static void the_size_of_a_sample_is_bounded(void **state)
{
    (void)state;
    const double areas[] = {1e4, 1e9, 1e30, 1e300};
    strl_ingest ingest = make_ingest();
    strl_octree octree = {.ingest = &ingest, .coupons = COUPONS};
    for (size_t i = 0; i < sizeof areas / sizeof *areas; i++) {
        uint32_t found = strl_octree_draws(&octree, STRL_OCTREE_DEPTH, areas[i] * 0x1p18);
        assert_true(found >= 1024 && found <= 16384);
    }
    assert_int_equal(strl_octree_draws(&octree, 3, 0), 0); /* nothing to draw by */
    octree.coupons = -log(-log(0.01));
    for (double q = 0.1; q < 3; q += 0.1)
        assert_in_range(strl_octree_draws(&octree, STRL_OCTREE_DEPTH, q * 0x1p18), 1, 3);
}

/* ---- which cell holds a triangle */

static bool is_held(const strl_soup_triangle *triangle, uint64_t key, uint32_t depth, double slack)
{
    double side = ldexp(1, (int)(SHIFT + STRL_OCTREE_DEPTH - depth));
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) {
            uint64_t cell = 0;
            for (uint32_t level = 0; level < depth; level++)
                cell |= (key >> (3 * (STRL_OCTREE_DEPTH - depth + level) + (uint32_t)k) & 1) << level;
            double way = triangle->corner[c].position[k] - ((double)cell + 0.5) * side;
            sum += way * way;
        }
        if (sqrt(sum) > side + slack)
            return false;
    }
    return true;
}

static double longest_edge(const strl_soup_triangle *triangle)
{
    double most = 0;
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) {
            double way = (double)triangle->corner[c].position[k] - triangle->corner[(c + 1) % 3].position[k];
            sum += way * way;
        }
        most = fmax(most, sqrt(sum));
    }
    return most;
}

static void check_limit(const strl_ingest *ingest, const strl_soup_triangle *triangle)
{
    uint64_t key = strl__curve_key_of_triangle(ingest, triangle);
    uint32_t limit = strl_octree_limit(ingest, triangle, key);
    double side = ldexp(1, (int)(SHIFT + STRL_OCTREE_DEPTH - limit)), extent = longest_edge(triangle);
    assert_true(limit <= STRL_OCTREE_DEPTH);
    if (limit > 0 && !is_held(triangle, key, limit, 2)) /* the centroid is rounded to the lattice */
        fail_msg("a triangle of %g is said to be held at depth %u", extent, limit);
    if (limit < STRL_OCTREE_DEPTH && is_held(triangle, key, limit + 1, -2))
        fail_msg("a triangle of %g is held below depth %u", extent, limit);
    assert_true(limit == STRL_OCTREE_DEPTH || extent >= side / 2 / 5 * 0.999); /* what is shorter goes deeper */
    assert_true(limit == 0 || extent <= 2 * side);
    assert_true(fabs((double)strl_octree_extent(triangle) - extent) <= 1e-5 * extent);
}

static strl_soup_triangle triangle_at(const double centre[3], double size, uint64_t *random)
{
    strl_soup_triangle triangle = {0};
    const double most = ldexp(1, (int)(SHIFT + STRL_OCTREE_DEPTH)) - 1;
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++)
            triangle.corner[c].position[k] =
                (uint32_t)fmin(fmax(centre[k] + size * (random_unit(random) - 0.5), 0), most);
    return triangle;
}

static void a_triangle_lies_in_the_smallest_cell_that_holds_it(void **state)
{
    (void)state;
    strl_ingest ingest = make_ingest();
    uint64_t random = 11;
    const double all = ldexp(1, (int)(SHIFT + STRL_OCTREE_DEPTH));
    for (uint32_t i = 0; i < 30000; i++) {
        double centre[3], size = all * exp2(-20 * random_unit(&random));
        for (int k = 0; k < 3; k++)
            centre[k] = all * random_unit(&random);
        strl_soup_triangle triangle = triangle_at(centre, size, &random);
        if (longest_edge(&triangle) > 0)
            check_limit(&ingest, &triangle);
    }
}

/* In the middle of all, where the eight largest cells meet, and on other corners and borders. */
static void small_triangles_on_borders_do_not_rise(void **state)
{
    (void)state;
    strl_ingest ingest = make_ingest();
    uint64_t random = 12;
    const double all = ldexp(1, (int)(SHIFT + STRL_OCTREE_DEPTH));
    for (uint32_t i = 0; i < 20000; i++) {
        double centre[3], cells = ldexp(1, 1 + (int)(i % 6)), size = all * exp2(-6 - 12 * random_unit(&random));
        for (int k = 0; k < 3; k++)
            centre[k] =
                i & 64u << k ? all * random_unit(&random) : all / cells * ceil((cells - 1) * random_unit(&random));
        strl_soup_triangle triangle = triangle_at(centre, size, &random);
        if (longest_edge(&triangle) == 0)
            continue;
        check_limit(&ingest, &triangle);
        uint32_t limit = strl_octree_limit(&ingest, &triangle, strl__curve_key_of_triangle(&ingest, &triangle));
        assert_true(limit >= 2); /* none is larger than an eighth of what that holds */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(triangles_are_drawn_by_area_at_every_height),
        cmocka_unit_test(frequencies_of_being_stored_are_as_areas),
        cmocka_unit_test(children_get_their_share_of_the_draws),
        cmocka_unit_test(sums_of_a_cell_are_those_of_its_triangles),
        cmocka_unit_test(samples_are_as_large_as_the_theorem_says),
        cmocka_unit_test(the_size_of_a_sample_is_bounded),
        cmocka_unit_test(a_triangle_lies_in_the_smallest_cell_that_holds_it),
        cmocka_unit_test(small_triangles_on_borders_do_not_rise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
