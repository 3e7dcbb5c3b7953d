"""Output formats of a schema: C, C++, Python module, ROS 2 packages, pages, ASN.1 text.

Face: backend, registry, asn, c, ros2.
"""
