#include "build/open_edges.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static int compare_places(const void *a, const void *b)
{
    const int64_t *x = a, *y = b;
    for (int k = 0; k < 3; k++)
        if (x[k] != y[k])
            return x[k] < y[k] ? -1 : 1;
    return 0;
}

static int compare_edges(const void *a, const void *b)
{
    const open_edge *x = a, *y = b;
    int order = compare_places(x->low, y->low);
    return order ? order : compare_places(x->high, y->high);
}

open_edge *list_open_edges(size_t count, const int64_t (*triangle)[3][3], size_t *open)
{
    open_edge *edges = malloc((3 * count + 1) * sizeof *edges);
    assert_non_null(edges);
    for (size_t i = 0; i < 3 * count; i++) {
        const int64_t *a = triangle[i / 3][i % 3], *b = triangle[i / 3][(i + 1) % 3];
        bool swap = compare_places(a, b) > 0;
        memcpy(edges[i].low, swap ? b : a, sizeof edges[i].low);
        memcpy(edges[i].high, swap ? a : b, sizeof edges[i].high);
    }
    qsort(edges, 3 * count, sizeof *edges, compare_edges);
    *open = 0;
    for (size_t i = 0, next; i < 3 * count; i = next) {
        for (next = i + 1; next < 3 * count && !compare_edges(&edges[i], &edges[next]);)
            next++;
        if ((next - i) & 1)
            edges[(*open)++] = edges[i];
    }
    return edges;
}

int64_t (*list_rim_points(size_t count, const int64_t (*triangle)[3][3], size_t *points))[3]
{
    size_t open;
    open_edge *edges = list_open_edges(count, triangle, &open);
    int64_t(*rim)[3] = malloc((2 * open + 1) * sizeof *rim);
    assert_non_null(rim);
    for (size_t i = 0; i < open; i++) {
        memcpy(rim[2 * i], edges[i].low, sizeof rim[0]);
        memcpy(rim[2 * i + 1], edges[i].high, sizeof rim[0]);
    }
    *points = 2 * open;
    qsort(rim, *points, sizeof *rim, compare_places);
    free(edges);
    return rim;
}

void assert_open_at_the_rim_only(size_t count, const int64_t (*triangle)[3][3], const int64_t (*rim)[3],
                                 size_t rim_count, uint32_t number)
{
    size_t open;
    open_edge *edges = list_open_edges(count, triangle, &open);
    for (size_t i = 0; i < open; i++)
        if (!bsearch(edges[i].low, rim, rim_count, sizeof *rim, compare_places) ||
            !bsearch(edges[i].high, rim, rim_count, sizeof *rim, compare_places))
            fail_msg(
                "cut %u has %zu open edges, one of which runs from %lld %lld %lld to %lld %lld %lld: at one end, the "
                "input is closed",
                number, open, (long long)edges[i].low[0], (long long)edges[i].low[1], (long long)edges[i].low[2],
                (long long)edges[i].high[0], (long long)edges[i].high[1], (long long)edges[i].high[2]);
    free(edges);
}
