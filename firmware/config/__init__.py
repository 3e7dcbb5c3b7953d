"""Configuration: reads, checks and reloads captain.toml.

Face: captain_toml, tables, board_file, reload, registered, reload_child.
"""
