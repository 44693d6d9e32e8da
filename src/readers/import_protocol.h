/* What a program that imports foreign formats (apps/import) writes on its standard output, and Stroll reads
 * (import_stream.c). All numbers are little-endian; nothing is aligned.
 *
 *   stream   = "STRLIMP1" record*
 *   record   = u32 kind, u32 bytes (at most STRL_IMPORT_RECORD_MOST), payload of so many bytes
 *
 * The first record is FACTS or ERROR. After FACTS come PART, MATERIAL and BLOCK in any order, at last END or ERROR;
 * after either of these comes nothing.
 *
 *   FACTS    u32 up axis (0 x, 1 y, 2 z), f64 metres a unit (0 = unknown), u64 triangles (a polygon of n corners counts
 *            n - 2), u64 bytes of the stream at most, 16 bytes name of the format, padded with zeros
 *   PART     name: the blocks that follow belong to the part of this name. Before the first: the part without a name
 *   MATERIAL u32 sRGB-encoded RGBA8 (R in the lowest byte), name: the next material, numbered from 0
 *   BLOCK    u32 flags, u32 material (one that came before, or STRL_IMPORT_NO_MATERIAL), u32 vertices (1 to
 *            STRL_IMPORT_CORNERS_MOST), u32 faces (at least 1), u32 corners of all faces (at most
 *            STRL_IMPORT_CORNERS_MOST); then of each vertex 3 x f32 or f64 position; then, where flagged, 3 x f32
 * normal of each, u32 colour of each; then, unless all faces are triangles, u16 corners of each face (at least 3); then
 * u16 vertex of each corner. Positions and normals need not be finite END      u64 triangles, u64 lines, u64 points,
 * u64 faces of no corner (the last three were left out), u64 checksum ERROR    u32 reason, text: one sentence without
 * its end
 *
 * A name is UTF-8 of at most STRL_IMPORT_NAME_MOST bytes, without a terminating zero. The checksum begins as 0; each
 * record before END makes it mix(checksum ^ XXH3 of the record, kind and bytes included), mix being strl__mix64. */
#ifndef STRL_READERS_IMPORT_PROTOCOL_H
#define STRL_READERS_IMPORT_PROTOCOL_H

#define STRL_IMPORT_MAGIC "STRLIMP1" /* its last character is the version */
#define STRL_IMPORT_MAGIC_BYTES 8u
#define STRL_IMPORT_RECORD_HEAD 8u
#define STRL_IMPORT_RECORD_MOST (768u << 10)
#define STRL_IMPORT_CORNERS_MOST 16384u
#define STRL_IMPORT_NAME_MOST 1023u
#define STRL_IMPORT_TEXT_MOST 300u
#define STRL_IMPORT_FACTS_BYTES 44u
#define STRL_IMPORT_FORMAT_BYTES 16u
#define STRL_IMPORT_BLOCK_HEAD 20u
#define STRL_IMPORT_END_BYTES 40u
#define STRL_IMPORT_NO_MATERIAL 0xffffffffu

enum strl_import_record {
    STRL_IMPORT_FACTS = 1,
    STRL_IMPORT_PART,
    STRL_IMPORT_MATERIAL,
    STRL_IMPORT_BLOCK,
    STRL_IMPORT_END,
    STRL_IMPORT_ERROR
};

enum strl_import_flag {
    STRL_IMPORT_NORMALS = 1,
    STRL_IMPORT_COLOURS = 2,
    STRL_IMPORT_DOUBLES = 4,  /* positions are f64 */
    STRL_IMPORT_POLYGONS = 8, /* faces say how many corners they have */
    STRL_IMPORT_ALL_FLAGS = 15
};

enum strl_import_reason {
    STRL_IMPORT_BROKEN = 1, /* the file is not what its format promises */
    STRL_IMPORT_MEMORY,     /* no memory within the limits */
    STRL_IMPORT_UNSUPPORTED
};

#endif
