"""Card of a box: one reproducible image that boots into a routing station."""
