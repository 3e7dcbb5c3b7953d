"""The card of the box: one reproducible image that boots by itself into a routing station."""
