/* Which kind of answer a request gets. */
#include "serve/answer.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "serve/text.h"

#define SENTENCE_TYPE "text/plain; charset=utf-8"

void strl__site_complain(strl__site *site, const char *sentence)
{
    if (site->complain)
        site->complain(site->context, sentence);
}

void strl__answer_text(strl__answer *answer, const char *type, strl_writer *out)
{
    strl__body *body = out->failed ? NULL : strl__body_create();
    answer->type = type;
    if (body) {
        /* it is held until it is sent */
        uint8_t *fitting = out->size > 0 ? strl__realloc(out->data, out->size, 1) : NULL;
        body->head = fitting ? fitting : out->data;
        body->head_bytes = out->size;
        answer->body = body;
    } else {
        strl__free(out->data);
        answer->status = 503;
        answer->type = NULL;
    }
    *out = (strl_writer){0};
}

void strl__answer_sentence(strl__answer *answer, unsigned status, const char *format, ...)
{
    char text[600];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text - 1, format, values);
    va_end(values);
    strl_writer out = {0};
    strl__put(&out, text);
    strl__put(&out, "\n");
    answer->status = status;
    strl__answer_text(answer, SENTENCE_TYPE, &out);
}

static bool is_known(const char *method)
{
    return strcmp(method, "GET") == 0 || strcmp(method, "HEAD") == 0 || strcmp(method, "OPTIONS") == 0;
}

bool strl__is_served_name(const char *name)
{
    static const char ending[] = ".stroll";
    size_t length = strlen(name), least = sizeof ending - 1;
    return name[0] != '.' && length > least && strcmp(name + length - least, ending) == 0;
}

bool strl__open_served(strl__site *site, const char *path, strl_file **file, strl_file_info *info, strl__answer *answer)
{
    strl_error err = {0};
    strl_found found = strl_folder_open_file(site->folder, path, file, &err);
    if (found == STRL_FOUND && strl_file_stat(*file, info, &err) != STRL_OK) {
        strl_file_close(*file, NULL);
        *file = NULL;
        found = STRL_FOUND_FAILED;
    }
    if (found == STRL_FOUND_NOTHING)
        strl__answer_sentence(answer, 404, "there is no such file");
    else if (found == STRL_FOUND_BARRED)
        strl__answer_sentence(answer, 403, "the file may not be read");
    else if (found == STRL_FOUND_FAILED)
        strl__answer_sentence(answer, 503, "the file cannot be opened now");
    if (found == STRL_FOUND_FAILED) {
        strl__site_complain(site, err.message);
        answer->retry_s = 1;
    }
    return found == STRL_FOUND;
}

static void answer_metrics(strl__site *site, strl__answer *answer)
{
    const strl__gauges gauges = {.open_connections = strl__connections_count(&site->connections),
                                 .open_containers = strl__models_open_count(&site->models)};
    strl_writer out = {0};
    answer->status = 200;
    strl__metrics_write(&site->metrics, &gauges, &out);
    strl__answer_text(answer, "text/plain; version=0.0.4; charset=utf-8", &out);
}

/* "/sub" where there is a folder "sub": links in its page need the slash. */
static bool redirect_to_folder(strl__site *site, const char *path, strl__answer *answer)
{
    strl_writer out = {0};
    if (!strl_folder_has_folder(site->folder, path))
        return false;
    strl__put(&out, "/");
    strl__put_url(&out, path);
    strl__put(&out, "/");
    bool fits = !out.failed && out.size < sizeof answer->location;
    if (fits)
        memcpy(answer->location, out.data, out.size);
    strl__free(out.data);
    if (fits)
        strl__answer_sentence(answer, 301, "the folder's listing is at its name with a slash");
    return fits;
}

static void answer_path(strl__site *site, strl__request *request, const strl__target *target, strl__query *query,
                        strl__answer *answer)
{
    const char *slash = strrchr(target->path, '/'), *name = slash ? slash + 1 : target->path;
    strl__refusal refusal = strl__parse_query(target->query, query);
    if (refusal.status)
        strl__answer_sentence(answer, refusal.status, "%s", refusal.sentence);
    else if (target->is_hidden)
        strl__answer_sentence(answer, 404, "there is no such file");
    else if (target->is_folder && query->kind != STRL__QUERY_NONE)
        strl__answer_sentence(answer, 400, "a folder has no nodes");
    else if (target->is_folder)
        strl__answer_listing(site, target->path,
                             query->format == STRL__FORMAT_JSON ||
                                 (query->format == STRL__FORMAT_ANY && strl__prefers_json(request->accept)),
                             answer);
    else if (strcmp(target->path, "metrics") == 0)
        answer_metrics(site, answer);
    else if (!strl__is_served_name(name)) {
        if (!redirect_to_folder(site, target->path, answer))
            strl__answer_sentence(answer, 404,
                                  "there is no such file; only files whose names end in .stroll are served");
    } else if (query->format != STRL__FORMAT_ANY)
        strl__answer_sentence(answer, 400, "a file has no format, only a listing has");
    else if (query->kind != STRL__QUERY_NONE)
        strl__answer_query(site, query, target->path, &request->pending, answer);
    else
        strl__answer_file(site, request, target->path, answer);
}

static void answer_target(strl__site *site, strl__request *request, strl__answer *answer)
{
    strl__target *target = strl__alloc(1, sizeof *target);
    strl__query *query = strl__alloc(1, sizeof *query);
    if (!target || !query) {
        strl__answer_sentence(answer, 503, "there is no memory for the request");
    } else {
        strl__refusal refusal = strl__parse_target(request->target, target);
        if (refusal.status)
            strl__answer_sentence(answer, refusal.status, "%s", refusal.sentence);
        else if (target->is_server)
            strl__answer_sentence(answer, 400, "only OPTIONS asks for the server itself");
        else
            answer_path(site, request, target, query, answer);
    }
    strl__free(query);
    strl__free(target);
}

void strl__answer_request(strl__site *site, strl__request *request, strl__answer *answer)
{
    *answer = (strl__answer){0};
    if (request->refusal.status) {
        strl__answer_sentence(answer, request->refusal.status, "%s", request->refusal.sentence);
        answer->close = true;
    } else if (!is_known(request->method)) {
        strl__answer_sentence(answer, 405, "the methods are GET, HEAD and OPTIONS");
    } else if (request->has_body) {
        strl__answer_sentence(answer, 400, "no request here has a body");
    } else if (strcmp(request->method, "OPTIONS") == 0) {
        answer->status = 204;
    } else {
        answer_target(site, request, answer);
    }
}
