/* sRGB codes and linear light, by tables that a reader holds. */
#ifndef STRL_READERS_SRGB_H
#define STRL_READERS_SRGB_H

#include <stdint.h>

typedef struct strl__srgb {
    double linear[256];     /* of each code */
    double thresholds[255]; /* linear light from where the code is one more */
} strl__srgb;

void strl__srgb_init(strl__srgb *srgb);
/* The nearest code in sRGB. Not a number: 255. */
uint8_t strl__srgb_encode(const strl__srgb *srgb, double linear);

#endif
