/* The memory that a glTF's JSON takes: tables of its elements, and the arena for names and rare things. */
#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "readers/gltf.h"

/* Near the limit tables grow by such a part. */
#define TIGHT_STEP 16u

/* From now on elements are counted alone. */
static strl_status fill_up(strl__gltf *gltf, strl_error *err)
{
    gltf->is_counting = true;
    return strl__fail(err, STRL_ERR_LIMIT,
                      "%s: what its JSON describes takes more than the %" PRIu64 " bytes that the memory budget allows",
                      gltf->reader->path, gltf->table_limit);
}

static uint64_t held_bytes(const strl__gltf *gltf)
{
    return gltf->table_bytes + gltf->arena.total_bytes;
}

/* How many items more: half as many as there are, near the limit a 16th; 0: not even that. */
static size_t choose_step(const strl__gltf *gltf, size_t capacity, size_t item_bytes)
{
    const size_t steps[] = {capacity < 16 ? 16 : capacity / 2, capacity / TIGHT_STEP + 1};
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++)
        if (held_bytes(gltf) + (uint64_t)steps[i] * item_bytes <= gltf->table_limit)
            return steps[i];
    return 0;
}

strl_status strl__gltf_add(strl__gltf *gltf, void *items_pointer, size_t *count, size_t *capacity, size_t item_bytes,
                           strl_error *err)
{
    void *items;
    if (*count == *capacity) {
        const size_t step = choose_step(gltf, *capacity, item_bytes);
        if (step == 0 || *count >= UINT32_MAX - 1)
            return fill_up(gltf, err);
        memcpy(&items, items_pointer, sizeof items);
        items = strl__realloc(items, *capacity + step, item_bytes);
        if (!items)
            return strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for %zu items of its JSON", gltf->reader->path,
                              *count);
        memcpy(items_pointer, &items, sizeof items);
        *capacity += step;
        gltf->table_bytes += step * item_bytes;
    }
    ++*count;
    return STRL_OK;
}

void *strl__gltf_keep(strl__gltf *gltf, size_t bytes, strl_error *err)
{
    const bool fits = bytes <= gltf->table_limit && held_bytes(gltf) <= gltf->table_limit - bytes;
    void *block = fits ? strl_arena_alloc_zero(&gltf->arena, 1, bytes) : NULL;
    if (!fits)
        fill_up(gltf, err);
    else if (!block)
        strl__fail(err, STRL_ERR_MEMORY, "%s: no memory for %zu bytes of what its JSON describes", gltf->reader->path,
                   bytes);
    return block;
}

/* With what is room in tables that have grown near the limit. */
strl_status strl__gltf_refuse_tables(const strl__gltf *gltf, strl_error *err)
{
    const uint64_t items = held_bytes(gltf) + gltf->counted_bytes, needed = items + items / TIGHT_STEP + (64 << 10);
    char advice[STRL__ADVICE_BYTES];
    strl__reader_advise(gltf->reader, needed, gltf->table_limit, advice);
    return strl__fail(err, STRL_ERR_LIMIT,
                      "%s: what its JSON describes takes up to %" PRIu64 " bytes, the memory budget allows %" PRIu64
                      ": %s",
                      gltf->reader->path, needed, gltf->table_limit, advice);
}
