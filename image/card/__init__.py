"""Card as a whole: build, flash, verification and release.

Face: build, figures, flash, keys, release, twice.
"""
