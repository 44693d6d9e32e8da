/* The part all sources share: every range is checked here, once, so that a class never sees one outside the object. */
#include "source/source.h"

#include <inttypes.h>
#include <string.h>

#include "base/fail.h"

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

strl_status strl_source_read_many(strl_source *source, const strl_source_span *spans, size_t count, strl_error *err)
{
    strl_status status = STRL_OK;
    for (size_t i = 0; status == STRL_OK && i < count; i++)
        status = check_range(source, spans[i].offset, spans[i].size, err);
    if (status == STRL_OK && source->klass->read_many)
        return source->klass->read_many(source, spans, count, err);
    for (size_t i = 0; status == STRL_OK && i < count; i++)
        status = source->klass->read(source, spans[i].offset, spans[i].data, spans[i].size, err);
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
