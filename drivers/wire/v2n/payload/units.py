"""Units of ASN.1 types in Vanetza-NAP's JSON, with special values.

Source: vanetza/asn1/rj/transformations/jer_transformations.gperf of nap-it/vanetza-nap (2026), compared with its
examples/out_*.json. For types without a row, the JSON has the ASN.1 integer. Examples are every enumeration, and
Wgs84AngleValue of the heading in a VAM and in a DENM of release 2. TimestampIts is in seconds since 2004, as a
fraction.

A row has the name of the type, ASN.1 units per SI unit, and special values. Special values are not converted: 800001
is an unknown altitude, not 8000.01 m.
"""

UNITS: dict[str, tuple[float, frozenset[int]]] = {
    name: (scale, frozenset(themselves))
    for name, scale, *themselves in (
        ("Latitude", 1e7, 900_000_001),
        ("Longitude", 1e7, 1_800_000_001),
        ("DeltaLatitude", 1e7, 131_072),
        ("DeltaLongitude", 1e7, 131_072),
        ("AltitudeValue", 100, 800_001),
        ("DeltaAltitude", 100, -12_700, 12_799, 12_800),
        ("SensorHeight", 100),
        ("SpeedValue", 100, 16_383),
        ("SpeedValueExtended", 100, 16_383),
        ("VelocityComponentValue", 100, 16_383),
        ("SpeedConfidence", 100, 126, 127),
        ("HeadingValue", 10, 3601),
        ("HeadingConfidence", 10, 126, 127),
        ("CartesianAngleValue", 10, 3601),
        ("AngleConfidence", 10, 127),
        ("AccelerationValue", 10, 161),
        ("LongitudinalAccelerationValue", 10, 161),
        ("LateralAccelerationValue", 10, 161),
        ("VerticalAccelerationValue", 10, 161),
        ("AccelerationConfidence", 10, 102),
        ("YawRateValue", 100, 32_767),
        ("DistanceValue", 100),
        ("DistanceConfidence", 100, 101, 102),
        ("CartesianCoordinate", 100),
        ("CartesianCoordinateLarge", 100),
        ("CoordinateConfidence", 100, 4096),
        ("VehicleLengthValue", 10, 1023),
        ("VehicleWidth", 10, 61, 62),
        ("ObjectDimensionValue", 10),
        ("SemiRangeLength", 10),
        ("Radius", 10),
        ("SteeringWheelAngleValue", 0.667, 512),
        ("TimestampIts", 1000),
        ("TransmissionInterval", 1000),
        ("SemiAxisLength", 100, 4094, 4095),
        ("StandardLength12b", 10),
    )
}
