#include "serve/models.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/fail.h"
#include "base/hash.h"
#include "base/memory.h"

#define KNOWN_WAYS 8u

void strl__models_init(strl__models *models)
{
    memset(models, 0, sizeof *models);
    strl_mutex_init(&models->mutex);
}

static void release(strl__model *model)
{
    if (!model)
        return;
    strl_container_close(model->container);
    strl_file_close(model->file, NULL);
    strl_mutex_deinit(&model->mutex);
    strl__free(model);
}

void strl__models_deinit(strl__models *models)
{
    for (unsigned i = 0; i < STRL__OPEN_MODELS; i++)
        release(models->open[i]);
    strl_mutex_deinit(&models->mutex);
}

static bool same_file(const strl_file_info *a, const strl_file_info *b)
{
    return a->bytes == b->bytes && a->modified_ns == b->modified_ns && a->device == b->device && a->inode == b->inode;
}

/* ---- facts ---- */

static strl_status read_file(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    return strl_file_read(context, offset, data, size, err);
}

static strl_status open_container(const strl_source_callbacks *callbacks, strl_container **container, strl_error *err)
{
    strl_source *source;
    *container = NULL;
    strl_status status = strl_source_open_callbacks(callbacks, 0, &source, err);
    return status == STRL_OK ? strl_container_open(source, container, err) : status;
}

/* False where the system failed, so that nothing has been learned. */
static bool read_facts(strl_file *file, uint64_t bytes, strl__model_facts *facts)
{
    const strl_source_callbacks callbacks = {.bytes = bytes, .context = file, .read = read_file};
    strl_container *container;
    *facts = (strl__model_facts){0};
    strl_status status = open_container(&callbacks, &container, NULL);
    if (status == STRL_OK) {
        const strl_container_info *info = strl_container_get_info(container);
        facts->is_container = true;
        memcpy(facts->model_id, info->model_id, sizeof facts->model_id);
        memcpy(facts->unit, info->unit, sizeof facts->unit);
        facts->triangles = strl_container_triangle_count(container);
        facts->trees = info->tree_count;
    }
    strl_container_close(container);
    return status == STRL_OK || status == STRL_ERR_FORMAT || status == STRL_ERR_UNSUPPORTED;
}

/* The file's place, else the one of its set to reuse. */
static strl__known_facts *find_known(strl__models *models, const strl_file_info *info)
{
    uint64_t set = strl__mix64(info->inode + strl__mix64(info->device)) % (STRL__KNOWN_FACTS / KNOWN_WAYS);
    strl__known_facts *first = &models->known[set * KNOWN_WAYS], *oldest = first;
    for (unsigned i = 0; i < KNOWN_WAYS; i++) {
        if (first[i].last_use && same_file(&first[i].file, info))
            return &first[i];
        if (first[i].last_use < oldest->last_use)
            oldest = &first[i];
    }
    return oldest;
}

void strl__models_facts(strl__models *models, strl_file *file, const strl_file_info *info, strl__model_facts *facts)
{
    strl_mutex_lock(&models->mutex);
    strl__known_facts *known = find_known(models, info);
    bool found = known->last_use && same_file(&known->file, info);
    if (found) {
        *facts = known->facts;
        known->last_use = ++models->uses;
    }
    strl_mutex_unlock(&models->mutex);
    if (found || !read_facts(file, info->bytes, facts))
        return;
    uint64_t now_ns = strl_clock_wall_ns();
    if (info->modified_ns > now_ns || now_ns - info->modified_ns < STRL__SETTLED_NS)
        return;
    strl_mutex_lock(&models->mutex);
    *find_known(models, info) = (strl__known_facts){*info, *facts, ++models->uses};
    strl_mutex_unlock(&models->mutex);
}

void strl__model_etag(const strl__model_facts *facts, const strl_file_info *info, char *etag, size_t size)
{
    if (!facts->is_container) {
        snprintf(etag, size, "\"f-%" PRIx64 "-%" PRIx64 "-%" PRIx64 "\"", info->bytes, info->modified_ns, info->inode);
        return;
    }
    char id[33];
    for (unsigned i = 0; i < 16; i++)
        snprintf(id + 2 * i, 3, "%02x", facts->model_id[i]);
    snprintf(etag, size, "\"m-%s\"", id);
}

/* ---- open containers ---- */

static strl_status read_model(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    strl__model *model = context;
    if (size > model->left_bytes)
        return strl__fail(err, STRL_ERR_LIMIT, "looking the nodes up takes more than a query may read at once");
    model->left_bytes -= size;
    return strl_file_read(model->file, offset, data, size, err);
}

static strl_status make_model(const strl_file *file, const strl_file_info *info, strl__model **model, strl_error *err)
{
    *model = NULL;
    strl__model *made = strl__alloc_zero(1, sizeof *made);
    if (!made)
        return strl__fail(err, STRL_ERR_MEMORY, "no memory to open a container");
    strl_status status = strl_file_duplicate(file, &made->file, err);
    if (status != STRL_OK) {
        strl__free(made);
        return status;
    }
    made->info = *info;
    strl_mutex_init(&made->mutex);
    *model = made;
    return STRL_OK;
}

static uint64_t bytes_of_all(const strl__models *models)
{
    uint64_t bytes = 0;
    for (unsigned i = 0; i < STRL__OPEN_MODELS; i++)
        bytes += models->open[i] ? models->open[i]->bytes : 0;
    return bytes;
}

/* The place of the one that nobody uses and that was not used for longest; NULL where all are in use. */
static strl__model **oldest_idle(strl__models *models)
{
    strl__model **oldest = NULL;
    for (unsigned i = 0; i < STRL__OPEN_MODELS; i++) {
        strl__model **at = &models->open[i];
        if (*at && (*at)->users == 0 && (!oldest || (*at)->last_use < (*oldest)->last_use))
            oldest = at;
    }
    return oldest;
}

static strl__model **free_place(strl__models *models)
{
    for (unsigned i = 0; i < STRL__OPEN_MODELS; i++)
        if (!models->open[i])
            return &models->open[i];
    strl__model **oldest = oldest_idle(models);
    if (oldest) {
        release(*oldest);
        *oldest = NULL;
    }
    return oldest;
}

/* Under the cache's mutex. */
static strl_status find_or_make(strl__models *models, const strl_file *file, const strl_file_info *info,
                                strl__model **model, strl_error *err)
{
    *model = NULL;
    for (unsigned i = 0; i < STRL__OPEN_MODELS; i++)
        if (models->open[i] && same_file(&models->open[i]->info, info))
            *model = models->open[i];
    strl_status status = STRL_OK;
    if (!*model) {
        strl__model **place = free_place(models);
        if (!place)
            return strl__fail(err, STRL_ERR_LIMIT, "all %u containers that may be open are at work", STRL__OPEN_MODELS);
        status = make_model(file, info, model, err);
        *place = *model;
    }
    if (*model) {
        (*model)->users++;
        (*model)->last_use = ++models->uses;
    }
    return status;
}

/* Under the model's mutex. */
static strl_status ready(strl__model *model, strl_error *err)
{
    model->left_bytes = STRL__LOOKUP_BYTES;
    if (model->container)
        return STRL_OK;
    const strl_source_callbacks callbacks = {.bytes = model->info.bytes, .context = model, .read = read_model};
    strl_status status = open_container(&callbacks, &model->container, err);
    if (status != STRL_OK)
        return status;
    uint64_t bytes = strl_container_lookup_bytes(model->container);
    if (bytes <= STRL__MODEL_BYTES)
        return STRL_OK;
    strl_container_close(model->container);
    model->container = NULL;
    return strl__fail(err, STRL_ERR_UNSUPPORTED,
                      "looking nodes up takes %" PRIu64 " bytes of memory, more than the %" PRIu64 " of a container",
                      bytes, STRL__MODEL_BYTES);
}

strl_status strl__models_borrow(strl__models *models, const strl_file *file, const strl_file_info *info,
                                strl__model **model, uint64_t *read_bytes, strl_error *err)
{
    uint64_t unwanted;
    read_bytes = read_bytes ? read_bytes : &unwanted;
    *read_bytes = 0;
    strl_mutex_lock(&models->mutex);
    strl_status status = find_or_make(models, file, info, model, err);
    strl_mutex_unlock(&models->mutex);
    if (status != STRL_OK)
        return status;
    if (!strl_mutex_try_lock(&(*model)->mutex)) {
        strl_mutex_lock(&models->mutex);
        (*model)->users--;
        strl_mutex_unlock(&models->mutex);
        *model = NULL;
        return strl__fail(err, STRL_ERR_CANCELLED, "another query is at work in the container");
    }
    status = ready(*model, err);
    *read_bytes = STRL__LOOKUP_BYTES - (*model)->left_bytes;
    if (status != STRL_OK) {
        strl__models_return(models, *model);
        *model = NULL;
    }
    return status;
}

void strl__models_return(strl__models *models, strl__model *model)
{
    if (!model)
        return;
    /* What failed keeps its place without a container: the next query tries anew. */
    uint64_t bytes = sizeof *model + (model->container ? strl_container_lookup_bytes(model->container) : 0);
    strl_mutex_unlock(&model->mutex);
    strl_mutex_lock(&models->mutex);
    model->bytes = bytes;
    model->last_ns = strl_clock_ns();
    model->users--;
    for (strl__model **oldest; bytes_of_all(models) > STRL__ALL_MODELS_BYTES && (oldest = oldest_idle(models));) {
        release(*oldest);
        *oldest = NULL;
    }
    strl_mutex_unlock(&models->mutex);
}

uint32_t strl__models_open_count(strl__models *models)
{
    uint32_t count = 0;
    strl_mutex_lock(&models->mutex);
    for (unsigned i = 0; i < STRL__OPEN_MODELS; i++)
        count += models->open[i] && models->open[i]->bytes > sizeof(strl__model);
    strl_mutex_unlock(&models->mutex);
    return count;
}

void strl__models_forget(strl__models *models, uint64_t idle_ns)
{
    strl_mutex_lock(&models->mutex);
    uint64_t now_ns = strl_clock_ns();
    for (unsigned i = 0; i < STRL__OPEN_MODELS; i++) {
        strl__model *model = models->open[i];
        if (!model || model->users || now_ns < model->last_ns || now_ns - model->last_ns < idle_ns)
            continue;
        release(model);
        models->open[i] = NULL;
    }
    strl_mutex_unlock(&models->mutex);
}
