/* What the files of the remote source share.
 *
 *     the walk's thread   submit, poll, cancel, read                                          http.c
 *     the disk thread     new reads: in the cache, or on to the network; keeps what came      http_disk.c
 *     the network thread  waiting reads -> requests -> answers; all of libcurl          http_network.c, http_transfer.c
 *
 * Without a cache there is no disk thread. A read moves NEW -> (LOOKED_UP ->) WAITING -> FETCHING -> DONE, back to
 * WAITING where an attempt fails, and from anywhere to DONE where it is cancelled. Its bytes are in its own
 * buffer, so that a transfer does not care who still wants them: it spreads what comes over the reads that are
 * attached to it at the moment.
 *
 * Where nothing comes any more a transfer beside the others looks whether the server answers again: one byte, that no
 * read wants. What was silent while a later request was answered is overtaken: it is given up and asked for again.
 *
 * Invariants: (1) an accepted read is in `reads` until it is DONE, then in `finished` (or its waiter's hands)
 * until it is taken, so it is answered exactly once; (2) everything under `mutex` is touched with it held, and
 * nothing waits while it is; (3) while the network thread runs only it calls libcurl,
 * but for curl_multi_wakeup, and only it touches what is said to be its own, with the mutex or without. */
#ifndef STRL_SOURCE_HTTP_H
#define STRL_SOURCE_HTTP_H

#include <curl/curl.h>

#include "platform/thread.h"
#include "source/cache.h"
#include "source/http_answer.h"
#include "source/http_pace.h"
#include "source/source.h"

#define STRL__HTTP_HEAD_BYTES 4096u /* what opening reads: a container's header, which says what model it is */
#define STRL__HTTP_MOST_CONNECTIONS 32u
#define STRL__HTTP_MOST_REDIRECTS 5
#define STRL__HTTP_AHEAD 64u                       /* reads whose surroundings are kept, */
#define STRL__HTTP_AHEAD_BYTES ((uint64_t)8 << 20) /* so much of them at most */
#define STRL__HTTP_MOST_MERGED ((uint64_t)2 << 20) /* bytes of a request for several reads */

typedef enum strl__http_state {
    STRL__HTTP_NEW,       /* nobody has looked at it yet; the disk thread will */
    STRL__HTTP_LOOKED_UP, /* in the hands of the disk thread */
    STRL__HTTP_WAITING,   /* for a transfer */
    STRL__HTTP_FETCHING,  /* attached to one */
    STRL__HTTP_DONE
} strl__http_state;

typedef struct strl__http_read {
    struct strl__http_read *next; /* in the finished list */
    uint64_t serial;              /* in order of submission; names a read that may be gone */
    uint64_t offset;              /* of the bytes asked for; what the cache knows them by */
    size_t size;
    uint64_t begin, end; /* what is fetched for it: the same, or more round it for a blocking read */
    float urgency;
    bool waited; /* by the thread that asked: not for poll */
    strl__http_state state;
    struct strl__http_transfer *transfer; /* while fetching */
    uint64_t filled;                      /* bytes from begin on that are in result.data */
    uint32_t attempts;                    /* that have failed */
    uint64_t not_before_ns;
    strl_source_result result; /* data: from begin on, once it is fetched */
} strl__http_read;

typedef struct strl__http_transfer {
    struct strl__http *http;
    CURL *easy; /* kept from one to the next */
    bool active, opening, redirected, overtaken;
    bool looking; /* the last one of `transfers`, which has no reads */
    uint64_t begun_ns;
    uint64_t begin, end; /* asked for */
    uint64_t received;
    uint64_t discarded; /* of the body of an answer that is of no use */
    bool judged;
    strl__http_verdict verdict;
    strl_error error; /* the reason, without the address */
    strl__http_fields fields;
    uint64_t watched_ns, watched_bytes; /* since when, and what had come then */
    bool receiving;                     /* counted in the pace */
    char reason[CURL_ERROR_SIZE];
} strl__http_transfer;

/* What a blocking read has fetched. */
typedef struct strl__http_ahead {
    uint64_t begin, end;
    uint8_t *data; /* owned; NULL = nothing beyond what was asked for, which has been taken away */
} strl__http_ahead;

/* Bytes to be kept in the cache, or (without data) an entry to be dropped from it. */
typedef struct strl__http_kept {
    struct strl__http_kept *next;
    uint64_t offset;
    size_t size;
    uint8_t data[];
} strl__http_kept;

typedef struct strl__http {
    strl_source base;
    /* Set before the threads begin. */
    char *url;   /* as libcurl has normalised it */
    char *shown; /* for sentences: without what may be secret in it */
    strl_http_desc desc;
    char *certificates; /* NULL = libcurl's */
    bool secure;        /* https */
    strl_thread *network, *disk;
    CURLM *multi;       /* the network thread's, once it runs */
    strl__cache *cache; /* the disk thread's; NULL = none */
    /* The network thread's own. */
    /* desc.connections for reads, and one that looks */
    strl__http_transfer transfers[STRL__HTTP_MOST_CONNECTIONS + 1];
    uint64_t heard_ns;          /* when bytes that a read wants came last */
    uint64_t answered_ns;       /* when the latest of the requests that were answered was begun */
    uint64_t renewed_ns;        /* connections that are older are not used again; 0 = there are none such */
    char *target;               /* where the address leads to; NULL = not known */
    struct curl_slist *headers; /* of every request */
    bool headers_conditional;   /* they name what was opened */
    /* Under the mutex. */
    strl_mutex mutex;
    strl_condition answered;            /* a waited read is done */
    strl_condition disk_work;           /* a new read, something to keep, or the end */
    bool disk_closing, network_closing; /* in this order: the disk thread wakes the network thread */
    bool opened;
    strl__http_read **reads; /* accepted and not done; owned */
    size_t read_count, read_capacity;
    uint64_t serials;
    strl__http_read *first_done, *last_done; /* for poll; owned */
    strl__http_identity identity;
    uint8_t model[16]; /* for the cache's keys */
    uint8_t head[STRL__HTTP_HEAD_BYTES];
    size_t head_bytes;
    strl__http_ahead ahead[STRL__HTTP_AHEAD]; /* the oldest is `ahead_next`: it goes first */
    unsigned ahead_next;
    uint64_t ahead_window;
    strl__http_kept *kept, **kept_end; /* to be written; owned */
    strl__http_kept *doubted;          /* to be dropped, before anything is looked up; owned */
    size_t kept_bytes;
    strl_error changed;     /* status not STRL_OK: the model is another one now, and this says so */
    uint32_t outages;       /* requests in a row that did not reach the server */
    uint32_t refusals;      /* answers in a row that it is asked too much */
    uint64_t not_before_ns; /* for all requests */
    strl__pace pace;
    strl_network_stats stats;
} strl__http;

/* ---- http_reads.c: with the mutex held */
/* A read that can be answered whatever happens; in `reads`, in state NEW or WAITING. */
strl_status strl__http_read_add(strl__http *http, const strl__http_read *like, strl__http_read **read, strl_error *err);
/* Hands the read over to poll or to who waits for it. status and error of its result are set. */
void strl__http_read_finish(strl__http *http, strl__http_read *read);
void strl__http_read_fail(strl__http *http, strl__http_read *read, const strl_error *error);
/* An attempt has failed: it waits for the next, or fails where there was none left. */
void strl__http_read_again(strl__http *http, strl__http_read *read, const strl_error *error, uint64_t now_ns);
void strl__http_read_fail_all(strl__http *http, const strl_error *error);
strl__http_read *strl__http_read_find(strl__http *http, uint64_t serial); /* NULL: done and gone */
/* The most urgent one in this state that may be taken at now_ns; NULL = none. */
strl__http_read *strl__http_read_most_urgent(strl__http *http, strl__http_state state, uint64_t now_ns);
/* Bytes of the reads that wait or are fetched. */
uint64_t strl__http_bytes_wanted(const strl__http *http);
/* "ADDRESS: reason" of a reason; written into error. */
void strl__http_name_error(const strl__http *http, strl_error *error);
uint64_t strl__http_random(strl__http *http);

/* ---- http_url.c */
/* Normalises and checks. *url and *shown are the caller's (strl__free). */
strl_status strl__http_url(const char *text, char **url, char **shown, bool *secure, strl_error *err);
/* Where a redirect from `url` led to, with the user and the password of `url` where that is the same server. The
 * caller's; NULL without memory. */
char *strl__http_url_target(const char *url, const char *led_to);

/* ---- http_disk.c */
void strl__http_disk_run(void *http); /* the disk thread */
/* Mutex held: a copy goes to the cache, unless there is none or too much is waiting already. */
void strl__http_keep(strl__http *http, uint64_t offset, const uint8_t *data, size_t size);
/* Mutex held: what the cache has of this read, or is about to have, is to go. */
void strl__http_forget(strl__http *http, uint64_t offset, size_t size);
void strl__http_disk_deinit(strl__http *http); /* once the thread has ended */

/* ---- http_network.c */
void strl__http_network_run(void *http); /* the network thread */

/* ---- http_transfer.c: the network thread */
/* For the transfer's range; false where libcurl does not take it. */
bool strl__http_transfer_start(strl__http_transfer *transfer);
/* libcurl has come to its end, or `code` stands for what ended it. Answers its reads or sends them back. */
void strl__http_transfer_end(strl__http_transfer *transfer, CURLcode code);
/* Mutex held. When it will have stalled, if nothing comes any more; when it may be overtaken, where that is sooner. */
uint64_t strl__http_transfer_deadline(const strl__http_transfer *transfer);
/* Looks whether it has stalled by now, or is overtaken; then the reason is in its error. */
bool strl__http_transfer_stalled(strl__http_transfer *transfer, uint64_t now_ns);

#endif
