"""User of the proof: a program that sends or receives by the Python client until its parent ends it.

usage: python -m tests.proof.client.user blocking-send|blocking-listen|asyncio ADDRESS COUNT RATE

ADDRESS  of the station, as captain_client.Station takes it.
COUNT    requests to send; stationID of their CAMs: 1 to COUNT.
RATE     requests per second.

A CAM is counted. A DENM of stationID READY tells that the subscription works; one of stationID END ends the program. Prints
`ready`, then a JSON object: `outcomes` by stationID, `received` stationIDs, `missed`.
"""

import asyncio
import json
import sys
import time
from collections import deque
from collections.abc import Iterator

from captain_client import Message, RefusedError, Sent, Station, StationError, aio

READY, END = 0xF000_0001, 0xF000_0002
OPEN = 100  # most open requests of a program: half a second of them
CONFIRM_S = 5.0  # timeout of a confirm; longer than a restart


class Count:
    """Received CAMs of one program."""

    def __init__(self) -> None:
        self.received: list[int] = []
        self._is_ready = False

    def is_end(self, message: Message) -> bool:
        """Count a message. Return True if it is the last one."""
        if message.type == "cam":
            self.received.append(message.station or 0)
        elif message.station == READY and not self._is_ready:
            self._is_ready = True
            print("ready", flush=True)
        return message.station == END


def name_of(error: StationError) -> str:
    """Return the name of an error; with its reason, if the station refused the request."""
    return f"{type(error).__name__} {error.reason}" if isinstance(error, RefusedError) else type(error).__name__


def moments(count: int, rate: float) -> Iterator[tuple[int, float]]:
    """Yield stationID and seconds to wait for each request."""
    start = time.monotonic()
    for number in range(count):
        yield number + 1, max(0.0, start + number / rate - time.monotonic())


def blocking_send(box: Station, count: int, rate: float) -> dict[int, str]:
    outcomes: dict[int, str] = {}
    waiting: deque[tuple[int, Sent]] = deque()

    def finish_one() -> None:
        number, sent = waiting.popleft()
        try:
            sent.confirmed(CONFIRM_S)
            outcomes[number] = "confirmed"
        except StationError as error:
            outcomes[number] = name_of(error)

    print("ready", flush=True)
    for number, pause in moments(count, rate):
        time.sleep(pause)
        try:
            waiting.append((number, box.send("cam", station=number)))
        except StationError as error:
            outcomes[number] = name_of(error)
        if len(waiting) > OPEN:
            finish_one()
    while waiting:
        finish_one()
    return outcomes


def blocking_listen(box: Station) -> tuple[list[int], int]:
    count = Count()
    for message in box.listen("cam", "denm"):
        if count.is_end(message):
            break
    return count.received, box.missed


async def asyncio_user(box: aio.Station, count: int, rate: float) -> tuple[dict[int, str], list[int], int]:
    """Send and receive at once. The requests begin with the first DENM."""
    outcomes: dict[int, str] = {}
    counted = Count()
    few = asyncio.Semaphore(OPEN)

    async def request(number: int) -> None:
        try:
            sent = await box.send("cam", station=number)
            await sent.confirmed(CONFIRM_S)
            outcomes[number] = "confirmed"
        except StationError as error:
            outcomes[number] = name_of(error)
        finally:
            few.release()

    async def send() -> None:
        async with asyncio.TaskGroup() as tasks:
            for number, pause in moments(count, rate):
                await asyncio.sleep(pause)
                await few.acquire()
                tasks.create_task(request(number))

    sending = None
    async for message in box.listen("cam", "denm"):
        is_end = counted.is_end(message)
        sending = sending or asyncio.create_task(send())
        if is_end:
            break
    if sending is not None:
        await sending
    return outcomes, counted.received, box.missed


async def _asyncio(address: str, count: int, rate: float) -> tuple[dict[int, str], list[int], int]:
    async with aio.Station(address) as box:
        return await asyncio_user(box, count, rate)


def main(form: str, address: str, count: int, rate: float) -> None:
    outcomes: dict[int, str] = {}
    received: list[int] = []
    missed = 0
    if form == "asyncio":
        outcomes, received, missed = asyncio.run(_asyncio(address, count, rate))
    else:
        with Station(address) as box:
            if form == "blocking-send":
                outcomes = blocking_send(box, count, rate)
            else:
                received, missed = blocking_listen(box)
    print(json.dumps({"outcomes": outcomes, "received": received, "missed": missed}))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4]))
