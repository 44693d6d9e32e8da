/* One node: simplify, record, encode, keep the base mesh. */
#include <math.h>
#include <string.h>

#include "base/fail.h"
#include "build/clusters/hierarchy.h"
#include "build/clusters/pm_spill.h"
#include "geometry/octahedral.h"
#include "geometry/record.h"
#include "geometry/simplify.h"

/* How far from half its triangles a node may end so that all nodes of a level end at one error. */
#define LEAST_OF_TARGET 0.8
#define MOST_OF_TARGET 1.25

void strl_made_node_deinit(strl_made_node *made)
{
    strl__free(made->payload.data);
    strl__free(made->mesh.data);
    strl__free(made->anchors.data);
    strl__free(made->next_neighbour);
    *made = (strl_made_node){0};
}

static strl_status simplify(const strl_hierarchy *hierarchy, const strl_mesh *mesh, uint32_t target, strl_arena *arena,
                            strl_simplified *result, strl_error *err)
{
    target = target < hierarchy->most_target ? target : hierarchy->most_target;
    strl_simplify_desc desc = {.target_triangles = target,
                               .soft_triangles = hierarchy->soft_triangles,
                               .error_limit = INFINITY,
                               .last_rung = STRL_SIMPLIFY_CLUSTERING,
                               .normal_weight = STRL_NORMAL_WEIGHT,
                               .colour_weight = STRL_COLOUR_WEIGHT,
                               .even_error = hierarchy->even_error,
                               .least_triangles = (uint32_t)(target * LEAST_OF_TARGET),
                               .most_triangles = (uint32_t)(target * MOST_OF_TARGET)};
    return strl_simplify(mesh, &desc, arena, result, err);
}

static void set_box(const strl_node_mesh *node, strl_node *record)
{
    for (int k = 0; k < 3; k++) {
        int32_t least = INT32_MAX, most = INT32_MIN;
        for (uint32_t p = 0; p < node->mesh.point_count; p++) {
            least = node->mesh.position[p][k] < least ? node->mesh.position[p][k] : least;
            most = node->mesh.position[p][k] > most ? node->mesh.position[p][k] : most;
        }
        record->box_min[k] = node->anchor[k] + least;
        record->box_max[k] = node->anchor[k] + most;
    }
}

static void fill_record(strl_node *record, const strl_node_mesh *node, const strl_simplified *simplified,
                        const strl_pm *pm)
{
    memcpy(record->anchor, node->anchor, sizeof record->anchor);
    set_box(node, record);
    record->geometric_min = pm->geometric_error[pm->step_count];
    record->geometric_max = pm->geometric_error[0];
    record->appearance_min = pm->appearance_error[pm->step_count];
    record->appearance_max = pm->appearance_error[0];
    record->vertex_count = pm->vertex_count;
    record->base_vertex_count = pm->vertex_end[0];
    record->triangle_count = pm->triangle_count;
    record->base_triangle_count = pm->triangle_end[0];
    record->step_count = pm->step_count;
    record->rung = simplified->rung;
    record->decode_parent = STRL_NONE;
}

/* The shares of the points that are left. */
static bool keep_shares(const strl_node_mesh *node, const uint32_t *point_map, strl_node_mesh *base, strl_arena *arena)
{
    const strl_mesh *mesh = &node->mesh;
    if (!node->share_first)
        return true;
    base->share_first = strl_arena_alloc(arena, (size_t)base->mesh.point_count + 1, sizeof *base->share_first);
    base->share = strl_arena_alloc(arena, node->share_first[mesh->point_count], sizeof *base->share);
    if (!base->share_first || !base->share)
        return false;
    uint32_t at = 0, next = 0;
    for (uint32_t p = 0; p < mesh->point_count; p++) {
        if (point_map[p] == UINT32_MAX)
            continue;
        base->share_first[next++] = at;
        for (uint32_t i = node->share_first[p]; i < node->share_first[p + 1]; i++)
            base->share[at++] = node->share[i];
    }
    base->share_first[next] = at;
    return true;
}

static bool count_neighbour(strl_made_node *made, uint32_t other)
{
    for (size_t i = 0; i < made->neighbour_count; i++)
        if (made->next_neighbour[2 * i] == other) {
            made->next_neighbour[2 * i + 1]++;
            return true;
        }
    if (!strl__grow(&made->next_neighbour, &made->neighbour_capacity, 2 * made->neighbour_count + 2,
                    sizeof *made->next_neighbour))
        return false;
    made->next_neighbour[2 * made->neighbour_count] = other;
    made->next_neighbour[2 * made->neighbour_count++ + 1] = 1;
    return true;
}

/* Which nodes of the next level this one's parent will share points with. */
static bool count_neighbours(const strl_node_mesh *base, uint32_t self, strl_made_node *made)
{
    made->state.record.shared_vertices = 0;
    for (uint32_t p = 0; base->share_first && p < base->mesh.point_count; p++) {
        uint32_t begin = base->share_first[p], end = base->share_first[p + 1], last = UINT32_MAX;
        made->state.record.shared_vertices += end > begin;
        for (uint32_t i = begin; i < end; i++) {
            uint32_t other = base->share[i] >> 1;
            if (other == self >> 1 || other == last)
                continue;
            made->state.outer_shared += last == UINT32_MAX;
            last = other;
            if (!count_neighbour(made, other))
                return false;
        }
    }
    return true;
}

/* What is simplified further keeps its normals: only what is stored is rounded. */
static void coarsen_normals(strl_pm *pm)
{
    for (uint32_t v = 0; v < pm->vertex_count; v++)
        for (unsigned k = 0; k < 2; k++)
            pm->normal[v][k] = strl_oct_coarsen(pm->normal[v][k]);
}

/* Measured claims in place of chained ones: of the way from the mesh to the input the smaller counts; which input the
 * node stands for is decided by its pieces, so the way back is the measured one. Both surfaces lie in one box: no claim
 * passes its diagonal. */
static void lower_errors(const strl_certificate *certificate, const strl_mesh *mesh, strl_pm *pm)
{
    float diagonal = mesh->most_error > 0 ? mesh->most_error : INFINITY;
    for (uint32_t i = 0; i <= pm->step_count; i++) {
        float *error = &pm->geometric_error[pm->step_count - i];
        *error = fminf(fmaxf(certificate->down[i], fminf(certificate->up[i], *error)), diagonal);
    }
}

static strl_status certify(const strl_node_mesh *node, const strl_anchors *anchors, const strl_simplified *simplified,
                           strl_arena *arena, strl_certificate *certificate, strl_pm *pm, strl_error *err)
{
    uint32_t own = anchors->own.count, beside = anchors->beside.count;
    strl_piece *piece = strl_arena_alloc(arena, (size_t)own + beside, sizeof *piece);
    if (!piece)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for the anchors of a node");
    memcpy(piece, anchors->own.item, own * sizeof *piece);
    if (beside)
        memcpy(piece + own, anchors->beside.item, beside * sizeof *piece);
    strl_status status = strl_certify(
        &node->mesh, simplified, &(strl_older){piece, own, own + beside, anchors->granted}, arena, certificate, err);
    if (!status)
        lower_errors(certificate, &node->mesh, pm);
    return status;
}

/* The anchors that go on to the parent: the node's own base mesh, or what it was measured against. */
static strl_status pass_anchors(const strl_hierarchy *hierarchy, const strl_anchors *anchors, const strl_mesh *base,
                                const strl_certificate *certificate, strl_made_node *made, strl_error *err)
{
    strl_pieces born = {0};
    const strl_anchor_plan *plan = &hierarchy->anchor_plan;
    uint64_t pieces = anchors ? anchors->own.count : 0, crowd = (uint64_t)plan->crowd * base->triangle_count;
    bool bears = plan->begins || (certificate && plan->crowd && pieces >= crowd);
    bool good = !bears || strl_anchors_bear(base, certificate, &born);
    if (good)
        strl_pieces_write(bears || !anchors ? &born : &anchors->own, &made->anchors);
    good = good && !made->anchors.failed;
    strl_pieces_deinit(&born);
    return good ? STRL_OK : strl__fail(err, STRL_ERR_MEMORY, "no memory for the anchors of a node");
}

strl_status strl_make_node(const strl_hierarchy *hierarchy, const strl_node_mesh *node, const strl_anchors *anchors,
                           uint32_t self, uint32_t target, strl_arena *arena, strl_made_node *made, strl_error *err)
{
    const strl_ingest *ingest = hierarchy->ingest;
    strl_arena_mark mark = strl_arena_get_mark(arena);
    strl_simplified simplified;
    strl_certificate certificate;
    strl_pm pm, decoded, *given = NULL;
    strl_node_mesh base = {0};
    uint32_t *point_map = strl_arena_alloc(arena, node->mesh.point_count, sizeof *point_map);
    strl_status status = point_map ? simplify(hierarchy, &node->mesh, target, arena, &simplified, err)
                                   : strl__fail(err, STRL_ERR_MEMORY, "no memory for a node");
    if (!status)
        status =
            strl_pm_record(&node->mesh, &simplified, ingest->palette, (uint32_t)ingest->palette_count, arena, &pm, err);
    if (!status && hierarchy->context->desc->compact)
        coarsen_normals(&pm);
    if (!status)
        fill_record(&made->state.record, node, &simplified, &pm);
    bool is_certified = hierarchy->anchor_plan.measures && anchors && anchors->own.count > 0;
    if (!status && is_certified)
        status = certify(node, anchors, &simplified, arena, &certificate, &pm, err);
    if (!status)
        status = strl_pm_spill_write(&pm, arena, &made->payload, err);
    if (!status)
        status = strl_mesh_after(&node->mesh, &simplified, point_map, arena, &base.mesh, err);
    /* where hardly any triangles share points, positions are most of a base mesh: they are not spilled twice */
    made->state.needs_payload = !status && base.mesh.point_count / 3 > base.mesh.triangle_count / 4;
    if (made->state.needs_payload && !strl_pm_spill_keeps_order(&pm))
        status = strl_pm_spill_read(made->payload.data, made->payload.size, arena, &decoded, err);
    if (status)
        goto done;
    memcpy(base.anchor, node->anchor, sizeof base.anchor);
    made->state.claims = (strl_node_claims){pm.geometric_error[pm.step_count], pm.geometric_error[0], 0};
    made->state.point_count = base.mesh.point_count;
    if (!keep_shares(node, point_map, &base, arena) || !count_neighbours(&base, self, made)) {
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for a node");
        goto done;
    }
    if (made->state.needs_payload)
        given = strl_pm_spill_keeps_order(&pm) ? &pm : &decoded;
    if (hierarchy->anchor_plan.measures || hierarchy->anchor_plan.begins)
        status = pass_anchors(hierarchy, anchors, &base.mesh, is_certified ? &certificate : NULL, made, err);
    if (!status)
        status = strl_node_mesh_write(&base, given, arena, &made->mesh, err);
done:
    strl_arena_rewind(arena, mark);
    return status;
}

strl_status strl_take_node(strl_hierarchy *hierarchy, strl_level *level, uint32_t self, strl_made_node *made,
                           strl_error *err)
{
    strl_node_state *state = &level->nodes[self];
    *state = made->state;
    state->payload_at = strl_spill_bytes(level->payloads);
    state->payload_bytes = (uint32_t)made->payload.size;
    state->mesh_at = strl_spill_bytes(level->meshes);
    state->mesh_bytes = (uint32_t)made->mesh.size;
    state->anchors_at = level->anchors ? strl_spill_bytes(level->anchors) : 0;
    state->anchors_bytes = made->anchors.size;
    strl_status status = strl_spill_append(level->payloads, made->payload.data, made->payload.size, err);
    if (!status)
        status = strl_spill_append(level->meshes, made->mesh.data, made->mesh.size, err);
    if (!status && level->anchors)
        status = strl_spill_append(level->anchors, made->anchors.data, made->anchors.size, err);
    for (size_t i = 0; i < made->neighbour_count && !status; i++)
        if (made->next_neighbour[2 * i] >= (level->count + 1) / 2)
            status = strl__fail(err, STRL_ERR_INTERNAL, "node %u shares points with one that is not there", self);
        else if (!strl_adjacency_add(&hierarchy->next, self >> 1, made->next_neighbour[2 * i],
                                     made->next_neighbour[2 * i + 1]))
            status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the neighbours of a level");
    return status || !level->states ? status : strl_node_state_save(level, self, made, err);
}
