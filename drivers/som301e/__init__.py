"""Driver for the Unex SOM301-E, and its worker process with the vendor's library.

Face: driver, options, process, shared_library.
"""
