/* A program that builds a container OUT of INPUT: libstroll_build. */
#include <inttypes.h>
#include <stdio.h>

#include <stroll/build.h>

int main(int argc, char **argv)
{
    strl_error err = {0};
    strl_build_result result;
    if (argc != 3)
        return 2;
    const strl_build_desc desc = {
        .inputs = (const char *const[]){argv[2]}, .input_count = 1, .output = argv[1], .jobs = 1};
    if (strl_build_clusters(&desc, &result, &err) != STRL_OK) {
        fprintf(stderr, "builder: %s: %s\n", strl_status_name(err.status), err.message);
        return 1;
    }
    printf("triangles %" PRIu64 "\n", result.triangles_leaf);
    return 0;
}
