#include "build/cuts.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <cmocka.h>

#include "build/meshes.h"
#include "container/cut.h"

static double (*as_doubles(size_t count, const int64_t (*triangle)[3][3]))[3][3]
{
    double(*corner)[3][3] = malloc((count + 1) * sizeof *corner);
    assert_non_null(corner);
    for (size_t i = 0; i < 9 * count; i++)
        corner[i / 9][i / 3 % 3][i % 3] = (double)triangle[i / 9][i / 3 % 3][i % 3];
    return corner;
}

void cut_input_load(const built_model *model, cut_input *in)
{
    in->triangle = built_leaves(model, &in->count);
    in->corner = as_doubles(in->count, (const int64_t(*)[3][3])in->triangle);
    surface_create(&in->surface, (uint32_t)in->count, (const double(*)[3][3])in->corner);
}

void cut_input_free(cut_input *in)
{
    surface_destroy(&in->surface);
    free(in->triangle);
    free(in->corner);
}

void cut_random_point(const double corner[3][3], uint64_t *random, double p[3])
{
    double root = sqrt(mesh_below(random, 1000001) * 1e-6), along = mesh_below(random, 1000001) * 1e-6;
    for (int k = 0; k < 3; k++)
        p[k] = (1 - root) * corner[0][k] + root * (1 - along) * corner[1][k] + root * along * corner[2][k];
}

void cut_mesh_add(const built_model *model, uint32_t node, uint32_t s, cut_mesh *cut)
{
    assert_true(strl__grow(&cut->triangle, &cut->capacity, cut->count + model->mesh[node].triangle_end[s],
                           sizeof *cut->triangle));
    cut->count += built_triangles(model, node, s, cut->triangle + cut->count);
    if (model->node[node].rung > cut->worst_rung)
        cut->worst_rung = model->node[node].rung;
    cut->dependent += model->node[node].group_size > 1;
}

void cut_uniform(const built_model *model, double length, cut_mesh *cut)
{
    strl_cut walk;
    strl_node record;
    strl_error err = {0};
    uint32_t id;
    cut->count = cut->worst_rung = cut->dependent = 0;
    strl_cut_init(&walk, model->container, 0, length);
    for (;;) {
        if (strl_cut_next(&walk, &id, &record, &err) != STRL_OK)
            fail_msg("%s", err.message);
        if (id == STRL_NONE)
            return;
        cut_mesh_add(model, id, strl_cut_state(&walk, &model->mesh[id]), cut);
    }
}

/* The largest distance of random points of the triangles from the surface. */
static double sampled_reach(const surface *from, size_t count, const double (*corner)[3][3], uint32_t samples,
                            uint64_t *random)
{
    double worst = 0, p[3];
    for (uint32_t i = 0; i < samples; i++) {
        cut_random_point(corner[mesh_random(random) % count], random, p);
        worst = fmax(worst, surface_distance(from, p));
    }
    return worst;
}

void assert_uniform_cuts_hold(const built_model *model, const char *name, unsigned cuts, uint32_t samples)
{
    cut_input in;
    cut_mesh cut = {0};
    uint64_t random = 3;
    cut_input_load(model, &in);
    double coarsest = (double)model->node[0].geometric_max, finest = (double)model->tree.leaf_geometric;
    for (unsigned i = 0; i < cuts; i++) {
        double length = finest * pow(coarsest / finest, i / (cuts - 1.));
        cut_uniform(model, length * model->tree.step, &cut);
        assert_true(cut.count > 0);
        double(*corner)[3][3] = as_doubles(cut.count, (const int64_t(*)[3][3])cut.triangle);
        surface now;
        surface_create(&now, (uint32_t)cut.count, (const double(*)[3][3])corner);
        double away = sampled_reach(&in.surface, cut.count, (const double(*)[3][3])corner, samples, &random);
        double lost = sampled_reach(&now, in.count, (const double(*)[3][3])in.corner, samples, &random);
        if (away > length || lost > length)
            fail_msg("%s: the cut at %g (lattice units) reaches %g from the input, which reaches %g from it", name,
                     length, away, lost);
        surface_destroy(&now);
        free(corner);
    }
    strl__free(cut.triangle);
    cut_input_free(&in);
}
