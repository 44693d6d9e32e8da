/* What goes wrong, and what Stroll says of it.
 *
 *     cc errors.c $(pkg-config --cflags --libs stroll) -lm -o errors
 *     ./errors model.stroll */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "orbit.h"

/* begin: sentences */
static void report(const char *what, strl_status status, const strl_error *err)
{
    printf("%s: %s: %s\n", what, strl_status_name(status), status == STRL_OK ? "fine" : err->message);
}

/* Opening fails with a code for the program and a sentence for people; nothing is left to close. */
static void try_to_open(const char *path)
{
    strl_error err;
    strl_source *source;
    strl_walk *walk = NULL;
    strl_status status = strl_source_open_file(path, 0, &source, &err);
    if (status == STRL_OK)
        status = strl_walk_open(source, NULL, &walk, &err);
    report("open", status, &err);
    strl_walk_close(walk); /* NULL is legal */
}
/* end: sentences */

/* begin: flaky */
/* The container in memory, and a network that is down for a while. */
typedef struct flaky {
    const uint8_t *data;
    bool down;
} flaky;

static strl_status read_flaky(void *context, uint64_t offset, void *data, size_t size, strl_error *err)
{
    const flaky *f = context;
    if (f->down)
        return strl_error_set(err, STRL_ERR_NETWORK, "the network is down");
    memcpy(data, f->data + offset, size);
    return STRL_OK;
}
/* end: flaky */

/* begin: faults */
static void run_frames(strl_walk *walk, int frames)
{
    strl_error err;
    strl_draw_list list;
    strl_camera camera = orbit(walk, 0, 1280, 720);
    strl_status status = STRL_OK;
    for (int i = 0; status == STRL_OK && i < frames; i++) {
        status = strl_walk_frame(walk, &camera, &list, &err);
        strl_walk_pump(walk, 4000000);
    }
    const strl_walk_stats *stats = strl_walk_get_stats(walk);
    printf("%s; drew %s; missing %s; %s: %s\n", status == STRL_OK ? "every frame succeeded" : err.message,
           stats->nodes ? "something" : "nothing", stats->missing_nodes ? "some" : "nothing",
           stats->faults ? "there were faults" : "no fault", stats->last_fault);
}

/* A read or a page that fails is no failure of the frame: that part stays coarse, and is asked for again. */
static void lose_the_network(const uint8_t *data, size_t size)
{
    strl_error err;
    flaky f = {data, false};
    const strl_source_callbacks callbacks = {.name = "flaky", .bytes = size, .context = &f, .read = read_flaky};
    strl_source *source;
    strl_walk *walk = NULL;
    strl_status status = strl_source_open_callbacks(&callbacks, 0, &source, &err);
    if (status == STRL_OK)
        status = strl_walk_open(source, NULL, &walk, &err);
    if (status != STRL_OK) {
        report("flaky", status, &err);
        return;
    }
    f.down = true;
    run_frames(walk, 50);
    f.down = false;
    run_frames(walk, 5000); /* asked for again later and later, up to seconds */
    strl_walk_close(walk);
}
/* end: faults */

/* begin: frame */
/* A frame fails for the caller's mistakes and for want of memory; the walk can be used on. */
static void look_nowhere(const char *path)
{
    strl_error err;
    strl_source *source;
    strl_walk *walk = NULL;
    strl_status status = strl_source_open_file(path, 0, &source, &err);
    if (status == STRL_OK)
        status = strl_walk_open(source, NULL, &walk, &err);
    if (status == STRL_OK) {
        strl_camera camera = orbit(walk, 0, 1280, 720);
        strl_draw_list list;
        memcpy(camera.eye, camera.target, sizeof camera.eye);
        status = strl_walk_frame(walk, &camera, &list, &err);
    }
    report("frame", status, &err);
    strl_walk_close(walk);
}
/* end: frame */

/* begin: main */
static uint8_t *load(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    long end = -1;
    if (file && fseek(file, 0, SEEK_END) == 0)
        end = ftell(file);
    uint8_t *data = end > 0 ? malloc((size_t)end) : NULL;
    *size = data ? (size_t)end : 0;
    if (data && (fseek(file, 0, SEEK_SET) != 0 || fread(data, 1, *size, file) != *size))
        *size = 0;
    if (file)
        fclose(file);
    return data;
}

int main(int argc, char **argv)
{
    size_t size = 0;
    uint8_t *data = argc == 2 ? load(argv[1], &size) : NULL;
    if (!size) {
        fprintf(stderr, "usage: errors MODEL.stroll\n");
        free(data);
        return 2;
    }
    try_to_open(argv[1]);
    try_to_open("no/such/model.stroll");
    try_to_open(argv[0]); /* no container */
    look_nowhere(argv[1]);
    lose_the_network(data, size);
    free(data);
    return 0;
}
/* end: main */
