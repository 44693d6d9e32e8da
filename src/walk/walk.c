/* A walk's life: open, frames, close. */
#include "walk/internal.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "platform/thread.h"

#define DEFAULT_MEMORY_BYTES ((uint64_t)512 << 20)
#define DEFAULT_REQUESTS 16u
#define DEFAULT_REMOTE_REQUESTS 64u         /* the source says how many of them are of use now */
#define MOST_ROOT_BYTES ((uint64_t)8 << 20) /* that are read together while a walk is opened */
#define AHEAD_FRAMES 15                     /* how far the eye's motion is carried on for prefetching */
#define AHEAD_EVERY 4                       /* frames between two looks ahead */

/* ---- opening */

/* What is read of several trees together. */
typedef struct root_reads {
    strl_source_span *spans; /* [tree_count], their data owned */
    uint32_t *trees;         /* whose they are */
    size_t count;
    uint64_t bytes;
} root_reads;

/* May take the span's data over; then it is NULL. */
typedef strl_status (*take_fn)(strl_walk *walk, uint32_t tree, strl_source_span *span, strl_error *err);

/* The container has bounded the size. */
static strl_status add_read(root_reads *reads, uint32_t tree, uint64_t offset, uint32_t size, uint64_t checksum,
                            strl_error *err)
{
    void *data = strl__alloc(size, 1);
    if (!data)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a page of %" PRIu32 " bytes", size);
    reads->trees[reads->count] = tree;
    reads->spans[reads->count++] = (strl_source_span){offset, size, data, checksum};
    reads->bytes += size;
    return STRL_OK;
}

static void drop_reads(root_reads *reads)
{
    while (reads->count > 0)
        strl__free(reads->spans[--reads->count].data);
    reads->bytes = 0;
}

/* Reads what was added, and waits. */
static strl_status take_all(strl_walk *walk, root_reads *reads, take_fn take, strl_error *err)
{
    strl_status status = strl_source_read_many(walk->source, reads->spans, reads->count, err);
    for (size_t i = 0; status == STRL_OK && i < reads->count; i++)
        status = take(walk, reads->trees[i], &reads->spans[i], err);
    drop_reads(reads);
    return status;
}

static strl_status ask_for_records(strl_walk *walk, root_reads *reads, uint32_t tree, strl_error *err)
{
    strl_treelet_ref ref;
    strl_status status = strl_container_root_treelet(walk->container, tree, &ref, err);
    if (status != STRL_OK)
        return status;
    if (!strl__treelet_reserve(walk, tree, 0, &ref))
        return strl__fail(err, STRL_ERR_MEMORY,
                          "the root records of tree %" PRIu32 " do not fit into the memory for walking, %" PRIu64
                          " bytes: it needs more",
                          tree, walk->memory_bytes);
    return add_read(reads, tree, ref.offset, ref.bytes, ref.checksum, err);
}

static strl_status take_records(strl_walk *walk, uint32_t tree, strl_source_span *span, strl_error *err)
{
    strl__treelet *treelet = strl__treelets_find(&walk->treelets, tree, 0);
    strl_status status = strl__treelet_load(walk, treelet, span->data, span->size, err);
    if (status == STRL_OK)
        walk->trees[tree].root = &treelet->nodes[0];
    else if (status == STRL_ERR_FORMAT)
        strl_source_doubt(walk->source, span->offset, span->size);
    return status;
}

static strl_status ask_for_root(strl_walk *walk, root_reads *reads, uint32_t tree, strl_error *err)
{
    strl__node *root = walk->trees[tree].root;
    const strl_page_ref *page = &root->record->page;
    uint64_t bytes = strl__node_bytes(root->record, walk->labels);
    if (!strl__make_room(walk, bytes, 0))
        return strl__fail(err, STRL_ERR_MEMORY,
                          "the root of tree %" PRIu32 " takes %" PRIu64
                          " bytes, more than is left of the memory for walking, %" PRIu64 " bytes: it needs more",
                          tree, bytes, walk->memory_bytes);
    strl__node_reserve(walk, root);
    walk->root_bytes += bytes;
    return add_read(reads, tree, page->offset, page->bytes, page->checksum, err);
}

/* The first frames want what lies beside the root. Without memory it is read again. */
static void keep_page(strl_walk *walk, const strl_page_ref *ref, strl_source_span *span)
{
    strl__page *page = strl__page_create(ref, span->data);
    if (!page)
        return;
    span->data = NULL;
    strl__page_keep(walk, page);
    strl__page_release(page);
}

static strl_status take_root(strl_walk *walk, uint32_t tree, strl_source_span *span, strl_error *err)
{
    strl__walk_tree *own = &walk->trees[tree];
    const strl_node *record = own->root->record;
    strl__mesh mesh;
    strl_status status = strl_page_check(&record->page, span->data, span->size, err);
    if (status != STRL_OK)
        strl_source_doubt(walk->source, span->offset, span->size);
    if (status == STRL_OK && !strl__placements_are_few(walk))
        status = strl_page_far(record, span->data, span->size, &own->far, err);
    if (status == STRL_OK)
        status = strl__mesh_create(record, span->data, span->size, NULL, walk->labels, own->shared, 0, &mesh, err);
    if (status != STRL_OK)
        return status;
    strl__node_install(walk, own->root, &mesh);
    own->preview = strl__preview_of(own->root);
    walk->root_bytes -= mesh.spare_bytes; /* a root is never evicted */
    keep_page(walk, &record->page, span);
    return STRL_OK;
}

/* Of all trees that are used; some MiB at a time, so that it takes no more memory than that. */
static strl_status read_roots(strl_walk *walk, root_reads *reads,
                              strl_status (*ask)(strl_walk *, root_reads *, uint32_t, strl_error *), take_fn take,
                              strl_error *err)
{
    strl_status status = STRL_OK;
    for (uint32_t tree = 0; status == STRL_OK && tree < walk->tree_count; tree++) {
        if (!walk->trees[tree].used)
            continue;
        status = ask(walk, reads, tree, err);
        if (status == STRL_OK && reads->bytes >= MOST_ROOT_BYTES)
            status = take_all(walk, reads, take, err);
    }
    return status == STRL_OK ? take_all(walk, reads, take, err) : status;
}

static strl_status load_roots(strl_walk *walk, strl_error *err)
{
    root_reads reads = {.spans = strl__alloc(walk->tree_count, sizeof *reads.spans),
                        .trees = strl__alloc(walk->tree_count, sizeof *reads.trees)};
    strl_status status = STRL_OK;
    if (!reads.spans || !reads.trees)
        status = strl__fail(err, STRL_ERR_MEMORY, "no memory for the roots of %" PRIu32 " trees", walk->tree_count);
    if (status == STRL_OK)
        status = read_roots(walk, &reads, ask_for_records, take_records, err);
    if (status == STRL_OK)
        status = read_roots(walk, &reads, ask_for_root, take_root, err);
    drop_reads(&reads);
    strl__free(reads.spans);
    strl__free(reads.trees);
    return status;
}

static strl_status load_trees(strl_walk *walk, strl_error *err)
{
    walk->tree_count = strl_container_get_info(walk->container)->tree_count;
    walk->trees = strl__alloc_zero(walk->tree_count, sizeof *walk->trees);
    if (!walk->trees)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %" PRIu32 " trees", walk->tree_count);
    for (uint32_t tree = 0; tree < walk->tree_count; tree++)
        walk->trees[tree].tree = strl_container_tree(walk->container, tree);
    strl_status status = strl__placements_load(walk, err);
    if (status == STRL_OK)
        status = load_roots(walk, err);
    return status ? status : strl__placements_bound(walk, err);
}

static void apply_desc(strl_walk *walk, const strl_walk_desc *desc, strl_source *source)
{
    const strl_walk_desc defaults = {0};
    uint32_t requests = strl_source_room(source) == UINT64_MAX ? DEFAULT_REQUESTS : DEFAULT_REMOTE_REQUESTS;
    desc = desc ? desc : &defaults;
    walk->memory_bytes = desc->memory_bytes ? desc->memory_bytes : DEFAULT_MEMORY_BYTES;
    walk->requests_in_flight = desc->requests_in_flight ? desc->requests_in_flight : requests;
    if (walk->requests_in_flight > STRL__MAX_REQUESTS)
        walk->requests_in_flight = STRL__MAX_REQUESTS;
    if (desc->executor)
        walk->executor = *desc->executor;
    walk->labels = desc->labels;
    walk->cull = desc->cull;
    strl_walk_set_error_px(walk, desc->error_px);
    walk->share_guard = STRL__LEAST_GUARD;
    strl__expect_nothing(walk);
    walk->splat_ratio = isfinite(desc->splat_px) && desc->splat_px > 0 ? desc->splat_px / walk->error_px : 1;
    walk->stats.allowed_error_px = walk->error_px;
    strl__points_prepare(walk);
}

strl_status strl_walk_open(strl_source *source, const strl_walk_desc *desc, strl_walk **out, strl_error *err)
{
    *out = NULL;
    strl_walk *walk = strl__alloc_zero(1, sizeof *walk);
    if (!walk) {
        strl_source_close(source);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for a walk");
    }
    apply_desc(walk, desc, source);
    strl_status status = strl_container_open(source, &walk->container, err);
    if (status == STRL_OK) {
        walk->source = strl_container_source(walk->container);
        status = load_trees(walk, err);
    }
    if (status != STRL_OK) {
        if (walk->source)
            strl_source_fail(walk->source, status, err);
        strl_walk_close(walk);
        return status;
    }
    walk->stats.resident_bytes = walk->resident_bytes;
    *out = walk;
    return STRL_OK;
}

void strl_walk_close(strl_walk *walk)
{
    if (!walk)
        return;
    strl__jobs_abandon(walk);
    strl__retired_free(walk);
    while (strl__page_drop_oldest(walk))
        ;
    strl__placements_deinit(walk);
    strl__treelets_deinit(&walk->treelets);
    strl_container_close(walk->container);
    void *const owned[] = {walk->trees,
                           walk->jobs,
                           walk->level.items,
                           walk->below.items,
                           walk->groups.items,
                           walk->groups.table,
                           walk->demands.items,
                           walk->demands.needs,
                           walk->demands.table,
                           walk->children.items,
                           walk->wanted.items,
                           walk->ahead.items,
                           walk->split.items,
                           walk->split_before.items,
                           walk->missing.items,
                           walk->prefetch.items,
                           walk->along.items,
                           walk->front.items,
                           walk->items,
                           walk->points,
                           walk->placed_points,
                           walk->ranges.items,
                           walk->wanted_runs.items,
                           walk->numbers,
                           walk->retired,
                           walk};
    for (unsigned size = 0; size < STRL__FAR_SIZES; size++)
        strl__far_points_deinit(&walk->far[size]);
    for (unsigned size = 0; size < STRL__POINT_SIZES; size++)
        strl__far_points_deinit(&walk->merged[size]);
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        strl__free(owned[i]);
}

/* ---- frames */

static void begin_frame(strl_walk *walk)
{
    strl_walk_stats *stats = &walk->stats;
    strl_walk_stats kept = *stats;
    *stats =
        (strl_walk_stats){.frame = ++walk->frame, .allowed_error_px = kept.allowed_error_px, .faults = kept.faults};
    memcpy(stats->last_fault, kept.last_fault, sizeof stats->last_fault);
    walk->settled = false;
}

/* What a camera further on along its motion would want. Only while nothing is missing now. */
static strl_status look_ahead(strl_walk *walk, const strl_camera *camera, strl_error *err)
{
    strl_camera further = *camera;
    double moved = 0;
    for (int axis = 0; axis < 3; axis++) {
        double eye = camera->eye[axis] - walk->camera.eye[axis],
               target = camera->target[axis] - walk->camera.target[axis];
        moved += fabs(eye) + fabs(target);
        further.eye[axis] += AHEAD_FRAMES * eye;
        further.target[axis] += AHEAD_FRAMES * target;
    }
    strl_view view;
    if (walk->frame % AHEAD_EVERY != 0 || walk->missing.count > 0 || moved == 0 || !strl_view_init(&view, &further))
        return STRL_OK;
    strl__cut cut = {.kind = STRL__CUT_PREFETCH,
                     .view = &view,
                     .allowed_px = walk->stats.allowed_error_px,
                     .capacity_bytes = walk->memory_bytes - walk->treelet_bytes - walk->placement_bytes,
                     .stop_at_capacity = true};
    return strl__cut_run(walk, &cut, err);
}

static strl_status select_front(strl_walk *walk, const strl_camera *camera, const strl_view *view, strl_error *err)
{
    strl__cut cut;
    strl_status status = strl__budget_cut(walk, view, &cut, err);
    if (status == STRL_OK)
        status = look_ahead(walk, camera, err);
    if (status != STRL_OK) {
        walk->split_before.count = 0; /* of the frame before this one: no longer to compare with */
        return status;
    }
    walk->stats.missing_nodes = cut.missing;
    walk->stats.nodes_backfacing = cut.backfacing;
    walk->settled = !cut.waits;
    strl__cut_commit(walk);
    return STRL_OK;
}

static bool is_same_camera(const strl_camera *a, const strl_camera *b)
{
    return memcmp(a->eye, b->eye, sizeof a->eye) == 0 && memcmp(a->target, b->target, sizeof a->target) == 0 &&
           memcmp(a->up, b->up, sizeof a->up) == 0 && a->fov_y_deg == b->fov_y_deg &&
           a->ortho_height == b->ortho_height && a->width == b->width && a->height == b->height;
}

strl_status strl_walk_frame(strl_walk *walk, const strl_camera *camera, strl_draw_list *list, strl_error *err)
{
    uint64_t start = strl_clock_ns();
    strl_view view;
    *list = (strl_draw_list){.near_distance = 1, .far_distance = 2};
    begin_frame(walk);
    strl__requests_receive(walk);
    strl__retired_free(walk); /* the list that borrowed them is no more */
    strl_status status = strl_view_init(&view, camera)
                             ? STRL_OK
                             : strl__fail(err, STRL_ERR_ARGUMENT,
                                          "the camera is degenerate: not finite, without a direction or an image");
    walk->stands = is_same_camera(camera, &walk->camera);
    if (status == STRL_OK)
        status = select_front(walk, camera, &view, err);
    if (status == STRL_OK) {
        strl__refine_front(walk);
        strl__requests_submit(walk);
        /* what comes of them tells whether a finer cut fits */
        walk->settled &= walk->coarsening == 0 || walk->renewals == 0;
        status = strl__draw_list(walk, &view, list, err);
        walk->camera = *camera;
    }
    walk->stats.requests_pending = walk->requests_pending;
    walk->stats.remote = strl_source_get_network_stats(walk->source, &walk->stats.network);
    walk->stats.resident_bytes = walk->resident_bytes;
    walk->stats.select_ns = strl_clock_ns() - start;
    return status;
}

uint64_t strl_walk_pump(strl_walk *walk, uint64_t budget_ns)
{
    return walk->executor.submit ? 0 : strl__jobs_pump(walk, budget_ns);
}

bool strl_walk_settled(const strl_walk *walk)
{
    return walk->settled;
}

const strl_walk_stats *strl_walk_get_stats(const strl_walk *walk)
{
    return &walk->stats;
}

strl_container *strl_walk_container(strl_walk *walk)
{
    return walk->container;
}

void strl_walk_bounds(const strl_walk *walk, double bounds[6])
{
    memcpy(bounds, walk->bounds, sizeof walk->bounds);
}

void strl_walk_set_error_px(strl_walk *walk, double error_px)
{
    walk->error_px = isfinite(error_px) && error_px > 0 ? error_px : 1;
}
