/* Node-array and subtree queries: docs/serve.md, "Queries". */
#include <string.h>

#include "base/memory.h"
#include "serve/answer.h"
#include "serve/select.h"

#define NODES_A_REQUEST 1024.0   /* looked at, cost as much as a plain request */
#define BYTES_A_REQUEST 131072.0 /* of node records read */
/* Of one turn, after which the thread looks after its other connections. */
#define TURN_NODES 1024u
#define TURN_BYTES ((uint64_t)1 << 20)

struct strl__pending {
    strl__site *site; /* borrowed */
    strl_file *file;  /* owned: the one of the beginning, whatever lies under its name by now */
    strl_file_info info;
    strl__selecting *selecting; /* owned; NULL until the container is open */
    uint64_t read_bytes;        /* of node records */
};

static void refuse(strl__site *site, strl__answer *answer, strl_status status, const strl_error *err)
{
    switch (status) {
    case STRL_ERR_CANCELLED:
        answer->is_later = true;
        break;
    case STRL_ERR_ARGUMENT:
        strl__answer_sentence(answer, 400, "%s", err->message);
        break;
    case STRL_ERR_FORMAT:
    case STRL_ERR_UNSUPPORTED:
        strl__answer_sentence(answer, 422, "the file cannot be asked for nodes: %s", err->message);
        break;
    default:
        if (status != STRL_ERR_LIMIT)
            strl__site_complain(site, err->message);
        /* What has been looked up so far is kept, so asking again goes on from there. */
        strl__answer_sentence(answer, 503, "%s",
                              status == STRL_ERR_LIMIT ? err->message : "the file cannot be read now");
        answer->retry_s = 1;
    }
}

/* Takes file and selection over in any case. */
static void give(strl__site *site, strl_file *file, const strl_file_info *info, strl__selection *selection,
                 const uint8_t head[STRL__ANSWER_HEAD_BYTES], strl__answer *answer)
{
    strl__body *body = strl__body_create();
    if (body)
        body->head = strl__alloc(STRL__ANSWER_HEAD_BYTES, 1);
    if (!body || !body->head) {
        strl__body_destroy(body);
        strl_file_close(file, NULL);
        strl__selection_deinit(selection);
        strl__answer_sentence(answer, 503, "there is no memory for the answer");
        return;
    }
    memcpy(body->head, head, STRL__ANSWER_HEAD_BYTES);
    body->head_bytes = STRL__ANSWER_HEAD_BYTES;
    body->file = file;
    body->info = *info;
    body->framed = true;
    body->pieces = selection->pieces;
    body->piece_count = selection->count;
    atomic_fetch_add(&site->metrics.query_nodes, selection->node_count);
    atomic_fetch_add(&site->metrics.queries_cut, selection->cut);
    answer->status = 200;
    answer->type = "application/octet-stream";
    answer->body = body;
}

/* ---- turns ---- */

void strl__pending_destroy(strl__pending *pending)
{
    if (!pending)
        return;
    atomic_fetch_sub(&pending->site->queries, 1);
    strl_file_close(pending->file, NULL);
    strl__selecting_destroy(pending->selecting);
    strl__free(pending);
}

/* NULL where too many are at work, or the answer says why not. Each has memory, and takes turns of a thread. */
static strl__pending *begin(strl__site *site, const char *path, strl__answer *answer)
{
    if (atomic_fetch_add(&site->queries, 1) >= site->most_queries) {
        atomic_fetch_sub(&site->queries, 1);
        answer->is_later = true;
        return NULL;
    }
    strl__pending *made = strl__alloc_zero(1, sizeof *made);
    if (!made) {
        atomic_fetch_sub(&site->queries, 1);
        strl__answer_sentence(answer, 503, "there is no memory for the answer");
        return NULL;
    }
    made->site = site;
    if (!strl__open_served(site, path, &made->file, &made->info, answer)) {
        strl__pending_destroy(made);
        return NULL;
    }
    return made;
}

/* A turn. *is_done false, and no failure: there is more to do. */
static strl_status work(strl__pending *self, strl__model *model, const strl__query *query, bool *is_done,
                        strl_error *err)
{
    strl__site *site = self->site;
    uint64_t left = STRL__LOOKUP_BYTES > self->read_bytes ? STRL__LOOKUP_BYTES - self->read_bytes : 0;
    uint64_t granted = left < TURN_BYTES ? left : TURN_BYTES;
    uint64_t most =
        query->most_bytes && query->most_bytes < site->answer_bytes ? query->most_bytes : site->answer_bytes;
    strl_status status = STRL_OK;
    *is_done = false;
    if (!self->selecting)
        status = strl__selecting_create(model->container, query, most, &self->selecting, err);
    if (status != STRL_OK)
        return status;
    model->left_bytes = granted;
    uint32_t before = strl__selecting_visited(self->selecting);
    status = strl__selecting_step(self->selecting, model->container, TURN_NODES, is_done, err);
    uint64_t used = granted - model->left_bytes;
    self->read_bytes += used;
    if (status != STRL_ERR_LIMIT)
        return status;
    bool moved = used > 0 || strl__selecting_visited(self->selecting) > before;
    if (granted == TURN_BYTES && left > granted && moved)
        return STRL_OK; /* that was the turn's limit */
    *is_done = strl__selecting_cut(self->selecting);
    return *is_done ? STRL_OK : status;
}

/* So far, in requests. */
static double cost_of(const strl__pending *self)
{
    double visited = self->selecting ? strl__selecting_visited(self->selecting) : 0;
    return visited / NODES_A_REQUEST + (double)self->read_bytes / BYTES_A_REQUEST;
}

/* Takes the file and the selection out of pending. */
static void finish(strl__pending *self, const strl_container_info *info, uint32_t tree, strl__answer *answer)
{
    strl__selection selection;
    uint8_t head[STRL__ANSWER_HEAD_BYTES];
    strl__selecting_take(self->selecting, &selection);
    strl__selection_head(&selection, info, tree, head);
    give(self->site, self->file, &self->info, &selection, head, answer);
    self->file = NULL;
}

/* True where the query has its answer; else it is to be asked again. */
static bool take_turn(strl__pending *self, const strl__query *query, strl__answer *answer)
{
    strl_error err = {0};
    strl__model *model = NULL;
    bool is_done = false;
    strl_container_info info;
    double before = cost_of(self);
    uint64_t opening; /* of this turn's borrowing */
    strl_status status = strl__models_borrow(&self->site->models, self->file, &self->info, &model, &opening, &err);
    self->read_bytes += opening;
    if (status == STRL_OK)
        status = work(self, model, query, &is_done, &err);
    if (model)
        info = *strl_container_get_info(model->container);
    strl__models_return(&self->site->models, model);
    atomic_fetch_add(&self->site->metrics.query_turns, status != STRL_ERR_CANCELLED);
    answer->work = cost_of(self) - before;
    if (status == STRL_OK && !is_done) {
        answer->is_later = answer->goes_on = true;
        return false;
    }
    if (status == STRL_OK)
        finish(self, &info, query->tree, answer);
    else
        refuse(self->site, answer, status, &err);
    return status != STRL_ERR_CANCELLED || !self->selecting; /* who has not begun keeps no place */
}

/* A query takes the thread that it runs on, and all that this thread serves waits: so it takes turns. */
void strl__answer_query(strl__site *site, const strl__query *query, const char *path, strl__pending **pending,
                        strl__answer *answer)
{
    if (!*pending)
        *pending = begin(site, path, answer);
    if (*pending && take_turn(*pending, query, answer)) {
        strl__pending_destroy(*pending);
        *pending = NULL;
    }
}
