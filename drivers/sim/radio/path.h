/* How strong a frame arrives: free space, buildings in the way, fading. */
#ifndef PATH_H
#define PATH_H

#include <stdbool.h>

#include "settings.h"
#include "v2xcast.h"

/* Loss in dB between two places, without fading.
 *
 * Free space at 5.9 GHz (H. T. Friis, 1946): 20 log10(4 pi d f / c), d at least 1 m. Each building adds 9 dB for each
 * of its walls that the straight line cuts and 0.4 dB for each metre inside: C. Sommer, D. Eckhoff, R. German and
 * F. Dressler, A Computationally Inexpensive Empirical Model of IEEE 802.11p Radio Shadowing in Urban Environments,
 * WONS 2011; the two numbers are those that Veins has for buildings. Heights do not count.
 */
double path_loss_db(const struct settings *settings, struct position from, struct position to);

/* dBm at the radio of what a place sends; normal is a random number of mean 0 and deviation 1. */
double path_power_dbm(const struct settings *settings, struct position from, double normal);

#endif
