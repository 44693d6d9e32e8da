/* A container in the middle of another file, decoding on threads of our own, and a tight budget.
 *
 *     cc own_source.c $(pkg-config --cflags --libs stroll) -pthread -lm -o own_source
 *     cat header.bin model.stroll > pack.bin
 *     ./own_source pack.bin 100 */
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "orbit.h"

/* begin: source */
typedef struct pack {
    int descriptor;
    uint64_t first; /* byte of the file at which the container begins */
} pack;

/* Thread-safe: pread shares no position. */
static strl_status read_pack(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    const pack *p = context;
    uint8_t *at = data;
    while (size) {
        ssize_t got = pread(p->descriptor, at, size, (off_t)(p->first + offset));
        if (got <= 0)
            return strl_error_set(err, STRL_ERR_IO, "the pack ends early or cannot be read");
        at += got;
        offset += (uint64_t)got;
        size -= (size_t)got;
    }
    return STRL_OK;
}

static void close_pack(void *context)
{
    pack *p = context;
    close(p->descriptor);
    free(p);
}

static strl_status open_pack(const char *path, uint64_t first, strl_source **source, strl_error *err)
{
    struct stat facts;
    pack *p = malloc(sizeof *p);
    *source = NULL;
    if (!p)
        return strl_error_set(err, STRL_ERR_MEMORY, "no memory for a pack");
    *p = (pack){open(path, O_RDONLY), first};
    if (p->descriptor < 0 || fstat(p->descriptor, &facts) != 0 || (uint64_t)facts.st_size < first) {
        close_pack(p);
        return strl_error_set(err, STRL_ERR_IO, "the pack cannot be opened or is too short");
    }
    const strl_source_callbacks callbacks = {
        .name = path, .bytes = (uint64_t)facts.st_size - first, .context = p, .read = read_pack, .close = close_pack};
    strl_status status = strl_source_open_callbacks(&callbacks, 2, source, err);
    if (status != STRL_OK)
        close_pack(p); /* a source that did not open does not close */
    return status;
}
/* end: source */

/* begin: executor */
typedef struct job {
    struct job *next;
    void (*run)(void *job);
    void *what;
} job;

typedef struct workers {
    pthread_mutex_t mutex; /* guards all below */
    pthread_cond_t came;
    job *first, **end;
    bool stopping;
    pthread_t threads[2];
    int started;
} workers;

/* On the walk's thread, from strl_walk_frame. */
static strl_status submit(void *context, void (*run)(void *job), void *what, strl_error *err)
{
    workers *w = context;
    job *made = malloc(sizeof *made);
    if (!made)
        return strl_error_set(err, STRL_ERR_MEMORY, "no memory for a job");
    *made = (job){NULL, run, what};
    pthread_mutex_lock(&w->mutex);
    *w->end = made;
    w->end = &made->next;
    pthread_cond_signal(&w->came);
    pthread_mutex_unlock(&w->mutex);
    return STRL_OK;
}

/* Runs what was accepted, also when it is told to stop: a job that never ran would never be released. */
static void *work(void *context)
{
    workers *w = context;
    pthread_mutex_lock(&w->mutex);
    while (w->first || !w->stopping) {
        job *next = w->first;
        if (!next) {
            pthread_cond_wait(&w->came, &w->mutex);
            continue;
        }
        w->first = next->next;
        if (!w->first)
            w->end = &w->first;
        pthread_mutex_unlock(&w->mutex);
        next->run(next->what);
        free(next);
        pthread_mutex_lock(&w->mutex);
    }
    pthread_mutex_unlock(&w->mutex);
    return NULL;
}

static strl_status start(workers *w, strl_error *err)
{
    *w = (workers){.end = &w->first};
    pthread_mutex_init(&w->mutex, NULL);
    pthread_cond_init(&w->came, NULL);
    for (; w->started < 2; w->started++)
        if (pthread_create(&w->threads[w->started], NULL, work, w) != 0)
            return strl_error_set(err, STRL_ERR_MEMORY, "a thread cannot be started");
    return STRL_OK;
}

static void stop(workers *w)
{
    pthread_mutex_lock(&w->mutex);
    w->stopping = true;
    pthread_cond_broadcast(&w->came);
    pthread_mutex_unlock(&w->mutex);
    for (int i = 0; i < w->started; i++)
        pthread_join(w->threads[i], NULL);
    pthread_cond_destroy(&w->came);
    pthread_mutex_destroy(&w->mutex);
}
/* end: executor */

/* begin: budget */
/* Frames until nothing is missing. memory_bytes is hard: where it is tight the allowed error grows instead. */
static strl_status walk_within(const char *path, uint64_t first, workers *w, uint64_t memory_bytes, strl_error *err)
{
    strl_source *source;
    strl_walk *walk = NULL;
    const strl_executor executor = {w, submit};
    const strl_walk_desc desc = {.memory_bytes = memory_bytes, .error_px = 0.5, .executor = &executor};
    strl_status status = open_pack(path, first, &source, err);
    if (status == STRL_OK)
        status = strl_walk_open(source, &desc, &walk, err);
    while (status == STRL_OK) {
        strl_camera camera = orbit(walk, 0, 1280, 720);
        strl_draw_list list;
        status = strl_walk_frame(walk, &camera, &list, err);
        if (strl_walk_settled(walk))
            break;
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL); /* here a program draws the list */
    }
    if (status == STRL_OK) {
        const strl_walk_stats *stats = strl_walk_get_stats(walk);
        printf("budget %" PRIu64 " KiB: holds %" PRIu64 " KiB, %" PRIu64
               " triangles; wanted 0.5 pixels, allowed %.2f\n",
               memory_bytes >> 10, stats->resident_bytes >> 10, stats->triangles, stats->allowed_error_px);
    }
    strl_walk_close(walk); /* before the workers stop */
    return status;
}
/* end: budget */

/* begin: main */
int main(int argc, char **argv)
{
    strl_error err = {0};
    workers w;
    if (argc != 3) {
        fprintf(stderr, "usage: own_source PACK FIRST_BYTE\n");
        return 2;
    }
    uint64_t first = strtoull(argv[2], NULL, 10);
    strl_status status = start(&w, &err);
    for (uint64_t memory_bytes = (uint64_t)64 << 20; status == STRL_OK && memory_bytes >= (uint64_t)2 << 20;
         memory_bytes /= 4)
        status = walk_within(argv[1], first, &w, memory_bytes, &err);
    stop(&w);
    if (status != STRL_OK)
        fprintf(stderr, "own_source: %s\n", err.message);
    return status == STRL_OK ? 0 : 1;
}
/* end: main */
