"""C and C++ of a layout: headers, code, tables, list of messages, runtime.

Face: form, names, defaults, limits, tables.
"""
