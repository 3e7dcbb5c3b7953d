"""UBX, the protocol of u-blox receivers: frames, messages, configuration.

Face: ubx, messages, values, keys, health, time.
"""
