/* The connections that are open: who they are, and since when nothing has come of them. A connection makes progress by
 * a whole request head, by each turn of its query and by each chunk that it takes of an answer, and by nothing else:
 * bytes that dribble in or out keep no place. Thread-safe. Internal. */
#ifndef STRL_SERVE_CONNECTIONS_H
#define STRL_SERVE_CONNECTIONS_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "platform/socket.h"
#include "platform/thread.h"

typedef enum strl__surplus { STRL__SURPLUS_NONE, STRL__SURPLUS_CONNECTIONS, STRL__SURPLUS_ADDRESS } strl__surplus;

typedef struct strl__connection {
    void *handle; /* the library's; NULL = the slot is free */
    int socket;   /* borrowed */
    strl_peer peer;
    strl__surplus surplus; /* beyond a limit when it came: its first request is turned away */
    bool paused;           /* for the bandwidth's sake */
    bool ended;
    void *exchange; /* the request at work, of its thread's; NULL = none */
    _Atomic uint64_t progress_ns;
    atomic_bool is_between; /* a request was answered and no other has begun */
} strl__connection;

typedef struct strl__connections {
    strl_mutex mutex;
    strl__connection *slots; /* [capacity], owned */
    uint32_t capacity, count;
    uint32_t most, most_per_address;
    bool closing;
} strl__connections;

/* capacity: places for connections within the limits and some more, which are told that there is no room. */
bool strl__connections_init(strl__connections *self, uint32_t most, uint32_t most_per_address, uint32_t capacity);
void strl__connections_deinit(strl__connections *self);
/* NULL where all places are taken. */
strl__connection *strl__connections_add(strl__connections *self, void *handle, int socket, const void *socket_address);
void strl__connections_remove(strl__connections *self, strl__connection *connection);
uint32_t strl__connections_count(strl__connections *self);
void strl__connection_progress(strl__connection *connection); /* NULL is legal */
/* Ends what has made no progress for timeout_ns; returns how many that were. *idle: how many of these were between two
 * requests. */
uint32_t strl__connections_end_idle(strl__connections *self, uint64_t timeout_ns, uint32_t *idle);

/* Notes that a connection has been suspended. False where the server closes: then the caller resumes it at once. */
bool strl__connections_pause(strl__connections *self, strl__connection *connection);
/* Resumes all that are suspended; closing: none will be from now on. */
void strl__connections_resume(strl__connections *self, bool closing, void (*resume)(void *handle));

#endif
