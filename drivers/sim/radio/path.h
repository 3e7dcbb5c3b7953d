/* Received power of a frame, from free-space loss, buildings in the path, and fading. */
#ifndef PATH_H
#define PATH_H

#include <stdbool.h>

#include "settings.h"
#include "v2xcast.h"

/* Returns the loss in dB between two positions, without fading.
 *
 * Free-space loss at 5.9 GHz (H. T. Friis, 1946): 20 log10(4 pi d f / c), d at least 1 m. Each building adds 9 dB per
 * wall that the straight line crosses and 0.4 dB per metre inside: C. Sommer, D. Eckhoff, R. German and F. Dressler,
 * A Computationally Inexpensive Empirical Model of IEEE 802.11p Radio Shadowing in Urban Environments, WONS 2011. Both
 * numbers are those of Veins for buildings. Heights are ignored.
 */
double path_loss_db(const struct settings *settings, struct position from, struct position to);

/* Returns the received power in dBm from a transmitter at `from`; normal is a random number of mean 0 and standard
 * deviation 1, for fading. */
double path_power_dbm(const struct settings *settings, struct position from, double normal);

#endif
