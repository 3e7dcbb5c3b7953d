"""captain listen: what a station's users receive, counted per type and station."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence

from board.errors import StationError
from firmware.user import client
from firmware.user.arguments import add_station, address, message_type, seconds, times
from firmware.user.received import Message, Pairing
from firmware.user.table import Screen, Table
from firmware.user.tally import HEADS, Tally, cells

DESCRIPTION = """\
Listens to a station as any user's program does, and shows for each type and
station (stationID of the ITS PDU header): how many messages, how many a
second, their sizes, the last signal strength where the interface knows it,
and how long ago the last one came. Payloads are not decoded.

On a terminal the table stays in place; elsewhere the stations heard in the
last second are printed every second, and all of them at the end. At most 256 rows are kept: those silent
longest are folded into the row `others`.
"""
EPILOG = """\
examples:
  captain listen                            everything, until Ctrl-C
  captain listen --type denm --count 1      wait for one DENM
  captain listen --json --duration 60 >log  a minute of messages
  captain listen --json | captain send - --station 127.0.0.1:5565
                                            one station sends on what another
                                            one receives
JSON, one object a line:
  type, station_id, message_id, protocol_version, octets, hex
        of the PDU; null where it is too short
  received (Unix time in s), rssi_dbm, data_rate (500 kbit/s), traffic_class,
  hop_limit, source_mac, security, latitude, longitude (degrees)
        of the interface, as RawRxMessage has them; absent without one

exit codes:
  0    the count or the duration is reached
  1    no station answers
  2    wrong usage
  130  Ctrl-C
"""
# A glance at a table tells no more; each costs the drawing of it.
REDRAW_S = 0.5


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object a line for each message")
    parser.add_argument(
        "--type",
        metavar="T",
        action="append",
        type=message_type,
        default=[],
        help="only this type (cam, denm, ...), or this messageID (200); may be repeated",
    )
    parser.add_argument("--count", metavar="N", type=times, help="end after so many messages")
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after so many seconds")
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    place = address(arguments)
    with client.session() as context:
        # Everything, where all types are wanted: what a station should not publish is to be seen as well.
        # A messageID has whatever name the station gives it.
        types = [f"v2x.{kind}." if isinstance(kind, str) else "v2x." for kind in arguments.type]
        topics = ["hb.", "raw.", *types] if types else [""]
        subscriber = client.subscribe(context, place, place.to_users, *topics)
        listening = Listening(subscriber, place, arguments.type, arguments.count, arguments.duration)
        if arguments.json:
            _print_json(listening)
        else:
            _show_table(listening)
    return 0


class Listening:
    """Messages of one subscription until a count, a duration, or a station that is not there.

    wanted  names or messageIDs of the types; all when empty.

    messages() calls `idle` at least every REDRAW_S, so that a table can be drawn while nothing comes.
    """

    def __init__(
        self,
        subscriber: client.Socket,
        place: client.Address,
        wanted: Sequence[str | int],
        most: int | None,
        for_s: float | None,
    ) -> None:
        self.pairing = Pairing()
        self.place = place
        self.started = self.heard = time.monotonic()
        self._subscriber = subscriber
        self._wanted = frozenset(wanted)
        self._most = most
        self._end = self.started + for_s if for_s is not None else None

    def messages(self, idle: Callable[[], None]) -> Iterator[Message]:
        count = 0
        wake = time.monotonic() + REDRAW_S
        while self._end is None or time.monotonic() < self._end:
            until = wake if self._end is None else min(wake, self._end)
            self._subscriber.poll(max(0, round((until - time.monotonic()) * 1000)) + 1)
            for frames in client.waiting(self._subscriber):
                self.heard = time.monotonic()
                message = self.pairing.feed(frames)
                if message is None or not self._is_wanted(message):
                    continue
                yield message
                count += 1
                if count == self._most:
                    return
            if time.monotonic() >= wake:
                self._check()
                idle()
                wake = time.monotonic() + REDRAW_S

    def _is_wanted(self, message: Message) -> bool:
        return not self._wanted or not self._wanted.isdisjoint((message.type, message.message_id))

    @property
    def silent_s(self) -> float:
        """Seconds without even a heartbeat; 0 while the station is there."""
        silent = time.monotonic() - self.heard
        return silent if silent > client.ANSWER_S else 0.0

    def _check(self) -> None:
        """What never said anything is no station; one that fell silent may come back: ZeroMQ reconnects."""
        if self.silent_s and self.heard == self.started:
            raise StationError(
                f"what listens at {self.place.host}:{self.place.to_users} sends no heartbeat",
                "is that where a station's users subscribe? name the port with --to-users PORT",
            )


def _print_json(listening: Listening) -> None:
    told = False

    def idle() -> None:
        nonlocal told
        if (listening.silent_s > 0) != told:
            told = not told
            print("captain: no heartbeat, waiting" if told else "captain: heartbeat again", file=sys.stderr)

    for message in listening.messages(idle):
        print(json.dumps(described(message)), flush=True)


def described(message: Message) -> dict[str, object]:
    """A message as `--json` prints it: header fields of the PDU, and what the interface knew."""
    pdu = message.pdu
    found: dict[str, object] = {
        "type": message.type,
        "station_id": message.station_id,
        "message_id": message.message_id,
        "protocol_version": pdu[0] if pdu else None,
        "octets": len(pdu),
    }
    if message.raw is not None:
        rx = message.raw.rx
        found |= {
            "received": message.raw.received_ns // 1000 / 1e6,
            "rssi_dbm": rx.rssi_dbm or None,  # RawRxMessage has 0 where it is not known
            "data_rate": rx.data_rate,
            "traffic_class": rx.traffic_class,
            "hop_limit": rx.hop_limit,
            "source_mac": rx.source_mac.hex(":"),
            "security": rx.security.status.name.lower(),
            "latitude": rx.position.latitude / 1e7,
            "longitude": rx.position.longitude / 1e7,
        }
    return found | {"hex": pdu.hex()}


def _show_table(listening: Listening) -> None:
    tally = Tally()
    with Screen() as screen:
        tick = Tick(tally, screen, listening)
        for message in listening.messages(tick):
            tally.add(message, time.monotonic())
        tick.draw(time.monotonic(), is_last=True)
    print(f"{tally.total} messages in {time.monotonic() - listening.started:.1f} s")


class Tick:
    """Draws the table: often on a terminal, the rows that changed every second elsewhere."""

    def __init__(self, tally: Tally, screen: Screen, listening: Listening) -> None:
        self._tally = tally
        self._screen = screen
        self._listening = listening
        self._marked = time.monotonic()

    def __call__(self) -> None:
        now = time.monotonic()
        is_due = now - self._marked >= 1.0
        if is_due or self._screen.is_terminal:
            self.draw(now)
        if is_due:
            self._tally.mark(now)
            self._marked = now

    def draw(self, now: float, is_last: bool = False) -> None:
        most = max(1, self._screen.height - 4)
        rows = self._tally.rows(most)
        if not (self._screen.is_terminal or is_last):
            rows = [row for row in rows if row.last >= self._marked]
        self._screen.show([Table(self._title(now), HEADS, [cells(row, now) for row in rows])])

    def _title(self, now: float) -> str:
        place, pairing = self._listening.place, self._listening.pairing
        parts = [
            time.strftime("%H:%M:%S"),
            f"{place.host}:{place.to_users}",
            f"{self._tally.total} messages in {now - self._listening.started:.0f} s",
        ]
        if pairing.rubbish:
            parts.append(f"{pairing.rubbish} unreadable (last {pairing.sample.hex()})")
        if self._listening.silent_s:
            parts.append(f"no heartbeat for {self._listening.silent_s:.0f} s")
        return "  ".join(parts)
