/* See marching.h. */
#include "scenes/marching.h"

#include <assert.h>
#include <stdbool.h>

/* The edge between two neighbouring corners. */
static unsigned edge_between(unsigned corner, unsigned other)
{
    unsigned low = corner & other;
    switch (corner ^ other) {
    case 1:
        return 0 + (low >> 1 & 1) + 2 * (low >> 2 & 1);
    case 2:
        return 4 + (low & 1) + 2 * (low >> 2 & 1);
    default:
        return 8 + (low & 1) + 2 * (low >> 1 & 1);
    }
}

/* Twice the middle of an edge, per axis 0, 1 or 2. */
static void edge_middle(unsigned edge, int middle[3])
{
    unsigned axis = edge / 4;
    unsigned first = axis == 0 ? 1 : 0;
    unsigned second = axis == 2 ? 1 : 2;
    middle[axis] = 1;
    middle[first] = 2 * (int)(edge & 1);
    middle[second] = 2 * (int)(edge >> 1 & 1);
}

/* Length of the chord between two edges' middles, squared; a forbidden one (both on one face of the cube) costs more
 * than all the allowed ones of a loop. */
static int chord_cost(unsigned edge, unsigned other)
{
    int a[3];
    int b[3];
    edge_middle(edge, a);
    edge_middle(other, b);
    int cost = 0;
    bool same_face = false;
    for (int axis = 0; axis < 3; axis++) {
        cost += (a[axis] - b[axis]) * (a[axis] - b[axis]);
        same_face |= a[axis] == b[axis] && a[axis] != 1;
    }
    return same_face ? cost + 1000 : cost;
}

/* next[e] = the edge to which the surface goes on from e across a face. */
static void link_edges(unsigned mask, int next[12])
{
    for (unsigned face = 0; face < 6; face++) {
        unsigned axis = face / 2;
        unsigned u = 1u << (axis + 1) % 3;
        unsigned v = 1u << (axis + 2) % 3;
        unsigned base = (face & 1) << axis;
        /* Counter-clockwise seen from outside the cube. */
        unsigned ring[4] = {base, base | u, base | u | v, base | v};
        if (!(face & 1)) {
            ring[1] = base | v;
            ring[3] = base | u;
        }
        for (unsigned i = 0; i < 4; i++) {
            if (!(mask >> ring[i] & 1) || (mask >> ring[(i + 1) % 4] & 1))
                continue;
            unsigned first = i; /* of the run of inside corners that ends at i */
            while (mask >> ring[(first + 3) % 4] & 1)
                first = (first + 3) % 4;
            unsigned leaves = edge_between(ring[i], ring[(i + 1) % 4]);
            next[leaves] = (int)edge_between(ring[first], ring[(first + 3) % 4]);
        }
    }
}

typedef struct loop_plan {
    uint8_t edges[12];
    int cost[12][12]; /* of the cheapest triangulation of the sub-polygon [i, j] */
    uint8_t apex[12][12];
} loop_plan;

/* The classic interval recursion over sub-polygons. */
static void plan_loop(loop_plan *plan, unsigned count)
{
    for (unsigned i = 0; i + 1 < count; i++)
        plan->cost[i][i + 1] = 0;
    for (unsigned span = 2; span < count; span++) {
        for (unsigned i = 0; i + span < count; i++) {
            unsigned j = i + span;
            int closing = span + 1 < count ? chord_cost(plan->edges[i], plan->edges[j]) : 0;
            plan->cost[i][j] = 1 << 20;
            for (unsigned k = i + 1; k < j; k++) {
                int cost = plan->cost[i][k] + plan->cost[k][j] + closing;
                if (cost < plan->cost[i][j]) {
                    plan->cost[i][j] = cost;
                    plan->apex[i][j] = (uint8_t)k;
                }
            }
        }
    }
}

static void emit_polygon(strl__cube_table *table, unsigned mask, const loop_plan *plan, unsigned i, unsigned j)
{
    if (j < i + 2)
        return;
    unsigned k = plan->apex[i][j];
    unsigned at = table->triangles[mask]++;
    assert(at < STRL__CUBE_TRIANGLES_MAX);
    table->edges[mask][3 * at + 0] = plan->edges[i];
    table->edges[mask][3 * at + 1] = plan->edges[j];
    table->edges[mask][3 * at + 2] = plan->edges[k];
    emit_polygon(table, mask, plan, i, k);
    emit_polygon(table, mask, plan, k, j);
}

void strl__cube_table_init(strl__cube_table *table)
{
    *table = (strl__cube_table){0};
    for (unsigned mask = 0; mask < 256; mask++) {
        int next[12] = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
        link_edges(mask, next);
        for (unsigned start = 0; start < 12; start++) {
            loop_plan plan = {0};
            unsigned count = 0;
            for (int edge = (int)start; next[edge] >= 0; count++) {
                int following = next[edge];
                next[edge] = -1;
                plan.edges[count] = (uint8_t)edge;
                edge = following;
            }
            if (count < 3)
                continue;
            plan_loop(&plan, count);
            assert(plan.cost[0][count - 1] < 1000);
            emit_polygon(table, mask, &plan, 0, count - 1);
        }
    }
}
