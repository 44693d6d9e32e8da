/* One plane that cuts the model open: what lies on the side of its normal is not drawn. */
#ifndef STRL_VIEWER_SECTION_H
#define STRL_VIEWER_SECTION_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct strl_section {
    bool on;
    double normal[3]; /* unit */
    double offset;    /* dot(normal, p) of the plane's points */
} strl_section;

/* Normal along an axis (0 to 2), through the middle of bounds. */
void strl_section_by_axis(strl_section *section, unsigned axis, const double bounds[6]);
/* Through a point of a surface, with its normal: cuts off what is in front. */
void strl_section_by_normal(strl_section *section, const double point[3], const double normal[3]);
/* Through three points; the side of `eye` is cut off. False, and the section as it was, where they are in line. */
bool strl_section_by_points(strl_section *section, const double points[3][3], const double eye[3]);
void strl_section_flip(strl_section *section);
/* The offsets between which the plane meets the bounds. */
void strl_section_range(const strl_section *section, const double bounds[6], double range[2]);
/* Moves along the normal by a share of that range, and no farther than its ends. */
void strl_section_move(strl_section *section, const double bounds[6], double share);
/* As strl_draw_options want it; zero while off. */
void strl_section_plane(const strl_section *section, double plane[4]);

#ifdef __cplusplus
}
#endif
#endif
