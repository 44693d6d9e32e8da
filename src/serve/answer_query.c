/* Node-array and subtree queries: docs/serve.md, "Queries". */
#include <string.h>

#include "base/memory.h"
#include "serve/answer.h"
#include "serve/select.h"

#define NODES_A_REQUEST 1024.0  /* looked at, cost as much as a plain request */
#define BYTES_A_REQUEST 131072.0 /* of node records read */

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
        strl__answer_sentence(answer, 503, "%s", status == STRL_ERR_LIMIT ? err->message : "the file cannot be read now");
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

static void answer_now(strl__site *site, const strl__query *query, const char *path, strl__answer *answer)
{
    strl_file *file;
    strl_file_info info;
    if (!strl__open_served(site, path, &file, &info, answer))
        return;
    strl_error err = {0};
    strl__model *model = NULL;
    strl__selection selection = {0};
    uint8_t head[STRL__ANSWER_HEAD_BYTES];
    uint64_t most = query->most_bytes && query->most_bytes < site->answer_bytes ? query->most_bytes : site->answer_bytes;
    strl_status status = strl__models_borrow(&site->models, file, &info, &model, &err);
    if (status == STRL_OK)
        status = strl__select(model->container, query, most, &selection, &err);
    if (status == STRL_OK)
        strl__selection_head(&selection, strl_container_get_info(model->container), query->tree, head);
    if (model)
        answer->work = selection.visited / NODES_A_REQUEST + (double)(STRL__LOOKUP_BYTES - model->left_bytes) / BYTES_A_REQUEST;
    strl__models_return(&site->models, model);
    if (status == STRL_OK) {
        give(site, file, &info, &selection, head, answer);
    } else {
        strl_file_close(file, NULL);
        refuse(site, answer, status, &err);
    }
}

/* A query may take the thread that it runs on for a while, and all that this thread serves waits. */
void strl__answer_query(strl__site *site, const strl__query *query, const char *path, strl__answer *answer)
{
    if (atomic_fetch_add(&site->queries, 1) < site->most_queries)
        answer_now(site, query, path, answer);
    else
        answer->is_later = true;
    atomic_fetch_sub(&site->queries, 1);
}
