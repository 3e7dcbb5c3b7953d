"""How etsi_its_messages calls things: the packages that ROS 2 users have. A rule a function.

Names and types of fields go into the hash (RIHS01) that two nodes compare before they talk, so a rule that is wrong by
a letter keeps old nodes, bags and displays out. Source of every rule: the released .msg files of etsi_its_messages
3.5.0; tests/asn1/ros2 compares the hashes of all of them.
"""

import re

from asn1.ros2 import RosError

# Words that a field may not be called in C++ or Python. etsi_its_messages has a name for two; ours follow a rule.
_RESERVED = {"class": "cls", "long": "lon"}
_WORDS = frozenset(
    """and as asm assert async auto await bool break case catch char const continue def default del delete do double
    elif else enum except explicit export extern finally float for friend from global goto if import in inline int is
    lambda mutable namespace new nonlocal not operator or pass private protected public raise register return short
    signed sizeof static struct switch template this throw try typedef typeid typename union unsigned using virtual void
    volatile while with xor yield""".split()  # noqa: SIM905 a list of quoted words says it less well
)
_WORD_START = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Za-z0-9])(?=[A-Z][a-z])")
_UNSIGNED = (("uint8", 2**8), ("uint16", 2**16), ("uint32", 2**32), ("uint64", 2**64))
_SIGNED = (("int8", 2**7), ("int16", 2**15), ("int32", 2**31), ("int64", 2**63))


def type_name(name: str) -> str:
    """Of a message: no `-`, no `_`, a capital first; an `A` before what begins with no letter (3... -> A3...)."""
    plain = name.replace("-", "").replace("_", "")
    plain = plain[:1].upper() + plain[1:]
    return plain if plain[:1].isalpha() else f"A{plain}"


def file_name(message: str) -> str:
    """What rosidl calls the files of a message: StationID and StationId would have the same ones.

    Source: rosidl_pycommon, convert_camel_case_to_lower_case_underscore.
    """
    words = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", message)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", words).lower()


def field_name(name: str) -> str:
    """Lower case, `_` where a word begins: referenceXYPosition -> reference_xy_position, alt-000-01 -> alt_000_01."""
    snake = _snake(name)
    return _RESERVED.get(snake) or (f"{snake}_field" if snake in _WORDS else snake)


def constant_name(name: str, prefix: str = "") -> str:
    """Upper case of the same; with a prefix, of the name that both make, so that CO2value of it becomes CO2_VALUE."""
    upper = _snake(name).upper()
    return _snake(f"{_snake(prefix).upper()}_{upper}").upper() if prefix else upper


def _snake(name: str) -> str:
    words = _WORD_START.sub("_", name.replace("-", "_"))
    return re.sub("_+", "_", words).lower()


def integer_type(low: int | None, high: int | None) -> str:
    """The smallest type for a range, unsigned before signed; int64 where an end is open.

    Raises RosError where no type of ROS 2 holds it.
    """
    if low is None or high is None:
        return "int64"
    if low >= 0:
        fitting = [name for name, count in _UNSIGNED if high < count]
    else:
        fitting = [name for name, count in _SIGNED if -count <= low and high < count]
    if not fitting:
        raise RosError(f"no integer of ROS 2 holds {low}..{high}")
    return fitting[0]
