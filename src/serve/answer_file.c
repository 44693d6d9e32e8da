/* A file, or a part of it. All that is said of it comes from the one descriptor from which its bytes come. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "serve/answer.h"

/* The file is the body's from then on; false without memory. */
static bool give_part(strl__answer *answer, strl_file *file, const strl_file_info *info, uint64_t first, uint64_t bytes)
{
    strl__body *body = strl__body_create();
    if (body)
        body->pieces = strl__alloc(1, sizeof *body->pieces);
    if (!body || !body->pieces) {
        strl__body_destroy(body);
        return false;
    }
    body->pieces[0] = (strl__piece){first, bytes};
    body->piece_count = bytes > 0;
    body->file = file;
    body->info = *info;
    answer->body = body;
    answer->type = "application/octet-stream";
    return true;
}

static void describe(strl__site *site, strl_file *file, const strl_file_info *info, strl__validators *validators,
                     strl__answer *answer)
{
    strl__model_facts facts;
    strl__models_facts(&site->models, file, info, &facts);
    strl__model_etag(&facts, info, answer->etag, sizeof answer->etag);
    int64_t modified_s = (int64_t)(info->modified_ns / 1000000000u);
    uint64_t now_ns = strl_clock_wall_ns();
    strl__format_date(modified_s, answer->modified);
    *validators = (strl__validators){
        .etag = answer->etag,
        .modified_s = modified_s,
        .date_is_strong = info->modified_ns < now_ns && now_ns - info->modified_ns > STRL__SETTLED_NS,
        .bytes = info->bytes,
    };
}

static void refuse_range(strl__answer *answer, uint64_t file_bytes)
{
    snprintf(answer->range, sizeof answer->range, "bytes */%" PRIu64, file_bytes);
    strl__answer_sentence(answer, 416, "the file has %" PRIu64 " bytes", file_bytes);
}

void strl__answer_file(strl__site *site, const strl__request *request, const char *path, strl__answer *answer)
{
    strl_file *file;
    strl_file_info info;
    if (!strl__open_served(site, path, &file, &info, answer))
        return;
    strl__validators validators;
    strl__range range;
    describe(site, file, &info, &validators, answer);
    answer->takes_ranges = true;
    answer->status = strl__decide(&request->conditions, &validators, strcmp(request->method, "GET") == 0, &range);
    bool given = false;
    if (answer->status == 416) {
        refuse_range(answer, info.bytes);
    } else if (answer->status == 412) {
        strl__answer_sentence(answer, 412, "the file is not the one that was meant");
    } else {
        uint64_t first = answer->status == 206 ? range.first : 0,
                 bytes = answer->status == 206 ? range.bytes : info.bytes;
        if (answer->status == 206)
            snprintf(answer->range, sizeof answer->range, "bytes %" PRIu64 "-%" PRIu64 "/%" PRIu64, first,
                     first + bytes - 1, info.bytes);
        given = give_part(answer, file, &info, first, bytes);
        if (!given)
            strl__answer_sentence(answer, 503, "there is no memory for the answer");
    }
    if (!given)
        strl_file_close(file, NULL);
}
