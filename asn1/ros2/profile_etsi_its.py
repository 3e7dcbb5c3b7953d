"""Profile etsi_its: messages that are of one type with those of etsi_its_messages (MIT licence), 3.5.0.

Same package, same names, same fields in the same order: then the hashes (RIHS01) are the same, and nodes, bags and
displays that know those messages know ours. Editions that it does not carry have packages of their own, by the same
rules: captain_<message>_<version>_msgs.

What the standard has and these messages have not: regional extensions (`RosMessage.left_out`), NULL, and whether an
extension addition is there that is not OPTIONAL in itself (they have no flag for it).
"""

from collections.abc import Iterator, Sequence

from asn1.ros2 import RosError
from asn1.ros2.etsi_its_fields import EtsiItsFields, Older, message_name
from asn1.ros2.fields import require_apart, require_finite
from asn1.ros2.model import RosMessage, RosPackage
from asn1.selection import reached
from asn1.types import Definition, Message, Reference, Schema

NAME = "etsi_its"

# Editions that etsi_its_messages 3.5.0 carries. Its VAM is TS 103 300-3 v2.2.1, of which no modules are given: every
# type of v2.1.1 has the same fields.
PACKAGES = {
    "cam-1.4.1": "etsi_its_cam_msgs",
    "cam-2.1.1": "etsi_its_cam_ts_msgs",
    "cpm-2.1.1": "etsi_its_cpm_ts_msgs",
    "denm-1.3.1": "etsi_its_denm_msgs",
    "denm-2.2.1": "etsi_its_denm_ts_msgs",
    "ivim-2.1.1": "etsi_its_ivim_ts_msgs",
    "mapem-2.1.1": "etsi_its_mapem_ts_msgs",
    "spatem-2.1.1": "etsi_its_spatem_ts_msgs",
    "vam-2.1.1": "etsi_its_vam_ts_msgs",
}

# etsi_its_cpm_ts_msgs is made with TS 102 894-2 v2.1.1, ours with v2.4.1.
OLDER = {
    "cpm-2.1.1": {
        ("EllipticalShape", "orientation"): Older("orientation", "Wgs84AngleValue"),
        ("RectangularShape", "shapeReferencePoint"): Older("centerPoint"),
        ("RectangularShape", "orientation"): Older("orientation", "Wgs84AngleValue"),
        ("RadialShape", "horizontalOpeningAngleStart"): Older(
            "stationaryHorizontalOpeningAngleStart", "Wgs84AngleValue"
        ),
        ("RadialShape", "horizontalOpeningAngleEnd"): Older("stationaryHorizontalOpeningAngleEnd", "Wgs84AngleValue"),
    }
}


def package_name(edition: str) -> str:
    """Of the package that holds an edition's messages: cam-2.3.1 is captain_cam_2_3_1_msgs."""
    words = edition.lower().replace("-", "_").replace(".", "_")
    return PACKAGES.get(edition) or f"captain_{words}_msgs"


def packages(schema: Schema, editions: Sequence[Message]) -> list[RosPackage]:
    """A package for each edition."""
    return [package(schema, edition) for edition in editions]


def package(schema: Schema, edition: Message) -> RosPackage:
    """All messages that the PDU of an edition reaches; of a DENM every subcause as well, though no field is one.

    Raises RosError where a message would hold itself, which no .msg can say.
    """
    waiting = [edition.pdu]
    if edition.type == "denm":
        waiting += _subcauses(schema, edition)
    messages: dict[str, RosMessage] = {}
    while waiting:
        reference = waiting.pop()
        name = message_name(reference)
        if name in messages:
            _require_same(messages[name], schema.resolve(reference))
            continue
        fields = EtsiItsFields(schema, reference, OLDER.get(edition.name, {}))
        messages[name] = fields.message()
        waiting += fields.reached
    tops = {edition.name: message_name(edition.pdu)}
    made = RosPackage(package_name(edition.name), NAME, (edition,), tops, dict(sorted(messages.items())))
    require_finite(made)
    require_apart(made)
    return made


def _require_same(message: RosMessage, definition: Definition) -> None:
    """Two elements of one name, in two modules, are one message only where they are the same."""
    if message.definition is not definition and message.definition != definition:
        raise RosError(f"{message.name}: two types are called so, and they are not the same")


def _subcauses(schema: Schema, edition: Message) -> Iterator[Reference]:
    for key in sorted(reached(schema, {edition.pdu.module})):
        for name in schema.modules[key].definitions:
            if name.endswith("SubCauseCode"):
                yield Reference(module=key, name=name)
