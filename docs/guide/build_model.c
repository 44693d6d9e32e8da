/* Builds a container from mesh files.
 *
 *     cc build_model.c $(pkg-config --cflags --libs stroll-build) -o build_model
 *     ./build_model model.stroll part1.ply part2.obj */
#include <inttypes.h>
#include <stdio.h>

#include <stroll/stroll.h>

/* begin: progress */
/* On the thread that called the builder, often; false would cancel. */
static bool show(void *context, const strl_build_progress *progress)
{
    int *percent = context, now = (int)(100 * progress->share);
    if (now > *percent)
        printf("%d%% %s\n", *percent = now, progress->stage);
    return true;
}
/* end: progress */

/* begin: build */
int main(int argc, char **argv)
{
    strl_error err = {0};
    strl_build_result result;
    int percent = -1;
    if (argc < 3) {
        fprintf(stderr, "usage: build_model OUT.stroll INPUT...\n");
        return 2;
    }
    const strl_build_desc desc = {.inputs = (const char *const *)argv + 2,
                                  .input_count = (uint32_t)argc - 2,
                                  .output = argv[1],
                                  .memory_bytes = (uint64_t)256 << 20,
                                  .progress = show,
                                  .context = &percent};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK) {
        fprintf(stderr, "build_model: %s\n", err.message);
        return 1;
    }
    printf("%" PRIu64 " triangles in, %" PRIu64 " in the finest level, %" PRIu64 " bytes\n", result.triangles_in,
           result.triangles_leaf, result.bytes_out);
    return 0;
}
/* end: build */
