#include "viewer/section.h"

#include <math.h>
#include <string.h>

/* Of the sine between two sides: below it three points are in line. */
#define LEAST_SINE 1e-9

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void strl_section_by_axis(strl_section *section, unsigned axis, const double bounds[6])
{
    *section = (strl_section){.on = true};
    section->normal[axis % 3] = 1;
    section->offset = bounds[axis % 3] + (bounds[3 + axis % 3] - bounds[axis % 3]) / 2;
}

void strl_section_by_normal(strl_section *section, const double point[3], const double normal[3])
{
    double length = sqrt(dot(normal, normal));
    if (!(length > 0))
        return;
    section->on = true;
    for (int i = 0; i < 3; i++)
        section->normal[i] = normal[i] / length;
    section->offset = dot(section->normal, point);
}

bool strl_section_by_points(strl_section *section, const double points[3][3], const double eye[3])
{
    double a[3], b[3], to_eye[3], normal[3];
    for (int i = 0; i < 3; i++) {
        a[i] = points[1][i] - points[0][i];
        b[i] = points[2][i] - points[0][i];
        to_eye[i] = eye[i] - points[0][i];
    }
    for (int i = 0; i < 3; i++)
        normal[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    if (!(sqrt(dot(normal, normal)) > LEAST_SINE * sqrt(dot(a, a)) * sqrt(dot(b, b))))
        return false;
    strl_section_by_normal(section, points[0], normal);
    if (dot(section->normal, to_eye) < 0)
        strl_section_flip(section);
    return true;
}

void strl_section_flip(strl_section *section)
{
    for (int i = 0; i < 3; i++)
        section->normal[i] = -section->normal[i];
    section->offset = -section->offset;
}

void strl_section_range(const strl_section *section, const double bounds[6], double range[2])
{
    range[0] = range[1] = 0;
    for (int i = 0; i < 3; i++) {
        double a = section->normal[i] * bounds[i], b = section->normal[i] * bounds[3 + i];
        range[0] += fmin(a, b);
        range[1] += fmax(a, b);
    }
}

void strl_section_move(strl_section *section, const double bounds[6], double share)
{
    double range[2];
    strl_section_range(section, bounds, range);
    section->offset = fmin(fmax(section->offset + share * (range[1] - range[0]), range[0]), range[1]);
}

void strl_section_plane(const strl_section *section, double plane[4])
{
    memset(plane, 0, 4 * sizeof *plane);
    if (!section->on)
        return;
    memcpy(plane, section->normal, sizeof section->normal);
    plane[3] = section->offset;
}
