/* Reads and decodes. A request is one page of nodes, one treelet or one page of placements; it keeps its slot until
 * every node of it is decoded, so that undecoded bytes are bounded by the number of slots. Decoding is a job per node:
 * the executor's, or the pump's. */
#include "walk/internal.h"

#include <math.h>
#include <stdlib.h>

#include "platform/thread.h"

#define FORGET_FRAMES 16u /* a read that nothing has wanted for this long is cancelled */
#define ABANDON_WAIT_NS 50000u
#define MOST_PREFETCH 4096u /* candidates of a frame: some hundred pages */
#define FLOOR_SINKS 0.8f    /* a frame */

/* ---- jobs */

static void destroy_job(strl__job *job)
{
    strl__mesh_deinit(&job->mesh);
    strl__page_release(job->page);
    strl__free(job);
}

/* Runs on any thread. */
static void run_job(void *context)
{
    strl__job *job = context;
    int phase = STRL__JOB_QUEUED;
    if (!atomic_compare_exchange_strong(&job->phase, &phase, STRL__JOB_RUNNING)) {
        destroy_job(job); /* abandoned: the walk has let go of it */
        return;
    }
    const strl_payload_reference *reference = job->record.decode_parent != STRL_NONE ? &job->reference : NULL;
    job->status = strl__mesh_create(&job->record, job->page->data, job->page->ref.bytes, reference, job->labels,
                                    job->shared, job->closed_size, &job->mesh, &job->error);
    atomic_store_explicit(&job->phase, STRL__JOB_DONE, memory_order_release);
}

void strl__jobs_abandon(strl_walk *walk)
{
    for (size_t i = 0; i < walk->job_count; i++) {
        strl__job *job = walk->jobs[i];
        int phase = STRL__JOB_QUEUED;
        if (walk->executor.submit && !job->is_waiting &&
            atomic_compare_exchange_strong(&job->phase, &phase, STRL__JOB_ABANDONED))
            continue; /* the executor still holds it and will release it */
        while (atomic_load_explicit(&job->phase, memory_order_acquire) == STRL__JOB_RUNNING)
            strl_sleep_ns(ABANDON_WAIT_NS);
        destroy_job(job);
    }
    walk->job_count = 0;
}

/* ---- slots */

static void free_slot(strl_walk *walk, strl__request *request)
{
    *request = (strl__request){0};
    walk->requests_pending--;
}

static void node_done(strl_walk *walk, strl__request *request)
{
    if (--request->node_count == 0)
        free_slot(walk, request);
}

static void drop_node(strl_walk *walk, strl__request *request, strl__node *node)
{
    strl__node_release(walk, node);
    node_done(walk, request);
}

static void node_failed(strl_walk *walk, strl__request *request, strl__node *node, const strl_error *error)
{
    strl__note_fault(walk, error);
    strl__back_off(walk, &node->retry, false);
    drop_node(walk, request, node);
}

/* Hands the job over as soon as the node is there by which it is decoded. */
static strl_status submit_job(strl_walk *walk, strl__job *job, strl_error *err)
{
    const strl__node *by = job->node->decoded_by;
    job->is_waiting = by && by->residency != STRL__RESIDENT;
    if (job->is_waiting)
        return STRL_OK;
    if (by)
        job->reference = strl__mesh_reference(by, &job->record);
    return walk->executor.submit ? walk->executor.submit(walk->executor.context, run_job, job, err) : STRL_OK;
}

/* False where the job has come to its end. */
static bool advance_waiting(strl_walk *walk, strl__job *job)
{
    strl_error error = {0};
    strl__request *request = job->node->request;
    if (job->node->decoded_by->residency == STRL__ABSENT)
        drop_node(walk, request, job->node); /* what it waits for has failed, and will be asked for again first */
    else if (submit_job(walk, job, &error) != STRL_OK)
        node_failed(walk, request, job->node, &error);
    else
        return true;
    return false;
}

static void reap_jobs(strl_walk *walk)
{
    size_t kept = 0;
    for (size_t i = 0; i < walk->job_count; i++) {
        strl__job *job = walk->jobs[i];
        if (job->is_waiting) {
            if (advance_waiting(walk, job))
                walk->jobs[kept++] = job;
            else
                destroy_job(job);
            continue;
        }
        if (atomic_load_explicit(&job->phase, memory_order_acquire) != STRL__JOB_DONE) {
            walk->jobs[kept++] = job;
            continue;
        }
        strl__request *request = job->node->request;
        if (job->status == STRL_OK && job->node->residency == STRL__RESIDENT && /* what it has is replaced */
            !strl__grow(&walk->retired, &walk->retired_capacity, walk->retired_count + 1, sizeof *walk->retired))
            job->status = strl__fail(&job->error, STRL_ERR_MEMORY, "no memory for a decoded node");
        if (job->status == STRL_OK) {
            strl__node_install(walk, job->node, &job->mesh);
            job->mesh = (strl__mesh){0};
            node_done(walk, request);
        } else {
            node_failed(walk, request, job->node, &job->error);
        }
        destroy_job(job);
    }
    walk->job_count = kept;
}

/* Installs what is decoded as it goes: other jobs may wait for it. */
uint64_t strl__jobs_pump(strl_walk *walk, uint64_t budget_ns)
{
    uint64_t ran = 0, before, start = strl_clock_ns();
    do {
        before = ran;
        for (size_t i = 0; i < walk->job_count && (ran == 0 || strl_clock_ns() - start < budget_ns); i++) {
            if (walk->jobs[i]->is_waiting ||
                atomic_load_explicit(&walk->jobs[i]->phase, memory_order_relaxed) != STRL__JOB_QUEUED)
                continue;
            run_job(walk->jobs[i]);
            ran++;
        }
        reap_jobs(walk);
    } while (ran > before && strl_clock_ns() - start < budget_ns);
    return ran;
}

/* ---- answers */

/* Takes over a reference of the page. */
static strl_status start_job(strl_walk *walk, strl__node *node, strl__page *page, strl_error *err)
{
    strl__job *job = strl__alloc_zero(1, sizeof *job);
    if (!job || !strl__grow(&walk->jobs, &walk->job_capacity, walk->job_count + 1, sizeof *walk->jobs)) {
        strl__free(job);
        strl__page_release(page);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to decode a node");
    }
    job->page = page;
    job->node = node;
    job->record = *node->record;
    job->labels = walk->labels;
    job->shared = walk->trees[node->treelet->tree].shared;
    job->closed_size = node->closed_size;
    strl_status status = submit_job(walk, job, err);
    if (status != STRL_OK) {
        destroy_job(job);
        return status;
    }
    walk->jobs[walk->job_count++] = job;
    return STRL_OK;
}

/* One fault, however many nodes. is_unread: the source failed; else what it brought is wrong. */
static void request_failed(strl_walk *walk, strl__request *request, const strl_error *error, bool is_unread)
{
    bool is_fault = error->status != STRL_ERR_CANCELLED;
    if (is_fault)
        strl__note_fault(walk, error);
    if (request->treelet) {
        request->treelet->residency = STRL__ABSENT;
        if (is_fault)
            strl__back_off(walk, &request->treelet->retry, is_unread);
        free_slot(walk, request);
        return;
    }
    if (request->run) {
        if (is_fault)
            strl__back_off(walk, &request->run->retry, is_unread);
        strl__run_release(walk, request->run);
        free_slot(walk, request);
        return;
    }
    for (strl__node *next, *node = request->first_asked; node; node = next) {
        next = node->next_asked;
        if (is_fault)
            strl__back_off(walk, &node->retry, is_unread);
        drop_node(walk, request, node);
    }
}

static void receive_page(strl_walk *walk, strl__request *request, strl_source_result *result)
{
    strl_error error = {0};
    strl__page *page = NULL;
    strl__node *node = request->first_asked;
    const strl_page_ref *ref = &node->record->page;
    strl_status status = strl_page_check(ref, result->data, result->size, &error);
    if (status != STRL_OK)
        strl_source_doubt(walk->source, ref->offset, ref->bytes);
    if (status == STRL_OK && !(page = strl__page_create(ref, result->data)))
        status = strl__fail(&error, STRL_ERR_MEMORY, "no memory for a page");
    if (status != STRL_OK) {
        request_failed(walk, request, &error, false);
        return;
    }
    result->data = NULL;
    request->answered = true;
    for (strl__node *next; node; node = next) {
        next = node->next_asked; /* the last one takes the request along where it fails */
        if (start_job(walk, node, strl__page_share(page), &error) != STRL_OK)
            node_failed(walk, request, node, &error);
    }
    strl__page_keep(walk, page);
    strl__page_release(page);
}

static void receive_treelet(strl_walk *walk, strl__request *request, const strl_source_result *result)
{
    strl_error error = {0};
    if (strl__treelet_load(walk, request->treelet, result->data, result->size, &error) == STRL_OK) {
        free_slot(walk, request);
        return;
    }
    strl_source_doubt(walk->source, request->treelet->ref.offset, request->treelet->ref.bytes);
    request_failed(walk, request, &error, false);
}

static void receive_run(strl_walk *walk, strl__request *request, const strl_source_result *result)
{
    strl_error error = {0};
    if (strl__run_load(walk, request->run, result->data, result->size, &error) == STRL_OK) {
        free_slot(walk, request);
        return;
    }
    strl_source_doubt(walk->source, request->run->facts.page.offset, request->run->facts.page.bytes);
    request_failed(walk, request, &error, false);
}

static void receive(strl_walk *walk, strl__request *request, strl_source_result *result)
{
    result->error.status = result->status;
    walk->stats.bytes_read += result->status == STRL_OK ? result->size : 0;
    if (result->status == STRL_OK)
        strl__source_answers(walk);
    else if (result->status != STRL_ERR_CANCELLED)
        strl__source_fails(walk);
    if (result->status != STRL_OK)
        request_failed(walk, request, &result->error, true);
    else if (request->treelet)
        receive_treelet(walk, request, result);
    else if (request->run)
        receive_run(walk, request, result);
    else
        receive_page(walk, request, result);
}

void strl__requests_receive(strl_walk *walk)
{
    strl_source_result result;
    reap_jobs(walk);
    while (strl_source_poll(walk->source, &result)) {
        strl__request *request = &walk->requests[result.token % STRL__MAX_REQUESTS];
        if (request->used && request->token == result.token && !request->answered)
            receive(walk, request, &result);
        strl__free(result.data);
    }
    strl__begin_look(walk);
}

/* ---- submission */

static uint64_t offset_of(const strl__candidate *candidate)
{
    return candidate->run ? candidate->run->facts.page.offset : candidate->node->record->page.offset;
}

static int by_urgency(const void *left, const void *right)
{
    const strl__candidate *a = left, *b = right;
    if (a->urgency != b->urgency)
        return a->urgency > b->urgency ? -1 : 1;
    uint64_t at_a = offset_of(a), at_b = offset_of(b);
    return at_a < at_b ? -1 : at_a > at_b;
}

/* Of which more nodes can be asked for. answered: the page is here, and nodes of it are being decoded. */
static strl__request *request_of(strl_walk *walk, uint64_t offset, bool answered)
{
    for (uint32_t i = 0; i < walk->requests_in_flight; i++) {
        strl__request *request = &walk->requests[i];
        if (request->used && request->answered == answered && !request->cancelled && !request->treelet &&
            !request->run && request->offset == offset)
            return request;
    }
    return NULL;
}

/* On a slow link the source has room for less than the slots: what could not come soon is not asked for, so that it
 * cannot be in the way of what the camera wants by then. */
static bool has_slot(const strl_walk *walk, uint32_t in_flight)
{
    return walk->requests_pending < in_flight && walk->room > 0;
}

static strl__request *take_slot(strl_walk *walk)
{
    uint32_t i = 0;
    while (walk->requests[i].used)
        i++;
    strl__request *request = &walk->requests[i];
    *request =
        (strl__request){.used = true, .token = ++walk->tokens * STRL__MAX_REQUESTS + i, .touched_frame = walk->frame};
    walk->requests_pending++;
    return request;
}

static strl_status submit(strl_walk *walk, strl__request *request, uint64_t offset, size_t size, float urgency,
                          strl_error *err)
{
    strl_status status = strl_source_submit(walk->source, request->token, offset, size, urgency, err);
    if (status == STRL_OK) {
        walk->stats.requests++;
        walk->room -= size < walk->room ? size : walk->room;
    }
    return status;
}

static void add_node(strl_walk *walk, strl__request *request, strl__node *node)
{
    strl__node_reserve(walk, node);
    strl__retry_asked(walk, &node->retry);
    node->request = request;
    node->next_asked = NULL;
    *(request->node_count++ > 0 && !request->answered ? &request->last_asked->next_asked : &request->first_asked) =
        node;
    request->last_asked = node;
    request->touched_frame = walk->frame;
}

/* The node's, whose room is there; NULL request: a new one. page: it is here already, and this reference of it is taken
 * over. */
static void ask_for_page(strl_walk *walk, strl__request *request, strl__node *node, strl__page *page, float urgency)
{
    const strl_page_ref *ref = &node->record->page;
    strl_error error = {0};
    bool is_new = !request;
    if (is_new) {
        request = take_slot(walk);
        request->offset = ref->offset;
        request->answered = page != NULL;
    }
    add_node(walk, request, node);
    strl_status status = STRL_OK;
    if (page)
        status = start_job(walk, node, page, &error);
    else if (is_new)
        status = submit(walk, request, ref->offset, ref->bytes, urgency, &error);
    if (status != STRL_OK)
        node_failed(walk, request, node, &error);
}

/* False where no room could be made: then nothing less urgent may take it either. */
static bool ask_for_node(strl_walk *walk, const strl__candidate *candidate, uint32_t in_flight, uint64_t evict_before)
{
    strl__node *node = candidate->node;
    bool has_more = node->residency == STRL__RESIDENT && node->mesh.held < node->mesh.step_count && !node->request;
    if (node->residency != STRL__ABSENT && !has_more)
        return true;
    strl__page *page = strl__page_find(walk, &node->record->page);
    strl__request *request = request_of(walk, node->record->page.offset, page != NULL);
    if (!request && (page ? walk->requests_pending >= in_flight : !has_slot(walk, in_flight)))
        return true;
    if (!strl__node_hold(walk, node))
        return true;
    strl__page_share(page); /* what makes room may let go of it */
    if (!strl__make_room(walk, strl__node_bytes(node->record, walk->labels), evict_before)) {
        walk->lacked_room |= has_more;
        strl__node_let_go(node);
        strl__page_release(page);
        return false;
    }
    ask_for_page(walk, request, node, page, candidate->urgency);
    return true;
}

static void ask_for_treelet(strl_walk *walk, const strl__candidate *candidate, uint32_t in_flight)
{
    const strl__treelet *parent = candidate->node->treelet;
    strl__treelet *treelet = strl__treelets_find(&walk->treelets, parent->tree, candidate->treelet);
    if ((treelet && (treelet->residency != STRL__ABSENT || strl__is_waiting(walk, &treelet->retry))) ||
        !has_slot(walk, in_flight))
        return;
    /* Decoding has checked that a treelet names those of all children of its nodes. */
    const strl_treelet_ref *ref = &parent->data.child_refs[candidate->treelet - parent->data.first_child_treelet];
    if (!treelet)
        treelet = strl__treelet_reserve(walk, parent->tree, candidate->treelet, ref);
    if (!treelet)
        return;
    strl_error error = {0};
    strl__request *request = take_slot(walk);
    request->treelet = treelet;
    treelet->residency = STRL__PENDING;
    strl__retry_asked(walk, &treelet->retry);
    if (submit(walk, request, ref->offset, ref->bytes, candidate->urgency, &error) != STRL_OK)
        request_failed(walk, request, &error, false);
}

/* As ask_for_node. */
static bool ask_for_run(strl_walk *walk, const strl__candidate *candidate, uint32_t in_flight, uint64_t evict_before)
{
    strl__run *run = candidate->run;
    const strl_treelet_ref *page = &run->facts.page;
    strl_error error = {0};
    if (run->residency != STRL__ABSENT || !has_slot(walk, in_flight))
        return true;
    if (!strl__make_room(walk, strl__run_bytes(strl__run_placements(walk, run)), evict_before))
        return false;
    strl__request *request = take_slot(walk);
    request->run = run;
    strl__run_reserve(walk, run, request);
    strl__retry_asked(walk, &run->retry);
    if (submit(walk, request, page->offset, page->bytes, candidate->urgency, &error) != STRL_OK)
        request_failed(walk, request, &error, false);
    return true;
}

static void ask_for_all(strl_walk *walk, strl__candidates *candidates, uint32_t in_flight, uint64_t evict_before)
{
    bool room = true;
    if (candidates->count > 1)
        qsort(candidates->items, candidates->count, sizeof *candidates->items, by_urgency);
    for (size_t i = 0; i < candidates->count; i++) {
        const strl__candidate *candidate = &candidates->items[i];
        if (candidate->treelet != STRL_NONE)
            ask_for_treelet(walk, candidate, in_flight);
        else if (room && candidate->run)
            room = ask_for_run(walk, candidate, in_flight, evict_before);
        else if (room)
            room = ask_for_node(walk, candidate, in_flight, evict_before);
    }
}

void strl__candidates_select(strl__candidates *candidates, size_t at)
{
    strl__candidate *items = candidates->items;
    size_t first = 0, end = candidates->count;
    while (end - first > 1) {
        const float pivot = items[first + (end - first) / 2].urgency;
        size_t i = first, j = end - 1;
        for (;; i++, j--) {
            while (items[i].urgency > pivot)
                i++;
            while (items[j].urgency < pivot)
                j--;
            if (i >= j)
                break;
            strl__candidate swapped = items[i];
            items[i] = items[j];
            items[j] = swapped;
        }
        size_t split = i > first ? i : first + 1; /* none of [first, split) is less urgent than any of [split, end) */
        if (at < split)
            end = split;
        else
            first = split;
    }
}

/* Of tens of thousands that might be wanted soon a frame asks for a few: to put all in order, and to find them at all,
 * would take longer than the rest of the frame. How urgent the last of the first MOST_PREFETCH is, is a bound for the
 * frames behind, which sinks again where there are fewer. */
static void bound_prefetch(strl_walk *walk)
{
    strl__candidates *prefetch = &walk->prefetch;
    if (prefetch->count > MOST_PREFETCH) {
        strl__candidates_select(prefetch, MOST_PREFETCH - 1);
        prefetch->count = MOST_PREFETCH;
        walk->prefetch_floor = fminf(prefetch->items[MOST_PREFETCH - 1].urgency, (float)STRL__PREFETCH_SHARE);
    } else
        walk->prefetch_floor *= FLOOR_SINKS;
}

static void forget_stale(strl_walk *walk)
{
    for (uint32_t i = 0; i < walk->requests_in_flight; i++) {
        strl__request *request = &walk->requests[i];
        if (!request->used || request->answered || request->cancelled || request->treelet ||
            request->touched_frame + FORGET_FRAMES >= walk->frame)
            continue;
        request->cancelled = true;
        strl_source_cancel(walk->source, request->token);
    }
}

void strl__requests_submit(strl_walk *walk)
{
    uint32_t in_flight = walk->is_looking ? 1 : walk->requests_in_flight;
    walk->room = strl_source_room(walk->source);
    ask_for_all(walk, &walk->missing, in_flight, walk->frame + 1);
    uint64_t idle_since = strl__idle_since(walk);   /* prefetching evicts only what has been idle for longer */
    ask_for_all(walk, &walk->along, 0, idle_since); /* no slot is theirs */
    bound_prefetch(walk);
    if (walk->missing.count == 0)
        ask_for_all(walk, &walk->prefetch, (in_flight + 1) / 2, idle_since);
    forget_stale(walk);
}
