#include "readers/srgb.h"

#include <math.h>

static double to_linear(double encoded)
{
    return encoded <= 0.04045 ? encoded / 12.92 : pow((encoded + 0.055) / 1.055, 2.4);
}

/* Codes change half way between them. */
void strl__srgb_init(strl__srgb *srgb)
{
    for (unsigned code = 0; code < 256; code++)
        srgb->linear[code] = to_linear(code / 255.);
    for (unsigned code = 0; code < 255; code++)
        srgb->thresholds[code] = to_linear((code + 0.5) / 255);
}

uint8_t strl__srgb_encode(const strl__srgb *srgb, double linear)
{
    unsigned code = 0;
    if (linear != linear)
        return 255;
    for (unsigned step = 128; step; step /= 2)
        if (linear >= srgb->thresholds[code + step - 1])
            code += step;
    return (uint8_t)code;
}
