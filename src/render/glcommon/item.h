/* What a shader needs to know of one item, computed in double and 64-bit integers. */
#ifndef STRL_RENDER_GLCOMMON_ITEM_H
#define STRL_RENDER_GLCOMMON_ITEM_H

#include <stdint.h>

#include "render/renderer.h"

/* 128 bytes, as node.vert.glsl reads them. */
typedef struct strl_gl_item {
    /* 0-2: cells from the reference (or model units from the origin) to view space, w the offset; 3-5: normals to
     * view space, w a linear debug colour or -1 */
    float rows[6][4];
    int32_t base[2][4]; /* anchor - reference cell, low and high words; base[0][3] flags */
} strl_gl_item;

/* Remembers the work that items of one placement share. Zero-initialise for each draw. */
typedef struct strl_gl_placing {
    bool valid;
    strl_positions positions;
    double origin[3], step, transform[12];
    int64_t reference[3]; /* the lattice cell next to the eye */
    bool mirrors;         /* counter-clockwise becomes clockwise */
    strl_gl_item shared;  /* rows, without debug colour */
} strl_gl_placing;

void strl__gl_item_make(strl_gl_placing *placing, const strl_draw_setup *setup, const strl_draw_item *item,
                        strl_gl_item *out);

#endif
