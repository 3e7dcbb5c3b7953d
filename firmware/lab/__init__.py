"""Test bench with stations and drivers: starts them as children, watches and stops them.

Face: copies, laboratory, ports.
Commands: lab, demo.
"""
