/* One triangle against others: an upper bound of how far any of its points is from them.
 *
 * The distance to one triangle is convex. So where a triangle is divided into convex fragments and each is given to one
 * of the others, the largest distance of a fragment's corners from the triangle it was given to bounds that of all its
 * points, however the division was made: rounding, and a division that is not clever, cost tightness and never the
 * bound. Fragments are cut along the prisms over the others, all in one direction, as overlays of height fields are
 * (Cohen, Manocha and Olano 1997); what no prism holds is halved until it is near enough to one of them (branch and
 * bound). */
#ifndef STRL_GEOMETRY_COVER_H
#define STRL_GEOMETRY_COVER_H

#include <stdbool.h>
#include <stdint.h>

#define STRL_FRAGMENT_MAX 12u
#define STRL_COVER_MAX 1024u

/* A triangle, which may be a line or a point. */
typedef struct strl_facet {
    double corner[3][3];
    double least[3], most[3]; /* its box */
    double claim;             /* how far what it stands for may be: added to every distance from it */
} strl_facet;

/* A convex piece of a triangle. */
typedef struct strl_fragment {
    uint32_t count;
    double corner[STRL_FRAGMENT_MAX][3];
} strl_fragment;

/* The prism over a facet in some direction: inside is where inward . x >= offset for each edge. */
typedef struct strl_prism {
    double inward[3][3], offset[3];
    double slack[3]; /* what sticks out by less is not worth a cut */
    bool is_flat;    /* it has no inside */
} strl_prism;

typedef struct strl_cover {
    const strl_facet *by;
    const uint32_t *pick;     /* [count] which of them; NULL = the first `count` */
    const strl_prism *prisms; /* over the facets, along `along`; NULL = made when needed */
    uint32_t count;           /* up to STRL_COVER_MAX */
    const double *along;      /* direction of the prisms, of any length; NULL = the triangle's normal */
    double enough;            /* a bound so large is good enough: no nearer facet is looked for */
    /* Told of each fragment and the facet it was given to. May be NULL. */
    void (*take)(void *context, uint32_t by, const strl_fragment *fragment);
    void *context;
} strl_cover;

/* Sets corners and box. */
void strl_facet_set(strl_facet *facet, const double a[3], const double b[3], const double c[3]);
/* Twice the area along the normal. */
void strl_facet_normal(const strl_facet *facet, double normal[3]);
/* Squared distance of a point, without the claim. */
double strl_facet_distance2(const strl_facet *facet, const double p[3]);

/* The mean of its corners. */
void strl_facet_middle(const strl_facet *facet, double middle[3]);
/* Whether all corners of `other`, and so all its points, are within `reach` of the facet, without claims; *distance:
 * how far the farthest is, set where they are. */
bool strl_facet_is_near(const strl_facet *facet, const strl_facet *other, double reach, double *distance);

/* along: of any length. */
void strl_prism_set(strl_prism *prism, const strl_facet *facet, const double along[3]);

/* No point of the triangle is further from the facets, claims added, than this. INFINITY without facets. Allocates
 * nothing. */
double strl_cover_bound(const strl_facet *triangle, const strl_cover *cover);

#endif
