"""captain meter: measures loss, order, delay and age of messages between stations."""

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from board.runtime.errors import UsageError
from firmware.client import client
from firmware.client.received import Pairing
from firmware.client.show.table import Screen, lines_for
from firmware.codec.library import load
from firmware.meter import recording, shows
from firmware.meter.arguments import RATE_HZ, add_options, check
from firmware.meter.event import PROBES
from firmware.meter.meter import Meter
from firmware.meter.probe import Probes
from firmware.meter.prober import Prober, Reflector
from firmware.meter.report import page
from firmware.meter.report.text import duration, tables
from firmware.meter.result import About, measured, result
from firmware.meter.session import Session, TimeLine
from firmware.meter.watch import status_fields
from firmware.meter.watch.station import Watch
from firmware.untrusted import within

DESCRIPTION = """\
Measures messages between stations: loss, duplicates, order, one-way delay,
round trip, age of information, gaps between receptions. It does so for each
direction from interface to interface, by type and station, and shows where
inside a station a delay is made. It changes no message. Messages are matched
by SHA-256 of their octets, so that any traffic will do: messages that stations
send anyway, or probes of the meter.

With two stations (--at twice) it measures between them; with one, its own hops.
Two recordings (`captain record --pcapng`) are measured in the same manner.
Averages are over intervals T (--interval) and over the whole.

A one-way delay needs two clocks of known accuracy, or one clock. It is given as
a value +- its accuracy. A round trip needs one clock only: `captain meter
--reflect` at the other end, and --round-trip here.

No message counts as lost before the grace time is over. If the meter itself
missed reports, messages are unseen, not lost.
"""
EPILOG = """\
examples:
  captain meter --at A=10.0.0.1 --at B=10.0.0.2
                              measure two stations, until Ctrl-C
  captain meter --at A=10.0.0.1 --at B=10.0.0.2 --report drive.html
                              also write a page, drive.json and drive.geojson
  captain meter --at A=10.0.0.1 --at B=10.0.0.2 --probe cam --count 6000
                              with probes of A, 10 a second
  captain meter --reflect     at the other end: send probes back, ...
  captain meter --at A=10.0.0.1 --probe cam --round-trip
                              ... and measure their round trip here
  captain meter a.pcapng b.pcapng
                              measure two recordings
  captain meter table1        ten messages between two stations of this machine
  captain meter table2        12,000 messages through two ROS 2 gateways: how to
  captain meter table3        10 Hz CAM, T = 1 s, round a block of houses, by
                              simulated radios

Ctrl-C or SIGTERM ends the measurement. The meter waits for messages under way,
then prints the result. A second signal ends the wait.

exit codes:
  0    measured; for table1 to table3, the measured loss equals the injected one
  1    no station answers; for table1 to table3, the two losses differ
  2    wrong usage
  130  ended before all stations were heard
"""

CUT = "The measurement was cut short: messages that were under way are not counted."
ENDING = (signal.SIGINT, signal.SIGTERM)


def arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser)


def main(arguments: argparse.Namespace) -> int:
    check(arguments)
    # A signal must print the result so far. SIGINT is set too, because shells start background jobs with SIGINT
    # ignored.
    for one in ENDING:
        signal.signal(one, signal.default_int_handler)
    if arguments.reflect:
        return _reflect(arguments)
    if arguments.what and arguments.what[0] in shows.SHOWS:
        shown = shows.SHOWS[arguments.what[0]](arguments.duration, arguments.interval)
        _tell(shown.result, arguments)
        print("\n".join(["", *shown.verdict]), file=sys.stderr if arguments.json else sys.stdout)
        return 0 if shown.is_right else 1
    _tell(_recordings(arguments) if arguments.what else _live(arguments), arguments)
    return 0


# -- measurement over the network


def _live(arguments: argparse.Namespace) -> dict[str, object]:
    line = TimeLine()
    sender = arguments.sender or arguments.at[0].name
    round_trips_of = sender if arguments.round_trip else ""
    meter = Meter(arguments.interval, arguments.grace, arguments.between, round_trips_of)
    session = Session(meter, line)
    with client.session() as context:
        for one in arguments.at:
            # With probes, all messages are read, because the time until delivery to users is measured.
            session.watch(one.name, one.place, context, is_whole=bool(arguments.probe))
        session.begin()
        _check_ends(meter)
        if arguments.probe:
            session.prober = _prober(arguments, context, session.watches)
        began_s = line()
        heard = f"captain: heard: {', '.join(one.name for one in arguments.at)}"
        with Screen(sys.stderr if arguments.json else None) as screen:

            def idle() -> None:
                if screen.is_terminal and not arguments.json:
                    screen.show(tables(result(meter, _about(session, began_s), session.prober, is_glance=True)))

            def waits() -> None:
                words = f"waiting for messages under way, at most {session.longest_end_s:g} s"
                print(f"captain: {words}; Ctrl-C ends the wait", file=sys.stderr, flush=True)

            with _stopped_by_signals(session):
                print(heard, file=sys.stderr, flush=True)
                session.run(arguments.duration, idle, waits)
        about = _about(session, began_s)
        if session.is_cut:
            about = about._replace(notes=(*about.notes, CUT))
        return result(meter, about, session.prober)


@contextmanager
def _stopped_by_signals(session: Session) -> Iterator[None]:
    def stop(_number: int, _frame: FrameType | None) -> None:
        session.stop()

    before = {one: signal.signal(one, stop) for one in ENDING}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


def _check_ends(meter: Meter) -> None:
    if strangers := meter.strangers():
        raise UsageError(f"--between: unknown interface: {', '.join(strangers)}", "write NAME:INTERFACE=NAME:INTERFACE")


def _prober(arguments: argparse.Namespace, context: client.Context, watches: Sequence[Watch]) -> Prober:
    watch = next(one for one in watches if arguments.sender in (None, one.name))
    known = within(watch.status, "interfaces")
    if strange := [name for name in arguments.interface or () if name not in known]:
        one_of = f"use one of {', '.join(known)}"
        raise UsageError(f"--interface: unknown to {watch.name}: {', '.join(strange)}", one_of)
    probes = Probes(load(), arguments.probe, arguments.size, time.time, status_fields.position_of(watch.status))
    return Prober(
        watch.name,
        context,
        watch.place,
        probes,
        rate=arguments.rate or RATE_HZ,
        most=arguments.count,
        options={} if arguments.interface is None else {"interfaces": arguments.interface},
    )


def _about(session: Session, began_s: float) -> About:
    ended_s = session.line() if session.ended_s is None else session.ended_s
    notes = []
    if (prober := session.prober) is not None:
        notes.append(
            f"{prober.name} sent {prober.count} probes ({prober.probes.kind}, {prober.probes.octets} octets, "
            f"{prober.rate:g} a second) with stationID {PROBES}"
        )
        watch = next(one for one in session.watches if one.name == prober.name)
        if session.ended_s is not None and not watch.own.is_over(prober.count):
            notes.append(f"{prober.name} did not report on all probes; check that its ports are of one station")
    stations = {watch.name: watch.told() for watch in session.watches}
    return About("link meter", "over the network", began_s, ended_s - began_s, stations, tuple(notes))


def _reflect(arguments: argparse.Namespace) -> int:
    place = arguments.at[0].place if arguments.at else client.Address()
    options = {} if arguments.interface is None else {"interfaces": arguments.interface}
    end = None if arguments.duration is None else time.monotonic() + arguments.duration
    with client.session() as context:
        reflector = Reflector(context, place, options)
        subscriber = client.subscribe(context, place, place.to_users, "")
        pairing = Pairing()
        print(f"captain: reflecting probes of {place.host}:{place.to_users}", file=sys.stderr, flush=True)
        with suppress(KeyboardInterrupt):
            while end is None or time.monotonic() < end:
                subscriber.poll(200)
                for frames in client.waiting(subscriber):
                    came_ns = time.monotonic_ns()
                    if (message := pairing.feed(frames)) is not None:
                        reflector.take(message, came_ns, time.monotonic_ns)
        stay_us = measured(reflector.stay_us)
    if arguments.json:
        counts = {"reflected": reflector.reflected, "not_reflected": reflector.not_reflected}
        print(json.dumps({**counts, "stay_us": stay_us}))
    else:
        print(f"{reflector.reflected} probes reflected; median time here: {duration(stay_us, 'median')}")
        if reflector.not_reflected:
            print(f"{reflector.not_reflected} probes not reflected: the station accepted no more messages")
    return 0


# -- measurement of recordings


def _recordings(arguments: argparse.Namespace) -> dict[str, object]:
    meter = Meter(arguments.interval, arguments.grace, arguments.between)
    one, other = (
        recording.read(Path(path), name, is_first=name == "A") for path, name in zip(arguments.what, "AB", strict=True)
    )
    laid = recording.measure(meter, one, other)
    _check_ends(meter)
    stations = {each.name: recording.told_of(each) for each in (one, other)}
    began_s = min(each.span[0] for each in (one, other))
    ended_s = max(each.span[1] for each in (one, other))
    about = About("link meter", "two recordings", began_s, ended_s - began_s, stations, tuple(laid.notes))
    return result(meter, about)


# -- output of the result


def _tell(measured: Mapping[str, object], arguments: argparse.Namespace) -> None:
    if arguments.json:
        print(json.dumps(measured), flush=True)
    else:
        print("\n\n".join("\n".join(lines_for(table, sys.stdout)) for table in tables(measured)), flush=True)
    if arguments.report is not None:
        for path in page.write(measured, arguments.report):
            print(f"captain: {path}", file=sys.stderr)
