/* From a request to its answer, without the library that carries them. Internal. */
#ifndef STRL_SERVE_ANSWER_H
#define STRL_SERVE_ANSWER_H

#include "platform/folder.h"
#include "serve/body.h"
#include "serve/limits.h"
#include "serve/metrics.h"
#include "serve/models.h"
#include "serve/parse.h"
#include "serve/connections.h"

/* a query that has had a turn and needs more; it has a place of most_queries */
typedef struct strl__pending strl__pending;
void strl__pending_destroy(strl__pending *pending); /* NULL is legal */

typedef struct strl__request {
    const char *method;
    char *target; /* as it came; is written to */
    strl__conditions conditions;
    const char *accept;    /* NULL = not there */
    strl__refusal refusal; /* what is wrong with its head */
    bool has_body;
    strl__pending *pending; /* owned; NULL = none */
} strl__request;

typedef struct strl__answer {
    unsigned status;
    const char *type; /* static; NULL = no body */
    strl__body *body; /* owned; NULL = none */
    bool takes_ranges;
    bool close; /* the connection, afterwards */
    bool is_page;
    unsigned retry_s; /* 0 = not said */
    bool is_later;    /* there is none yet: ask again when others have ended, */
    bool goes_on;     /* or have had their turn */
    double work;      /* what it, or this turn, cost beyond a plain request, in requests */
    char etag[STRL__ETAG_BYTES], modified[STRL__DATE_BYTES], range[72]; /* "" = not said */
    char location[3 * STRL__PATH_BYTES + 8];
} strl__answer;

/* What answers need of the server. */
typedef struct strl__site {
    strl_folder *folder;
    strl__models models;
    strl__metrics metrics;
    strl__connections connections;
    uint64_t answer_bytes;
    uint64_t held_most; /* bytes of memory of all answers that are under way */
    _Atomic uint64_t held_bytes;
    uint32_t most_queries; /* at work at once, those between two turns included */
    _Atomic uint32_t queries;
    void (*complain)(void *context, const char *sentence); /* NULL = nobody wants to know */
    void *context;
} strl__site;

/* The system's reasons are not for strangers, but for the owner. */
void strl__site_complain(strl__site *site, const char *sentence);
/* Gives an answer, or is_later; the caller destroys its body. */
void strl__answer_request(strl__site *site, strl__request *request, strl__answer *answer);
/* A status with a sentence as its body. */
void strl__answer_sentence(strl__answer *answer, unsigned status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* Takes the text over; without memory (out failed) the answer is 503. */
void strl__answer_text(strl__answer *answer, const char *type, strl_writer *out);

/* ---- the kinds of answers, one a file ---- */
void strl__answer_file(strl__site *site, const strl__request *request, const char *path, strl__answer *answer);
void strl__answer_query(strl__site *site, const strl__query *query, const char *path, strl__pending **pending,
                        strl__answer *answer);
void strl__answer_listing(strl__site *site, const char *path, bool json, strl__answer *answer);
/* A regular file of the folder, with what the open file is. False: the answer says why there is none. The caller
 * closes. */
bool strl__open_served(strl__site *site, const char *path, strl_file **file, strl_file_info *info,
                       strl__answer *answer);
bool strl__is_served_name(const char *name);

#endif
