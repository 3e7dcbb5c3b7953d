"""Codec commands: decode, encode and explain messages with the message library.

Face: library, reading, decoding, encoding, identify, writing.
Commands: decode, encode, convert, explain, listen, demo, replay.
"""
