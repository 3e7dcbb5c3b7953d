"""Events: EN 302 637-3 as `denm`, TS 103 831 as `denm_ts`, EN 302 637-3 V1.2.2 as `denm_v1`."""

from .kind import Kind, place

DENM = Kind(
    name="denm",
    editions=("denm-1.3.1", "denm-2.3.1", "denm-2.2.1", "denm-1.2.2"),
    position=(place("denm.management.eventPosition"),),
    generated=("denm.management.referenceTime",),
    clock="its",
    # The standards spell one field in two ways: originatingStationID until TS 103 831, originatingStationId since.
    key=(
        "denm.management.actionID.originatingStationID",
        "denm.management.actionId.originatingStationId",
        "denm.management.actionID.sequenceNumber",
        "denm.management.actionId.sequenceNumber",
    ),
)
DENM_TS = DENM._replace(name="denm_ts", editions=("denm-2.2.1", "denm-2.3.1", "denm-1.3.1"), is_usual=False)
DENM_V1 = DENM._replace(
    name="denm_v1", editions=("denm-1.2.2", "denm-1.3.1", "denm-2.3.1", "denm-2.2.1"), is_usual=False
)
