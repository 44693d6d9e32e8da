/* What the fuzzers of readers share: a hostile file may be refused, but what is read must keep the
 * reader's promises. */
#ifndef STRL_FUZZ_READER_H
#define STRL_FUZZ_READER_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/hash.h"
#include "readers/internal.h"

#define FUZZ_CHECK(condition)                                                                                          \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                                            \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

#define FUZZ_TRIANGLES_MAX 20000u

typedef struct fuzz_pass {
    strl_status status;
    uint64_t count, checksum;
    uint32_t highest_part, highest_material;
    strl_reader_drops drops;
} fuzz_pass;

static inline void fuzz_check_triangle(const strl_triangle *triangle, fuzz_pass *pass)
{
    for (unsigned i = 0; i < 9; i++) {
        FUZZ_CHECK(__builtin_isfinite(triangle->position[i / 3][i % 3]));
        FUZZ_CHECK(__builtin_isfinite(triangle->normal[i / 3][i % 3]));
    }
    for (unsigned i = 0; i < 6; i++) {
        const float coordinate = triangle->texcoord[i / 2][i % 2];
        FUZZ_CHECK(__builtin_isfinite(coordinate));
        FUZZ_CHECK((triangle->flags & STRL_TRIANGLE_HAS_TEXCOORD) || coordinate == 0);
    }
    FUZZ_CHECK(
        (triangle->flags & ~(STRL_TRIANGLE_HAS_NORMAL | STRL_TRIANGLE_HAS_COLOUR | STRL_TRIANGLE_HAS_TEXCOORD)) == 0);
    if (!(triangle->flags & STRL_TRIANGLE_HAS_COLOUR))
        FUZZ_CHECK(triangle->colour[0] == 0xffffffffu && triangle->colour[2] == 0xffffffffu);
    pass->highest_part = triangle->part > pass->highest_part ? triangle->part : pass->highest_part;
    pass->highest_material = triangle->material > pass->highest_material ? triangle->material : pass->highest_material;
}

static inline fuzz_pass fuzz_read_pass(strl_reader *reader)
{
    fuzz_pass pass = {0};
    strl_triangle triangles[61];
    strl_error err = {0};
    memset(triangles, 0, sizeof triangles); /* what lies between members is part of the checksum */
    size_t count = 0;
    do {
        pass.status = strl_reader_next(reader, triangles, 61, &count, &err);
        FUZZ_CHECK(pass.status == STRL_OK || (count == 0 && err.message[0] != 0 && err.status == pass.status));
        for (size_t i = 0; i < count; i++)
            fuzz_check_triangle(&triangles[i], &pass);
        pass.count += count;
        pass.checksum = strl__mix64(pass.checksum ^ strl__checksum(triangles, count * sizeof *triangles));
    } while (count > 0);
    strl_reader_drops_get(reader, &pass.drops);
    return pass;
}

/* Each piece twice to the same triangles, and as many finite placements as are announced, at most. */
static inline void fuzz_pieces(const strl_reader_desc *desc, const strl__format *format)
{
    strl_reader_desc own = *desc;
    strl_reader *reader;
    strl_error err = {0};
    own.most_pieces = 3;
    if (strl__reader_open_as(&own, format, &reader, &err))
        return;
    uint64_t announced = 0, placements = 0;
    for (uint32_t p = 0; p < strl_reader_piece_count(reader); p++) {
        strl_reader_piece facts;
        strl_reader_piece_get(reader, p, &facts);
        announced += p ? facts.placements : 0;
        if (facts.triangles > FUZZ_TRIANGLES_MAX)
            continue;
        FUZZ_CHECK(strl_reader_select(reader, p, &err) == STRL_OK);
        const fuzz_pass first = fuzz_read_pass(reader);
        FUZZ_CHECK(strl_reader_select(reader, p, &err) == STRL_OK);
        const fuzz_pass second = fuzz_read_pass(reader);
        FUZZ_CHECK(first.count == second.count && first.checksum == second.checksum);
        FUZZ_CHECK(p == 0 || first.count <= facts.triangles);
        FUZZ_CHECK(!facts.is_empty || first.count == 0);
    }
    bool found = announced <= FUZZ_TRIANGLES_MAX && strl_reader_begin_placements(reader, &err) == STRL_OK;
    while (found) {
        strl_reader_placement placement;
        if (strl_reader_next_placement(reader, &placement, &found, &err) || !found)
            break;
        FUZZ_CHECK(placement.piece > 0 && placement.piece < strl_reader_piece_count(reader) &&
                   ++placements <= announced);
        for (unsigned i = 0; i < 12; i++)
            FUZZ_CHECK(__builtin_isfinite(placement.transform[i]));
    }
    strl_reader_close(reader);
}

static inline void fuzz_reader(const strl__format *format, const uint8_t *data, size_t size)
{
    static int file = -1; /* the process's own scratch, reused because creating one is slow */
    char path[40];
    if (file < 0)
        file = memfd_create("fuzz", 0);
    FUZZ_CHECK(file >= 0 && ftruncate(file, 0) == 0 && pwrite(file, data, size, 0) == (ssize_t)size);
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    strl_reader_desc desc = {.path = path, .memory_bytes = STRL__READER_MEMORY_LEAST};
    strl_reader *reader;
    strl_error err = {0};
    if (strl__reader_open_as(&desc, format, &reader, &err)) {
        FUZZ_CHECK(reader == NULL && err.message[0] != 0);
        return;
    }
    strl_reader_info info;
    strl_reader_info_get(reader, &info);
    if (info.hint_is_exact && info.triangles_hint > FUZZ_TRIANGLES_MAX) {
        strl_reader_close(reader); /* parts used again and again: nothing is wrong with it but the time it takes */
        return;
    }
    fuzz_pass first = fuzz_read_pass(reader);
    /* A triangle takes a byte at the very least, or is known beforehand. */
    FUZZ_CHECK(first.count <= (info.hint_is_exact ? info.triangles_hint : size));
    FUZZ_CHECK(first.highest_part < strl_reader_part_count(reader));
    FUZZ_CHECK(first.highest_material < strl_reader_material_count(reader));
    FUZZ_CHECK(strl_reader_rewind(reader, &err) == STRL_OK);
    fuzz_pass second = fuzz_read_pass(reader);
    FUZZ_CHECK(first.status == second.status && first.count == second.count && first.checksum == second.checksum);
    FUZZ_CHECK(memcmp(&first.drops, &second.drops, sizeof first.drops) == 0);
    strl_reader_rest(reader);
    fuzz_pass none = fuzz_read_pass(reader);
    FUZZ_CHECK(none.count == 0 && !reader->prepared && (none.status == STRL_OK || none.status == second.status));
    FUZZ_CHECK(strl_reader_rewind(reader, &err) == STRL_OK);
    fuzz_pass third = fuzz_read_pass(reader);
    FUZZ_CHECK(first.status == third.status && first.checksum == third.checksum);
    strl_reader_close(reader);
    fuzz_pieces(&desc, format);
}

#endif
