/* The only way to the heap. Sizes are checked for overflow; failures can be injected by tests. */
#ifndef STRL_BASE_MEMORY_H
#define STRL_BASE_MEMORY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* count * size bytes, uninitialised. NULL on overflow or without memory; never NULL for 0 bytes. Thread-safe. */
void *strl__alloc(size_t count, size_t size);
/* The same, zeroed. */
void *strl__alloc_zero(size_t count, size_t size);
/* Like realloc of count * size bytes; the old block stays valid on failure. */
void *strl__realloc(void *block, size_t count, size_t size);
void strl__free(void *block);
/* A copy of a zero-terminated string, owned by the caller (strl__free). */
char *strl__strdup(const char *text);

/* Test hook: the n-th allocation from now (1 = next) and all after it fail; 0 switches the hook off. Process-wide. */
void strl__alloc_fail_after(uint64_t n);

/* Makes room for `need` items in a growing array: *items with capacity *capacity of item_size bytes. Grows by half. */
bool strl__grow(void *items_pointer, size_t *capacity, size_t need, size_t item_size);

/* Arena: bump allocation, released as a whole. Not thread-safe; one per job. */
typedef struct strl_arena {
    struct strl_arena_block *head; /* the block in use; older ones behind it */
    size_t used;                   /* bytes used in head */
    size_t total_bytes;            /* bytes of all blocks */
    size_t limit_bytes;            /* 0 = none; allocations that would pass it return NULL */
} strl_arena;

typedef struct strl_arena_mark {
    struct strl_arena_block *head;
    size_t used;
} strl_arena_mark;

void strl_arena_init(strl_arena *arena, size_t limit_bytes);
void strl_arena_deinit(strl_arena *arena);
/* 16-byte aligned, uninitialised; NULL on overflow, limit or without memory. */
void *strl_arena_alloc(strl_arena *arena, size_t count, size_t size);
void *strl_arena_alloc_zero(strl_arena *arena, size_t count, size_t size);
strl_arena_mark strl_arena_get_mark(const strl_arena *arena);
/* Releases all that was allocated since the mark. Keeps the newest block for reuse where it can. */
void strl_arena_rewind(strl_arena *arena, strl_arena_mark mark);

#endif
