"""Layout of the schema's types: bits of the encoding, and place in memory.

Face: nodes, memory, widths, layout.
"""
