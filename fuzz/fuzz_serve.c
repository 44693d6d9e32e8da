/* What the server takes apart of a stranger's request. The first byte says as what the rest is taken; whatever it is,
 * what comes out keeps its promises: no path leads out, no part is outside of its file, nothing leaves its quotes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "container/names.h"
#include "serve/parse.h"
#include "serve/text.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void must(int good, const char *promise)
{
    if (!good) {
        fprintf(stderr, "broken promise: %s\n", promise);
        abort();
    }
}

static void check_path(const strl__target *target)
{
    const char *path = target->path;
    size_t length = strlen(path);
    must(length <= STRL__PATH_BYTES, "a path has at most 1024 bytes");
    must(strl__utf8_is_name((const uint8_t *)path, length), "a path is UTF-8");
    must(length > 0 || target->is_folder, "the root is a folder");
    for (const char *c = path; *c; c++)
        must((unsigned char)*c >= 0x20 && *c != 0x7f && *c != '\\', "a path has no control character and no backslash");
    for (const char *name = path; length > 0 && name;) {
        size_t bytes = strcspn(name, "/");
        must(bytes > 0 && bytes <= STRL__COMPONENT_BYTES, "a name in a path has 1 to 255 bytes");
        must(!(name[0] == '.' && (bytes == 1 || (bytes == 2 && name[1] == '.'))), "a path does not go up");
        must(name[0] != '.' || target->is_hidden, "a hidden name is told");
        name = name[bytes] ? name + bytes + 1 : NULL;
    }
}

static void check_query(char *text)
{
    static strl__query query;
    strl__refusal refusal = strl__parse_query(text, &query);
    must(refusal.status == 0 || (refusal.status == 400 && refusal.sentence),
         "a query is taken or refused with a sentence");
    must(query.count <= STRL__QUERY_ITEMS, "a query has at most 4096 items");
    if (refusal.status)
        return;
    must((query.kind == STRL__QUERY_NONE) == (query.count == 0), "a query for nodes has some");
    for (uint32_t i = 1; i < query.count; i++)
        must(query.items[i - 1].node < query.items[i].node, "nodes increase");
}

static void try_target(char *text)
{
    strl__target target;
    strl__refusal refusal = strl__parse_target(text, &target);
    must(refusal.status == 0 || ((refusal.status == 400 || refusal.status == 414) && refusal.sentence),
         "a target is taken or refused with a sentence");
    if (refusal.status || target.is_server)
        return;
    check_path(&target);
    if (target.query)
        check_query(target.query);
}

static void try_range(char *text)
{
    static const uint64_t sizes[] = {0, 1, 100, UINT64_C(1) << 40, UINT64_MAX};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        strl__range range = strl__parse_range(text, sizes[i]);
        if (range.kind == STRL__RANGE_PART)
            must(range.bytes > 0 && range.first < sizes[i] && range.bytes <= sizes[i] - range.first,
                 "a part is in its file");
    }
}

static void try_date(char *text)
{
    int64_t time, again;
    char formed[STRL__DATE_BYTES];
    if (!strl__parse_date(text, &time))
        return;
    strl__format_date(time, formed);
    must(strl__parse_date(formed, &again) && again == time, "a date goes there and back");
}

/* Lines: If-Match, If-None-Match, If-Unmodified-Since, If-Modified-Since, Range, If-Range; empty = not there. */
static void try_conditions(char *text)
{
    const char *lines[6] = {NULL};
    for (int i = 0; i < 6 && text; i++) {
        char *end = strchr(text, '\n');
        if (end)
            *end++ = 0;
        lines[i] = *text ? text : NULL;
        text = end;
    }
    const strl__conditions conditions = {.match = {lines[0]},
                                         .none_match = {lines[1]},
                                         .unmodified_since = lines[2],
                                         .modified_since = lines[3],
                                         .range = lines[4],
                                         .if_range = lines[5]};
    const strl__validators file = {.etag = "\"m-0\"", .modified_s = 784111777, .date_is_strong = true, .bytes = 1000};
    strl__range range;
    unsigned status = strl__decide(&conditions, &file, true, &range);
    must(status == 200 || status == 206 || status == 304 || status == 412 || status == 416,
         "the status is one of five");
    must((status == 206) == (range.kind == STRL__RANGE_PART), "206 has a part");
    must(status != 206 || range.bytes <= file.bytes - range.first, "a part is in its file");
    must(strl__decide(&conditions, &file, false, &range) != 206, "no method but GET has parts");
    if (lines[0])
        must(!strl__etag_is_listed(lines[0], file.etag, false) || strl__etag_is_listed(lines[0], file.etag, true),
             "what matches as a strong tag matches as a weak one");
}

static void try_text(char *text)
{
    strl_writer html = {0}, log = {0}, url = {0}, json = {0};
    char line[64];
    strl__put_html(&html, text);
    strl__put_log(&log, text);
    strl__put_url(&url, text);
    strl__put_json(&json, text);
    strl__log_text(text, line, sizeof line);
    for (size_t i = 0; i < html.size; i++)
        must(html.data[i] != '<' && html.data[i] != '>' && html.data[i] != '"' && html.data[i] != '\'',
             "HTML has no tag");
    for (size_t i = 0; i < log.size; i++)
        must(log.data[i] > 0x20 && log.data[i] < 0x7f && log.data[i] != '"', "a log is printable");
    for (size_t i = 0; i < url.size; i++)
        must(!strchr("<>\"'?#&: ", url.data[i]), "a link is a path");
    for (size_t i = 0; i < json.size; i++)
        must(json.data[i] >= 0x20, "JSON has no control character");
    must(strlen(line) < sizeof line, "a line fits");
    strl__free(html.data);
    strl__free(log.data);
    strl__free(url.data);
    strl__free(json.data);
    strl__prefers_json(text);
    strl__is_token(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static void (*const tries[])(char *) = {try_target, check_query, try_range, try_date, try_conditions, try_text};
    if (size == 0)
        return 0;
    char *text = malloc(size); /* exactly as long as it is, for sanitizers to watch */
    if (!text)
        return 0;
    memcpy(text, data + 1, size - 1);
    text[size - 1] = 0;
    tries[data[0] % (sizeof tries / sizeof *tries)](text);
    free(text);
    return 0;
}
