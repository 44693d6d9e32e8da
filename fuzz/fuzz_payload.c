/* Hostile node payloads: refused with a sentence, or decoded to a mesh that keeps every invariant and survives another
 * round. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/payload.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What was accepted can be encoded, and comes back with the same shape. */
static void encode_again(const strl_pm *pm, strl_arena *arena)
{
    strl_error err = {0};
    strl_writer writer = {0};
    strl_pm again;
    if (strl_payload_encode(pm, NULL, arena, &writer, NULL, &err) ||
        strl_payload_decode(writer.data, writer.size, NULL, arena, &again, &err) || again.vertex_count != pm->vertex_count ||
        again.triangle_count != pm->triangle_count ||
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
    strl_arena_init(&arena, (size_t)512 << 20);
    strl_status peek = strl_payload_peek(data, size, &sizes, &err);
    strl_status status = strl_payload_decode(data, size, NULL, &arena, &pm, &err);
    if ((peek && !status) || (status && (status != STRL_ERR_FORMAT || !err.message[0])))
        abort();
    if (!status) {
        if (strl_pm_check(&pm, &err) || sizes.vertex_count != pm.vertex_count ||
            sizes.triangle_count != pm.triangle_count)
            abort();
        encode_again(&pm, &arena);
    }
    strl_arena_deinit(&arena);
    return 0;
}
