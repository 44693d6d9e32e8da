/* Whether --memory kept images from the pixel error that was asked for, and the sentence that says so. */
#ifndef STRL_CLI_COARSE_H
#define STRL_CLI_COARSE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Over all frames. Zero-initialise. */
typedef struct strl_cli_coarse {
    uint64_t frames;        /* all */
    uint64_t coarse_frames; /* of them, those drawn coarser than asked because memory was full */
    double asked_px;        /* of the worst of them, as the two below */
    double allowed_px;      /* what the walk could hold */
    double drawn_px;        /* largest of what was drawn; infinite where the eye was inside a node's box */
} strl_cli_coarse;

/* One frame: what was asked for, as --error and --splat (less counts as --error), what the walk allowed where --error
 * was asked for (more where its budget is tight) and what was drawn. */
void strl_cli_coarse_add(strl_cli_coarse *coarse, double error_px, double splat_px, double allowed_px, double drawn_px);
/* One sentence on standard error where there was such a frame; a warning, so not for --quiet. */
void strl_cli_coarse_report(const strl_cli_coarse *coarse, uint64_t memory_bytes);

#ifdef __cplusplus
}
#endif
#endif
