"""captain encode --example, with the built message library."""

import pytest

from firmware import cli
from tests.asn1.codec import captain_messages


def test_encode_example_with_fields_prints_the_octets_of_the_message(capsys):
    assert cli.main(["encode", "--example", "cam-1.4.1", "speed=13.9", "latitude=48.76", "station=4711"]) == 0
    cam = captain_messages.find("cam-1.4.1")
    made = cam.decode(bytes.fromhex(capsys.readouterr().out))
    assert made == cam.example(speed=13.9, latitude=48.76, station=4711)


def test_encode_example_with_to_json_prints_what_encode_reads(capsys, tmp_path):
    assert cli.main(["encode", "--example", "denm-2.3.1", "cause=94", "-o", str(tmp_path / "denm.json")]) == 0
    assert cli.main(["encode", str(tmp_path / "denm.json")]) == 0
    octets = bytes.fromhex(capsys.readouterr().out)
    assert captain_messages.find("denm-2.3.1").decode(octets) == captain_messages.example("denm-2.3.1", cause=94)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["camm"], "captain: --example: unknown edition 'camm'"),
        (["cam", "speed"], "captain: --example: 'speed': invalid field"),
        (["cam", "speed=200"], "speedValue: out of range: 200 is not in 0..163.82 m/s"),
        (["cam", "sped=1"], "captain: --example: sped: is no name in cam-1.4.1; did you mean speed?"),
        (["denm-2.3.1", "termination=isCancellation"], "breaks a constraint of DenmPayload"),
    ],
)
def test_encode_example_with_an_invalid_argument_names_it(capsys, words, said):
    assert cli.main(["encode", "--example", *words]) == 1
    out, err = capsys.readouterr()
    assert said in err
    assert not out
