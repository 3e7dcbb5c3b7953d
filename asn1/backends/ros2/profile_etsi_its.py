"""Profile etsi_its: messages with the types of etsi_its_messages 3.5.0 (MIT licence).

Package, names, fields and their order are the same, and so are the hashes (RIHS01). Nodes, bags and displays for those
messages accept ours. Editions that etsi_its_messages lacks have packages of their own, by the same rules:
captain_<message>_<version>_msgs.

These messages have no field for regional extensions (`RosMessage.left_out`) and NULL. They have no presence flag for an
extension addition that is not OPTIONAL in itself.
"""

from collections.abc import Iterator, Sequence

from asn1.backends.ros2.etsi_its_fields import EtsiItsFields, Older, message_name
from asn1.backends.ros2.fields import require_apart, require_finite
from asn1.backends.ros2.model import RosError, RosMessage, RosPackage
from asn1.model.selection import reached
from asn1.model.types import Definition, Message, Reference, Schema

NAME = "etsi_its"

# Editions of etsi_its_messages 3.5.0, with their packages. Its VAM is TS 103 300-3 v2.2.1, for which no modules are
# available; every type of v2.1.1 has the same fields.
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

# Names and types of TS 102 894-2 v2.1.1, from which etsi_its_cpm_ts_msgs is generated. Our CPM uses v2.4.1.
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
    """Return the name of an edition's package: cam-2.3.1 is captain_cam_2_3_1_msgs."""
    words = edition.lower().replace("-", "_").replace(".", "_")
    return PACKAGES.get(edition) or f"captain_{words}_msgs"


def packages(schema: Schema, editions: Sequence[Message]) -> list[RosPackage]:
    """Return a package for each edition."""
    return [package(schema, edition) for edition in editions]


def package(schema: Schema, edition: Message) -> RosPackage:
    """Return the package of an edition, with all messages that its PDU contains.

    A DENM's package also has every subcause, although no field has these types.
    Raises RosError if a message would contain itself, which a .msg cannot express.
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
    """Raise RosError for two different types with the same name."""
    if message.definition is not definition and message.definition != definition:
        raise RosError(f"{message.name}: two different types have this name")


def _subcauses(schema: Schema, edition: Message) -> Iterator[Reference]:
    for key in sorted(reached(schema, {edition.pdu.module})):
        for name in schema.modules[key].definitions:
            if name.endswith("SubCauseCode"):
                yield Reference(module=key, name=name)
