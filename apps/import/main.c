/* stroll-import FILE: imports a file by assimp and writes its triangles to standard output, in the protocol of
 * readers/import_protocol.h. Stroll runs it as a child process, because assimp holds whole scenes in memory and dies of
 * some files; the limits of both are its parent's work. Exit status: 0, or the reason of the error that the stream ends
 * in. */
#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/version.h>
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "memory_end.h"
#include "output.h"
#include "scene.h"
#include "stroll/version.h"

#define NO_OUTPUT 65 /* as 64, no reason of the protocol's */

static int usage(void)
{
    fputs("usage: stroll-import FILE\n"
          "Writes the triangles of FILE to standard output, for stroll to read. Run by stroll itself.\n",
          stderr);
    return 64; /* no reason of the protocol's */
}

/* The stream gets a descriptor of its own: what assimp or a library prints to standard output goes to standard error.
 */
static int take_output(void)
{
    int stream = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
    if (stream >= 0 && dup2(STDERR_FILENO, STDOUT_FILENO) >= 0)
        return stream;
    fprintf(stderr, "stroll-import: no descriptor for its output: %s\n", strerror(errno));
    if (stream >= 0)
        close(stream);
    return -1;
}

static void find_extension(const char *path, char *extension, size_t size)
{
    const char *name = strrchr(path, '/'), *dot = strrchr(name ? name : path, '.');
    snprintf(extension, size, "%s", dot ? dot + 1 : "");
    for (char *at = extension; *at; at++)
        *at = (char)tolower((unsigned char)*at);
}

static const struct aiScene *import(const char *path)
{
    struct aiPropertyStore *settings = aiCreatePropertyStore();
    if (!settings)
        return NULL;
    /* A scene's skeleton is no surface, and must not become one. */
    aiSetImportPropertyInteger(settings, AI_CONFIG_IMPORT_NO_SKELETON_MESHES, 1);
    /* No step after the import: some of them crash, and we triangulate, place and check ourselves. */
    return aiImportFileExWithProperties(path, 0, NULL, settings);
}

/* Its own words, and what can be done. */
static void tell_failure(const char *why, import_refusal *refusal)
{
    const char *advice = "convert it to PLY, OBJ or glTF";
    why = *why ? why : "it does not say why";
    if (strstr(why, "Unrecognized file schema")) {
        why = "it is STEP, of exact surfaces, and no IFC";
        advice = "let the program that made it export triangles, as glTF, OBJ or STL";
    } else if (strstr(why, "DXF: this file contains no 3d data")) {
        why = "it finds no line, polyline or face in this DXF file, and reads nothing else of one";
        advice = "let the program that made it export surfaces";
    } else if (strstr(why, "Binary files are not supported")) {
        advice = "save it as a DXF file of text";
    }
    size_t length = strlen(why);
    length -= length > 0 && why[length - 1] == '.';
    snprintf(refusal->sentence, sizeof refusal->sentence, "assimp cannot import it: %.*s: %s",
             (int)(length < 190 ? length : 190), why, advice);
}

static int run(const char *path, int descriptor)
{
    char extension[STRL_IMPORT_FORMAT_BYTES];
    import_refusal refusal = {STRL_IMPORT_BROKEN, ""};
    import_write_magic(descriptor);
    import_end_without_memory(descriptor);
    const struct aiScene *scene = import(path);
    import_output *output = scene ? import_output_create(descriptor) : NULL;
    if (!scene) {
        const char *why = aiGetErrorString();
        tell_failure(why ? why : "", &refusal);
    } else if (!output) {
        refusal.reason = STRL_IMPORT_MEMORY;
        snprintf(refusal.sentence, sizeof refusal.sentence, "no memory left to write its triangles");
    } else {
        find_extension(path, extension, sizeof extension);
        if (import_scene_write(scene, extension, output, &refusal))
            return 0;
    }
    if (refusal.sentence[0])
        import_write_error(descriptor, refusal.reason, refusal.sentence);
    return (int)refusal.reason;
}

int main(int argc, char **argv)
{
    if (argc == 2 && strcmp(argv[1], "--version") == 0) {
        printf("stroll-import %s, assimp %u.%u.%u\n", STRL_VERSION, aiGetVersionMajor(), aiGetVersionMinor(),
               aiGetVersionPatch());
        return 0;
    }
    if (argc != 2 || strcmp(argv[1], "--help") == 0)
        return usage();
    int descriptor = take_output();
    /* Without a clean end: destructors of a scene that a broken file has made are one more place to die, and what is
     * told is told. */
    _exit(descriptor < 0 ? NO_OUTPUT : run(argv[1], descriptor));
}
