/* Hostile node payloads: refused with a sentence, or decoded to a mesh that keeps every invariant and survives another
 * round. Those that are told by another mesh get a small one. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/payload.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { SIDE = 6, CELLS = SIDE - 1 };

/* A wavy grid, the same in each run. */
static strl_payload_reference make_reference(int32_t (*position)[3], uint16_t (*normal)[2], uint16_t (*triangle)[3])
{
    for (uint16_t v = 0; v < SIDE * SIDE; v++) {
        position[v][0] = v % SIDE * 100;
        position[v][1] = v / SIDE * 100;
        position[v][2] = v * v % 17;
        normal[v][0] = normal[v][1] = 512;
    }
    for (uint16_t t = 0; t < CELLS * CELLS * 2; t++) {
        uint16_t corner = (uint16_t)(t / 2 / CELLS * SIDE + t / 2 % CELLS);
        triangle[t][0] = t % 2 ? (uint16_t)(corner + SIDE + 1) : corner;
        triangle[t][1] = t % 2 ? (uint16_t)(corner + SIDE) : (uint16_t)(corner + 1);
        triangle[t][2] = t % 2 ? (uint16_t)(corner + 1) : (uint16_t)(corner + SIDE);
    }
    return (strl_payload_reference){.vertex_count = SIDE * SIDE,
                                    .triangle_count = CELLS * CELLS * 2,
                                    .position = position,
                                    .normal = normal,
                                    .position_stride = sizeof *position,
                                    .normal_stride = sizeof *normal,
                                    .triangle = (const uint16_t(*)[3])triangle,
                                    .offset = {7, -7, 0}};
}

/* What was accepted can be encoded, and comes back with the same shape. */
static void encode_again(const strl_pm *pm, const strl_payload_reference *reference, strl_arena *arena)
{
    strl_error err = {0};
    strl_writer writer = {0};
    strl_pm again;
    if (strl_payload_encode(pm, reference, arena, &writer, NULL, &err) ||
        strl_payload_decode(writer.data, writer.size, reference, arena, &again, &err) ||
        again.vertex_count != pm->vertex_count || again.triangle_count != pm->triangle_count ||
        memcmp(again.vertex_end, pm->vertex_end, (pm->step_count + 1) * sizeof *pm->vertex_end) ||
        memcmp(again.triangle_end, pm->triangle_end, (pm->step_count + 1) * sizeof *pm->triangle_end) ||
        memcmp(again.geometric_error, pm->geometric_error, (pm->step_count + 1) * sizeof *pm->geometric_error))
        abort();
    strl__free(writer.data);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    strl_arena arena;
    strl_pm pm;
    strl_error err = {0};
    strl_payload_sizes sizes;
    int32_t position[SIDE * SIDE][3];
    uint16_t normal[SIDE * SIDE][2], triangle[CELLS * CELLS * 2][3];
    const strl_payload_reference grid = make_reference(position, normal, triangle);
    const strl_payload_reference *reference = size > 1 && data[1] & 4 ? &grid : NULL;
    strl_arena_init(&arena, (size_t)512 << 20);
    strl_status peek = strl_payload_peek(data, size, &sizes, &err);
    strl_status status = strl_payload_decode(data, size, reference, &arena, &pm, &err);
    if ((peek && !status) || (status && (status != STRL_ERR_FORMAT || !err.message[0])))
        abort();
    if (!status) {
        if (strl_pm_check(&pm, &err) || sizes.vertex_count != pm.vertex_count ||
            sizes.triangle_count != pm.triangle_count)
            abort();
        encode_again(&pm, reference, &arena);
    }
    strl_arena_deinit(&arena);
    return 0;
}
