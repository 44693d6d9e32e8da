/* A scene of assimp's as a stream: counted first, so that the stream can say what comes, then told node by node.
 * Placements are applied here, in doubles; nothing is asked of assimp but what the file says. */
#ifndef STRL_IMPORT_SCENE_H
#define STRL_IMPORT_SCENE_H

#include <assimp/scene.h>

#include "output.h"

#define IMPORT_SENTENCE_BYTES (STRL_IMPORT_TEXT_MOST + 1)

/* Why a scene was refused; sentence empty = it was not. */
typedef struct import_refusal {
    enum strl_import_reason reason;
    char sentence[IMPORT_SENTENCE_BYTES];
} import_refusal;

/* extension: of the file's name, lower case, without the dot. False: refused, or the output failed; what was written
 * then is not ended. */
bool import_scene_write(const struct aiScene *scene, const char *extension, import_output *output,
                        import_refusal *refusal);

#endif
