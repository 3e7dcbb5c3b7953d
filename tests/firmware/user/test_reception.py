from pathlib import Path

from firmware.user import reception

GATEWAY = Path(__file__).resolve().parents[3] / "firmware/gateway/captain_gateway_msgs/msg/Metadata.msg"


def test_the_definition_is_that_of_the_gateway():
    lines = (line.partition("#")[0].strip() for line in GATEWAY.read_text(encoding="utf-8").splitlines())
    assert reception.DEFINITION.splitlines() == [line for line in lines if line]
