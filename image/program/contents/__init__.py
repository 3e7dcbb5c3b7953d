"""Contents of a frozen program: archives, byte code and layers.

Face: archives, bytecode, layers.
"""
