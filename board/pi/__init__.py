"""Raspberry Pi: its models, and lines of config.txt that add devices."""
