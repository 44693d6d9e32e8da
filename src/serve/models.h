/* What the server knows of the containers in its folder: facts of many, and a few that are open for queries. Both are
 * recognised by what the system says of the open file, so that a file that was replaced is another. Thread-safe.
 * Internal. */
#ifndef STRL_SERVE_MODELS_H
#define STRL_SERVE_MODELS_H

#include "container/container.h"
#include "platform/file.h"
#include "platform/thread.h"

#define STRL__KNOWN_FACTS 4096u /* twice those of the longest listing */
#define STRL__OPEN_MODELS 16u
#define STRL__MODEL_BYTES ((uint64_t)64 << 20)       /* of memory that one may take */
#define STRL__ALL_MODELS_BYTES ((uint64_t)128 << 20) /* of memory that those kept may take together */
#define STRL__LOOKUP_BYTES ((uint64_t)32 << 20)      /* of node records that one query may read */
#define STRL__SETTLED_NS ((uint64_t)2000000000)      /* a younger change may be followed by one of the same date */

typedef struct strl__model_facts {
    bool is_container;
    uint8_t model_id[16];
    uint64_t triangles; /* of the finest level */
    uint32_t trees;
    char unit[16];
} strl__model_facts;

typedef struct strl__known_facts {
    strl_file_info file;
    strl__model_facts facts;
    uint64_t last_use; /* 0 = empty */
} strl__known_facts;

/* A container that is open for queries; of one query at a time, under its mutex. */
typedef struct strl__model {
    strl_mutex mutex;
    strl_file_info info;
    strl_file *file;           /* owned */
    strl_container *container; /* owned; NULL until the first query has opened it */
    uint64_t left_bytes;       /* that the query at work may still read */
    /* of the cache, under its mutex */
    uint64_t bytes, last_use, last_ns;
    uint32_t users;
} strl__model;

typedef struct strl__models {
    strl_mutex mutex;
    uint64_t uses;
    strl__known_facts known[STRL__KNOWN_FACTS];
    strl__model *open[STRL__OPEN_MODELS]; /* owned; NULL = free */
} strl__models;

void strl__models_init(strl__models *models);
void strl__models_deinit(strl__models *models); /* nothing is borrowed */

/* Reads the header where the file is not known. What cannot be read is no container. */
void strl__models_facts(strl__models *models, strl_file *file, const strl_file_info *info, strl__model_facts *facts);
/* The tag of a file: a container's is its model id, so that it is the same on every server. */
void strl__model_etag(const strl__model_facts *facts, const strl_file_info *info, char *etag, size_t size);

/* For one query: locked and opened, for which *read_bytes (NULL: not wanted) were read, also where it fails.
 * STRL_ERR_FORMAT or _UNSUPPORTED: it is no container, or one too large to look nodes up in; STRL_ERR_LIMIT: one place
 * too few; STRL_ERR_CANCELLED: another query is at work in it, nothing is waited for. */
strl_status strl__models_borrow(strl__models *models, const strl_file *file, const strl_file_info *info,
                                strl__model **model, uint64_t *read_bytes, strl_error *err);
void strl__models_return(strl__models *models, strl__model *model); /* NULL is legal */
uint32_t strl__models_open_count(strl__models *models);
/* Closes what has not been used for so long: a file that was replaced meanwhile would keep its place on the disk. */
void strl__models_forget(strl__models *models, uint64_t idle_ns);

#endif
