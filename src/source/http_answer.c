#include "source/http_answer.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"

static strl__http_verdict say(strl__http_verdict verdict, strl_error *err, const char *reason, unsigned status)
{
    strl__fail(err, STRL_ERR_NETWORK, "%s (%u)", reason, status);
    return verdict;
}

static strl__http_verdict changed(strl_error *err)
{
    strl__fail(err, STRL_ERR_NETWORK, "the model has changed since it was opened: open it again");
    return STRL__HTTP_CHANGED;
}

/* Statuses other than that of a range. */
static strl__http_verdict judge_status(const strl__http_asked *asked, const strl__http_fields *answer, strl_error *err)
{
    unsigned status = answer->status;
    strl__http_verdict gone = asked->redirected ? STRL__HTTP_MOVED : STRL__HTTP_REFUSED;
    if (status == 200)
        return say(STRL__HTTP_REFUSED, err,
                   "the server does not answer byte ranges here, it sends the whole file: is that a model, or a page?",
                   status);
    if (status == 404 || status == 410)
        return say(gone, err, "there is nothing at this address", status);
    if (status == 401 || status == 403 || status == 407)
        return say(gone, err, "the server refuses access", status);
    if (status == 412 && !asked->opening)
        return changed(err);
    if (status == 416 && !asked->opening)
        return changed(err); /* the range lies within what was opened */
    if (status == 416)
        return say(STRL__HTTP_REFUSED, err, "the file is empty, or the server does not answer byte ranges", status);
    if (status == 429)
        return say(STRL__HTTP_AGAIN, err, "the server is asked too often", status);
    if (status == 408 || status == 425 || status >= 500)
        return say(STRL__HTTP_AGAIN, err, "the server failed", status);
    return say(STRL__HTTP_REFUSED, err, "the server refuses the request", status);
}

static bool is_other_content(const strl__http_identity *opened, const strl__http_identity *found)
{
    if (opened->total != found->total)
        return true;
    if (opened->etag[0])
        return found->etag[0] && strcmp(opened->etag, found->etag) != 0;
    return opened->modified[0] && found->modified[0] && strcmp(opened->modified, found->modified) != 0;
}

static strl__http_verdict judge_range(const strl__http_asked *asked, const strl__http_fields *answer, strl_error *err)
{
    if (!answer->range_known) {
        strl__fail(err, STRL_ERR_NETWORK, "the answer does not say which range of how many bytes it is");
        return asked->opening ? STRL__HTTP_REFUSED : STRL__HTTP_AGAIN;
    }
    if (!asked->opening && is_other_content(&asked->identity, &answer->identity))
        return changed(err);
    uint64_t end = answer->identity.total - 1, last = asked->opening && end < asked->last ? end : asked->last;
    if (answer->first == asked->first && answer->last == last)
        return STRL__HTTP_GOOD;
    strl__fail(err, STRL_ERR_NETWORK,
               "the answer is bytes %" PRIu64 " to %" PRIu64 ", expected %" PRIu64 " to %" PRIu64, answer->first,
               answer->last, asked->first, last);
    return STRL__HTTP_AGAIN;
}

strl__http_verdict strl__http_judge(const strl__http_asked *asked, const strl__http_fields *answer, strl_error *err)
{
    if (answer->status == 0) {
        strl__fail(err, STRL_ERR_NETWORK, "the server does not speak HTTP");
        return STRL__HTTP_AGAIN;
    }
    if (answer->status != 206)
        return judge_status(asked, answer, err);
    if (answer->encoding[0]) {
        strl__fail(err, STRL_ERR_NETWORK, "the server sends the range encoded as %s, expected as it is",
                   answer->encoding);
        return STRL__HTTP_REFUSED;
    }
    return judge_range(asked, answer, err);
}
