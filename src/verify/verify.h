/* The independent proof that a container is what it claims to be. Written from docs/format.md and docs/format-
 * payload.md alone: it shares no code with the writer, the reader or the builder. docs/algorithms/verify.md
 * says what is proved and how.
 *
 * A container that breaks its promises is a result (report->ok is false), not a failure of the call. */
#ifndef STRL_VERIFY_VERIFY_H
#define STRL_VERIFY_VERIFY_H

#include <stdbool.h>
#include <stdint.h>

#include "stroll/error.h"

#define STRL_VERIFY_UNIFORM_CUTS 8u
#define STRL_VERIFY_LEAST_MEMORY (64ull << 20)
#define STRL_VERIFY_ROOT_TRIANGLES 16384u

typedef enum strl_verify_kind {
    STRL_VERIFY_HEADER,     /* fields, ranges, reserved bytes, model id */
    STRL_VERIFY_REFERENCES, /* alignment and range of everything that is referred to */
    STRL_VERIFY_CHECKSUMS,
    STRL_VERIFY_TABLES,    /* placements, parts, materials */
    STRL_VERIFY_RECORDS,   /* ranges of node records, parents and children, treelets */
    STRL_VERIFY_PAGES,     /* payloads without gaps in id order, decoded sizes */
    STRL_VERIFY_PAYLOADS,  /* each decodes to a progressive mesh as its record says */
    STRL_VERIFY_COUNTS,    /* triangles, vertices, groups, levels, drops */
    STRL_VERIFY_BOXES,     /* geometry in box, boxes nest */
    STRL_VERIFY_CONES,     /* normals of the triangles of a node and all below it in its cone */
    STRL_VERIFY_ERRORS,    /* monotone from the leaves to the root */
    STRL_VERIFY_GROUPS,    /* membership and sizes */
    STRL_VERIFY_ROOT,      /* the root's base mesh is small enough */
    STRL_VERIFY_UNIONS,    /* children's base meshes are the parent's finest state */
    STRL_VERIFY_CLOSED,    /* the header's word on whether the input is closed */
    STRL_VERIFY_CRACKS,    /* view-dependent cuts have no open edge where the input has none */
    STRL_VERIFY_LEAVES,    /* leaf triangles are the input's, on the lattice */
    STRL_VERIFY_DISTANCES, /* no measured distance is above the claim */
    STRL_VERIFY_KINDS
} strl_verify_kind;

typedef struct strl_verify_check {
    bool done;      /* it was part of this run */
    uint64_t count; /* things looked at */
    uint64_t failures;
    char first[480]; /* the sentence of the first failure */
} strl_verify_check;

/* A measured cut. Lengths in model units. */
typedef struct strl_verify_cut {
    double error;      /* allowed: every claim in the cut is at most this; of a level: the largest claim */
    double claimed;    /* the largest claimed error in the cut */
    double from_input; /* largest distance of an input point from the cut */
    double to_input;   /* largest distance of a point of the cut from the input */
    double rms;        /* over all points of both directions */
    uint64_t nodes, triangles;
    uint64_t points; /* measured, both directions */
} strl_verify_cut;

/* Claimed over measured; 0 where the distance measured is nothing but the rounding of the measurement. */
double strl_verify_ratio(const strl_verify_cut *cut);

/* Zero-initialise the desc: every 0 takes its default. */
typedef struct strl_verify_desc {
    const char *model;
    const char *const *inputs; /* what the model was built from, in the same order */
    uint32_t input_count;      /* 0 = the container alone is checked */
    const char *scratch_dir;   /* an existing folder, for files without names; needed with inputs */
    const char *importer;      /* the program that reads foreign formats (readers/reader.h); NULL = as installed */
    uint64_t memory_bytes;     /* 0 = 1 GiB; least STRL_VERIFY_LEAST_MEMORY */
    unsigned jobs;             /* threads that work; 0 = one per processor */
    uint32_t cuts;             /* view-dependent cuts per tree; 0 = 200 */
    uint64_t seed;             /* of cuts and samples */
    /* Called on the caller's thread; false cancels. May be NULL. stage is static. */
    bool (*progress)(void *context, const char *stage, uint64_t done, uint64_t total);
    void *context;
} strl_verify_desc;

typedef struct strl_verify_report {
    bool ok;
    strl_verify_check checks[STRL_VERIFY_KINDS];
    uint64_t trees, nodes, groups, triangles_in, triangles_leaf;
    bool closed;              /* the leaf mesh is watertight */
    uint64_t open_edges;      /* of the leaf mesh */
    uint32_t cuts;            /* view-dependent cuts that were tried */
    uint32_t cracked_cuts;    /* of them with an open edge that the input has not */
    uint64_t cracks;          /* such edges, over the cracked cuts that were looked at closely */
    uint64_t cut_triangles;   /* of all these cuts */
    uint64_t clustered_nodes; /* nodes made by the ladder's last rung */
    uint64_t excluded_edges;  /* edges of the cuts left out because they touch one */
    uint64_t unions_exempt;   /* parents whose group simplified shared vertices first */
    strl_verify_cut uniform[STRL_VERIFY_UNIFORM_CUTS];
    uint32_t uniform_count;  /* 0 without inputs */
    strl_verify_cut *levels; /* owned; [level_count] all nodes of a level in their base state */
    uint32_t level_count;
    double claimed_over_measured_median;         /* of the uniform cuts where something was measured; 0 = nowhere */
    double most_claimed_over_measured_of_levels; /* 0 = nothing was measured */
    double worst_claimed_over_measured;          /* the least of the uniform cuts: below 1 is a broken claim */
} strl_verify_report;

/* Short name of a check, for people and JSON. */
const char *strl_verify_name(strl_verify_kind kind);

/* STRL_OK: the report is filled in, whatever it says. Failure: it could not be made (memory, files, inputs). */
strl_status strl_verify_run(const strl_verify_desc *desc, strl_verify_report *report, strl_error *err);
void strl_verify_report_deinit(strl_verify_report *report);

#endif
