"""Updates of a box: fetched, checked, written to the other slot, taken back.

Commands: update.
"""
