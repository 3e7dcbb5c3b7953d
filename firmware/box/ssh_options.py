"""What stands before a key in a line of authorized_keys: options, as sshd reads them.

Source: sshd(8), AUTHORIZED_KEYS FILE FORMAT; values as OpenSSH 9.2 took and refused them.
"""

import ipaddress
import re
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

QUOTED = r'"(?:[^"\\]|\\.)*"'
FLAGS = ("agent-forwarding", "port-forwarding", "pty", "touch-required", "user-rc", "verify-required", "x11-forwarding")
OPTION = re.compile(
    rf"(?P<flag>cert-authority|restrict|(?:no-)?(?:{'|'.join(FLAGS)}))"
    rf"|(?P<name>command|environment|expiry-time|from|permitlisten|permitopen|principals|tunnel)=(?P<value>{QUOTED})",
    re.IGNORECASE,
)
ONCE = ("command", "from", "principals")
UNTIL = re.compile(r"(\d{8}(?:\d{4}(?:\d\d)?)?)(Z?)")  # YYYYMMDD[Z] or YYYYMMDDHHMM[SS][Z]
ZONE = timedelta(hours=12)  # without Z a time is the box's own, which is never further behind
VARIABLE = re.compile(r"[A-Za-z0-9_]+=.*", re.DOTALL)
PORT = r"(?:\*|0*[1-9][0-9]{0,4})"
FORWARD = re.compile(rf"(?:\[[^\]]*\]|[^:/\[\]]*)[:/](?P<port>{PORT})")
LISTEN = re.compile(rf"(?P<port>{PORT})|{FORWARD.pattern.replace('?P<port>', '?P<at>')}")
LAST_PORT = 65535
NUMBER = re.compile(r"[0-9]{1,10}")
TUNNELS = range(0x7FFFFFFD)  # SSH_TUNID_MAX and less
STRANGE = "\ufffd"  # for an octet that is no UTF-8
SHOWN = 24
MOST_VALUE = 40  # of a value is shown; the longest time has 29

Trouble = tuple[str, str]  # what is wrong, what to do


class Option(NamedTuple):
    """name: in small letters; value: without its quotes; None: it has none."""

    name: str
    value: str | None
    written: str


def trouble(options: str) -> Trouble | None:
    """For what sshd would pass the whole line over; None where it takes it."""
    if STRANGE in options:
        return "an option has an octet that is not UTF-8", "save the file as UTF-8"
    found, rest = parted(options)
    if rest is not None:
        return f'"{rest[:SHOWN]}" is no option of a key', "sshd(8) lists them, under AUTHORIZED_KEYS FILE FORMAT"
    counts = Counter(option.name for option in found)
    if twice := next((name for name in ONCE if counts[name] > 1), ""):
        return f"{twice} is there {counts[twice]} times, and sshd takes it once", f"write one {twice}"
    if counts["principals"] and not counts["cert-authority"]:
        return "principals is for an authority's key", "leave it out, or write cert-authority before it"
    for option in found:
        if option.value is not None and (remedy := VALUES.get(option.name, _any)(option.value)):
            shown = option.written if len(option.written) <= MOST_VALUE else f'{option.written[:MOST_VALUE]}..."'
            return f"{shown} is {NOUNS[option.name]}", remedy
    return None


def parted(options: str) -> tuple[list[Option], str | None]:
    """The options, and from where on they are none; None: to the end."""
    found: list[Option] = []
    rest = options
    while option := OPTION.match(rest):
        value = option["value"]
        name = (option["flag"] or option["name"]).lower()
        found.append(Option(name, None if value is None else value[1:-1].replace('\\"', '"'), option[0]))
        rest = rest[option.end() :]
        if not rest:
            return found, None
        if not rest.startswith(","):
            break
        rest = rest[1:]
    return found, rest


def shut(options: str, now: float) -> str:
    """Why nobody gets in by a key with these, and by nothing else; empty where somebody does.

    now  Unix time.
    """
    found, _ = parted(options)
    at = datetime.fromtimestamp(now, UTC)
    for until in (UNTIL.fullmatch(option.value or "") for option in found if option.name == "expiry-time"):
        end = _time(until[1]) if until else None  # the earliest counts
        if until and end is not None and end <= at - (timedelta() if until[2] else ZONE):
            return f"has expired: expiry-time is {until[1]}"
    if any(option.name == "cert-authority" for option in found):
        return "is an authority's: only a certificate that it has signed for operator gets in"
    return ""


# -- values: what to do about one that sshd refuses; nothing where it takes it


def _any(_: str) -> str:
    return ""


def _expiry(value: str) -> str:
    until = UNTIL.fullmatch(value)
    if until and _time(until[1]) is not None:
        return ""
    return "write YYYYMMDD, or YYYYMMDDHHMM, with Z for UTC: sshd passes the line over"


def _hosts(value: str) -> str:
    return next(_wrong_hosts(value), "")


def _wrong_hosts(value: str) -> Iterator[str]:
    for written in value.split(","):
        host = written.removeprefix("!")
        if not host:
            yield "write a host between two commas"
        elif host.split() != [host]:
            yield f'write no blank into "{written}"'
        elif "/" in host:
            near = _network(host)
            if near != host:
                yield f"write {near} for {host}" if near else f"{host} is no network; write one as 10.0.0.0/8"


def _network(host: str) -> str:
    """The network that is meant by an address and a length; empty where that is none."""
    try:
        return str(ipaddress.ip_network(host, strict=False))
    except ValueError:
        return ""


def _environment(value: str) -> str:
    return "" if VARIABLE.fullmatch(value) else 'write environment="NAME=value"'


def _opened(value: str) -> str:
    is_one = (found := FORWARD.fullmatch(value)) and _is_port(found["port"])
    return "" if is_one else 'write permitopen="HOST:PORT", an address of IPv6 in [ ], any port as *'


def _listened(value: str) -> str:
    is_one = (found := LISTEN.fullmatch(value)) and _is_port(found["port"] or found["at"])
    return "" if is_one else 'write permitlisten="PORT" or permitlisten="HOST:PORT", any port as *'


def _tunnel(value: str) -> str:
    return (
        ""
        if value == "any" or (NUMBER.fullmatch(value) and int(value) in TUNNELS)
        else 'write the number of a tun device, as tunnel="0", or tunnel="any"'
    )


def _is_port(text: str) -> bool:
    return text == "*" or int(text) <= LAST_PORT


def _time(text: str) -> datetime | None:
    """None where it is no time."""
    try:
        return datetime.strptime(text.ljust(14, "0"), "%Y%m%d%H%M%S").replace(tzinfo=UTC)
    except ValueError:
        return None


VALUES: dict[str, Callable[[str], str]] = {
    "environment": _environment, "expiry-time": _expiry, "from": _hosts, "permitlisten": _listened,
    "permitopen": _opened, "tunnel": _tunnel,
}  # fmt: skip
NOUNS = {
    "environment": "no variable", "expiry-time": "no time", "from": "no list of hosts", "permitlisten": "no port",
    "permitopen": "no host and port", "tunnel": "no device",
}  # fmt: skip
