/* Heads of bricks, read and written by the text of docs/format-payload.md ("Bricks") alone: what tests of sample trees
 * look into and lie with. */
#ifndef STRL_TESTS_SUPPORT_BRICK_H
#define STRL_TESTS_SUPPORT_BRICK_H

#include <stddef.h>
#include <stdint.h>

#define TEST_BRICK_STREAMS 12u

typedef struct test_brick_level {
    float size;
    uint16_t end;
} test_brick_level;

typedef struct test_brick_run {
    uint8_t level;
    uint32_t count;
} test_brick_run;

typedef struct test_brick_splat {
    int64_t centre[3];
    uint8_t side, coverage, normal[2], parallel;
    uint32_t rgba;
} test_brick_splat;

typedef struct test_brick {
    uint8_t version, level_count;
    uint32_t run_count, splat_count;
    test_brick_level *level;   /* malloc, as what follows; room for 255 */
    test_brick_splat *splat;   /* room for 65535 */
    test_brick_run *run;       /* room for 16 more than there are */
    size_t bytes;              /* of the head, as read */
    unsigned surplus, missing; /* written with a value too many, too few in stream number (this - 1) */
} test_brick;

/* Fails the running test where the bytes end within the head. */
void test_brick_read(test_brick *brick, const uint8_t *payload, size_t size);
/* Head as it now is, then the bytes that follow the one that was read; malloc. Centres are stored in 32nds of a cell's
 * side. */
uint8_t *test_brick_write(const test_brick *brick, const uint8_t *payload, size_t size, size_t *written);
void test_brick_free(test_brick *brick);

#endif
