#include "build/planted_bricks.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "container/writer.h"
#include "geometry/payload.h"

static void must(strl_status status, const strl_error *err)
{
    if (status != STRL_OK)
        fail_msg("%s", err->message);
}

static void copy_node(strl_container_writer *to, uint32_t id, strl_node record, const uint8_t *payload, strl_pm *mesh,
                      brick_lie lie, void *context)
{
    strl_error err = {0};
    strl_arena arena = {0};
    strl_writer encoded = {0};
    test_brick brick;
    size_t written, size = record.payload_bytes;
    test_brick_read(&brick, payload, size);
    if (lie(context, id, &record, &brick, mesh)) {
        must(strl_payload_encode(mesh, NULL, &arena, &encoded, NULL, &err), &err);
        record.triangle_count = record.base_triangle_count = mesh->triangle_count;
        brick.run_count = 1;
        brick.run[0] = (test_brick_run){1, mesh->triangle_count};
        brick.bytes = 0;
        payload = encoded.data;
        size = encoded.size;
    }
    uint8_t *bytes = test_brick_write(&brick, payload, size, &written);
    must(strl_container_writer_add_node(to, &record, bytes, (uint32_t)written, &err), &err);
    free(bytes);
    test_brick_free(&brick);
    strl__free(encoded.data);
    strl_arena_deinit(&arena);
}

void plant_placed_bricks(const char *good, const char *bad, brick_lie lie, void *context,
                         const strl_placement *placement, uint32_t count)
{
    strl_error err = {0};
    strl_container_writer *to;
    built_model model;
    size_t size;
    uint64_t bytes;
    uint8_t *file = built_read_file(built_path(good), &size);
    built_open(&model, built_path(good));
    const strl_container_writer_desc desc = {
        .path = built_path(bad), .scratch_dir = built_path(""), .info = model.info};
    must(strl_container_writer_create(&desc, &to, &err), &err);
    must(strl_container_writer_begin_tree(to, &model.tree, &err), &err);
    for (uint32_t id = 0; id < model.tree.node_count; id++)
        copy_node(to, id, model.node[id], file + model.node[id].page.offset + model.node[id].payload_offset,
                  &model.mesh[id], lie, context);
    must(strl_container_writer_end_tree(to, &err), &err);
    for (uint32_t i = 0; i < count; i++)
        must(strl_container_writer_add_placement(to, &placement[i], &err), &err);
    must(strl_container_writer_finish(to, &bytes, &err), &err);
    strl_container_writer_destroy(to);
    built_close(&model);
    free(file);
}

void plant_bricks(const char *good, const char *bad, brick_lie lie, void *context)
{
    plant_placed_bricks(good, bad, lie, context, NULL, 0);
}

bool no_brick_lie(void *context, uint32_t id, strl_node *record, test_brick *brick, strl_pm *mesh)
{
    (void)context, (void)id, (void)record, (void)brick, (void)mesh;
    return false;
}
