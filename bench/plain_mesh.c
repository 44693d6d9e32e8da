#include "plain_mesh.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_PROPERTIES = 32, ROWS = 4096, FACE_BYTES = 13 };
#define MAX_COUNT 0x40000000u /* three corners a triangle stay in 32 bits */

/* What the header says of the vertices' rows. */
typedef struct layout {
    size_t vertex_count, face_count, row_bytes, offset[3];
    bool wide[3]; /* double, else float */
    bool found[3];
    bool has_corners;
} layout;

void *plain_allocate(size_t count, size_t size)
{
    void *memory = calloc(count ? count : 1, size);
    if (!memory) {
        fprintf(stderr, "no memory for %zu items of %zu bytes\n", count, size);
        exit(1);
    }
    return memory;
}

static size_t scalar_bytes(const char *type)
{
    static const char *const names[] = {"char", "uchar", "int8",  "uint8",  "short", "ushort",  "int16",  "uint16",
                                        "int",  "uint",  "int32", "uint32", "float", "float32", "double", "float64"};
    static const size_t bytes[] = {1, 1, 1, 1, 2, 2, 2, 2, 4, 4, 4, 4, 4, 4, 8, 8};
    for (size_t i = 0; i < sizeof bytes / sizeof *bytes; i++)
        if (!strcmp(type, names[i]))
            return bytes[i];
    return 0;
}

static bool add_vertex_property(layout *head, const char *type, const char *name)
{
    size_t bytes = scalar_bytes(type);
    if (!bytes)
        return false;
    if (name[0] >= 'x' && name[0] <= 'z' && !name[1]) {
        int axis = name[0] - 'x';
        bool is_real = type[0] == 'f' || type[0] == 'd';
        if (!is_real)
            return false;
        head->offset[axis] = head->row_bytes;
        head->wide[axis] = bytes == 8;
        head->found[axis] = true;
    }
    head->row_bytes += bytes;
    return true;
}

static bool is_corner_list(const char *count_type, const char *type)
{
    return scalar_bytes(count_type) == 1 && scalar_bytes(type) == 4 && type[0] != 'f';
}

/* One line of the header; `element` is the first letter of the element at hand. False = this mesh is not for us. */
static bool read_header_line(layout *head, const char *line, char *element)
{
    char a[64] = "", b[64] = "", c[64] = "", d[64] = "";
    int words = sscanf(line, "%*s %63s %63s %63s %63s", a, b, c, d);
    if (!strncmp(line, "format", 6))
        return !strcmp(a, "binary_little_endian");
    if (!strncmp(line, "element", 7)) {
        size_t count = words >= 2 ? strtoull(b, NULL, 10) : 0;
        *element = a[0];
        bool is_vertex = !strcmp(a, "vertex"), is_face = !strcmp(a, "face");
        *(is_face ? &head->face_count : &head->vertex_count) = count;
        return (is_vertex || is_face) && count < MAX_COUNT;
    }
    if (!strncmp(line, "property", 8)) {
        if (*element == 'v')
            return words == 2 && add_vertex_property(head, a, b);
        bool is_first = !head->has_corners;
        head->has_corners = true;
        return is_first && words == 4 && !strcmp(a, "list") && is_corner_list(b, c);
    }
    return true; /* ply, comment, obj_info */
}

static bool read_header(FILE *file, layout *head)
{
    char line[1024], element = 0;
    if (!fgets(line, sizeof line, file) || strncmp(line, "ply", 3) != 0)
        return false;
    while (fgets(line, sizeof line, file)) {
        if (!strncmp(line, "end_header", 10))
            return head->found[0] && head->found[1] && head->found[2] && head->has_corners;
        if (!read_header_line(head, line, &element))
            return false;
    }
    return false;
}

static bool read_vertices(FILE *file, const layout *head, plain_mesh *mesh)
{
    unsigned char *rows = plain_allocate(ROWS, head->row_bytes);
    size_t done = 0;
    while (done < head->vertex_count) {
        size_t count = head->vertex_count - done < ROWS ? head->vertex_count - done : ROWS;
        if (fread(rows, head->row_bytes, count, file) != count)
            break;
        for (size_t i = 0; i < 3 * count; i++) {
            const unsigned char *at = rows + i / 3 * head->row_bytes + head->offset[i % 3];
            float narrow;
            memcpy(&narrow, at, sizeof narrow);
            mesh->position[3 * done + i] = narrow;
            if (head->wide[i % 3])
                memcpy(&mesh->position[3 * done + i], at, sizeof(double));
        }
        done += count;
    }
    free(rows);
    return done == head->vertex_count;
}

static bool read_faces(FILE *file, const layout *head, plain_mesh *mesh)
{
    unsigned char *rows = plain_allocate(ROWS, FACE_BYTES);
    size_t done = 0;
    bool good = true;
    while (good && done < head->face_count) {
        size_t count = head->face_count - done < ROWS ? head->face_count - done : ROWS;
        good = fread(rows, FACE_BYTES, count, file) == count;
        for (size_t i = 0; good && i < count; i++) {
            uint32_t *corner = mesh->corner + 3 * (done + i);
            memcpy(corner, rows + i * FACE_BYTES + 1, 3 * sizeof *corner);
            good = rows[i * FACE_BYTES] == 3 && corner[0] < head->vertex_count && corner[1] < head->vertex_count &&
                   corner[2] < head->vertex_count;
        }
        done += count;
    }
    free(rows);
    return good;
}

bool plain_mesh_read(const char *path, plain_mesh *mesh)
{
    layout head = {0};
    *mesh = (plain_mesh){0};
    FILE *file = fopen(path, "rb");
    bool good = file && read_header(file, &head);
    if (good) {
        mesh->vertex_count = head.vertex_count;
        mesh->triangle_count = head.face_count;
        mesh->position = plain_allocate(head.vertex_count, 3 * sizeof *mesh->position);
        mesh->corner = plain_allocate(head.face_count, 3 * sizeof *mesh->corner);
        good = read_vertices(file, &head, mesh) && read_faces(file, &head, mesh);
    }
    if (!good) {
        fprintf(stderr, "%s is no binary little-endian PLY file of triangles, or is cut short\n", path);
        plain_mesh_free(mesh);
    }
    if (file)
        fclose(file);
    return good;
}

static size_t number_used(const uint32_t *corner, size_t corner_count, uint32_t *number, size_t vertex_count)
{
    size_t used = 0;
    for (size_t i = 0; i < corner_count; i++)
        number[corner[i]] = 1;
    for (size_t i = 0; i < vertex_count; i++)
        number[i] = number[i] ? (uint32_t)used++ : UINT32_MAX;
    return used;
}

bool plain_mesh_write(const char *path, const float *position, size_t vertex_count, const uint32_t *corner,
                      size_t triangle_count)
{
    uint32_t *number = plain_allocate(vertex_count, sizeof *number);
    size_t used = number_used(corner, 3 * triangle_count, number, vertex_count);
    FILE *file = fopen(path, "wb");
    if (file) {
        fprintf(file,
                "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty float x\nproperty float y\n"
                "property float z\nelement face %zu\nproperty list uchar uint vertex_indices\nend_header\n",
                used, triangle_count);
        for (size_t i = 0; i < vertex_count; i++)
            if (number[i] != UINT32_MAX)
                fwrite(position + 3 * i, sizeof *position, 3, file);
        for (size_t i = 0; i < triangle_count; i++) {
            uint32_t row[3] = {number[corner[3 * i]], number[corner[3 * i + 1]], number[corner[3 * i + 2]]};
            fputc(3, file);
            fwrite(row, sizeof *row, 3, file);
        }
    }
    free(number);
    bool good = file && !ferror(file);
    if (file && fclose(file) != 0)
        good = false;
    if (!good)
        fprintf(stderr, "%s could not be written\n", path);
    return good;
}

void plain_mesh_free(plain_mesh *mesh)
{
    free(mesh->position);
    free(mesh->corner);
    *mesh = (plain_mesh){0};
}

double plain_mesh_diagonal(const plain_mesh *mesh)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, sum = 0;
    for (size_t i = 0; i < 3 * mesh->vertex_count; i++) {
        low[i % 3] = fmin(low[i % 3], mesh->position[i]);
        high[i % 3] = fmax(high[i % 3], mesh->position[i]);
    }
    for (int axis = 0; mesh->vertex_count && axis < 3; axis++)
        sum += (high[axis] - low[axis]) * (high[axis] - low[axis]);
    return sqrt(sum);
}
