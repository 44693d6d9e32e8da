/* A surface larger than memory, in chunks that are loaded when a query comes near them and thrown out, the
 * longest unused first, when they would pass the budget. Coordinates are lattice units, as doubles.
 *
 * Thread-safe: each worker asks through a seeker of its own, which pins the chunks that it looks at. */
#ifndef STRL_VERIFY_SURFACE_H
#define STRL_VERIFY_SURFACE_H

#include "base/memory.h"
#include "platform/thread.h"
#include "stroll/error.h"
#include "verify/bvh.h"

/* One block of memory: this, then its arrays. Triangles are in the order of the leaves of its tree, vertices in
 * that of their first use, so that consecutive ones are near each other. */
typedef struct strl__chunk {
    double base[3]; /* vertices and tree are relative to it */
    double claimed; /* error claimed for this piece; 0 for the input */
    uint32_t vertex_count, triangle_count, node_count;
    uint64_t bytes; /* of the block */
    double (*vertex)[3];
    strl__bvh_node *nodes;
    uint16_t (*triangle)[3];
} strl__chunk;

/* vertex: relative to base. Uses scratch. NULL without memory; owned by the caller (strl__free). triangle_count
 * >= 1, at most 65536 vertices. */
strl__chunk *strl__v_chunk_build(const double base[3], const double (*vertex)[3], uint32_t vertex_count,
                                 const uint32_t (*triangle)[3], uint32_t triangle_count, strl_arena *scratch);
/* Sets the arrays' addresses of a block that was copied from elsewhere. */
void strl__v_chunk_point(strl__chunk *chunk);
uint64_t strl__v_chunk_bytes(uint32_t vertex_count, uint32_t triangle_count, uint32_t node_count);

typedef struct strl__surface_slot {
    strl__chunk *chunk;
    uint32_t pins;
    bool loading;
    uint32_t older, newer; /* among the chunks that are held */
} strl__surface_slot;

typedef struct strl__surface {
    uint32_t count;
    double (*box)[2][3];   /* [count] encloses the chunk; owned */
    double base[3];        /* of the tree of chunks */
    double most_claimed;   /* no chunk claims more; 0 for the input */
    strl__bvh_node *nodes; /* over chunks, owned */
    uint32_t *order;       /* [count] chunks in the order of its leaves, owned */
    /* Makes chunk `index`; worker is the thread's slot in the pool. */
    strl_status (*load)(void *context, uint32_t index, unsigned worker, strl__chunk **chunk, strl_error *err);
    void *context;
    uint64_t budget;  /* bytes; pinned chunks may pass it */
    strl_mutex mutex; /* guards what follows */
    strl_condition loaded;
    strl__surface_slot *slots; /* [count], owned */
    uint32_t oldest, newest;
    uint64_t held;
} strl__surface;

/* box is taken over, also on failure. */
strl_status strl__v_surface_init(strl__surface *surface, uint32_t count, double (*box)[2][3], strl_error *err);
void strl__v_surface_deinit(strl__surface *surface);
strl_status strl__v_surface_pin(strl__surface *surface, uint32_t index, unsigned worker, const strl__chunk **chunk,
                                strl_error *err);
void strl__v_surface_unpin(strl__surface *surface, uint32_t index);

#define STRL__SEEKER_PINS 64u

typedef struct strl__seeker {
    strl__surface *surface;
    unsigned worker;
    uint64_t most_bytes; /* pinned at a time */
    uint64_t pinned_bytes;
    uint32_t pinned;
    uint32_t index[STRL__SEEKER_PINS];
    const strl__chunk *chunk[STRL__SEEKER_PINS];
    uint32_t last_place, last_triangle; /* what was found last; the next query is likely near it */
    strl_status status;                 /* sticky failure of loading */
    strl_error error;
} strl__seeker;

void strl__v_seeker_init(strl__seeker *seeker, strl__surface *surface, unsigned worker, uint64_t most_bytes);
void strl__v_seeker_deinit(strl__seeker *seeker);
/* Squared distance of p from the surface. Exact up to rounding. */
double strl__v_seeker_distance2(strl__seeker *seeker, const double p[3]);

/* By how much p is farther from the surface than claimed: the least, over all chunks, of the distance from a chunk less
 * its own claim. found: an upper bound of that. */
double strl__v_seeker_excess(strl__seeker *seeker, const double p[3], double found);
/* The claim of the chunk that was found last. */
double strl__v_seeker_claimed(const strl__seeker *seeker);

/* Squared distance of p from a triangle, which may be degenerate. */
double strl__v_triangle_distance2(const double p[3], const double a[3], const double b[3], const double c[3]);

#endif
