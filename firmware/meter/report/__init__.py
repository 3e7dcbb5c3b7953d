"""Output of a measurement: tables, plots, a map and a page.

Face: spots, page, text.
"""
