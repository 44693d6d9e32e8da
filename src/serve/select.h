/* Which pieces of a container a query's nodes need: docs/serve.md, "Queries". Internal. */
#ifndef STRL_SERVE_SELECT_H
#define STRL_SERVE_SELECT_H

#include "serve/body.h"
#include "serve/parse.h"
#include "container/container.h"

#define STRL__SELECTED_NODES 65536u /* of one answer */
#define STRL__VISITED_NODES 262144u /* subtrees that overlap are gone through each */
#define STRL__ANSWER_HEAD_BYTES 64u

typedef struct strl__selection {
    strl__piece *pieces; /* owned (strl__free); by offset, each once */
    size_t count, capacity;
    uint64_t bytes;      /* of the pieces and their frames */
    uint32_t node_count; /* nodes that are answered */
    uint32_t visited;    /* that were looked at */
    bool cut;
    uint32_t next_node; /* where cut: what was asked for and is lower is answered, and nothing else; else STRL_NONE */
} strl__selection;

/* A selection in the making, which may pause between any two nodes. */
typedef struct strl__selecting strl__selecting;

/* most_bytes: of the answer; the first node is always answered. STRL_ERR_ARGUMENT: the query asks for what there is
 * not. */
strl_status strl__selecting_create(const strl_container *container, const strl__query *query, uint64_t most_bytes,
                                   strl__selecting **selecting, strl_error *err);
void strl__selecting_destroy(strl__selecting *selecting); /* NULL is legal */
/* Looks at that many nodes more at most. The container is the one of the beginning, or the same opened anew.
 * STRL_ERR_LIMIT: what it reads from gives no more now; nothing is lost, and it may go on later. */
strl_status strl__selecting_step(strl__selecting *selecting, strl_container *container, uint32_t most_visits,
                                 bool *is_done, strl_error *err);
/* The answer ends here. False where it has no node yet: that would be no answer. */
bool strl__selecting_cut(strl__selecting *selecting);
uint32_t strl__selecting_visited(const strl__selecting *selecting); /* nodes so far */
/* Once it is done or cut; the selection is the caller's. */
void strl__selecting_take(strl__selecting *selecting, strl__selection *selection);

void strl__selection_deinit(strl__selection *selection);
/* The head of the answer. */
void strl__selection_head(const strl__selection *selection, const strl_container_info *info, uint32_t tree,
                          uint8_t head[STRL__ANSWER_HEAD_BYTES]);

#endif
