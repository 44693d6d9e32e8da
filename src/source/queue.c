#include "source/queue.h"

#include "base/fail.h"
#include "base/memory.h"

void strl__read_queue_init(strl__read_queue *queue)
{
    *queue = (strl__read_queue){0};
    strl_mutex_init(&queue->mutex);
}

static void drop(strl__read *read)
{
    strl__free(read->result.data);
    strl__free(read);
}

void strl__read_queue_clear(strl__read_queue *queue)
{
    strl_mutex_lock(&queue->mutex);
    for (size_t i = 0; i < queue->waiting_count; i++)
        drop(queue->waiting[i]);
    queue->waiting_count = 0;
    strl_mutex_unlock(&queue->mutex);
}

void strl__read_queue_deinit(strl__read_queue *queue)
{
    strl__read_queue_clear(queue);
    while (queue->first_done) {
        strl__read *next = queue->first_done->next;
        drop(queue->first_done);
        queue->first_done = next;
    }
    strl__free(queue->waiting);
    strl_mutex_deinit(&queue->mutex);
}

static bool goes_before(const strl__read *a, const strl__read *b)
{
    if (a->request.urgency != b->request.urgency)
        return a->request.urgency > b->request.urgency;
    return a->age < b->age;
}

static void sift_up(strl__read **heap, size_t at)
{
    strl__read *moved = heap[at];
    while (at > 0 && goes_before(moved, heap[(at - 1) / 2])) {
        heap[at] = heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    heap[at] = moved;
}

static void sift_down(strl__read **heap, size_t count, size_t at)
{
    strl__read *moved = heap[at];
    for (;;) {
        size_t child = 2 * at + 1;
        if (child >= count)
            break;
        if (child + 1 < count && goes_before(heap[child + 1], heap[child]))
            child++;
        if (!goes_before(heap[child], moved))
            break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = moved;
}

strl_status strl__read_queue_reserve(strl__read_queue *queue, const strl__read_request *request, strl__read **read,
                                     strl_error *err)
{
    *read = NULL;
    strl__read *made = strl__alloc_zero(1, sizeof *made);
    if (!made ||
        !strl__grow(&queue->waiting, &queue->waiting_capacity, queue->waiting_count + 1, sizeof *queue->waiting)) {
        strl__free(made);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to queue a read");
    }
    made->request = *request;
    made->result.token = request->token;
    *read = made;
    return STRL_OK;
}

void strl__read_queue_push(strl__read_queue *queue, strl__read *read)
{
    read->age = queue->pushed++;
    if (read->request.urgency != read->request.urgency)
        read->request.urgency = 0; /* not a number has no place in an order */
    queue->waiting[queue->waiting_count] = read;
    sift_up(queue->waiting, queue->waiting_count++);
}

strl__read *strl__read_queue_take(strl__read_queue *queue)
{
    strl__read *read = NULL;
    strl_mutex_lock(&queue->mutex);
    if (queue->waiting_count) {
        read = queue->waiting[0];
        queue->waiting[0] = queue->waiting[--queue->waiting_count];
        if (queue->waiting_count)
            sift_down(queue->waiting, queue->waiting_count, 0);
    }
    strl_mutex_unlock(&queue->mutex);
    return read;
}

static void append_done(strl__read_queue *queue, strl__read *read)
{
    read->next = NULL;
    if (queue->first_done)
        queue->last_done->next = read;
    else
        queue->first_done = read;
    queue->last_done = read;
}

void strl__read_queue_done(strl__read_queue *queue, strl__read *read)
{
    strl_mutex_lock(&queue->mutex);
    append_done(queue, read);
    strl_mutex_unlock(&queue->mutex);
}

void strl__read_queue_cancel(strl__read_queue *queue, uint64_t token)
{
    strl_mutex_lock(&queue->mutex);
    size_t kept = 0;
    for (size_t i = 0; i < queue->waiting_count; i++) {
        strl__read *read = queue->waiting[i];
        if (read->request.token != token) {
            queue->waiting[kept++] = read;
            continue;
        }
        read->result.status = strl__fail(&read->result.error, STRL_ERR_CANCELLED, "cancelled");
        append_done(queue, read);
    }
    if (kept != queue->waiting_count) {
        queue->waiting_count = kept;
        for (size_t i = kept / 2; i-- > 0;)
            sift_down(queue->waiting, kept, i);
    }
    strl_mutex_unlock(&queue->mutex);
}

bool strl__read_queue_answer(strl__read_queue *queue, strl_source_result *result)
{
    strl_mutex_lock(&queue->mutex);
    strl__read *read = queue->first_done;
    if (read)
        queue->first_done = read->next;
    strl_mutex_unlock(&queue->mutex);
    if (!read)
        return false;
    *result = read->result;
    strl__free(read);
    return true;
}

bool strl__read_queue_serve(strl__read_queue *queue, strl_source *source, strl__fetch_fn fetch)
{
    strl__read *read = strl__read_queue_take(queue);
    if (!read)
        return false;
    strl_source_result *result = &read->result;
    result->data = strl__alloc(read->request.size, 1);
    if (result->data)
        result->status = fetch(source, read->request.offset, result->data, read->request.size, &result->error);
    else
        result->status =
            strl__fail(&result->error, STRL_ERR_MEMORY, "no memory for a read of %zu bytes", read->request.size);
    if (result->status == STRL_OK) {
        result->size = read->request.size;
    } else {
        strl__free(result->data);
        result->data = NULL;
    }
    strl__read_queue_done(queue, read);
    return true;
}
