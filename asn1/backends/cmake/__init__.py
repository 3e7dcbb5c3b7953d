"""Output format cmake: the C sources as a CMake package.

Face: form.
"""
