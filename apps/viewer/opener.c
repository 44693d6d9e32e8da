#include "viewer/opener.h"

#include <inttypes.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"
#include "stroll/build.h"
#include "platform/file.h"
#include "platform/file.h"
#include "platform/output.h"
#include "platform/thread.h"
#include "shared/folder.h"
#include "shared/importer.h"
#include "shared/location.h"

struct strl_opener {
    char *cache;
    strl_thread *thread;
    atomic_bool cancelled;
    strl_opener_state state; /* the owner's thread only, as what follows but for the two paths */
    bool of_mesh, built_before;
    char input[4096], output[4096];
    strl_mutex mutex; /* guards the rest */
    strl_build_progress progress;
    bool done;
    char warning[480]; /* the first */
    unsigned warning_count;
    strl_status status;
    strl_error error;
};

strl_status strl_opener_create(const char *cache, strl_opener **opener, strl_error *err)
{
    strl_opener *made = strl__alloc_zero(1, sizeof *made);
    *opener = NULL;
    if (made && cache)
        made->cache = strl__strdup(cache);
    if (!made || (cache && !made->cache)) {
        strl__free(made);
        return strl__fail(err, STRL_ERR_MEMORY, "no memory for opening files");
    }
    strl_mutex_init(&made->mutex);
    *opener = made;
    return STRL_OK;
}

void strl_opener_destroy(strl_opener *opener)
{
    if (!opener)
        return;
    strl_opener_cancel(opener);
    strl_thread_join(opener->thread);
    strl_mutex_deinit(&opener->mutex);
    strl__free(opener->cache);
    strl__free(opener);
}

/* ---- building */

static bool report(void *context, const strl_build_progress *progress)
{
    strl_opener *opener = context;
    strl_mutex_lock(&opener->mutex);
    opener->progress = *progress;
    strl_mutex_unlock(&opener->mutex);
    return !atomic_load(&opener->cancelled);
}

static void note_warning(void *context, const char *sentence)
{
    strl_opener *opener = context;
    strl_mutex_lock(&opener->mutex);
    if (opener->warning_count++ == 0)
        snprintf(opener->warning, sizeof opener->warning, "%s", sentence);
    strl_mutex_unlock(&opener->mutex);
}

static void build(void *context)
{
    strl_opener *opener = context;
    const char *input = opener->input;
    unsigned processors = strl_cpu_count();
    /* A processor is left to the window. */
    const strl_build_desc desc = {.inputs = &input,
                                  .input_count = 1,
                                  .output = opener->output,
                                  .jobs = processors > 1 ? processors - 1 : 1,
                                  .importer = strl_importer(),
                                  .progress = report,
                                  .warn = note_warning,
                                  .context = opener};
    strl_build_result result;
    strl_error error = {0};
    strl_status status = strl_build_clusters(&desc, &result, &error);
    strl_mutex_lock(&opener->mutex);
    opener->status = status;
    opener->error = error;
    opener->done = true;
    strl_mutex_unlock(&opener->mutex);
}

/* ---- where */

static bool is_container(const char *path)
{
    bool is = false;
    return strl_location_is_container(&(strl_location){.name = path}, &is, NULL) == STRL_OK && is;
}

/* Names in the cache tell files of one name in different folders apart. */
static strl_status cache_name(strl_opener *opener, strl_error *err)
{
    const char *slash = strrchr(opener->input, '/'), *name = slash ? slash + 1 : opener->input;
    strl_status status = strl_folder_make(opener->cache, err);
    int bytes = snprintf(opener->output, sizeof opener->output, "%s/%016" PRIx64 "-%s.stroll", opener->cache,
                         strl__checksum(opener->input, strlen(opener->input)), name);
    if (status == STRL_OK && (bytes < 0 || (size_t)bytes >= sizeof opener->output))
        status = strl__fail(err, STRL_ERR_LIMIT, "%s: the path is too long", opener->input);
    return status;
}

static strl_status choose_output(strl_opener *opener, strl_error *err)
{
    int bytes = snprintf(opener->output, sizeof opener->output, "%s.stroll", opener->input);
    if (bytes < 0 || (size_t)bytes >= sizeof opener->output)
        return strl__fail(err, STRL_ERR_LIMIT, "%s: the path is too long", opener->input);
    strl_status status = strl_output_check(opener->output, err);
    return status == STRL_OK || !opener->cache ? status : cache_name(opener, err);
}

static bool is_built(const strl_opener *opener)
{
    strl_file_info input, output;
    return strl_path_stat(opener->input, &input, NULL) == STRL_OK &&
           strl_path_stat(opener->output, &output, NULL) == STRL_OK && output.modified_ns > input.modified_ns &&
           is_container(opener->output);
}

strl_status strl_opener_start(strl_opener *opener, const char *file, bool again, strl_error *err)
{
    strl_file_info info;
    if (opener->state == STRL_OPENER_BUILDS)
        return strl__fail(err, STRL_ERR_ARGUMENT, "%s is not opened: another file is still being built", file);
    if (strlen(file) >= sizeof opener->input)
        return strl__fail(err, STRL_ERR_LIMIT, "%.200s: the path is too long", file);
    strl_status status = strl_path_stat(file, &info, err);
    if (status != STRL_OK)
        return status;
    memcpy(opener->input, file, strlen(file) + 1);
    opener->state = STRL_OPENER_READY;
    opener->warning_count = 0;
    opener->of_mesh = !is_container(file);
    opener->built_before = false;
    if (!opener->of_mesh) {
        memcpy(opener->output, file, strlen(file) + 1);
        return STRL_OK;
    }
    status = choose_output(opener, err);
    if (status == STRL_OK && !again && is_built(opener)) {
        opener->built_before = true;
        return STRL_OK;
    }
    opener->done = false;
    opener->progress = (strl_build_progress){0};
    atomic_store(&opener->cancelled, false);
    if (status == STRL_OK)
        status = strl_thread_start(&opener->thread, build, opener, err);
    opener->state = status == STRL_OK ? STRL_OPENER_BUILDS : STRL_OPENER_IDLE;
    return status;
}

void strl_opener_cancel(strl_opener *opener)
{
    atomic_store(&opener->cancelled, true);
}

static void describe(const strl_build_progress *p, strl_opener_news *news)
{
    news->share = p->share;
    if (p->seconds_left > 0)
        snprintf(news->text, sizeof news->text, "%s, %.1f M triangles, %.0f s left", p->stage ? p->stage : "begin",
                 (double)p->triangles_in * 1e-6, p->seconds_left);
    else
        snprintf(news->text, sizeof news->text, "%s, %.1f M triangles", p->stage ? p->stage : "begin",
                 (double)p->triangles_in * 1e-6);
}

/* Once the thread has ended. */
static void describe_warnings(const strl_opener *opener, strl_opener_news *news)
{
    if (opener->warning_count == 1)
        snprintf(news->warning, sizeof news->warning, "%s", opener->warning);
    else if (opener->warning_count > 1)
        snprintf(news->warning, sizeof news->warning, "%s (and %u more warning%s)", opener->warning,
                 opener->warning_count - 1, opener->warning_count == 2 ? "" : "s");
}

void strl_opener_poll(strl_opener *opener, strl_opener_news *news)
{
    *news = (strl_opener_news){.state = opener->state};
    bool done = false;
    if (opener->state == STRL_OPENER_BUILDS) {
        strl_mutex_lock(&opener->mutex);
        describe(&opener->progress, news);
        done = opener->done;
        news->error = opener->error;
        news->state = !done ? STRL_OPENER_BUILDS : opener->status == STRL_OK ? STRL_OPENER_READY : STRL_OPENER_FAILED;
        strl_mutex_unlock(&opener->mutex);
    }
    if (done) {
        strl_thread_join(opener->thread);
        opener->thread = NULL;
    }
    if (news->state == STRL_OPENER_READY) {
        memcpy(news->container, opener->output, sizeof news->container);
        memcpy(news->mesh, opener->input, opener->of_mesh ? sizeof news->mesh : 0);
        news->built_before = opener->built_before;
    }
    if (news->state == STRL_OPENER_READY || news->state == STRL_OPENER_FAILED)
        describe_warnings(opener, news);
    if (news->state != STRL_OPENER_BUILDS)
        opener->state = STRL_OPENER_IDLE;
}
