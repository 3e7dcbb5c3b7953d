import io

from firmware.recordings.mcap import CHUNK_OCTETS, Mcap
from tests.firmware.client.mcap_file import read

SECOND = 1_000_000_000


def written(*messages, channels=("cam", "denm")):
    stream = io.BytesIO()
    mcap = Mcap(stream, "ros2", "test")
    numbers = [mcap.channel(f"{one}/received", f"a/msg/{one.upper()}", "uint8 a\n", {"k": "v"}) for one in channels]
    for place, ns, octets in messages:
        mcap.add(numbers[place], ns, octets)
    mcap.close()
    return stream.getvalue()


def test_a_recording_without_a_message_is_whole():
    found = read(written())
    assert found.messages == []
    assert found.summary.count(4) == 2


def test_messages_come_back_with_topic_type_definition_and_time():
    found = read(written((0, 5, b"one"), (1, 7, b"two"), (0, 9, b"three")))
    assert found.messages == [(1, 5, b"one"), (2, 7, b"two"), (1, 9, b"three")]
    assert found.channels[2] == ("denm/received", 2, "cdr")
    assert found.schemas[1] == ("a/msg/CAM", "ros2msg", "uint8 a\n")


def test_topics_of_one_type_share_its_definition():
    stream = io.BytesIO()
    mcap = Mcap(stream, "ros2", "test")
    for topic in "ab":
        mcap.add(mcap.channel(topic, "a/msg/A", "uint8 a\n", {}), 1, b"")
    mcap.close()
    found = read(stream.getvalue())
    assert list(found.schemas) == [1]
    assert [schema for _, schema, _ in found.channels.values()] == [1, 1]


def test_a_chunk_ends_by_time_and_by_size():
    assert read(written((0, 0, b"a"), (0, 3 * SECOND, b"b"), (0, 4 * SECOND, b"c"))).summary.count(8) == 2
    assert read(written(*[(0, ns, bytes(CHUNK_OCTETS // 2)) for ns in range(5)])).summary.count(8) == 3


def test_time_may_step_back():
    assert len(read(written((0, 9 * SECOND, b"a"), (0, SECOND, b"b"), (0, 2 * SECOND, b"c"))).messages) == 3


def test_what_has_come_is_in_the_file_before_it_is_closed():
    stream = io.BytesIO()
    mcap = Mcap(stream, "ros2", "test")
    mcap.add(mcap.channel("a", "a/msg/A", "uint8 a\n", {}), 1, b"octets of a message")
    assert b"octets of a message" not in stream.getvalue()
    mcap.flush()
    assert b"octets of a message" in stream.getvalue()


def test_a_flush_with_nothing_writes_nothing():
    stream = io.BytesIO()
    mcap = Mcap(stream, "ros2", "test")
    before = stream.getvalue()
    mcap.flush()
    assert stream.getvalue() == before
