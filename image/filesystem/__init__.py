"""File trees, archives and file systems, made and read without root.

Face: disk, ext4, tree.
"""
