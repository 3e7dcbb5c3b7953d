"""Registry of output formats by their name on the command line.

Each module below imports its generator only when it writes, so that `captain-asn1 list` starts fast.
"""

from asn1.backends.asn.form import AsnText
from asn1.backends.backend import Backend
from asn1.backends.c.form import Sources
from asn1.backends.cmake.form import CMakePackage
from asn1.backends.cpython.form import PYTHON, WHEEL
from asn1.backends.docs.form import Pages
from asn1.backends.ros2.form import RosPackages

# The menu shows them in this order.
BACKENDS: dict[str, Backend] = {
    "cmake": CMakePackage(),
    "sources": Sources(),
    "python": PYTHON,
    "wheel": WHEEL,
    "docs": Pages(),
    "asn": AsnText(),
    "ros2": RosPackages(),
}
