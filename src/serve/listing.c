/* The listing of a folder, for people and for programs. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "container/names.h"
#include "serve/answer.h"
#include "serve/text.h"

#define MOST_ENTRIES 2000u
#define MOST_LOOKED_AT 100000u /* names of a folder, whatever they are */

typedef struct entry {
    char *name; /* owned */
    bool is_folder, is_open;
    strl_file_info info;
    strl__model_facts facts;
} entry;

typedef struct listing {
    entry *entries; /* [count], owned */
    size_t count, capacity;
    uint32_t looked_at;
    bool truncated, failed;
} listing;

/* What could not be asked for is not shown. */
static bool is_shown(const char *name, bool is_folder)
{
    size_t length = strlen(name);
    if (name[0] == '.' || length > STRL__COMPONENT_BYTES || !strl__utf8_is_name((const uint8_t *)name, length))
        return false;
    for (const char *c = name; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f || *c == '\\')
            return false;
    return is_folder || strl__is_served_name(name);
}

static bool take_entry(void *context, const char *name, bool is_folder)
{
    listing *all = context;
    bool is_last = ++all->looked_at > MOST_LOOKED_AT;
    if (!is_last && !is_shown(name, is_folder))
        return true;
    if (is_last || all->count == MOST_ENTRIES) {
        all->truncated = true;
        return false;
    }
    char *copy = strl__strdup(name);
    if (!copy || !strl__grow(&all->entries, &all->capacity, all->count + 1, sizeof *all->entries)) {
        strl__free(copy);
        all->failed = true;
        return false;
    }
    all->entries[all->count++] = (entry){.name = copy, .is_folder = is_folder};
    return true;
}

static int compare_entries(const void *left, const void *right)
{
    const entry *a = left, *b = right;
    return a->is_folder != b->is_folder ? (int)b->is_folder - (int)a->is_folder : strcmp(a->name, b->name);
}

/* One file at a time is open. What cannot be opened (or is a link out of the folder) is not shown. */
static void examine(strl__site *site, const char *folder, entry *file)
{
    char path[STRL__PATH_BYTES + STRL__COMPONENT_BYTES + 2];
    size_t length = strlen(folder), name = strlen(file->name);
    memcpy(path, folder, length);
    if (length > 0)
        path[length++] = '/';
    memcpy(path + length, file->name, name + 1);
    strl_file *opened;
    if (length + name > STRL__PATH_BYTES || strl_folder_open_file(site->folder, path, &opened, NULL) != STRL_FOUND)
        return;
    file->is_open = strl_file_stat(opened, &file->info, NULL) == STRL_OK;
    if (file->is_open)
        strl__models_facts(&site->models, opened, &file->info, &file->facts);
    strl_file_close(opened, NULL);
}

/* ---- JSON ---- */

static void put_facts_json(strl_writer *out, const entry *file)
{
    char etag[STRL__ETAG_BYTES], date[STRL__DATE_BYTES];
    strl__model_etag(&file->facts, &file->info, etag, sizeof etag);
    strl__format_time(file->info.modified_ns, date);
    strl__put_format(out, ",\"bytes\":%" PRIu64 ",\"modified\":\"%s\",\"etag\":", file->info.bytes, date);
    strl__put_json(out, etag);
    if (!file->facts.is_container) {
        strl__put(out, ",\"triangles\":null,\"unit\":null,\"trees\":null,\"model_id\":null");
        return;
    }
    strl__put_format(out, ",\"triangles\":%" PRIu64 ",\"trees\":%" PRIu32 ",\"model_id\":\"%.32s\",\"unit\":",
                     file->facts.triangles, file->facts.trees, etag + 3);
    strl__put_json(
        out, strl__utf8_is_name((const uint8_t *)file->facts.unit, strlen(file->facts.unit)) ? file->facts.unit : "");
}

static void put_json_of(strl_writer *out, const listing *all, bool folders)
{
    bool first = true;
    strl__put(out, folders ? "\"folders\":[" : "\"files\":[");
    for (size_t i = 0; i < all->count; i++) {
        const entry *one = &all->entries[i];
        if (one->is_folder != folders || (!folders && !one->is_open))
            continue;
        strl__put(out, first ? "\n{\"name\":" : ",\n{\"name\":");
        strl__put_json(out, one->name);
        if (!folders)
            put_facts_json(out, one);
        strl__put(out, "}");
        first = false;
    }
    strl__put(out, "]");
}

static void put_json_page(strl_writer *out, const char *folder, const listing *all)
{
    strl__put(out, "{\"folder\":");
    strl__put_json(out, folder);
    strl__put_format(out, ",\"truncated\":%s,\n", all->truncated ? "true" : "false");
    put_json_of(out, all, true);
    strl__put(out, ",\n");
    put_json_of(out, all, false);
    strl__put(out, "}\n");
}

/* ---- HTML ---- */

static void put_amount(strl_writer *out, uint64_t amount, unsigned thousand, const char *const units[5])
{
    double value = (double)amount;
    unsigned power = 0;
    for (; value >= thousand && power < 4; power++)
        value /= thousand;
    strl__put_format(out, power == 0 ? "%.0f%s" : "%.1f%s", value, units[power]);
}

static void put_link(strl_writer *out, const char *name, bool is_folder)
{
    /* "./" keeps a name with a colon from being taken for a scheme. */
    strl__put(out, "<tr><td><a href=\"./");
    strl__put_url(out, name);
    strl__put(out, is_folder ? "/\">" : "\">");
    strl__put_html(out, name);
    strl__put(out, is_folder ? "/</a>" : "</a>");
}

static void put_row(strl_writer *out, const entry *one)
{
    static const char *const bytes[] = {" B", " KiB", " MiB", " GiB", " TiB"};
    static const char *const counts[] = {"", " K", " M", " G", " T"};
    if (!one->is_folder && !one->is_open)
        return;
    put_link(out, one->name, one->is_folder);
    if (one->is_folder) {
        strl__put(out, "<td><td><td></tr>\n");
        return;
    }
    strl__put(out, "<td>");
    put_amount(out, one->info.bytes, 1024, bytes);
    strl__put(out, "<td>");
    if (one->facts.is_container)
        put_amount(out, one->facts.triangles, 1000, counts);
    else
        strl__put(out, "not a container");
    strl__put(out, "<td>");
    strl__put_html(out, one->facts.unit);
    strl__put(out, "</tr>\n");
}

static void put_page(strl_writer *out, const char *folder, const listing *all)
{
    strl__put(out, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
                   "<meta name=\"viewport\" content=\"width=device-width\"><title>Stroll: /");
    strl__put_html(out, folder);
    strl__put(out,
              "</title><style>body{font:16px system-ui,sans-serif;margin:2em}td,th{padding:.2em 1em;text-align:right}"
              "td:first-child,th:first-child{text-align:left}tr:nth-child(even){background:#8882}</style></head><body>"
              "<h1>/");
    strl__put_html(out, folder);
    strl__put(out, "</h1>\n<table><tr><th>name<th>size<th>triangles<th>unit</tr>\n");
    if (*folder)
        strl__put(out, "<tr><td><a href=\"../\">../</a><td><td><td></tr>\n");
    for (size_t i = 0; i < all->count; i++)
        put_row(out, &all->entries[i]);
    strl__put(out, "</table>\n");
    if (all->truncated)
        strl__put(out, "<p>There is more in this folder than is listed.</p>\n");
    strl__put(out, "</body></html>\n");
}

void strl__answer_listing(strl__site *site, const char *path, bool json, strl__answer *answer)
{
    listing all = {0};
    strl_writer out = {0};
    strl_error err = {0};
    strl_found found = strl_folder_list(site->folder, path, take_entry, &all, &err);
    if (found == STRL_FOUND && !all.failed) {
        if (all.count > 0)
            qsort(all.entries, all.count, sizeof *all.entries, compare_entries);
        for (size_t i = 0; i < all.count; i++)
            if (!all.entries[i].is_folder)
                examine(site, path, &all.entries[i]);
        if (json)
            put_json_page(&out, path, &all);
        else
            put_page(&out, path, &all);
        answer->status = 200;
        answer->is_page = !json;
        strl__answer_text(answer, json ? "application/json" : "text/html; charset=utf-8", &out);
    } else if (found == STRL_FOUND_NOTHING || found == STRL_FOUND_BARRED) {
        strl__answer_sentence(answer, found == STRL_FOUND_BARRED ? 403 : 404, "%s",
                              found == STRL_FOUND_BARRED ? "the folder may not be read" : "there is no such folder");
    } else {
        strl__site_complain(site, all.failed ? "no memory to list a folder" : err.message);
        strl__answer_sentence(answer, 503, "the folder cannot be listed now");
        answer->retry_s = 1;
    }
    for (size_t i = 0; i < all.count; i++)
        strl__free(all.entries[i].name);
    strl__free(all.entries);
}
