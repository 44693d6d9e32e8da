/* stroll info: what a container holds, from its header and its node records; payloads are not read. */
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"
#include "container/container.h"
#include "options.h"
#include "remote.h"
#include "shared/placed.h"

#define MOST_GROUP_SIZE 32u /* larger groups are counted together */

typedef struct level_facts {
    uint64_t nodes, vertices, base_vertices, shared_vertices, triangles, base_triangles, steps;
    uint64_t rungs[STRL_RUNG_SAMPLED + 1];       /* nodes */
    uint64_t group_members[MOST_GROUP_SIZE + 2]; /* nodes by the size of their group; the last one: larger */
    double large_groups;                         /* groups larger than MOST_GROUP_SIZE */
    double boundary_steps;                       /* of groups: each member adds its share of the group's */
    float geometric_min, geometric_max, appearance_min, appearance_max; /* lattice units */
} level_facts;

typedef struct tree_facts {
    uint64_t pages, payload_bytes; /* payload pages and the bytes in them */
    level_facts *levels;           /* [level_count], owned */
} tree_facts;

static void widen(float *least, float *most, float low, float high, bool first)
{
    *least = first || low < *least ? low : *least;
    *most = first || high > *most ? high : *most;
}

static void count_node(level_facts *level, const strl_node *node)
{
    bool first = level->nodes++ == 0;
    level->vertices += node->vertex_count;
    level->base_vertices += node->base_vertex_count;
    level->shared_vertices += node->shared_vertices;
    level->triangles += node->triangle_count;
    level->base_triangles += node->base_triangle_count;
    level->steps += node->step_count;
    level->boundary_steps += (double)node->boundary_steps / node->group_size;
    level->rungs[node->rung]++;
    uint32_t size = node->group_size <= MOST_GROUP_SIZE ? node->group_size : MOST_GROUP_SIZE + 1;
    level->group_members[size]++;
    if (size > MOST_GROUP_SIZE)
        level->large_groups += 1.0 / node->group_size;
    widen(&level->geometric_min, &level->geometric_max, node->geometric_min, node->geometric_max, first);
    widen(&level->appearance_min, &level->appearance_max, node->appearance_min, node->appearance_max, first);
}

static uint64_t groups_of_size(const level_facts *level, uint32_t size)
{
    return size > MOST_GROUP_SIZE ? (uint64_t)(level->large_groups + 0.5) : level->group_members[size] / size;
}

static uint64_t groups_of(const level_facts *level)
{
    uint64_t groups = 0;
    for (uint32_t size = 1; size <= MOST_GROUP_SIZE + 1; size++)
        groups += groups_of_size(level, size);
    return groups;
}

static uint64_t boundary_steps_of(const level_facts *level)
{
    return (uint64_t)(level->boundary_steps + 0.5);
}

static strl_status survey(strl_container *container, uint32_t index, tree_facts *facts, strl_error *err)
{
    const strl_tree *tree = strl_container_tree(container, index);
    facts->levels = strl__alloc_zero(tree->level_count, sizeof *facts->levels);
    if (!facts->levels)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the facts of %" PRIu32 " levels", tree->level_count);
    uint64_t last_page = 0;
    for (uint32_t id = 0; id < tree->node_count; id++) {
        strl_node node;
        strl_status status = strl_container_node(container, index, id, &node, err);
        if (status != STRL_OK)
            return status;
        count_node(&facts->levels[node.level], &node);
        facts->payload_bytes += node.payload_bytes;
        facts->pages += node.page.offset != last_page; /* the nodes of a page have consecutive ids */
        last_page = node.page.offset;
    }
    return STRL_OK;
}

static const char *const structure_names[] = {"", "clusters", "hlod", "samples"};
static const char *const rung_names[] = {"topology", "seams", "disjoint", "clustering", "sampled"};

static double share(uint64_t part, uint64_t whole)
{
    return whole ? (double)part / (double)whole : 0;
}

static json_t *reals(const double *values, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        json_array_append_new(array, json_real(values[i]));
    return array;
}

static json_t *cells(const int64_t values[3])
{
    json_t *array = json_array();
    for (int i = 0; i < 3; i++)
        json_array_append_new(array, json_integer(values[i]));
    return array;
}

static void put_count(json_t *object, const char *name, uint64_t value)
{
    json_object_set_new(object, name, json_integer((json_int_t)value));
}

static void put_length(json_t *object, const char *name, float lattice, double step)
{
    json_object_set_new(object, name, json_real((double)lattice * step));
}

static json_t *level_to_json(uint32_t number, const level_facts *level, double step)
{
    json_t *object = json_object(), *groups = json_object(), *rungs = json_object();
    put_count(object, "level", number);
    put_count(object, "nodes", level->nodes);
    put_count(object, "groups", groups_of(level));
    for (uint32_t size = 1; size <= MOST_GROUP_SIZE + 1; size++) {
        char name[16];
        snprintf(name, sizeof name, size > MOST_GROUP_SIZE ? "over %u" : "%u",
                 size > MOST_GROUP_SIZE ? MOST_GROUP_SIZE : size);
        if (groups_of_size(level, size))
            put_count(groups, name, groups_of_size(level, size));
    }
    json_object_set_new(object, "group_sizes", groups);
    put_count(object, "vertices", level->vertices);
    put_count(object, "base_vertices", level->base_vertices);
    put_count(object, "triangles", level->triangles);
    put_count(object, "base_triangles", level->base_triangles);
    put_count(object, "steps", level->steps);
    put_count(object, "boundary_steps", boundary_steps_of(level));
    put_count(object, "shared_vertices", level->shared_vertices);
    json_object_set_new(object, "locked_share", json_real(share(level->shared_vertices, level->base_vertices)));
    put_length(object, "geometric_min", level->geometric_min, step);
    put_length(object, "geometric_max", level->geometric_max, step);
    put_length(object, "appearance_min", level->appearance_min, step);
    put_length(object, "appearance_max", level->appearance_max, step);
    for (unsigned rung = 0; rung <= STRL_RUNG_SAMPLED; rung++)
        put_count(rungs, rung_names[rung], level->rungs[rung]);
    json_object_set_new(object, "rungs", rungs);
    return object;
}

static json_t *tree_to_json(const strl_tree *tree, const tree_facts *facts)
{
    json_t *object = json_object(), *levels = json_array();
    json_object_set_new(object, "structure", json_string(structure_names[tree->structure]));
    json_object_set_new(object, "origin", reals(tree->origin, 3));
    json_object_set_new(object, "step", json_real(tree->step));
    json_object_set_new(object, "box_min", cells(tree->box_min));
    json_object_set_new(object, "box_max", cells(tree->box_max));
    put_count(object, "nodes", tree->node_count);
    put_count(object, "levels", tree->level_count);
    put_count(object, "groups", tree->group_count);
    put_count(object, "triangles", tree->triangle_count);
    put_count(object, "vertices", tree->vertex_count);
    put_count(object, "root_triangles", tree->root_triangles);
    put_length(object, "leaf_geometric", tree->leaf_geometric, tree->step);
    put_count(object, "pages", facts->pages);
    put_count(object, "payload_bytes", facts->payload_bytes);
    for (uint32_t i = tree->level_count; i-- > 0;)
        json_array_append_new(levels, level_to_json(i, &facts->levels[i], tree->step));
    json_object_set_new(object, "per_level", levels);
    return object;
}

static void format_id(const strl_container_info *info, char text[33])
{
    for (int i = 0; i < 16; i++)
        snprintf(text + (size_t)2 * i, 3, "%02x", info->model_id[i]);
}

/* Another program's container may name any unit; a line break in it is not to break the line. */
static void format_unit(const strl_container_info *info, char text[sizeof info->unit])
{
    memcpy(text, info->unit, sizeof info->unit);
    for (char *at = text; *at; at++)
        if ((unsigned char)*at < ' ' || *at == 0x7f)
            *at = '?';
}

static void header_to_json(json_t *object, const strl_container *container, uint64_t placed)
{
    static const char *const axes[] = {"x", "y", "z"};
    const strl_container_info *info = strl_container_get_info(container);
    char id[33];
    format_id(info, id);
    put_count(object, "version", info->version);
    json_object_set_new(object, "model_id", json_string(id));
    put_count(object, "bytes", info->file_bytes);
    json_object_set_new(object, "unit", json_string(info->unit));
    json_object_set_new(object, "up", json_string(axes[info->up_axis]));
    json_object_set_new(object, "has_colour", json_boolean(info->has_colour));
    json_object_set_new(object, "has_images", json_boolean(info->has_images));
    json_object_set_new(object, "closed", json_boolean(info->closed_hint != 0));
    json_object_set_new(object, "bounds", reals(info->bounds, 6));
    put_count(object, "triangles_in", info->triangles_in);
    json_t *dropped = json_object();
    put_count(dropped, "nonfinite", info->dropped_nonfinite);
    put_count(dropped, "degenerate", info->dropped_degenerate);
    put_count(dropped, "lines", info->dropped_lines);
    put_count(dropped, "points", info->dropped_points);
    json_object_set_new(object, "dropped", dropped);
    put_count(object, "parts", info->part_count);
    put_count(object, "materials", info->material_count);
    put_count(object, "placements", info->placement_count);
    put_count(object, "triangles_placed", placed < INT64_MAX ? placed : INT64_MAX);
    put_count(object, "triangles", strl_container_triangle_count(container));
    json_object_set_new(object, "bytes_per_triangle",
                        json_real(share(info->file_bytes, strl_container_triangle_count(container))));
}

static void print_header(const char *path, const strl_container *container, uint64_t placed)
{
    const strl_container_info *info = strl_container_get_info(container);
    char id[33];
    format_id(info, id);
    printf("%s: version %" PRIu32 ", model %s\n", path, info->version, id);
    uint64_t triangles = strl_container_triangle_count(container);
    printf("  %" PRIu64 " bytes, %" PRIu64 " triangle%s, %.2f bytes a triangle\n", info->file_bytes, triangles,
           strl_cli_plural(triangles), share(info->file_bytes, triangles));
    char unit[sizeof info->unit];
    format_unit(info, unit);
    printf("  unit %s, up %c, %s%s, %s\n", unit[0] ? unit : "unknown", "xyz"[info->up_axis],
           info -> has_colour ? "coloured" : "white", info->has_images ? ", images and texture coordinates" : "",
           info->closed_hint ? "input closed" : "input open");
    printf("  bounds %.9g %.9g %.9g to %.9g %.9g %.9g\n", info->bounds[0], info->bounds[1], info->bounds[2],
           info->bounds[3], info->bounds[4], info->bounds[5]);
    printf("  read %" PRIu64 " triangle%s; dropped %" PRIu64 " not finite, %" PRIu64 " degenerate; skipped %" PRIu64
           " line%s, %" PRIu64 " point%s\n",
           info->triangles_in, strl_cli_plural(info->triangles_in), info->dropped_nonfinite, info->dropped_degenerate,
           info->dropped_lines, strl_cli_plural(info->dropped_lines), info->dropped_points,
           strl_cli_plural(info->dropped_points));
    printf("  %" PRIu32 " part%s, %" PRIu32 " material%s, %" PRIu64 " placement%s\n", info->part_count,
           strl_cli_plural(info->part_count), info->material_count, strl_cli_plural(info->material_count),
           info->placement_count, strl_cli_plural(info->placement_count));
    if (placed != triangles)
        printf("  %" PRIu64 " triangles as placed\n", placed);
}

static void print_groups(const level_facts *level)
{
    printf("         groups by size:");
    for (uint32_t size = 1; size <= MOST_GROUP_SIZE + 1; size++)
        if (groups_of_size(level, size))
            printf(" %s%" PRIu32 ": %" PRIu64, size > MOST_GROUP_SIZE ? ">" : "",
                   size > MOST_GROUP_SIZE ? MOST_GROUP_SIZE : size, groups_of_size(level, size));
    printf("; rungs:");
    for (unsigned rung = 0; rung <= STRL_RUNG_SAMPLED; rung++)
        if (level->rungs[rung])
            printf(" %s %" PRIu64, rung_names[rung], level->rungs[rung]);
    printf("\n");
}

static void print_tree(uint32_t index, const strl_tree *tree, const tree_facts *facts)
{
    printf("tree %" PRIu32 ": %s, lattice step %.9g, origin %.9g %.9g %.9g\n", index, structure_names[tree->structure],
           tree->step, tree->origin[0], tree->origin[1], tree->origin[2]);
    printf("  %" PRIu32 " node%s, %" PRIu32 " level%s, %" PRIu32 " group%s, %" PRIu64 " page%s with %" PRIu64
           " bytes of payload\n",
           tree->node_count, strl_cli_plural(tree->node_count), tree->level_count, strl_cli_plural(tree->level_count),
           tree->group_count, strl_cli_plural(tree->group_count), facts->pages, strl_cli_plural(facts->pages),
           facts->payload_bytes);
    printf("  leaves: %" PRIu64 " triangle%s, %" PRIu64 " vertices, quantisation error %.3g; root: %" PRIu32
           " triangle%s\n",
           tree->triangle_count, strl_cli_plural(tree->triangle_count), tree->vertex_count,
           (double)tree->leaf_geometric * tree->step, tree->root_triangles, strl_cli_plural(tree->root_triangles));
    printf("  %5s %8s %8s %12s %12s %10s %10s %7s %9s\n", "level", "nodes", "groups", "triangles", "base", "error min",
           "error max", "locked", "boundary");
    for (uint32_t i = tree->level_count; i-- > 0;) {
        const level_facts *level = &facts->levels[i];
        printf("  %5" PRIu32 " %8" PRIu64 " %8" PRIu64 " %12" PRIu64 " %12" PRIu64 " %10.3g %10.3g %6.2f%% %9" PRIu64
               "\n",
               i, level->nodes, groups_of(level), level->triangles, level->base_triangles,
               (double)level->geometric_min * tree->step, (double)level->geometric_max * tree->step,
               100 * share(level->shared_vertices, level->base_vertices), boundary_steps_of(level));
        print_groups(level);
    }
}

static strl_status describe(strl_container *container, const char *path, bool as_json, strl_error *err)
{
    uint64_t placed;
    strl_status status = strl_placed_triangles(container, &placed, err);
    if (status != STRL_OK)
        return status;
    json_t *object = json_object(), *trees = json_array();
    json_object_set_new(object, "trees", trees);
    if (as_json)
        header_to_json(object, container, placed);
    else
        print_header(path, container, placed);
    for (uint32_t i = 0; status == STRL_OK && i < strl_container_get_info(container)->tree_count; i++) {
        tree_facts facts = {0};
        status = survey(container, i, &facts, err);
        if (status == STRL_OK && as_json)
            json_array_append_new(trees, tree_to_json(strl_container_tree(container, i), &facts));
        else if (status == STRL_OK)
            print_tree(i, strl_container_tree(container, i), &facts);
        strl__free(facts.levels);
    }
    if (status == STRL_OK && as_json) {
        if (json_dumpf(object, stdout, JSON_INDENT(2)) != 0)
            status = strl__fail(err, STRL_ERR_IO, "cannot write the facts of %s as JSON", path);
        printf("\n");
    }
    json_decref(object);
    return status;
}

static int run(strl_cli_args *args)
{
    bool as_json = false;
    strl_cli_remote remote = {0};
    strl_location location;
    strl_cli_list models;
    const strl_cli_option options[] = {
        {.name = "json", .kind = STRL_CLI_FLAG, .value = &as_json, .help = "print one JSON object"},
        STRL_CLI_REMOTE_OPTIONS(&remote),
    };
    const strl_cli_usage usage = {
        .positional = "MODEL",
        .least = 1,
        .most = 1,
        .notes = "Errors and lengths are in model units. \"locked\" is the share of a level's base vertices "
                 "that another\nnode of the level has too; \"boundary\" counts collapses of shared vertices "
                 "within groups.",
        .options = options,
        .option_count = STRL_CLI_COUNT_OF(options)};
    int stop = strl_cli_parse(args, &usage, &models);
    if (stop >= 0)
        return stop;
    strl_error err;
    strl_container *container = NULL;
    strl_status status = strl_cli_locate(&remote, models.items[0], &location, &err);
    if (status == STRL_OK)
        status = strl_location_open_container(&location, &container, &err);
    if (status == STRL_OK)
        status = describe(container, models.items[0], as_json, &err);
    strl_container_close(container);
    return status == STRL_OK ? 0 : strl_cli_fail(&err);
}

STRL_CLI_COMMAND(info, "print what a container holds", run);
