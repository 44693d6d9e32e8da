/* Where a container's payload bytes go, and how fast they decode: one JSON line a file, with bytes per leaf triangle
 * for each stream of docs/format-payload.md. One core, processor time.
 *
 *     bench_streams FILE.stroll... */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "container/treelet.h"
#include "geometry/payload_encode.h"

enum { ROUNDS = 5 };

static const struct {
    const char *name;
    unsigned first, end; /* streams */
} kinds[] = {
    {"base_connectivity", STRL__STREAM_OPERATION, STRL__STREAM_BASE_POSITION},
    {"base_positions", STRL__STREAM_BASE_POSITION, STRL__STREAM_STEP_POSITION},
    {"step_positions", STRL__STREAM_STEP_POSITION, STRL__STREAM_PARENT},
    {"step_parents", STRL__STREAM_PARENT, STRL__STREAM_KIND},
    {"step_kinds", STRL__STREAM_KIND, STRL__STREAM_START},
    {"step_starts", STRL__STREAM_START, STRL__STREAM_ARC},
    {"step_arcs", STRL__STREAM_ARC, STRL__STREAM_GENERAL},
    {"step_general", STRL__STREAM_GENERAL, STRL__STREAM_GEOMETRIC_ERROR},
    {"errors", STRL__STREAM_GEOMETRIC_ERROR, STRL__STREAM_NORMAL},
    {"normals", STRL__STREAM_NORMAL, STRL__STREAM_PALETTE_INDEX},
    {"palette_indices", STRL__STREAM_PALETTE_INDEX, STRL__STREAM_COLOUR},
    {"colours", STRL__STREAM_COLOUR, STRL__STREAM_PALETTE},
    {"palettes", STRL__STREAM_PALETTE, STRL__STREAM_SELECT},
    {"copied_triangles", STRL__STREAM_SELECT, STRL__STREAM_COPY_NORMAL},
    {"copied_normals", STRL__STREAM_COPY_NORMAL, STRL__STREAM_TEXCOORD},
    {"texture_coordinates", STRL__STREAM_TEXCOORD, STRL__STREAM_COUNT},
};

struct node {
    strl_node record;
    uint8_t *payload; /* the arena's */
    strl_pm mesh;
    strl_payload_reference reference;
};

struct model {
    strl_container *container;
    struct node *nodes;
    uint32_t count;
    uint64_t leaf_triangles, triangles, payload_bytes, file_bytes;
    strl_arena arena;
};

static const strl_payload_reference *reference_of(struct model *model, struct node *node)
{
    if (node->record.decode_parent == STRL_NONE)
        return NULL;
    const struct node *parent = &model->nodes[node->record.decode_parent];
    node->reference = strl_payload_reference_of(&parent->mesh);
    strl_page_place(&node->reference, parent->record.anchor, &node->record);
    return &node->reference;
}

static strl_status load_node(struct model *model, uint32_t id, strl_error *err)
{
    struct node *node = &model->nodes[id];
    strl_status status = strl_container_node(model->container, 0, id, &node->record, err);
    const strl_node *record = &node->record;
    node->payload = strl_arena_alloc(&model->arena, record->payload_bytes, 1);
    if (!status && !node->payload)
        status = STRL_ERR_MEMORY;
    if (!status)
        status = strl_source_read(strl_container_source(model->container), record->page.offset + record->payload_offset,
                                  node->payload, record->payload_bytes, err);
    if (!status)
        status = strl_payload_decode(node->payload, record->payload_bytes, reference_of(model, node), &model->arena,
                                     &node->mesh, err);
    model->payload_bytes += record->payload_bytes;
    model->triangles += record->triangle_count;
    return status;
}

static strl_status load(struct model *model, const char *path, strl_error *err)
{
    strl_status status = strl_container_open_path(path, &model->container, err);
    if (status)
        return status;
    const strl_tree *tree = strl_container_tree(model->container, 0);
    model->count = tree->node_count;
    model->leaf_triangles = tree->triangle_count;
    model->file_bytes = strl_container_get_info(model->container)->file_bytes;
    model->nodes = calloc(model->count, sizeof *model->nodes);
    for (uint32_t id = 0; id < model->count && !status; id++)
        status = model->nodes ? load_node(model, id, err) : STRL_ERR_MEMORY;
    return status;
}

static strl_status sum_streams(struct model *model, double bits[STRL__STREAM_COUNT], strl_error *err)
{
    strl_arena scratch = {0};
    strl_status status = STRL_OK;
    for (uint32_t id = 0; id < model->count && !status; id++) {
        struct strl__streams_out streams;
        double more[STRL__STREAM_COUNT];
        status = strl__payload_collect(&model->nodes[id].mesh, reference_of(model, &model->nodes[id]), &scratch,
                                       &streams, NULL, err);
        strl__streams_bits(&streams, more);
        for (unsigned i = 0; i < STRL__STREAM_COUNT; i++)
            bits[i] += more[i];
        strl__streams_deinit(&streams);
    }
    strl_arena_deinit(&scratch);
    return status;
}

static double processor_s(void)
{
    struct timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    double p = *(const double *)a, q = *(const double *)b;
    return p < q ? -1 : p > q;
}

static strl_status time_decode(struct model *model, double seconds[ROUNDS], strl_error *err)
{
    strl_arena arena = {0};
    strl_status status = STRL_OK;
    for (int round = 0; round < ROUNDS; round++) {
        double start = processor_s();
        for (uint32_t id = 0; id < model->count && !status; id++) {
            struct node *node = &model->nodes[id];
            strl_pm mesh;
            status = strl_payload_decode(node->payload, node->record.payload_bytes, reference_of(model, node), &arena,
                                         &mesh, err);
            strl_arena_rewind(&arena, (strl_arena_mark){0});
        }
        seconds[round] = processor_s() - start;
    }
    qsort(seconds, ROUNDS, sizeof *seconds, compare);
    strl_arena_deinit(&arena);
    return status;
}

static strl_status report(const char *path, strl_error *err)
{
    struct model model = {0};
    double bits[STRL__STREAM_COUNT] = {0}, seconds[ROUNDS];
    strl_status status = load(&model, path, err);
    if (!status)
        status = sum_streams(&model, bits, err);
    if (!status)
        status = time_decode(&model, seconds, err);
    if (!status) {
        double leaves = (double)model.leaf_triangles, rate = 1e-6 * (double)model.triangles;
        printf("{\"bench\":\"streams\",\"commit\":\"%s\",\"file\":\"%s\",\"triangles\":%" PRIu64
               ",\"bytes_per_triangle\":%.4f",
               STRL_COMMIT, path, model.leaf_triangles, (double)model.file_bytes / leaves);
        for (unsigned k = 0; k < sizeof kinds / sizeof *kinds; k++) {
            double sum = 0;
            for (unsigned i = kinds[k].first; i < kinds[k].end; i++)
                sum += bits[i] / 8;
            printf(",\"%s\":%.4f", kinds[k].name, sum / leaves);
        }
        printf(
            ",\"beside_payloads\":%.4f,\"decode_mtri_per_s\":%.2f,\"decode_slowest\":%.2f,\"decode_fastest\":%.2f}\n",
            (double)(model.file_bytes - model.payload_bytes) / leaves, rate / seconds[ROUNDS / 2],
            rate / seconds[ROUNDS - 1], rate / seconds[0]);
    }
    strl_container_close(model.container);
    strl_arena_deinit(&model.arena);
    free(model.nodes);
    return status;
}

int main(int count, char **arguments)
{
    for (int i = 1; i < count; i++) {
        strl_error err = {0};
        if (report(arguments[i], &err)) {
            fprintf(stderr, "%s\n", err.message[0] ? err.message : "no memory");
            return 1;
        }
    }
    return count > 1 ? 0 : 2;
}
