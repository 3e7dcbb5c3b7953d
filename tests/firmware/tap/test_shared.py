"""Shared subscriptions of a real broker: copies divide what comes, and miss nothing."""

import signal

import pytest

from tests.broker.fixtures import Brokers
from tests.broker.mosquitto import Mosquitto
from tests.firmware.tap.copies import Copy, numbered, publish, wait_for

COUNT = 600


def options(broker: Mosquitto, *more: str) -> tuple[str, ...]:
    return ("--url", broker.plain_url, "--profile", "raw", "--json", *more)


def all_numbers(copies: list[Copy], count: int) -> list[int]:
    """Wait until together they have so many lines, end them, and return what they printed."""
    wait_for(copies, count)
    for copy in copies:
        assert copy.end()[0] == 0
    return sorted(number for copy in copies for number in copy.numbers)


@pytest.mark.parametrize("many", [2, 3])
def test_copies_divide_the_load_and_each_message_comes_to_exactly_one(brokers: Brokers, many: int) -> None:
    broker = brokers()
    copies = [Copy(*options(broker)) for _ in range(many)]
    writer = brokers.client(broker, "writer")
    try:
        publish(writer, 0, COUNT)

        assert all_numbers(copies, COUNT) == list(range(COUNT))
        # mosquitto takes turns; whoever reads faster may have a few more.
        assert all(len(copy.numbers) > COUNT / many / 2 for copy in copies)
    finally:
        for copy in copies:
            copy.__exit__()


def test_without_a_group_every_copy_has_everything(brokers: Brokers) -> None:
    broker = brokers()
    with Copy(*options(broker, "--group", "")) as one, Copy(*options(broker, "--group", "")) as two:
        publish(brokers.client(broker, "writer"), 0, 20)
        one.wait_for(20)
        two.wait_for(20)
        assert one.numbers == two.numbers == list(range(20))


def test_groups_do_not_share_with_each_other(brokers: Brokers) -> None:
    broker = brokers()
    with Copy(*options(broker, "--group", "a")) as one, Copy(*options(broker, "--group", "b")) as two:
        publish(brokers.client(broker, "writer"), 0, 20)
        one.wait_for(20)
        two.wait_for(20)


def test_a_copy_that_leaves_loses_nothing_of_what_it_was_given(brokers: Brokers) -> None:
    broker = brokers()
    writer = brokers.client(broker, "writer")
    with Copy(*options(broker)) as stays, Copy(*options(broker)) as leaves:
        publish(writer, 0, 200)
        code, said = leaves.end()  # whatever it has read by now
        publish(writer, 200, 200)
        left = leaves.numbers
        stays.wait_for(400 - len(left))
        assert code == 0
        assert f"{len(left)} messages in" in said
        assert left
        assert sorted(stays.numbers + left) == list(range(400))


def test_a_copy_that_comes_later_takes_its_share(brokers: Brokers) -> None:
    broker = brokers()
    writer = brokers.client(broker, "writer")
    with Copy(*options(broker)) as first:
        publish(writer, 0, 50)
        first.wait_for(50)
        with Copy(*options(broker)) as second:
            publish(writer, 50, 100)
            second.wait_for(1)
            first.wait_for(150 - 50)
            assert all_numbers([first, second], 150) == list(range(150))


def test_a_copy_that_is_killed_has_its_share_when_it_comes_back_to_its_session(brokers: Brokers) -> None:
    broker = brokers()
    writer = brokers.client(broker, "writer")
    session = ("--client-id", "kept", "--session-expiry-s", "60")
    with Copy(*options(broker)) as other:
        with Copy(*options(broker, *session)) as killed:
            killed.end(signal.SIGKILL)
        broker.says("Client kept closed its connection")
        publish(writer, 0, 40)
        with Copy(*options(broker, *session)) as back:
            assert all_numbers([other, back], 40) == list(range(40))
            assert len(back.numbers) == 20


def test_what_the_count_leaves_over_is_told(brokers: Brokers) -> None:
    broker = brokers()
    with Copy(*options(broker, "--count", "10")) as one:
        writer = brokers.client(broker, "writer")
        publish(writer, 0, 40)
        one.wait_for(10)
        code, said = one.result()
        assert code == 0
        assert one.numbers == list(range(10))
        assert "10 messages in" in said


def test_numbered_messages_are_told_apart() -> None:
    assert numbered(1) != numbered(256)
