"""Names of messages, fields and constants, by the rules of etsi_its_messages.

Names and types of fields go into the hash (RIHS01) that two nodes compare. One wrong letter in a rule excludes old
nodes, bags and displays. Source of every rule: the released .msg files of etsi_its_messages 3.5.0;
tests/asn1/backends/ros2 compares the hashes of all of them.
"""

import re

from asn1.backends.ros2.model import RosError

# Keywords of C++ or Python cannot be names of fields. etsi_its_messages renames two of them; the others get the suffix
# _field.
_RESERVED = {"class": "cls", "long": "lon"}
_WORDS = frozenset(
    """and as asm assert async auto await bool break case catch char const continue def default del delete do double
    elif else enum except explicit export extern finally float for friend from global goto if import in inline int is
    lambda mutable namespace new nonlocal not operator or pass private protected public raise register return short
    signed sizeof static struct switch template this throw try typedef typeid typename union unsigned using virtual void
    volatile while with xor yield""".split()  # noqa: SIM905 quotes around each word would hide them
)
_WORD_START = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Za-z0-9])(?=[A-Z][a-z])")
_UNSIGNED = (("uint8", 2**8), ("uint16", 2**16), ("uint32", 2**32), ("uint64", 2**64))
_SIGNED = (("int8", 2**7), ("int16", 2**15), ("int32", 2**31), ("int64", 2**63))


def type_name(name: str) -> str:
    """Return the name of a message: without `-` and `_`, and with a capital first.

    A name that begins with a digit gets the prefix `A`.
    """
    plain = name.replace("-", "").replace("_", "")
    plain = plain[:1].upper() + plain[1:]
    return plain if plain[:1].isalpha() else f"A{plain}"


def file_name(message: str) -> str:
    """Return the name that rosidl gives to a message's files. It is the same for StationID and StationId.

    Source: rosidl_pycommon, convert_camel_case_to_lower_case_underscore.
    """
    words = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", message)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", words).lower()


def field_name(name: str) -> str:
    """Return a name in snake case: referenceXYPosition -> reference_xy_position, alt-000-01 -> alt_000_01."""
    snake = _snake(name)
    return _RESERVED.get(snake) or (f"{snake}_field" if snake in _WORDS else snake)


def constant_name(name: str, prefix: str = "") -> str:
    """Return a name in upper snake case, with a prefix.

    Prefix and name are split into words together: CO2value with a prefix ends in CO2_VALUE.
    """
    upper = _snake(name).upper()
    return _snake(f"{_snake(prefix).upper()}_{upper}").upper() if prefix else upper


def _snake(name: str) -> str:
    words = _WORD_START.sub("_", name.replace("-", "_"))
    return re.sub("_+", "_", words).lower()


def integer_type(low: int | None, high: int | None) -> str:
    """Return the smallest type for a range, unsigned before signed; int64 for an open end.

    Raises RosError if no type of ROS 2 is large enough.
    """
    if low is None or high is None:
        return "int64"
    if low >= 0:
        fitting = [name for name, count in _UNSIGNED if high < count]
    else:
        fitting = [name for name, count in _SIGNED if -count <= low and high < count]
    if not fitting:
        raise RosError(f"no integer type of ROS 2 has the range {low}..{high}")
    return fitting[0]
