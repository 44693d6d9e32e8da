#include "coarse.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "options.h"

/* The eye inside a node's box has no pixel error at all, at any budget: then only what the walk allowed tells. */
static double worth_px(double allowed_px, double drawn_px)
{
    return isfinite(drawn_px) ? drawn_px : allowed_px;
}

void strl_cli_coarse_add(strl_cli_coarse *coarse, double error_px, double splat_px, double allowed_px, double drawn_px)
{
    const double asked_px = fmax(error_px, splat_px);
    coarse->frames++;
    if (!(allowed_px > error_px) || !(drawn_px > asked_px))
        return;
    coarse->coarse_frames++;
    double worst = coarse->coarse_frames > 1 ? worth_px(coarse->allowed_px, coarse->drawn_px) / coarse->asked_px : 0;
    if (worth_px(allowed_px, drawn_px) / asked_px < worst)
        return;
    coarse->asked_px = asked_px;
    coarse->allowed_px = allowed_px;
    coarse->drawn_px = drawn_px;
}

static void format_px(char text[32], double px)
{
    snprintf(text, 32, px < 1000 ? "%.3g" : "%.0f", px);
}

void strl_cli_coarse_report(const strl_cli_coarse *coarse, uint64_t memory_bytes)
{
    char memory[32], asked[32], worst[32];
    if (coarse->coarse_frames == 0)
        return;
    strl_cli_format_scaled(memory, (double)memory_bytes, 1024);
    format_px(asked, coarse->asked_px);
    format_px(worst, worth_px(coarse->allowed_px, coarse->drawn_px));
    fprintf(stderr,
            "stroll: --memory %s holds too little for a pixel error of %s: %" PRIu64 " of %" PRIu64
            " frame%s coarser, with errors up to %s pixels%s\n",
            memory, asked, coarse->coarse_frames, coarse->frames, coarse->frames == 1 ? " is" : "s are", worst,
            isfinite(coarse->drawn_px) ? "" : " where the eye is not inside a node's box");
}
