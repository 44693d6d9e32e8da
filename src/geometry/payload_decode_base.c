/* The base mesh of a node payload: a traversal of gates. docs/format-payload.md, "Base mesh", is normative. */
#include "geometry/payload_decode.h"

#include <inttypes.h>

#include "base/fail.h"
#include "geometry/payload_front.h"

/* The next vertex, at a residual from `predicted`; false where no more were announced. */
static bool new_vertex(struct strl__decoder *d, const uint32_t predicted[3], uint32_t from, uint32_t *vertex)
{
    if (d->mesh.vertex_count >= d->sizes.base_vertex_count)
        return false;
    *vertex = d->mesh.vertex_count++;
    d->from[*vertex] = (uint16_t)from;
    strl__pull_position(&d->in, STRL__STREAM_BASE_POSITION, predicted, d->mesh.position[*vertex]);
    return true;
}

/* An earlier vertex by its distance from the next new one. */
static bool earlier_vertex(const struct strl__decoder *d, uint32_t distance, uint32_t *vertex)
{
    *vertex = d->mesh.vertex_count - 1 - distance;
    return distance < d->mesh.vertex_count;
}

static bool new_twin(struct strl__decoder *d, uint32_t *vertex)
{
    uint32_t twin;
    if (d->mesh.vertex_count >= d->sizes.base_vertex_count ||
        !earlier_vertex(d, strl__pull(&d->in, STRL__STREAM_TWIN), &twin))
        return false;
    *vertex = d->mesh.vertex_count++;
    d->from[*vertex] = (uint16_t)twin;
    for (unsigned k = 0; k < 3; k++)
        d->mesh.position[*vertex][k] = d->mesh.position[twin][k];
    strl__twin_join(d->mesh.twin, twin, *vertex);
    return true;
}

static void position_as_prediction(const int32_t position[3], uint32_t predicted[3])
{
    for (unsigned k = 0; k < 3; k++)
        predicted[k] = (uint32_t)position[k];
}

/* The vertex before the next new one, which predicts it where nothing better does. */
static uint32_t latest(const struct strl__decoder *d, uint32_t predicted[3])
{
    uint32_t count = d->mesh.vertex_count;
    predicted[0] = predicted[1] = predicted[2] = 0;
    if (count)
        position_as_prediction(d->mesh.position[count - 1], predicted);
    return count ? count - 1 : 0;
}

static bool decode_seed(struct strl__decoder *d, uint32_t corner[3])
{
    for (unsigned k = 0; k < 3; k++) {
        uint32_t code = strl__pull(&d->in, STRL__STREAM_SEED), predicted[3];
        uint32_t from = latest(d, predicted);
        if (k) {
            from = corner[k - 1];
            position_as_prediction(d->mesh.position[from], predicted);
        }
        bool sound = code == 0   ? new_vertex(d, predicted, from, &corner[k])
                     : code == 1 ? new_twin(d, &corner[k])
                                 : earlier_vertex(d, code - 2, &corner[k]);
        if (!sound)
            return false;
    }
    return true;
}

/* The third vertex of the triangle behind a gate. */
static bool decode_apex(struct strl__decoder *d, const struct strl__front *front, unsigned operation, uint32_t *c)
{
    const struct strl__gate *gate = &front->gate[front->current];
    uint32_t a = gate->start, b = gate->end, predicted[3];
    bool sound = true;
    if (operation == STRL__OP_NEW) {
        const int32_t *p = d->mesh.position[a], *q = d->mesh.position[b], *r = d->mesh.position[gate->behind];
        for (unsigned k = 0; k < 3; k++)
            predicted[k] = (uint32_t)p[k] + (uint32_t)q[k] - (uint32_t)r[k];
        sound = new_vertex(d, predicted, a, c);
    } else if (operation == STRL__OP_RIGHT) {
        *c = front->gate[gate->next].end;
    } else if (operation == STRL__OP_LEFT) {
        *c = front->gate[gate->previous].start;
    } else if (operation == STRL__OP_SPLIT) {
        sound = earlier_vertex(d, strl__pull(&d->in, STRL__STREAM_REFERENCE), c);
    } else {
        sound = operation == STRL__OP_TWIN && new_twin(d, c);
    }
    return sound && *c != a && *c != b;
}

/* One triangle, or the news that there is none behind a gate. */
static bool decode_operation(struct strl__decoder *d, struct strl__front *front)
{
    uint32_t corner[3];
    strl__front_settle(front);
    if (front->current == STRL__NONE) {
        if (!decode_seed(d, corner))
            return false;
        strl__front_seed(front, corner[0], corner[1], corner[2]);
    } else {
        const struct strl__gate *gate = &front->gate[front->current];
        unsigned operation = strl__pull(&d->in, STRL__STREAM_OPERATION + strl__front_context(front));
        if (operation == STRL__OP_BORDER) {
            strl__front_apply(front, operation, 0);
            return true;
        }
        corner[0] = gate->end;
        corner[1] = gate->start;
        if (!decode_apex(d, front, operation, &corner[2]))
            return false;
        strl__front_apply(front, operation, corner[2]);
    }
    strl__mesh_add_triangle(&d->mesh, corner[0], corner[1], corner[2]);
    for (unsigned k = 0; k < 3; k++)
        strl__front_count(front, corner[k]);
    const int32_t(*position)[3] = (const int32_t(*)[3])d->mesh.position;
    return !strl__same_position(position, corner[0], corner[1]) &&
           !strl__same_position(position, corner[1], corner[2]) && !strl__same_position(position, corner[2], corner[0]);
}

strl_status strl__decode_base(struct strl__decoder *d)
{
    struct strl__front front;
    if (!strl__front_init(&front, d->sizes.base_vertex_count, d->sizes.base_triangle_count, d->scratch))
        return strl__fail(d->err, STRL_ERR_MEMORY, "no memory to decode a node payload");
    while (d->mesh.triangle_count < d->sizes.base_triangle_count)
        if (d->in.failed || !decode_operation(d, &front))
            return strl__fail(d->err, STRL_ERR_FORMAT,
                              "node payload's base mesh is broken at triangle %" PRIu32 " of %" PRIu32,
                              d->mesh.triangle_count, d->sizes.base_triangle_count);
    while (d->mesh.vertex_count < d->sizes.base_vertex_count) { /* vertices of no base triangle */
        uint32_t predicted[3], vertex, from = latest(d, predicted);
        new_vertex(d, predicted, from, &vertex);
    }
    d->pm->vertex_end[0] = d->mesh.vertex_count;
    d->pm->triangle_end[0] = d->mesh.triangle_count;
    return STRL_OK;
}
