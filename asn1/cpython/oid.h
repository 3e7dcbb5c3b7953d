/* Object identifiers: content octets (X.690 8.19, 8.20) to "1.3.6.1" and back. */
#ifndef CAPTAIN_OID_H
#define CAPTAIN_OID_H

#include <stdbool.h>
#include <stddef.h>

/* False: malformed, an arc beyond 64 bits, or longer than `size`. */
bool oid_text(const unsigned char *octets, size_t count, bool is_relative, char *text, size_t size);
/* Number of octets written; 0: no identifier, or longer than `size`. */
size_t oid_octets(const char *text, size_t length, bool is_relative, unsigned char *octets, size_t size);

#endif
