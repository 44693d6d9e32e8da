#include "viewer/journal.h"

#include <errno.h>
#include <string.h>

#include "base/fail.h"
#include "base/memory.h"

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

json_t *strl_journal_text(const char *text)
{
    json_t *string = json_string(text);
    size_t bytes = strlen(text) + 1;
    char *plain = string ? NULL : strl__alloc(bytes, 1);
    for (size_t i = 0; plain && i < bytes; i++)
        plain[i] = (char)((unsigned char)text[i] < 0x80 ? text[i] : '?');
    if (plain)
        string = json_string(plain);
    strl__free(plain);
    return string;
}

json_t *strl_journal_vector(const double v[3])
{
    return json_pack("[f,f,f]", v[0], v[1], v[2]);
}
