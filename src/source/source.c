/* The part all sources share: every range is checked here, once, so that a class never sees one outside the object. */
#include "source/source.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define MOST_ATTEMPTS 8u /* at bytes that come wrong: where every other answer is, one read in 256 fails */

static strl_status check_range(const strl_source *source, uint64_t offset, size_t size, strl_error *err)
{
    if (offset <= source->bytes && size <= source->bytes - offset)
        return STRL_OK;
    return strl__fail(err, STRL_ERR_FORMAT,
                      "%zu bytes at byte %" PRIu64 " lie past the end of the %s source (%" PRIu64 " bytes)", size,
                      offset, source->klass->kind, source->bytes);
}

strl_status strl_source_submit(strl_source *source, uint64_t token, uint64_t offset, size_t size, float urgency,
                               strl_error *err)
{
    strl_status status = check_range(source, offset, size, err);
    return status == STRL_OK ? source->klass->submit(source, token, offset, size, urgency, err) : status;
}

bool strl_source_poll(strl_source *source, strl_source_result *result)
{
    *result = (strl_source_result){0};
    return source->klass->poll(source, result);
}

void strl_source_cancel(strl_source *source, uint64_t token)
{
    source->klass->cancel(source, token);
}

strl_status strl_source_read(strl_source *source, uint64_t offset, void *data, size_t size, strl_error *err)
{
    strl_status status = check_range(source, offset, size, err);
    return status == STRL_OK ? source->klass->read(source, offset, data, size, err) : status;
}

bool strl_source_may_differ(const strl_source *source)
{
    return source->klass->doubt != NULL;
}

bool strl_source_ask_again(strl_source *source, unsigned *attempt, uint64_t offset, size_t size)
{
    if (!strl_source_may_differ(source) || ++*attempt > MOST_ATTEMPTS)
        return false;
    strl_source_doubt(source, offset, size);
    return true;
}

static bool is_wrong(const strl_source_span *span)
{
    return strl__checksum(span->data, span->size) != span->checksum;
}

strl_status strl_source_read_known(strl_source *source, const strl_source_span *span, strl_error *err)
{
    strl_status status;
    unsigned attempt = 1;
    do {
        status = strl_source_read(source, span->offset, span->data, span->size, err);
    } while (status == STRL_OK && strl_source_may_differ(source) && is_wrong(span) &&
             strl_source_ask_again(source, &attempt, span->offset, span->size));
    return status;
}

/* Those that came wrong, together again. */
static strl_status mend(strl_source *source, const strl_source_span *spans, size_t count, strl_error *err)
{
    strl_source_span *wrong = strl__alloc(count, sizeof *wrong);
    if (!wrong)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for %zu reads", count);
    strl_status status = STRL_OK;
    for (unsigned attempt = 1; status == STRL_OK; attempt++) {
        size_t wrong_count = 0;
        for (size_t i = 0; i < count; i++) {
            unsigned own = attempt;
            if (is_wrong(&spans[i]) && strl_source_ask_again(source, &own, spans[i].offset, spans[i].size))
                wrong[wrong_count++] = spans[i];
        }
        if (wrong_count == 0)
            break;
        status = source->klass->read_many(source, wrong, wrong_count, err);
    }
    strl__free(wrong);
    return status;
}

strl_status strl_source_read_many(strl_source *source, const strl_source_span *spans, size_t count, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; status == STRL_OK && i < count; i++)
        status = check_range(source, spans[i].offset, spans[i].size, err);
    if (status == STRL_OK && count > 0 && source->klass->read_many) {
        status = source->klass->read_many(source, spans, count, err);
        return status == STRL_OK ? mend(source, spans, count, err) : status;
    }
    for (size_t i = 0; status == STRL_OK && i < count; i++)
        status = strl_source_read_known(source, &spans[i], err);
    return status;
}

uint64_t strl_source_room(strl_source *source)
{
    return source->klass->room ? source->klass->room(source) : UINT64_MAX;
}

void strl_source_doubt(strl_source *source, uint64_t offset, size_t size)
{
    if (source->klass->doubt)
        source->klass->doubt(source, offset, size);
}

bool strl_source_get_network_stats(const strl_source *source, strl_network_stats *stats)
{
    *stats = (strl_network_stats){0};
    return source->klass->get_network_stats && source->klass->get_network_stats(source, stats);
}

strl_status strl_source_fail(const strl_source *source, strl_status status, strl_error *err)
{
    if (status == STRL_OK || !err || !source->name || strstr(err->message, source->name))
        return status;
    return strl__fail_context(err, status, "%.300s", source->name);
}

void strl_source_close(strl_source *source)
{
    if (source)
        source->klass->close(source);
}
