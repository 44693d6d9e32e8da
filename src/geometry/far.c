#include "geometry/far.h"

#include <math.h>

#include "geometry/colour.h"
#include "geometry/octahedral.h"

double strl_hidden_share(double area, double seen, double along)
{
    return along * fmin(seen, 1) + (1 - along) * (1 - exp(-area / 2));
}

/* normal: as long as the faces are parallel. */
static void add_face(strl_far_sums *sums, double area, uint32_t rgba, const double normal[3])
{
    sums->area += area;
    for (unsigned k = 0; k < 3; k++)
        sums->linear[k] += area * (double)strl_srgb_decode(rgba >> 8 * k & 255);
    sums->linear[3] += area * (rgba >> 24) / 255;
    double side = sums->normal[0] * normal[0] + sums->normal[1] * normal[1] + sums->normal[2] * normal[2];
    for (int k = 0; k < 3; k++)
        sums->normal[k] += (side < 0 ? -area : area) * normal[k];
}

void strl_far_add(strl_far_sums *sums, const strl_far *far)
{
    float normal[3];
    strl_oct_decode(far->normal, normal);
    double length = 1 - 0.5 * far->spread / STRL_SPREAD_MOST;
    add_face(sums, (double)far->area, far->rgba,
             (const double[3]){length * (double)normal[0], length * (double)normal[1], length * (double)normal[2]});
}

strl_far strl_far_end(const strl_far_sums *sums)
{
    strl_far far = {.area = (float)fmin(sums->area, 0x1p126)}; /* stays a number when it is added up again */
    float normal[3];
    if (!(sums->area > 0))
        return (strl_far){0};
    double square = 0;
    for (unsigned k = 0; k < 3; k++) {
        normal[k] = (float)(sums->normal[k] / sums->area);
        square += (double)normal[k] * (double)normal[k];
    }
    far.spread = (uint8_t)lrint(STRL_SPREAD_MOST * fmin(fmax(2 - 2 * sqrt(square), 0), 1));
    for (unsigned k = 0; k < 3; k++)
        far.rgba |= strl_srgb_encode((float)(sums->linear[k] / sums->area)) << 8 * k;
    far.rgba |= (uint32_t)lrint(255 * sums->linear[3] / sums->area) << 24;
    strl_oct_encode(normal, far.normal);
    return far;
}

static double triangle_area(const strl_pm *mesh, const uint16_t corner[3], double normal[3])
{
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)mesh->position[corner[1]][k] - mesh->position[corner[0]][k];
        b[k] = (double)mesh->position[corner[2]][k] - mesh->position[corner[0]][k];
    }
    for (int k = 0; k < 3; k++)
        normal[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    for (int k = 0; k < 3; k++)
        normal[k] = length > 0 ? normal[k] / length : 0;
    return length / 2;
}

/* The finest ones. What they hide tells how large the faces are: of parallel ones as much, of others half. */
static void add_splats(strl_far_sums *sums, const strl_brick_head *head)
{
    for (uint32_t i = head->level_count > 1 ? head->splat_end[head->level_count - 2] : 0; i < strl_brick_splats(head);
         i++) {
        const strl_splat *splat = &head->splat[i];
        double length = fmax(splat->parallel / 255.0, 0.5),
               area = ldexp(splat->coverage / 255.0, 2 * splat->side) / length;
        float line[3];
        strl_splat_line(splat, line);
        add_face(sums, area, splat->rgba,
                 (const double[3]){length * (double)line[0], length * (double)line[1], length * (double)line[2]});
    }
}

/* Samples of a brick are few; its splats are means of all that is below. */
strl_far strl_far_of_mesh(const strl_pm *mesh, const strl_brick_head *head)
{
    strl_far_sums sums = {0}, splats = {0};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        double normal[3], area = triangle_area(mesh, mesh->triangle[t], normal);
        uint32_t v = mesh->triangle[t][0];
        uint32_t material = mesh->palette[mesh->palette_index ? mesh->palette_index[v] : 0].rgba;
        add_face(&sums, area, strl_rgba_multiply(mesh->colour ? mesh->colour[v] : UINT32_MAX, material), normal);
    }
    add_splats(&splats, head);
    return strl_far_end(splats.area > sums.area ? &splats : &sums);
}

strl_far strl_far_place(const strl_far *far, const double transform[12], double stretch)
{
    strl_far placed = *far;
    float before[3], after[3];
    strl_oct_decode(far->normal, before);
    for (int row = 0; row < 3; row++)
        after[row] = (float)(transform[4 * row] * (double)before[0] + transform[4 * row + 1] * (double)before[1] +
                             transform[4 * row + 2] * (double)before[2]);
    if (isfinite(fabsf(after[0]) + fabsf(after[1]) + fabsf(after[2])))
        strl_oct_encode(after, placed.normal);
    placed.area = (float)fmin((double)far->area * stretch * stretch, 0x1p126);
    return placed;
}
