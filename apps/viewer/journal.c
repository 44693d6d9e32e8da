#include "viewer/journal.h"

#include <errno.h>
#include <string.h>

#include "base/fail.h"

strl_status strl_journal_open(const char *path, FILE **journal, strl_error *err)
{
    *journal = path ? fopen(path, "w") : NULL;
    if (path && !*journal)
        return strl__fail(err, STRL_ERR_IO, "cannot write the log %s: %s", path, strerror(errno));
    return STRL_OK;
}

void strl_journal_close(FILE *journal)
{
    if (journal)
        fclose(journal);
}

void strl_journal_write(FILE *journal, const char *name, json_t *object)
{
    if (journal && object && json_object_set_new(object, "event", json_string(name)) == 0) {
        json_dumpf(object, journal, JSON_COMPACT | JSON_REAL_PRECISION(17));
        fputc('\n', journal);
        fflush(journal);
    }
    json_decref(object);
}

json_t *strl_journal_vector(const double v[3])
{
    return json_pack("[f,f,f]", v[0], v[1], v[2]);
}
