"""Both clients with a double of a station: restarts, malformed confirms, use after close."""

import asyncio
import gc
import math
import os
import re
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Any, TypeVar

import pytest

from captain_client import Station, StationError, UnconfirmedError, UnreachableError, aio
from tests.firmware.captain_client.cpp.double import Double
from tests.firmware.captain_client.test_reception import PDU, TOLD
from tests.system.station import PATIENCE

T = TypeVar("T")

SETTLED_MS = 500  # libzmq connects again after at most 200 ms


def answered(call: Callable[[], T], answer: Callable[[], object]) -> T:
    """Return the result of a call of the client, which the double answers meanwhile."""
    with ThreadPoolExecutor(1) as pool:
        result = pool.submit(call)
        answer()
        return result.result()


def welcomed(double: Double, connect: Callable[[], T]) -> T:
    return answered(connect, double.welcome)


async def welcomed_soon(double: Double, connect: Awaitable[T]) -> T:
    return (await asyncio.gather(connect, asyncio.to_thread(double.welcome)))[0]


def connected(double: Double) -> Station:
    return welcomed(double, lambda: Station(double.address))


@asynccontextmanager
async def connected_soon(double: Double) -> AsyncIterator[aio.Station]:
    box = aio.Station(double.address)
    await welcomed_soon(double, box.__aenter__())
    try:
        yield box
    finally:
        await box.close()


def restart(double: Double) -> None:
    double.stop()
    double.start_again("run-2")


def confirm_as_sent(double: Double, label: str) -> None:
    double.confirm(label, "accepted", interfaces=["g5"])
    double.confirm(label, "sent", interface="g5")


def welcome_late(double: Double) -> None:
    """Answer the connection of a client after a pause, in which it must not send."""
    assert double.takes_nothing(SETTLED_MS)
    double.welcome()


def publish_cam_after_subscription(double: Double, sequence: int) -> None:
    double.wait_for_subscription("message.cam.")
    double.publish("message.cam.", TOLD | {"run": double.run, "sequence": sequence}, PDU)


# -- restarts


@pytest.mark.parametrize("rounds", [1, 2])
def test_first_message_after_a_restart_waits_for_a_status_and_is_confirmed(double: Double, rounds: int):
    with connected(double) as box:
        for _ in range(rounds):
            restart(double)
            sent = answered(lambda: box.send("cam", PDU), lambda: welcome_late(double))
            confirm_as_sent(double, sent.label)
            assert sent.confirmed().sent == ("g5",)


def test_asyncio_first_messages_after_a_restart_wait_for_a_status_and_are_confirmed(double: Double):
    async def send(box: aio.Station) -> tuple[str, ...]:
        sent = await box.send("cam", PDU)
        confirm_as_sent(double, sent.label)
        return (await sent.confirmed()).sent

    async def use() -> list[Any]:
        async with connected_soon(double) as box:
            restart(double)
            return await asyncio.gather(send(box), send(box), asyncio.to_thread(welcome_late, double))

    assert asyncio.run(use()) == [("g5",), ("g5",), None]


def test_message_after_a_restart_without_a_status_raises_unreachable_until_one_comes(double: Double):
    with welcomed(double, lambda: Station(double.address, timeout_s=SETTLED_MS / 1000)) as box:
        restart(double)
        for _ in range(2):
            with pytest.raises(UnreachableError):
                box.send("cam", PDU)
        assert double.takes_nothing(0)
        double.publish_status()
        assert box.send("cam", PDU).label


def test_second_interruption_while_a_message_waits_for_a_status_needs_a_further_status(double: Double):
    with connected(double) as box, ThreadPoolExecutor(1) as pool:
        restart(double)
        sending = pool.submit(box.send, "cam", PDU)
        interrupt_again(double)
        double.publish_status()
        assert double.takes_nothing(SETTLED_MS)
        double.publish_status()
        assert double.take()[2]["label"] == sending.result(PATIENCE).label


def test_asyncio_second_interruption_while_a_message_waits_for_a_status_needs_a_further_status(double: Double):
    def answer() -> str:
        interrupt_again(double)
        double.publish_status()
        assert double.takes_nothing(SETTLED_MS)
        double.publish_status()
        return str(double.take()[2]["label"])

    async def use() -> bool:
        async with connected_soon(double) as box:
            restart(double)
            sent, label = await asyncio.gather(box.send("cam", PDU), asyncio.to_thread(answer))
            return sent.label == label

    assert asyncio.run(use())


def interrupt_again(double: Double) -> None:
    assert double.takes_nothing(SETTLED_MS)
    double.stop_taking()
    double.take_again()
    assert double.takes_nothing(SETTLED_MS)


def test_asyncio_message_that_waits_for_a_status_when_the_client_is_closed_gets_a_station_error(double: Double):
    async def use() -> Any:
        async with connected_soon(double) as box:
            restart(double)
            sending = asyncio.ensure_future(box.send("cam", PDU))
            await asyncio.sleep(SETTLED_MS / 1000)
        (error,) = await asyncio.wait_for(asyncio.gather(sending, return_exceptions=True), PATIENCE)
        return error

    error = asyncio.run(use())
    assert isinstance(error, StationError)
    assert not isinstance(error, UnreachableError)


def test_restart_before_the_first_message_counts_the_messages_of_the_new_run(double: Double):
    with connected(double) as box:
        cams = welcomed(double, lambda: box.listen("cam", timeout_s=PATIENCE))
        restart(double)
        cam = answered(lambda: next(cams), lambda: publish_cam_after_subscription(double, 3))
        assert (cam.missed, box.missed) == (2, 2)


def test_asyncio_restart_before_the_first_message_counts_the_messages_of_the_new_run(double: Double):
    async def use() -> tuple[int, int]:
        async with connected_soon(double) as box:
            cams = await welcomed_soon(double, box.listen("cam", timeout_s=PATIENCE).__aenter__())
            restart(double)
            answer = asyncio.to_thread(publish_cam_after_subscription, double, 3)
            cam, _ = await asyncio.gather(anext(cams), answer)
            return cam.missed, box.missed

    assert asyncio.run(use()) == (2, 2)


# -- malformed confirms


def test_malformed_confirm_raises_nothing_in_send(double: Double):
    with connected(double) as box:
        double.confirm(box.send("cam", PDU).label, "accepted", interfaces=7)
        sent = box.send("cam", PDU)
        confirm_as_sent(double, sent.label)
        assert sent.confirmed().sent == ("g5",)


def test_asyncio_reader_goes_on_after_a_malformed_confirm(double: Double):
    async def use() -> tuple[str, ...]:
        async with connected_soon(double) as box:
            double.confirm((await box.send("cam", PDU)).label, "accepted", interfaces=7)
            sent = await box.send("cam", PDU)
            confirm_as_sent(double, sent.label)
            return (await sent.confirmed()).sent

    assert asyncio.run(use()) == ("g5",)


# -- arguments

ADDRESSES: list[Any] = [5555, None, ("127.0.0.1", 5555), b":5555"]
TIMES: list[Any] = ["3", math.nan, math.inf, 1e300, -5, True]


@pytest.mark.parametrize("client", [Station, aio.Station])
def test_station_with_an_argument_of_a_wrong_type_names_it_with_its_value(client: Any):
    async def use(*arguments: Any, **options: Any) -> None:
        client(*arguments, **options)

    for address in ADDRESSES:
        with pytest.raises(ValueError, match=f"^address: {re.escape(repr(address))} is not"):
            asyncio.run(use(address))
    for timeout_s in [*TIMES, None]:
        with pytest.raises(ValueError, match=f"^timeout_s: {re.escape(repr(timeout_s))} is not"):
            asyncio.run(use(timeout_s=timeout_s))
    with pytest.raises(ValueError, match=r"^control: 7 is not"):
        asyncio.run(use(control=7))


def test_reports_with_an_argument_of_a_wrong_type_name_it_with_its_value(double: Double):
    async def use_soon() -> None:
        async with connected_soon(double) as box:
            use(box)

    def use(box: Any) -> None:
        for listen in (box.listen, box.indications, box.confirms, box.frames):
            with pytest.raises(ValueError, match=r"^types: \['cam'\] is not a text|^interfaces: \['cam'\] is not"):
                listen(["cam"])
            for timeout_s in TIMES:
                with pytest.raises(ValueError, match=f"^timeout_s: {re.escape(repr(timeout_s))} is not"):
                    listen("cam", timeout_s=timeout_s)

    with connected(double) as box:
        use(box)
    asyncio.run(use_soon())


@pytest.mark.parametrize("timeout_s", [*TIMES, None])
def test_confirmed_with_an_invalid_timeout_names_it(double: Double, timeout_s: Any):
    async def use() -> None:
        async with connected_soon(double) as box:
            await (await box.send("cam", PDU)).confirmed(timeout_s)

    with connected(double) as box, pytest.raises(ValueError, match=f"^timeout_s: {re.escape(repr(timeout_s))} is not"):
        box.send("cam", PDU).confirmed(timeout_s)
    with pytest.raises(ValueError, match=f"^timeout_s: {re.escape(repr(timeout_s))} is not"):
        asyncio.run(use())


# -- use in a child process


def test_use_of_a_client_in_a_child_process_raises_station_error(double: Double):
    with connected(double) as box:
        cams, sent = welcomed(double, box.listen), box.send("cam", PDU)
        uses: list[Callable[[], object]] = [lambda: box.send("cam", PDU), box.listen, cams.__next__, sent.confirmed]
        if (child := os.fork()) == 0:
            errors = 0
            for use in uses:
                try:
                    use()
                except StationError as error:
                    errors += "create a Station in each process" in str(error)
            os._exit(errors)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == len(uses)
        confirm_as_sent(double, sent.label)
        assert sent.confirmed().sent == ("g5",)


# -- use before the block, and without close

UNCLOSED = """
import asyncio, gc, sys
import captain_client
from captain_client import aio

class Ring:
    def __init__(self, box):
        self.box, self.ring = box, self

async def main():
    box = Ring(aio.Station(sys.argv[1])).box
    await box.__aenter__()
    await box.send("cam", bytes(8))

asyncio.run(main())
box = Ring(captain_client.Station(sys.argv[1])).box
box.ring = Ring(box.listen("cam"))
box.send("cam", bytes(8))
del box
gc.collect()
"""


def test_program_that_closes_no_client_ends(double: Double):
    command = [sys.executable, "-c", UNCLOSED, double.address]
    with subprocess.Popen(command) as child:
        for _ in range(3):
            double.welcome()
        try:
            assert child.wait(PATIENCE) == 0
        finally:
            child.kill()


def test_asyncio_send_before_the_block_says_to_use_it(double: Double):
    async def use() -> None:
        box = aio.Station(double.address)
        with pytest.raises(StationError, match="async with"):
            await box.send("cam", PDU)
        await box.close()

    asyncio.run(use())


# -- use after close

USES: dict[str, Callable[[Any], Any]] = {
    "send": lambda box: box.send("cam", PDU),
    "listen": lambda box: box.listen(),
    "status": lambda box: box.status(),
}


@pytest.mark.parametrize("use", USES)
@pytest.mark.filterwarnings("error")
def test_use_of_a_closed_client_raises_station_error(double: Double, use: str):
    with connected(double) as box:
        pass
    with pytest.raises(StationError, match="closed"):
        USES[use](box)
    gc.collect()


@pytest.mark.parametrize("use", USES)
@pytest.mark.filterwarnings("error")
def test_asyncio_use_of_a_closed_client_raises_station_error(double: Double, use: str):
    async def main() -> None:
        async with connected_soon(double) as box:
            pass
        with pytest.raises(StationError, match="closed"):
            await USES[use](box)

    asyncio.run(main())
    gc.collect()


def test_iterator_and_open_request_of_a_closed_client_raise_station_error(double: Double):
    with connected(double) as box:
        cams = welcomed(double, box.listen)
        sent = box.send("cam", PDU)
    with pytest.raises(StationError, match="closed"):
        next(cams)
    with pytest.raises(UnconfirmedError, match="closed"):
        sent.confirmed()


def test_asyncio_tasks_that_wait_when_the_client_is_closed_get_station_errors(double: Double):
    async def use() -> list[Any]:
        async with connected_soon(double) as box:
            cams = await welcomed_soon(double, box.listen("cam").__aenter__())
            sent = await box.send("cam", PDU)
            tasks = [asyncio.ensure_future(anext(cams)), asyncio.ensure_future(sent.confirmed())]
            await asyncio.sleep(0)
        return await asyncio.wait_for(asyncio.gather(*tasks, return_exceptions=True), PATIENCE)

    iterated, confirmed = asyncio.run(use())
    assert isinstance(iterated, StationError)
    assert isinstance(confirmed, UnconfirmedError)
