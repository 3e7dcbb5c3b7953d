"""Link meter: matches reports of stations to determine the fate of each message.

Commands: meter.
"""
