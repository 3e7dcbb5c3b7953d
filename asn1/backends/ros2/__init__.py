"""ROS 2 message packages from the schema.

Face: form, options, cdr, plan, profiles.
"""
