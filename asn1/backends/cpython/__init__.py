"""Python module captain_messages: its C sources and its build.

Face: form.
"""
