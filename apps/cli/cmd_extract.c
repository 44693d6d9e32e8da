/* stroll extract: a uniform cut as one PLY file. Vertices stream into the file, triangles into a spill beside it,
 * because PLY wants all vertices first; then the triangles follow and the counts are put into the header's reserved
 * places. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/cursor.h"
#include "base/fail.h"
#include "container/container.h"
#include "container/cut.h"
#include "geometry/octahedral.h"
#include "interrupt.h"
#include "options.h"
#include "platform/file.h"
#include "platform/output.h"
#include "progress.h"
#include "remote.h"

#define TRIANGLE_BYTES 13u /* u8 count, 3 u32 */

typedef struct extraction {
    strl_container *container; /* owned, as all below */
    strl_output *output;
    strl_file *out, *spill;          /* out: the output's; borrowed */
    strl_writer vertices, triangles; /* of the node at hand */
    uint16_t *map;
    strl_arena arena;
    const char *path;
    double length;
    bool wide; /* positions as double */
    bool colour;
    uint64_t out_bytes, spill_bytes, vertex_count, triangle_count, node_count;
    strl_cli_progress line;
} extraction;

/* How far apart two points a unit or more apart along some axis are at least once they are placed, along some axis of
 * the world: 1 / the greatest sum over a row of the inverse. */
static double least_gap(const double m[12])
{
    double sums = 0, determinant = 0;
    for (int i = 0; i < 3; i++) {
        double row = 0;
        for (int j = 0; j < 3; j++) {
            int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            double cofactor = m[4 * a + c] * m[4 * b + d] - m[4 * a + d] * m[4 * b + c]; /* of row j, column i */
            row += fabs(cofactor);
            determinant += i == 0 ? m[4 * j] * cofactor : 0;
        }
        sums = fmax(sums, row);
    }
    return sums > 0 ? fabs(determinant) / sums : 0;
}

/* Floats do where they tell neighbouring lattice cells apart, everywhere in the placed model. */
static strl_status choose_width(extraction *self, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(self->container);
    double reach = 0, step = INFINITY;
    for (int i = 0; i < 6; i++)
        reach = fmax(reach, fabs(info->bounds[i]));
    for (uint64_t p = 0; p < info->placement_count; p++) {
        strl_placement placement;
        strl_status status = strl_container_placement(self->container, p, &placement, err);
        if (status != STRL_OK)
            return status;
        double gap = least_gap(placement.transform);
        step = fmin(step, gap * strl_container_tree(self->container, placement.tree)->step);
    }
    self->wide = reach > step * 0x1p23;
    return STRL_OK;
}

/* Written twice: with placeholders to reserve the room, then with the counts; a comment pads it to the same length. */
static strl_status write_header(extraction *self, uint64_t *bytes, strl_error *err)
{
    char text[1024], fill[64];
    const char *type = self->wide ? "double" : "float";
    int digits = snprintf(NULL, 0, "%" PRIu64 "%" PRIu64, self->vertex_count, self->triangle_count);
    memset(fill, '.', sizeof fill);
    int length = snprintf(
        text, sizeof text,
        "ply\nformat binary_little_endian 1.0\ncomment extracted by stroll %.*s\nelement vertex %" PRIu64
        "\nproperty %s x\nproperty %s y\nproperty %s z\n"
        "property float nx\nproperty float ny\nproperty float nz\n%selement face %" PRIu64
        "\nproperty list uchar uint vertex_indices\nend_header\n",
        40 - digits, fill, self->vertex_count, type, type, type,
        self->colour ? "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n" : "",
        self->triangle_count);
    *bytes = (uint64_t)length;
    return strl_file_write(self->out, 0, text, (size_t)length, err);
}

static strl_status open_output(extraction *self, strl_error *err)
{
    strl_status status = strl_output_open(self->path, NULL, &self->output, err);
    if (status != STRL_OK)
        return status;
    self->out = strl_output_file(self->output);
    status = strl_output_spill(self->output, &self->spill, err);
    return status == STRL_OK ? write_header(self, &self->out_bytes, err) : status;
}

/* What a vertex of this placement needs beside the mesh. */
typedef struct frame_facts {
    const strl_tree *tree;
    const double *transform;
    double normal[3][3]; /* cofactors: turns normals as the transform turns planes, up to length */
    bool mirrors;        /* the transform turns triangles over */
    bool as_it_is;       /* the transform is the identity */
} frame_facts;

static void prepare_frame(frame_facts *frame, const strl_tree *tree, const double transform[12])
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    frame->tree = tree;
    frame->transform = transform;
    frame->as_it_is = true;
    for (int i = 0; i < 12; i++)
        frame->as_it_is = frame->as_it_is && transform[i] == identity[i];
    double determinant = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
            frame->normal[i][j] =
                transform[4 * a + c] * transform[4 * b + d] - transform[4 * a + d] * transform[4 * b + c];
            determinant += i == 0 ? transform[j] * frame->normal[0][j] : 0;
        }
    frame->mirrors = determinant < 0;
}

static void put_position(extraction *self, const frame_facts *frame, const int64_t cell[3])
{
    double model[3], world[3];
    for (int axis = 0; axis < 3; axis++)
        model[axis] = frame->tree->origin[axis] + frame->tree->step * (double)cell[axis];
    for (int axis = 0; axis < 3; axis++) {
        const double *row = frame->transform + (ptrdiff_t)4 * axis;
        world[axis] =
            frame->as_it_is ? model[axis] : row[0] * model[0] + row[1] * model[1] + row[2] * model[2] + row[3];
        if (self->wide)
            strl_writer_f64(&self->vertices, world[axis]);
        else
            strl_writer_f32(&self->vertices, (float)world[axis]);
    }
}

static void put_normal(extraction *self, const frame_facts *frame, const uint16_t code[2])
{
    float normal[3];
    strl_oct_decode(code, normal);
    double turned[3], length = 0, sign = frame->mirrors ? -1 : 1;
    for (int i = 0; i < 3; i++) {
        turned[i] = sign * (frame->normal[i][0] * (double)normal[0] + frame->normal[i][1] * (double)normal[1] +
                            frame->normal[i][2] * (double)normal[2]);
        length += turned[i] * turned[i];
    }
    length = length > 0 ? sqrt(length) : 1;
    for (int i = 0; i < 3; i++)
        strl_writer_f32(&self->vertices, frame->as_it_is ? normal[i] : (float)(turned[i] / length));
}

static void put_colour(extraction *self, const strl_pm *mesh, uint32_t vertex)
{
    uint32_t own = mesh->colour ? mesh->colour[vertex] : 0xffffffff;
    uint32_t material = mesh->palette[mesh->palette_index ? mesh->palette_index[vertex] : 0].rgba;
    for (unsigned shift = 0; shift < 32; shift += 8) {
        uint32_t product = (own >> shift & 255) * (material >> shift & 255);
        strl_writer_u8(&self->vertices, (uint8_t)((product + 127) / 255));
    }
}

static void put_triangle(extraction *self, const frame_facts *frame, const strl_pm *mesh, uint32_t triangle)
{
    strl_writer_u8(&self->triangles, 3);
    for (unsigned k = 0; k < 3; k++) {
        uint16_t corner = mesh->triangle[triangle][frame->mirrors ? 2 - k : k];
        strl_writer_u32(&self->triangles, (uint32_t)self->vertex_count + self->map[corner]);
    }
}

static strl_status flush(strl_writer *writer, strl_file *file, uint64_t *bytes, strl_error *err)
{
    if (writer->failed)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a node's part of %s", strl_file_path(file));
    strl_status status = strl_file_write(file, *bytes, writer->data, writer->size, err);
    *bytes += writer->size;
    writer->size = 0;
    return status;
}

static strl_status write_state(extraction *self, const frame_facts *frame, const strl_node *node, const strl_pm *mesh,
                               uint32_t state, strl_error *err)
{
    uint32_t vertices = mesh->vertex_end[state], triangles = mesh->triangle_end[state];
    if (self->vertex_count + vertices > UINT32_MAX)
        return strl__fail(err, STRL_ERR_LIMIT,
                          "the cut has more vertices than a PLY file can number (2^32); ask for a larger error");
    strl_cut_resolve(mesh, state, self->map);
    for (uint32_t vertex = 0; vertex < vertices; vertex++) {
        int64_t cell[3];
        for (int axis = 0; axis < 3; axis++)
            cell[axis] = node->anchor[axis] + mesh->position[vertex][axis];
        put_position(self, frame, cell);
        put_normal(self, frame, mesh->normal[vertex]);
        if (self->colour)
            put_colour(self, mesh, vertex);
    }
    for (uint32_t triangle = 0; triangle < triangles; triangle++)
        put_triangle(self, frame, mesh, triangle);
    self->vertex_count += vertices;
    self->triangle_count += triangles;
    self->node_count++;
    strl_status status = flush(&self->vertices, self->out, &self->out_bytes, err);
    return status == STRL_OK ? flush(&self->triangles, self->spill, &self->spill_bytes, err) : status;
}

static strl_status extract_placement(extraction *self, const strl_placement *placement, strl_error *err)
{
    const strl_tree *tree = strl_container_tree(self->container, placement->tree);
    double stretch = strl_transform_stretch(placement->transform);
    frame_facts frame;
    strl_cut cut;
    prepare_frame(&frame, tree, placement->transform);
    strl_cut_init(&cut, self->container, placement->tree, stretch > 0 ? self->length / stretch : self->length);
    for (;;) {
        uint32_t id;
        strl_node node;
        strl_pm mesh;
        strl_arena_mark mark = strl_arena_get_mark(&self->arena);
        strl_status status = strl_cut_next(&cut, &id, &node, err);
        if (status != STRL_OK || id == STRL_NONE)
            return status;
        status = strl_container_mesh(self->container, placement->tree, &node, &self->arena, &mesh, err);
        if (status == STRL_OK)
            status = write_state(self, &frame, &node, &mesh, strl_cut_state(&cut, &mesh), err);
        strl_arena_rewind(&self->arena, mark);
        if (status != STRL_OK)
            return status;
        strl_cli_progress_update(&self->line, "extract", id + 1, tree->node_count, "nodes");
        status = strl_cli_check_interrupt(err);
        if (status != STRL_OK)
            return status;
    }
}

static strl_status report_triangles(void *context, uint64_t done, uint64_t total, strl_error *err)
{
    extraction *self = context;
    strl_cli_progress_update(&self->line, "triangles", done / TRIANGLE_BYTES, total / TRIANGLE_BYTES, "triangles");
    return strl_cli_check_interrupt(err);
}

static strl_status finish(extraction *self, strl_error *err)
{
    uint64_t header_bytes;
    strl_status status = strl_output_append(self->output, self->spill, report_triangles, self, err);
    if (status == STRL_OK)
        status = write_header(self, &header_bytes, err);
    return status == STRL_OK ? strl_output_finish(self->output, false, err) : status;
}

static strl_status extract(extraction *self, strl_error *err)
{
    const strl_container_info *info = strl_container_get_info(self->container);
    self->colour = info->has_colour;
    self->map = strl__alloc(STRL_PM_MAX_VERTICES, sizeof *self->map);
    strl_status status = self->map ? choose_width(self, err)
                                   : strl__fail(err, STRL_ERR_MEMORY, "no memory to extract into %s", self->path);
    if (status == STRL_OK)
        status = open_output(self, err);
    for (uint64_t i = 0; status == STRL_OK && i < info->placement_count; i++) {
        strl_placement placement;
        status = strl_container_placement(self->container, i, &placement, err);
        if (status == STRL_OK)
            status = extract_placement(self, &placement, err);
    }
    return status == STRL_OK ? finish(self, err) : status;
}

static void release(extraction *self)
{
    strl_cli_progress_end(&self->line);
    strl_output_close(self->output);
    strl_file_close(self->spill, NULL);
    strl__free(self->vertices.data);
    strl__free(self->triangles.data);
    strl_arena_deinit(&self->arena);
    strl_container_close(self->container);
    strl__free(self->map);
}

static strl_status refuse_own_input(const char *model, const char *path, strl_error *err)
{
    strl_file_info input, output;
    if (strl_path_stat(model, &input, NULL) == STRL_OK && strl_path_stat(path, &output, NULL) == STRL_OK &&
        input.device == output.device && input.inode == output.inode)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s is the model itself and would be overwritten", path);
    return STRL_OK;
}

static int run(strl_cli_args *args)
{
    extraction self = {0};
    strl_cli_list models;
    strl_cli_remote remote = {0};
    strl_location location;
    const strl_cli_option options[] = {
        {.name = "error",
         .letter = 'e',
         .kind = STRL_CLI_REAL,
         .value = &self.length,
         .argument = "LENGTH",
         .required = true,
         .help = "largest geometric error, model units; 0 = the finest level",
         .least = 0,
         .most = 1e300},
        {.name = "output",
         .letter = 'o',
         .kind = STRL_CLI_STRING,
         .value = &self.path,
         .argument = "FILE.ply",
         .required = true,
         .help = "the PLY file to write"},
        STRL_CLI_REMOTE_OPTIONS(&remote),
    };
    const strl_cli_usage usage = {
        .positional = "MODEL", .least = 1, .most = 1, .options = options, .option_count = STRL_CLI_COUNT_OF(options)};
    int stop = strl_cli_parse(args, &usage, &models);
    if (stop >= 0)
        return stop;
    strl_error err;
    strl_arena_init(&self.arena, 0);
    strl_cli_progress_init(&self.line, args->quiet);
    strl_cli_catch_interrupts();
    strl_status status = refuse_own_input(models.items[0], self.path, &err);
    if (status == STRL_OK)
        status = strl_output_check(self.path, &err);
    if (status == STRL_OK)
        status = strl_cli_locate(&remote, models.items[0], &location, &err);
    if (status == STRL_OK)
        status = strl_location_open_container(&location, &self.container, &err);
    if (status == STRL_OK)
        status = extract(&self, &err);
    release(&self);
    if (status != STRL_OK)
        return strl_cli_fail(&err);
    if (!args->quiet)
        printf("%s: %" PRIu64 " triangle%s, %" PRIu64 " vertices from %" PRIu64 " node%s\n", self.path,
               self.triangle_count, strl_cli_plural(self.triangle_count), self.vertex_count, self.node_count,
               strl_cli_plural(self.node_count));
    return 0;
}

STRL_CLI_COMMAND(extract, "write the coarsest mesh within an error as PLY", run);
