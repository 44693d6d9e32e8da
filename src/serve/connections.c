#include "serve/connections.h"

#include <string.h>

#include "base/memory.h"

bool strl__connections_init(strl__connections *self, uint32_t most, uint32_t most_per_address, uint32_t capacity)
{
    *self = (strl__connections){.capacity = capacity, .most = most, .most_per_address = most_per_address};
    self->slots = strl__alloc_zero(capacity, sizeof *self->slots);
    if (self->slots)
        strl_mutex_init(&self->mutex);
    return self->slots != NULL;
}

void strl__connections_deinit(strl__connections *self)
{
    if (self->slots)
        strl_mutex_deinit(&self->mutex);
    strl__free(self->slots);
    self->slots = NULL;
}

static bool same_address(const strl_peer *a, const strl_peer *b)
{
    return a->is_v6 == b->is_v6 && memcmp(a->address, b->address, sizeof a->address) == 0;
}

/* Against those that are within the limits themselves. */
static strl__surplus surplus_of(const strl__connections *self, const strl_peer *peer)
{
    uint32_t all = 0, same = 0;
    for (uint32_t i = 0; i < self->capacity; i++) {
        const strl__connection *other = &self->slots[i];
        if (!other->handle || other->surplus != STRL__SURPLUS_NONE)
            continue;
        all++;
        same += same_address(&other->peer, peer);
    }
    return all >= self->most                ? STRL__SURPLUS_CONNECTIONS
           : same >= self->most_per_address ? STRL__SURPLUS_ADDRESS
                                            : STRL__SURPLUS_NONE;
}

strl__connection *strl__connections_add(strl__connections *self, void *handle, int socket, const void *socket_address)
{
    strl_peer peer;
    strl_peer_from(socket_address, &peer);
    strl__connection *slot = NULL;
    strl_mutex_lock(&self->mutex);
    for (uint32_t i = 0; !slot && i < self->capacity; i++)
        slot = self->slots[i].handle ? NULL : &self->slots[i];
    if (slot) {
        slot->surplus = surplus_of(self, &peer);
        slot->peer = peer;
        slot->socket = socket;
        slot->paused = slot->ended = false;
        slot->exchange = NULL;
        atomic_store(&slot->progress_ns, strl_clock_ns());
        atomic_store(&slot->is_between, false);
        slot->handle = handle;
        self->count++;
    }
    strl_mutex_unlock(&self->mutex);
    return slot;
}

void strl__connections_remove(strl__connections *self, strl__connection *connection)
{
    if (!connection)
        return;
    strl_mutex_lock(&self->mutex);
    connection->handle = NULL;
    self->count--;
    strl_mutex_unlock(&self->mutex);
}

uint32_t strl__connections_count(strl__connections *self)
{
    strl_mutex_lock(&self->mutex);
    uint32_t count = self->count;
    strl_mutex_unlock(&self->mutex);
    return count;
}

void strl__connection_progress(strl__connection *connection)
{
    if (connection)
        atomic_store(&connection->progress_ns, strl_clock_ns());
}

uint32_t strl__connections_end_idle(strl__connections *self, uint64_t timeout_ns, uint32_t *idle)
{
    uint32_t count = 0;
    *idle = 0;
    /* Held over all of it: a connection is removed before its socket is closed, so no socket here is another's. */
    strl_mutex_lock(&self->mutex);
    uint64_t now_ns = strl_clock_ns();
    for (uint32_t i = 0; i < self->capacity; i++) {
        strl__connection *slot = &self->slots[i];
        uint64_t since_ns = atomic_load(&slot->progress_ns);
        if (!slot->handle || slot->paused || slot->ended || now_ns <= since_ns || now_ns - since_ns < timeout_ns)
            continue;
        slot->ended = true;
        *idle += atomic_load(&slot->is_between); /* before: its thread ends the request at once */
        strl_socket_end(slot->socket);
        count++;
    }
    strl_mutex_unlock(&self->mutex);
    return count;
}

bool strl__connections_pause(strl__connections *self, strl__connection *connection)
{
    strl_mutex_lock(&self->mutex);
    bool closing = self->closing;
    connection->paused = !closing;
    strl_mutex_unlock(&self->mutex);
    return !closing;
}

/* One of the suspended from *at on, which is not so any more; NULL = none is left. Whoever asks is the only one who
 * resumes. */
static void *next_paused(strl__connections *self, bool closing, uint32_t *at)
{
    void *handle = NULL;
    strl_mutex_lock(&self->mutex);
    self->closing |= closing;
    for (; !handle && *at < self->capacity; ++*at) {
        strl__connection *slot = &self->slots[*at];
        if (!slot->handle || !slot->paused)
            continue;
        slot->paused = false;
        atomic_store(&slot->progress_ns, strl_clock_ns());
        handle = slot->handle;
    }
    strl_mutex_unlock(&self->mutex);
    return handle;
}

void strl__connections_resume(strl__connections *self, bool closing, void (*resume)(void *handle))
{
    /* Outside of the lock, for the library has locks of its own; what is suspended is not closed meanwhile. Once over
     * all of them: one that is suspended anew at once waits for the next time, and when all ends nothing is suspended
     * anew. */
    uint32_t at = 0;
    for (void *handle; (handle = next_paused(self, closing, &at));)
        resume(handle);
}
