/* A decoded payload, the rules that it must keep, its states, and hashes of vertices, edges and triangles by
 * absolute lattice position, so that meshes of different nodes can be compared without being in memory
 * together.
 *
 * Vertices are in the order of refinement; state s has vertices [0, vertex_end[s]) and triangles [0,
 * triangle_end[s]); a corner c stands for c where c < vertex_end[s], else for what parent[c] stands for. */
#ifndef STRL_VERIFY_MESH_H
#define STRL_VERIFY_MESH_H

#include "base/hash.h"
#include "base/memory.h"
#include "verify/model.h"

typedef struct strl__vmesh {
    uint32_t vertex_count, triangle_count, step_count, palette_count;
    int32_t (*position)[3];  /* [vertex_count] from the node's anchor */
    uint16_t (*normal)[2];   /* [vertex_count] */
    uint32_t *colour;        /* [vertex_count]; NULL = white */
    uint16_t (*texcoord)[2]; /* [vertex_count]; NULL = all 0 */
    uint16_t *palette_index; /* [vertex_count]; NULL = 0 */
    uint16_t *parent;        /* [vertex_count] */
    uint16_t (*triangle)[3]; /* [triangle_count] corners in the finest state */
    uint32_t *vertex_end;    /* [step_count + 1] */
    uint32_t *triangle_end;  /* [step_count + 1] */
    float *geometric_error;  /* [step_count + 1] */
    float *appearance_error; /* [step_count + 1] */
    uint32_t (*palette)[2];  /* [palette_count] part, material */
} strl__vmesh;

/* The mesh by which a payload is told, and its anchor less the payload's, modulo 2^32. */
typedef struct strl__v_told {
    const strl__vmesh *mesh;
    uint32_t offset[3];
} strl__v_told;

/* docs/format-payload.md. STRL_ERR_FORMAT with a sentence where the bytes are not a payload; the arrays live in
 * arena. told: NULL = self-contained. Without with_looks normals and colours are not decoded, and zero. */
/* What stands before the mesh in a payload of a sample tree (docs/format-payload.md, "Bricks"). *bytes: its length. Its
 * streams live in arena. */
strl_status strl__v_brick_check(const uint8_t *payload, const strl__vnode *node, strl_arena *arena, size_t *bytes,
                                strl_error *err);
strl_status strl__v_payload_decode(const uint8_t *data, size_t size, const strl__v_told *told, strl_arena *arena,
                                   bool with_looks, strl__vmesh *mesh, strl_error *err);

/* Every rule of a progressive mesh; STRL_ERR_FORMAT with a sentence. What indexing relies on, then what states
 * promise. */
strl_status strl__v_mesh_check_ranges(const strl__vmesh *mesh, strl_error *err);
strl_status strl__v_mesh_check_states(const strl__vmesh *mesh, strl_arena *scratch, strl_error *err);

/* map[v] is the vertex that stands for v in state; [vertex_count]. */
void strl__v_mesh_resolve(const strl__vmesh *mesh, uint32_t state, uint16_t *map);
/* The coarsest state with an error of at most limit (lattice units), else the finest. with_appearance: the
 * larger of both. */
uint32_t strl__v_mesh_state(const strl__vmesh *mesh, double limit, bool with_appearance);

static inline strl__hash128 strl__hash_point(int64_t x, int64_t y, int64_t z)
{
    uint64_t a = (uint64_t)x * 0x9e3779b97f4a7c15u, b = (uint64_t)y * 0xc2b2ae3d27d4eb4fu,
             c = (uint64_t)z * 0x165667b19e3779f9u;
    strl__hash128 hash = {strl__mix64(strl__mix64(strl__mix64(a + 0x1b873593u) + b) + c),
                          strl__mix64(strl__mix64(strl__mix64(c ^ 0x85ebca6bc2b2ae35u) ^ b) ^ a)};
    return hash;
}

static inline bool strl__hash_less(strl__hash128 a, strl__hash128 b)
{
    return a.low != b.low ? a.low < b.low : a.high < b.high;
}

static inline bool strl__hash_same(strl__hash128 a, strl__hash128 b)
{
    return a.low == b.low && a.high == b.high;
}

/* The same for both directions. */
static inline strl__hash128 strl__hash_edge(strl__hash128 a, strl__hash128 b)
{
    return (strl__hash128){strl__mix64(a.low + b.low), strl__mix64(a.high + b.high + 0x632be59bd9b4e019u)};
}

/* The same for the three rotations of the corners, another one for the other side. */
static inline strl__hash128 strl__hash_triangle(strl__hash128 a, strl__hash128 b, strl__hash128 c)
{
    strl__hash128 first = a, second = b, third = c;
    if (strl__hash_less(b, a) && strl__hash_less(b, c))
        first = b, second = c, third = a;
    else if (strl__hash_less(c, a) && strl__hash_less(c, b))
        first = c, second = a, third = b;
    return (strl__hash128){
        strl__mix64(strl__mix64(first.low + 0x2545f4914f6cdd1du) + 3 * second.low + 5 * third.low),
        strl__mix64(strl__mix64(first.high ^ 0x9fb21c651e98df25u) + 7 * second.high + 11 * third.high)};
}

/* Of a tree and twelve numbers, by their bits. */
/* own_part: as stored; 0 where it is not compared. */
strl__hash128 strl__hash_placement(uint32_t tree, uint32_t own_part, const double transform[12]);

static inline void strl__hash_add(strl__hash128 *sum, strl__hash128 hash)
{
    sum->low += hash.low;
    sum->high += hash.high;
}

/* points: [vertex_count] receives the hashes of the vertices of all states. */
void strl__v_mesh_hash_points(const strl__vmesh *mesh, const int64_t anchor[3], strl__hash128 *points);
/* The sum over the triangles of a state, whose map is given. */
strl__hash128 strl__v_mesh_hash(const strl__vmesh *mesh, uint32_t state, const uint16_t *map,
                                const strl__hash128 *points);

/* Nodes that tell one another, at most, from the self-contained one on. */
#define STRL__V_CHAIN 32u

/* A mesh by which others are told. */
typedef struct strl__vchain {
    bool is_whole, with_looks;
    const strl__vtree *tree;
    uint32_t node;
    int64_t anchor[3];
    strl_arena arena;
    strl__vmesh mesh;
} strl__vchain;

/* Per worker: bytes of a payload page, and arenas for what is decoded from it. */
typedef struct strl__worker {
    uint8_t *bytes, *payload;
    size_t capacity, payload_capacity;
    strl_arena arena, scratch;
    strl__vchain chain[STRL__V_CHAIN]; /* by depth */
} strl__worker;

strl__worker *strl__v_workers_create(const strl__model *model); /* NULL without memory */
void strl__v_workers_destroy(const strl__model *model, strl__worker *workers);

/* Decodes and checks a node's payload, `bytes`; the meshes that it is told by are read and decoded too. The mesh lives
 * in worker->arena until the next call, which rewinds worker->scratch too. */
strl_status strl__v_decode_node(strl__model *model, const strl__vtree *tree, uint32_t id, const uint8_t *bytes,
                                bool with_looks, strl__worker *worker, strl__vmesh *mesh, strl_error *err);

/* Reads and decodes one node's payload again, after the main pass has found it sound; what could not be indexed
 * fails. The mesh lives in worker->arena until the next call, which rewinds worker->scratch too. */
strl_status strl__v_load_mesh(strl__model *model, const strl__vtree *tree, uint32_t node, strl__worker *worker,
                              strl__vmesh *mesh, strl_error *err);

/* The main pass over all payloads: checksums, decoding, mesh rules, counts, boxes, errors; fills in the nodes'
 * hashes. */
strl_status strl__v_check_contents(strl__model *model, strl__vtree *tree, strl_error *err);
/* Whether the triangles lie in the cones of their node and of those above. Fails without memory alone. */
strl_status strl__v_check_cones(strl__model *model, const strl__vtree *tree, uint32_t id, const strl__vmesh *mesh,
                                strl_arena *scratch, strl_error *err);
/* Unions, from these hashes. */
void strl__v_check_unions(strl__model *model, const strl__vtree *tree, uint64_t *exempt);

#endif
