"""Owner's files on the card: checks them and writes the system's and station's files.

Face: store, owner, verdict.
"""
