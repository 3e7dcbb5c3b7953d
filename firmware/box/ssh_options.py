"""What stands before a key in a line of authorized_keys: options, as sshd reads them.

Source: sshd(8), AUTHORIZED_KEYS FILE FORMAT; values as OpenSSH 9.2 took and refused them.
"""

import ipaddress
import re
from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

QUOTED = r'"(?:[^"\\]|\\"|\\(?!"))*"'  # only a quote can be escaped
FLAGS = ("agent-forwarding", "port-forwarding", "pty", "touch-required", "user-rc", "verify-required", "x11-forwarding")
OPTION = re.compile(
    rf"(?:(?P<flag>cert-authority|restrict|(?:no-)?(?:{'|'.join(FLAGS)}))"
    rf"|(?P<name>command|environment|expiry-time|from|permitlisten|permitopen|principals|tunnel)=(?P<value>{QUOTED}))"
    "(?:,|$)",
    re.IGNORECASE,
)
ONCE = ("command", "from", "principals")
# YYYYMMDD, YYYYMMDDHHMM or YYYYMMDDHHMMSS; of the box's own zone, or of UTC.
UNTIL = re.compile(r"([0-9]{8}(?:[0-9]{4}(?:[0-9]{2})?)?)(Z|UTC)?", re.IGNORECASE)
ZONE = timedelta(hours=12)  # the box's own time is never further behind
VARIABLE = re.compile(r"[A-Za-z0-9_]+=.*", re.DOTALL)
PORT = r"(\*|0{0,9}[1-9][0-9]{0,4})"  # names of ports are a machine's own, and an image knows none
HOST = r"(?:\[[^\]]*\]|[^:/\[\]]*)"
OPENED = re.compile(f"{HOST}[:/]{PORT}")
LISTENED = re.compile(f"(?:{HOST}:)?{PORT}")
LAST_PORT = 65535
NUMBER = re.compile(r"[0-9]{1,10}")
LAST_TUNNEL = 0x7FFFFFFD  # SSH_TUNID_MAX
STRANGE = "\ufffd"  # for an octet that is no UTF-8
SHOWN = 24
MOST_VALUE = 40  # characters of a value that are shown; the longest time has 31

Trouble = tuple[str, str]  # what is wrong, what to do


class Option(NamedTuple):
    """name: in small letters; value: without its quotes; None: it has none."""

    name: str
    value: str | None
    written: str


def trouble(options: str) -> Trouble | None:
    """For what sshd would pass the whole line over, or what can never fit; None where there is nothing of it."""
    if STRANGE in options:  # sshd would take it, but the box writes its lines anew
        return "an option has an octet that is not UTF-8", "save the file as UTF-8"
    found, rest = _parted(options)
    if rest:
        return f'"{rest[:SHOWN]}" is no option of a key', "sshd(8) lists them, under AUTHORIZED_KEYS FILE FORMAT"
    counts = Counter(option.name for option in found)
    if twice := next((name for name in ONCE if counts[name] > 1), ""):
        return f"{twice} is there {counts[twice]} times, and sshd takes it once", f"write one {twice}"
    if counts["principals"] and not counts["cert-authority"]:
        return "principals is for an authority's key", "leave it out, or write cert-authority before it"
    for option in found:
        if option.name in CHECKS and option.value is not None:
            check, noun = CHECKS[option.name]
            if remedy := check(option.value):
                return f"{_cut(option.written)} is {noun}", remedy
    return None


def shut(options: str, now: float) -> str:
    """Why nobody gets in by a key with these, and by nothing else; empty where somebody does.

    now  Unix time.
    """
    found, _ = _parted(options)
    at = datetime.fromtimestamp(now, UTC)
    ends = []
    for until in (UNTIL.fullmatch(option.value or "") for option in found if option.name == "expiry-time"):
        end = _time(until[1]) if until else None
        if until and end is not None and end <= at - (timedelta() if until[2] else ZONE):
            ends.append((end, until[1]))
    if ends:
        return f"has expired: expiry-time is {min(ends)[1]}"
    hosts = next((option.value or "" for option in found if option.name == "from"), "")
    if hosts and all(host.startswith("!") for host in hosts.split(",")):
        return f"lets nobody in: from names only who is shut out, {_cut(hosts)}"
    if any(option.name == "cert-authority" for option in found):
        return "is an authority's: only a certificate that it has signed for operator gets in"
    return ""


def _parted(options: str) -> tuple[list[Option], str]:
    """The options, and from where on they are none; behind the last one may be a comma."""
    found: list[Option] = []
    rest = options
    while option := OPTION.match(rest):
        value = option["value"]
        name = (option["flag"] or option["name"]).lower()
        written = option[0].removesuffix(",")
        found.append(Option(name, None if value is None else value[1:-1].replace('\\"', '"'), written))
        rest = rest[option.end() :]
    return found, rest


# -- values: what to do about a wrong one; nothing about a right one


def _expiry(value: str) -> str:
    until = UNTIL.fullmatch(value)
    if until and _time(until[1]) is not None:
        return ""
    return "write YYYYMMDD, or YYYYMMDDHHMM, with Z for UTC"


def _hosts(value: str) -> str:
    return next((remedy for written in value.split(",") if (remedy := _host(written.removeprefix("!")))), "")


def _host(host: str) -> str:
    """sshd lets nobody in by an empty one, nor by a network that is none; blanks and masks fit no host."""
    if not host:
        return "write a host between two commas"
    if host.split() != [host]:
        return f'write no blank into "{_cut(host)}"'
    _, is_network, length = host.partition("/")
    if not is_network:
        return ""
    try:
        found = ipaddress.ip_interface(host)
    except ValueError:
        return f"{_cut(host)} is no network; write one as 10.0.0.0/8"
    if int(found.ip) == int(found.network.network_address) and length.isdecimal():
        return ""
    return f"write {found.network} for {_cut(host)}"


def _environment(value: str) -> str:
    return "" if VARIABLE.fullmatch(value) else 'write environment="NAME=value"'


def _opened(value: str) -> str:
    if (found := OPENED.fullmatch(value)) and _is_port(found[1]):
        return ""
    return 'write permitopen="HOST:PORT", the port as a number or *, an address of IPv6 in [ ]'


def _listened(value: str) -> str:
    if (found := LISTENED.fullmatch(value)) and _is_port(found[1]):
        return ""
    return 'write permitlisten="PORT" or permitlisten="HOST:PORT", the port as a number or *'


def _tunnel(value: str) -> str:
    if value.lower() == "any" or (NUMBER.fullmatch(value) and int(value) <= LAST_TUNNEL):
        return ""
    return 'write the number of a tun device, as tunnel="0", or tunnel="any"'


CHECKS: dict[str, tuple[Callable[[str], str], str]] = {
    "environment": (_environment, "no variable"),
    "expiry-time": (_expiry, "no time"),
    "from": (_hosts, "no list of hosts"),
    "permitlisten": (_listened, "no port"),
    "permitopen": (_opened, "no host and port"),
    "tunnel": (_tunnel, "no device"),
}


def _is_port(text: str) -> bool:
    return text == "*" or int(text) <= LAST_PORT


def _time(text: str) -> datetime | None:
    """None where it is no time."""
    try:
        return datetime.strptime(text.ljust(14, "0"), "%Y%m%d%H%M%S").replace(tzinfo=UTC)
    except ValueError:
        return None


def _cut(text: str) -> str:
    return text if len(text) <= MOST_VALUE else f"{text[:MOST_VALUE]}..."
