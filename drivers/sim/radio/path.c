#define _GNU_SOURCE /* M_PI */
#include "path.h"

#include <math.h>

static const double FREQUENCY_HZ = 5.9e9, LIGHT_M_S = 299792458.0;
static const double CUT_DB = 9.0, INSIDE_DB_M = 0.4;
static const double DEGREE_M = 111319.5; /* metres per degree of latitude, and per degree of longitude at the equator */

struct point {
    double east, north; /* metres from the origin, the receiving radio */
};

static struct point seen_from(struct position origin, struct position place)
{
    double narrowed = cos(origin.latitude * 1e-7 * M_PI / 180);
    return (struct point){
        .east = ((double)place.longitude - origin.longitude) * 1e-7 * DEGREE_M * narrowed,
        .north = ((double)place.latitude - origin.latitude) * 1e-7 * DEGREE_M,
    };
}

/* Clips a line from 0 to `to` between two bounds of one axis: narrows first and last, shares of its length. */
static void clip(double to, double bound, double other, double *first, double *last)
{
    double low = fmin(bound, other), high = fmax(bound, other);
    if (to == 0) {
        if (low >= 0 || high <= 0)
            *last = -1; /* the line is at right angles to the axis, outside of the bounds */
        return;
    }
    *first = fmax(*first, fmin(low / to, high / to));
    *last = fmin(*last, fmax(low / to, high / to));
}

/* Returns the loss by a building. Liang and Barsky, 1984: the line is inside between first and last of its length. */
static double building_db(const struct building *building, struct position origin, struct point to, double length)
{
    struct point one = seen_from(origin, building->corner), other = seen_from(origin, building->opposite);
    double first = -INFINITY, last = INFINITY;
    clip(to.east, one.east, other.east, &first, &last);
    clip(to.north, one.north, other.north, &first, &last);
    double begin = fmax(first, 0), end = fmin(last, 1);
    if (begin >= end)
        return 0;
    int cuts = (first > 0) + (last < 1);
    return cuts * CUT_DB + (end - begin) * length * INSIDE_DB_M;
}

double path_loss_db(const struct settings *settings, struct position from, struct position to)
{
    struct point way = seen_from(to, from);
    double length = hypot(way.east, way.north);
    double loss = 20 * log10(4 * M_PI * fmax(length, 1) * FREQUENCY_HZ / LIGHT_M_S);
    for (size_t at = 0; length > 0 && at < settings->building_count; at++)
        loss += building_db(&settings->buildings[at], to, way, length);
    return loss;
}

double path_power_dbm(const struct settings *settings, struct position from, double normal)
{
    struct position here = {settings->latitude, settings->longitude};
    return settings->power - path_loss_db(settings, from, here) + settings->fading * normal;
}
