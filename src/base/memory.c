#include "base/memory.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

static _Atomic uint64_t fail_countdown; /* test hook, see strl__alloc_fail_after */

void strl__alloc_fail_after(uint64_t n)
{
    atomic_store(&fail_countdown, n);
}

static bool injected_failure(void)
{
    uint64_t left = atomic_load_explicit(&fail_countdown, memory_order_relaxed);
    if (left == 0)
        return false;
    while (left > 1)
        if (atomic_compare_exchange_weak(&fail_countdown, &left, left - 1))
            return false;
    return true;
}

static bool product(size_t count, size_t size, size_t *bytes)
{
    if (__builtin_mul_overflow(count, size, bytes))
        return false;
    if (*bytes == 0)
        *bytes = 1;
    return true;
}

void *strl__alloc(size_t count, size_t size)
{
    size_t bytes;
    return product(count, size, &bytes) && !injected_failure() ? malloc(bytes) : NULL;
}

void *strl__alloc_zero(size_t count, size_t size)
{
    size_t bytes;
    return product(count, size, &bytes) && !injected_failure() ? calloc(1, bytes) : NULL;
}

void *strl__realloc(void *block, size_t count, size_t size)
{
    size_t bytes;
    return product(count, size, &bytes) && !injected_failure() ? realloc(block, bytes) : NULL;
}

void strl__free(void *block)
{
    free(block);
}

char *strl__strdup(const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = strl__alloc(size, 1);
    if (copy)
        memcpy(copy, text, size);
    return copy;
}

bool strl__grow(void *items_pointer, size_t *capacity, size_t need, size_t item_size)
{
    if (need <= *capacity)
        return true;
    void *items;
    memcpy(&items, items_pointer, sizeof items);
    size_t wanted = *capacity < 16 ? 16 : *capacity + *capacity / 2;
    if (wanted < need)
        wanted = need;
    void *grown = strl__realloc(items, wanted, item_size);
    if (!grown)
        return false;
    memcpy(items_pointer, &grown, sizeof grown);
    *capacity = wanted;
    return true;
}

/* The header is padded to 16 bytes, so that what follows it keeps malloc's alignment. */
struct strl_arena_block {
    struct strl_arena_block *next;
    size_t bytes;
};

#define ARENA_BLOCK_BYTES ((size_t)256 << 10)

void strl_arena_init(strl_arena *arena, size_t limit_bytes)
{
    *arena = (strl_arena){.limit_bytes = limit_bytes};
}

void strl_arena_deinit(strl_arena *arena)
{
    while (arena->head) {
        struct strl_arena_block *next = arena->head->next;
        strl__free(arena->head);
        arena->head = next;
    }
    *arena = (strl_arena){.limit_bytes = arena->limit_bytes};
}

static bool arena_push_block(strl_arena *arena, size_t bytes)
{
    size_t size = bytes > ARENA_BLOCK_BYTES ? bytes : ARENA_BLOCK_BYTES;
    if (size > SIZE_MAX - sizeof(struct strl_arena_block))
        return false;
    if (arena->limit_bytes &&
        (arena->total_bytes > arena->limit_bytes || size > arena->limit_bytes - arena->total_bytes))
        return false;
    struct strl_arena_block *block = strl__alloc(1, sizeof *block + size);
    if (!block)
        return false;
    block->next = arena->head;
    block->bytes = size;
    arena->head = block;
    arena->used = 0;
    arena->total_bytes += size;
    return true;
}

void *strl_arena_alloc(strl_arena *arena, size_t count, size_t size)
{
    size_t bytes;
    if (!product(count, size, &bytes) || bytes > SIZE_MAX - 15)
        return NULL;
    bytes = (bytes + 15) & ~(size_t)15;
    if (!arena->head || bytes > arena->head->bytes - arena->used)
        if (!arena_push_block(arena, bytes))
            return NULL;
    char *start = (char *)(arena->head + 1) + arena->used;
    arena->used += bytes;
    return start;
}

void *strl_arena_alloc_zero(strl_arena *arena, size_t count, size_t size)
{
    void *block = strl_arena_alloc(arena, count, size);
    if (block)
        memset(block, 0, count * size);
    return block;
}

strl_arena_mark strl_arena_get_mark(const strl_arena *arena)
{
    return (strl_arena_mark){arena->head, arena->used};
}

void strl_arena_rewind(strl_arena *arena, strl_arena_mark mark)
{
    while (arena->head != mark.head) {
        struct strl_arena_block *block = arena->head;
        if (block->next == mark.head && mark.head == NULL) {
            arena->used = 0; /* the only block: kept for the next round */
            return;
        }
        arena->head = block->next;
        arena->total_bytes -= block->bytes;
        strl__free(block);
    }
    arena->used = mark.used;
}
