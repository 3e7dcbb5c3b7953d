"""asyncio client with a station: many tasks, confirms, reports, errors."""

import asyncio
import itertools
import signal
from collections.abc import Awaitable, Callable
from typing import TypeVar

import pytest
import zmq.asyncio

from captain_client import RefusedError, UnconfirmedError, UnreachableError
from captain_client.aio import Station
from tests.firmware.captain_client.places import address_of
from tests.system.air import Air
from tests.system.conftest import Bench, Launcher
from tests.system.ports import Ports
from tests.system.station import PATIENCE
from tests.system.user import mark

T = TypeVar("T")


@pytest.fixture(scope="module")
def bench(launch_shared: Launcher) -> Bench:
    return launch_shared(station={"id": 4711, "position": {"latitude": 48.7668, "longitude": 11.4321}})


@pytest.fixture
def air(bench: Bench) -> Air:
    return bench.settled().air


def run(bench: Bench, use: Callable[[Station], Awaitable[T]], timeout_s: float = 3.0) -> T:
    """Run a coroutine with a client of the station."""

    async def main() -> T:
        async with Station(address_of(bench), timeout_s=timeout_s, control=str(bench.station.control)) as box:
            return await use(box)

    return asyncio.run(main())


def test_messages_of_many_tasks_are_confirmed(bench: Bench, air: Air):
    async def send(box: Station) -> tuple[str, ...]:
        return (await (await box.send("cam", mark())).confirmed()).sent

    async def use(box: Station) -> list[tuple[str, ...]]:
        return await asyncio.gather(*(send(box) for _ in range(300)))

    assert run(bench, use) == [("g5",)] * 300
    assert len({air.hear().pdu for _ in range(300)}) == 300


def test_messages_that_are_sent_just_before_the_end_of_the_program_reach_the_air(bench: Bench, air: Air):
    pdus = [mark() for _ in range(100)]

    async def use(box: Station) -> None:
        for pdu in pdus:
            await box.send("cam", pdu)

    run(bench, use)
    assert [air.hear().pdu for _ in pdus] == pdus


def test_message_by_short_names_that_is_out_of_range_is_refused(bench: Bench):
    async def use(box: Station) -> None:
        await (await box.send("cam", speed=999.0)).confirmed()

    with pytest.raises(RefusedError) as refused:
        run(bench, use)
    assert [fault["value"] for fault in refused.value.invalid] == [999.0]


def test_message_that_is_sent_in_the_block_of_listen_is_received(bench: Bench, air: Air):
    pdus = [mark() for _ in range(1000)]

    async def use(box: Station) -> list[bytes]:
        async with box.listen("cam", timeout_s=0.5) as cams:
            for pdu in pdus:
                air.send(pdu)
            found = [cam.pdu async for cam in cams]
        assert box.missed == 0
        return found

    assert run(bench, use) == pdus


def test_listen_without_a_block_begins_with_the_first_message(bench: Bench, air: Air):
    async def use(box: Station) -> bytes:
        async def send() -> None:
            while True:
                air.send(mark())
                await asyncio.sleep(0.001)

        sender = asyncio.create_task(send())
        async for cam in box.listen("cam", timeout_s=PATIENCE):
            sender.cancel()
            return cam.pdu
        return b""

    assert run(bench, use)[:2] == b"\2\2"


def test_subscription_to_an_unknown_type_raises_value_error_when_it_begins(bench: Bench):
    async def block(box: Station) -> None:
        async with box.listen("camm"):
            raise AssertionError

    async def first_message(box: Station) -> None:
        await anext(box.indications("camm"))

    for use in (block, first_message):
        with pytest.raises(ValueError, match=r"'camm': unknown to the station; did you mean cam\?"):
            run(bench, use)


def test_reports_are_objects_of_the_station(bench: Bench, air: Air):
    async def use(box: Station) -> None:
        wait = {"timeout_s": PATIENCE}
        async with (
            box.indications("cam", **wait) as indications,
            box.confirms("cam", **wait) as confirms,
            box.frames("g5", **wait) as frames,
        ):
            air.send(pdu := mark())
            assert (await anext(indications))["station_id"] == int.from_bytes(pdu[2:6], "big")
            assert pdu in (await anext(frames)).octets
            sent = await box.send("cam", mark())
            assert (await anext(confirms))["label"] == sent.label
        assert (await box.status())["interfaces"]["g5"]["state"] == "up"
        assert (await box.time())["state"] == "system"

    run(bench, use)


def test_commands_reach_the_control_socket(bench: Bench):
    async def use(box: Station) -> None:
        await box.reload_policy()
        with pytest.raises(RefusedError, match="no recorder"):
            await box.trigger("near miss")

    run(bench, use)


def test_task_that_waits_for_a_message_can_be_cancelled(bench: Bench, air: Air):
    async def use(box: Station) -> bytes:
        async with box.listen("cam", timeout_s=PATIENCE) as cams:
            for _ in range(3):
                with pytest.raises(asyncio.TimeoutError):
                    await asyncio.wait_for(anext(cams), 0.01)
            air.send(pdu := mark())
            assert (await anext(cams)).pdu == pdu
            return pdu

    run(bench, use)


def test_poll_of_libzmq_that_returns_early_ends_no_wait(bench: Bench, air: Air, monkeypatch: pytest.MonkeyPatch):
    # Seen after a restart of the station: 60 of 691 requests raised UnreachableError before their timeout.
    poll, calls = zmq.asyncio.Socket.poll, itertools.count()

    def early(self: zmq.asyncio.Socket, *arguments: int) -> Awaitable[int]:
        return asyncio.sleep(0, 0) if next(calls) % 2 else poll(self, *arguments)

    monkeypatch.setattr(zmq.asyncio.Socket, "poll", early)

    async def use(box: Station) -> None:
        async with box.listen("cam", timeout_s=PATIENCE) as cams:
            for _ in range(20):
                air.send(pdu := mark())
                assert (await anext(cams)).pdu == pdu
                assert (await (await box.send("cam", mark())).confirmed()).sent == ("g5",)

    run(bench, use)
    for _ in range(20):
        air.hear()


def test_station_that_is_not_there_is_unreachable_within_the_timeout():
    ports = Ports()

    async def main() -> None:
        async with Station(f":{ports.take_row(4)[0]}", timeout_s=0.1):
            pass

    with pytest.raises(UnreachableError, match=r"Connection refused|Connect call failed"):
        asyncio.run(main())
    ports.release()


def test_restart_of_the_station_ends_its_open_requests_and_the_client_goes_on(launch: Launcher):
    bench = launch()

    async def use(box: Station) -> None:
        bench.station.signal(signal.SIGSTOP)  # the request reaches its socket and is never confirmed
        lost = await box.send("cam", mark())
        bench.station.kill()
        bench.station.start()
        with pytest.raises(UnconfirmedError, match="restarted"):
            await lost.confirmed(timeout_s=PATIENCE)
        assert (await (await box.send("cam", mark())).confirmed()).sent == ("g5",)

    run(bench, use)


def test_message_of_a_stopped_station_raises_unreachable(launch: Launcher):
    bench = launch()

    async def use(box: Station) -> None:
        bench.station.stop()
        await asyncio.gather(*(send_until_refused(box) for _ in range(3)))

    with pytest.raises(UnreachableError):
        run(bench, use, timeout_s=0.2)


async def send_until_refused(box: Station) -> None:
    while True:
        sent = await box.send("cam", mark())
        try:
            await sent.confirmed(timeout_s=0.1)
        except UnconfirmedError:
            continue


def test_close_with_unwritten_messages_does_not_block_the_event_loop(launch: Launcher):
    bench = launch()

    async def use() -> int:
        turns = 0

        async def turn() -> None:
            nonlocal turns
            while True:
                await asyncio.sleep(0.01)
                turns += 1

        async with Station(address_of(bench)) as box:
            bench.station.signal(signal.SIGSTOP)
            for _ in range(800):
                await box.send("cam", bytes(60_000))
            task = asyncio.create_task(turn())
        task.cancel()
        return turns

    try:
        assert asyncio.run(use()) > 1
    finally:
        bench.station.signal(signal.SIGCONT)
