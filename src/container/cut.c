#include "container/cut.h"

#include <math.h>

void strl_cut_init(strl_cut *cut, strl_container *container, uint32_t tree, double length)
{
    *cut = (strl_cut){.container = container, .tree = tree, .parent = STRL_NONE};
    cut->adds = strl_container_tree(container, tree)->structure == STRL_STRUCTURE_SAMPLES;
    cut->limit = length / strl_container_tree(container, tree)->step; /* exact: the step is a power of two */
}

static bool group_splits(const strl_cut *cut, const strl_node *record)
{
    return (double)record->group_geometric > cut->limit;
}

strl_status strl_cut_next(strl_cut *cut, uint32_t *id, strl_node *record, strl_error *err)
{
    *id = STRL_NONE;
    uint32_t count = strl_container_tree(cut->container, cut->tree)->node_count;
    while (cut->next < count) {
        uint32_t node = cut->next++;
        strl_status status = strl_container_node(cut->container, cut->tree, node, record, err);
        /* Parents never decrease with the id: their treelets are read in order too. */
        if (status == STRL_OK && node > 0 && record->parent != cut->parent) {
            strl_node parent;
            status = strl_container_node(cut->container, cut->tree, record->parent, &parent, err);
            cut->parent = record->parent;
            cut->splits = group_splits(cut, &parent);
        }
        if (status != STRL_OK)
            return status;
        if ((node == 0 || cut->splits) && (cut->adds || record->child_count == 0 || !group_splits(cut, record))) {
            *id = node;
            return STRL_OK;
        }
    }
    return STRL_OK;
}

uint32_t strl_cut_state(const strl_cut *cut, const strl_pm *mesh)
{
    uint32_t low = 0, high = mesh->step_count; /* errors never increase with the state */
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if ((double)mesh->geometric_error[middle] <= cut->limit)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

void strl_cut_resolve(const strl_pm *mesh, uint32_t state, uint16_t *map)
{
    uint32_t end = mesh->vertex_end[state];
    /* A parent comes before its child, so it is resolved already. */
    for (uint32_t vertex = 0; vertex < mesh->vertex_count; vertex++)
        map[vertex] = vertex < end ? (uint16_t)vertex : map[mesh->parent[vertex]];
}

/* One Jacobi rotation: makes row and column p, q of the symmetric matrix zero outside the diagonal. */
static void rotate(double a[3][3], int p, int q)
{
    if (a[p][q] == 0)
        return;
    double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
    double c = 1 / sqrt(t * t + 1), s = t * c;
    int r = 3 - p - q;
    double rp = a[r][p], rq = a[r][q];
    a[p][p] -= t * a[p][q];
    a[q][q] += t * a[p][q];
    a[p][q] = a[q][p] = 0;
    a[r][p] = a[p][r] = c * rp - s * rq;
    a[r][q] = a[q][r] = s * rp + c * rq;
}

double strl_transform_stretch(const double transform[12])
{
    double a[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            a[i][j] =
                transform[i] * transform[j] + transform[4 + i] * transform[4 + j] + transform[8 + i] * transform[8 + j];
    for (int sweep = 0; sweep < 12; sweep++) {
        rotate(a, 0, 1);
        rotate(a, 0, 2);
        rotate(a, 1, 2);
    }
    return sqrt(fmax(fmax(a[0][0], a[1][1]), a[2][2]));
}
