/* What the checker knows of a container: header, trees and all node records, decoded by code of its own.
 * Everything in a record is checked for its range before it comes here; where records contradict each other,
 * checking stops after the records. */
#ifndef STRL_VERIFY_MODEL_H
#define STRL_VERIFY_MODEL_H

#include "jobs/pool.h"
#include "platform/file.h"
#include "verify/checks.h"

#define STRL__NO_NODE UINT32_MAX

typedef struct strl__hash128 {
    uint64_t low, high;
} strl__hash128;

typedef struct strl__place {
    uint64_t offset, checksum;
    uint32_t bytes;
} strl__place;

typedef struct strl__vnode {
    uint32_t parent, first_child, group, group_size;
    uint16_t level;
    uint8_t child_count, rung;
    bool told_by_parent; /* its payload is decoded by the parent's mesh */
    int64_t anchor[3];
    int64_t box[2][3], group_box[2][3]; /* min, max */
    float geometric_min, geometric_max, appearance_min, appearance_max, group_geometric, group_appearance;
    int16_t cone_axis[3];
    uint16_t cone_cosine; /* times 65535; 0 = there is no cone */
    uint32_t vertex_count, base_vertex_count, triangle_count, base_triangle_count, step_count;
    uint32_t boundary_steps, shared_vertices;
    uint32_t payload_offset, payload_bytes, page_decoded;
    strl__place page;
    strl__hash128 base, finest; /* sums of the hashes of its triangles, from its payload */
} strl__vnode;

typedef struct strl__vtree {
    uint32_t index, structure, level_count, node_count, group_count, root_triangles;
    double origin[3], step;
    int64_t box[2][3];
    uint64_t triangle_count, vertex_count;
    float leaf_geometric;
    strl__place root;
    strl__vnode *nodes;   /* [node_count], owned */
    uint32_t *page_first; /* [page_count + 1] first node of each run of nodes on one page, owned */
    uint32_t page_count;
    uint32_t *group_first; /* [group_count] its first member, owned */
} strl__vtree;

typedef struct strl__section {
    uint32_t depth;
    uint64_t item_count;
    strl__place place;
} strl__section;

enum { STRL__TREES = 1, STRL__PLACEMENTS, STRL__PARTS, STRL__MATERIALS, STRL__IMAGES, STRL__RUNS, STRL__SECTIONS };

#define STRL__RUN_PLACEMENTS 512u

/* What the file says of the placements of one page, and their box as they are read. */
typedef struct strl__vrun {
    double box[2][3], found[2][3]; /* min, max; world */
    float area;
    strl__place page;
} strl__vrun;

typedef struct strl__model {
    const strl_verify_desc *desc;
    strl__checks *checks;
    strl_pool *pool;
    uint64_t memory_bytes;
    strl_file *file;
    uint64_t file_bytes; /* as the header says, and no more than there is */
    bool closed;         /* the header's word */
    uint64_t triangles_in, dropped_nonfinite, dropped_degenerate, dropped_lines, dropped_points;
    double bounds[6];
    strl__section sections[STRL__SECTIONS];
    strl__vtree *trees; /* [tree_count], owned */
    uint32_t tree_count;
    strl__hash128 placements; /* sum of the hashes of all of them */
    strl__vrun *runs;         /* [run_count], owned; NULL where all placements are on one page */
    uint32_t run_count;
    uint64_t record_bytes; /* held by all trees' arrays */
} strl__model;

/* Each returns a failure of the machine only; *sound false where what comes later cannot be looked at. */
strl_status strl__v_read_header(strl__model *model, bool *sound, strl_error *err);
strl_status strl__v_read_trees(strl__model *model, bool *sound, strl_error *err);
strl_status strl__v_read_tables(strl__model *model, strl_error *err);
strl_status strl__v_read_records(strl__model *model, strl__vtree *tree, bool *sound, strl_error *err);
void strl__v_trees_deinit(strl__model *model);
/* Whether what the file says of the area of each run is that of its placements. All payloads must be sound. */
strl_status strl__v_check_run_areas(strl__model *model, strl_error *err);

/* runs.c, for the tables: an item of the table of runs; its page of placements as the table's index names it; the box
 * of a placement; what its placements come to when they have been read. */
strl_status strl__v_runs_create(strl__model *model, strl_error *err);
void strl__v_run_read(strl__model *model, uint64_t run, const uint8_t *bytes, size_t size);
void strl__v_run_page(strl__model *model, uint64_t first, uint64_t count, const strl__place *place);
void strl__v_run_placement(strl__model *model, uint64_t item, const double low[3], const double high[3]);
void strl__v_run_end(strl__model *model, uint64_t first);
/* Another reading of the placements, for their areas. area: [tree_count] of the trees as placed as they are, world
 * units. */
strl_status strl__v_read_areas(strl__model *model, const double *area, strl_error *err);
/* By how much the transform enlarges areas at most. */
double strl__v_area_scale(const double transform[12]);
/* samples: with trees that add up, whose area may be more. */
void strl__v_run_area(strl__model *model, uint64_t first, double area, bool samples);

/* Whether records of parents, children and group members agree: boxes, errors, groups, counts, pages. */
strl_status strl__v_check_structure(strl__model *model, strl__vtree *tree, strl_error *err);

/* Reads the bytes at place into data (place->bytes long) and checks range and checksum; key and what describe it.
 * *good false: a flaw was noted. */
strl_status strl__v_fetch(strl__model *model, const strl__place *place, const char *what, uint64_t key, uint8_t *data,
                          bool *good, strl_error *err);
bool strl__v_place_good(strl__model *model, const strl__place *place, const char *what, uint64_t key);

/* Progress; STRL_ERR_CANCELLED where the callback says so. From the caller's thread only. */
strl_status strl__v_report(strl__model *model, const char *stage, uint64_t done, uint64_t total, strl_error *err);

static inline uint64_t strl__key(const strl__vtree *tree, uint32_t node)
{
    return (uint64_t)tree->index << 32 | node;
}

static inline bool strl__replaces(const strl__vtree *tree)
{
    return tree->structure != 3;
}

/* Whether the input's triangles are in the node: leaves have them, or where nodes add up, all. */
static inline bool strl__holds_input(const strl__vtree *tree, uint32_t node)
{
    return !strl__replaces(tree) || tree->nodes[node].child_count == 0;
}

static inline uint32_t strl__group_first(const strl__vtree *tree, uint32_t node)
{
    return tree->group_first[tree->nodes[node].group];
}

#endif
