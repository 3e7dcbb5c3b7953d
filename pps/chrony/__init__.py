"""chronyd interface: configuration, feed and tracking.

Face: configuration, feed, tracking.
"""
