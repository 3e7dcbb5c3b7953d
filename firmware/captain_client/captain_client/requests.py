"""Requests of one client, from sending to the last confirm.

A request is open until the station has refused it, or each of its interfaces has sent or dropped it. It also ends if
the station is restarted: a new run of the station never confirms requests of the former one.
"""

import json
import os
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from reprlib import repr as short
from typing import Any, NamedTuple

from captain_client.arguments import check_mapping, check_text, faults
from captain_client.errors import RefusedError, UnconfirmedError
from captain_client.reports import object_of

MOST_OPEN = 10_000  # open requests: far above what a station confirms in a second
MOST_OCTETS = 0xFFFF  # libzmq in the station ends the connection at a longer frame, and the message is lost
FORMS = ("json", "plain")
STATUS = b"status."
TYPE = re.compile(r"[a-z0-9_]{1,255}")
EDITION = re.compile(r"([a-z0-9_]{1,100})-[a-z0-9.-]{1,100}")

OF_SEND = 'write send("{type}", edition="{edition}")'


class Confirmed(NamedTuple):
    """Outcome of a request that at least one interface has sent.

    type     message type.
    digest   first 16 hexadecimal digits of the SHA-256 of the PDU.
    sent     interfaces that have sent it.
    dropped  drop reason of each interface that has not.
    """

    type: str
    digest: str
    sent: tuple[str, ...]
    dropped: dict[str, str]


class Outgoing(NamedTuple):
    """Request to send: envelope, PDU or JSON object, and options."""

    envelope: bytes
    body: bytes
    options: dict[str, Any]


def outgoing(
    kind: str, value: Any, form: str, edition: str, options: Mapping[str, Any] | None, fields: Mapping[str, Any]
) -> Outgoing:
    """Return a request.

    kind     message type, as in envelopes; empty: the station reads the type from the PDU.
    value    PDU in octets, message as a dict, or None: the message consists of `fields`.
    form     dialect of a dict: "plain" (SI units, names; the default) or "json" (integers of the standard).
    edition  edition of the message; empty: the preferred one of the type.
    fields   values by short name or path, in the plain dialect.

    Raises ValueError if an argument has a wrong type, the arguments contradict one another, JSON does not have a value,
    or the request is too long.
    """
    check_text("kind", kind, 'the message type, such as "cam"')
    check_text("form", form)
    check_text("edition", edition)
    check_mapping("options", options or {})
    envelope = f"v2x.{check_type(kind, OF_SEND)}." if kind else "v2x."
    asked = dict(options or {})
    if "form" in asked:
        raise ValueError("options: form: invalid here; give the parameter `form`")
    if isinstance(value, bytes | bytearray | memoryview):
        if form or edition or fields:
            raise ValueError("octets have no form, edition or fields; give a dict or fields in place of them")
        body = bytes(value)
    else:
        if value is not None and fields:
            raise ValueError("a message and fields; give one of both")
        if form and form not in FORMS:
            raise ValueError(f"form: {form!r}: unknown; {' or '.join(FORMS)}")
        asked["form"] = form or "plain"
        if value is not None:
            check_mapping("message", value, " or octets")
        told = {"edition": edition} if edition else {}
        name, content = ("fields", fields) if value is None else ("message", value)
        body = _octets({**told, name: dict(content)}, content)
    _check_length("message", body)
    return Outgoing(envelope.encode(), body, asked)


def check_type(kind: str, of_edition: str = 'write "{type}", which has all editions') -> str:
    """Return a message type.

    of_edition  remedy if it is an edition; {type} and {edition} are replaced.

    Raises ValueError if it is invalid.
    """
    if not TYPE.fullmatch(kind):
        found = EDITION.fullmatch(kind)
        remedy = of_edition.format(type=found[1], edition=kind) if found else "lower case, such as cam"
        raise ValueError(f"{short(kind)}: invalid message type; {remedy}")
    return kind


def _check_length(name: str, frame: bytes) -> None:
    if len(frame) > MOST_OCTETS:
        raise ValueError(f"{name}: {len(frame)} octets; at most {MOST_OCTETS}")


def _octets(value: dict[str, Any], content: Mapping[str, Any], path: str = "") -> bytes:
    """Return an object in JSON. content, path: part of it that the user gives, and the path of this part in errors.

    Raises ValueError if JSON does not have a value.
    """
    try:
        return json.dumps(value, allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        with suppress(RecursionError):
            if fault := next(faults(dict(content), path), ""):
                raise ValueError(fault) from error
        raise ValueError(f"no JSON: {error}") from error


class Request:
    """One request and the confirms that came for it.

    label    label in its confirms.
    run      last known run of the station at that time; None before the first status.
    is_over  the outcome is known, or cannot become known.
    on_over  called once when it is over.
    """

    __slots__ = ("_confirms", "_ended", "_expected", "is_over", "kind", "label", "on_over", "run")

    def __init__(self, label: str, kind: str, run: str | None) -> None:
        self.label = label
        self.kind = kind or "message"
        self.run = run
        self.is_over = False
        self.on_over: Callable[[], object] = bool  # does nothing
        self._confirms: dict[str, dict[str, Any]] = {}  # last confirm by interface; "" for a refusal of the station
        self._expected: set[str] | None = None  # interfaces that must confirm it; None before the station's confirm
        self._ended = ""  # reason why no further confirm can come

    def feed(self, confirm: dict[str, Any]) -> None:
        """Take a confirm with the label of this request."""
        outcome = confirm.get("outcome")
        if outcome == "accepted":
            self._expected = set(map(str, _list(confirm, "interfaces")))
        else:
            self._confirms[str(confirm.get("interface") or "")] = confirm
            if outcome == "refused":
                self._expected = set()
        if self._expected is not None and self._expected <= self._confirms.keys():
            self.is_over = True
            self.on_over()

    def end(self, why: str) -> None:
        """End the request without an outcome."""
        self._ended = why
        self.is_over = True
        self.on_over()

    def outcome(self) -> Confirmed:
        """Return the outcome.

        Raises RefusedError if the station refused the request or no interface sent it, and UnconfirmedError if
        confirms are missing.
        """
        sent = {name: one for name, one in self._confirms.items() if one.get("outcome") == "sent"}
        others = {name: one for name, one in self._confirms.items() if name not in sent}
        if not self.is_over or self._ended:
            raise UnconfirmedError(f"{self.kind}: {self._ended or self._missing()}", "it may have been sent")
        if not sent:
            raise _refused(self.kind, next(iter(others.values()), {}))
        kind, digest = next((str(one.get("type", "")), str(one.get("digest", ""))) for one in sent.values())
        return Confirmed(kind, digest, tuple(sent), {name: str(one.get("reason", "")) for name, one in others.items()})

    def _missing(self) -> str:
        if self._expected is None:
            return "no confirm of the station"
        return f"no confirm of {', '.join(sorted(self._expected - self._confirms.keys()))}"


def _refused(kind: str, confirm: Mapping[str, Any]) -> RefusedError:
    reason, detail, meaning = (str(confirm.get(key) or "") for key in ("reason", "detail", "meaning"))
    where = f"dropped by {confirm['interface']}" if confirm.get("interface") else "refused"
    invalid = [fault for fault in _list(confirm, "invalid") if isinstance(fault, dict)]
    told = f"{kind}: {where}: {reason}: {detail or meaning}"
    return RefusedError(told, meaning if detail else "", reason, detail, invalid)


def _list(confirm: Mapping[str, Any], key: str) -> list[Any]:
    found = confirm.get(key)
    return found if isinstance(found, list) else []


class Requests:
    """Open requests by label. The oldest one ends as unconfirmed when more than `most` are open.

    run       identifier of the station's run; None before the first status.
    statuses  number of received statuses.
    """

    def __init__(self, most: int = MOST_OPEN) -> None:
        self.run: str | None = None
        self.statuses = 0
        self._open: dict[str, Request] = {}
        self._most = most
        self._token = os.urandom(4).hex()  # clients of one station must not have equal labels
        self._count = 0

    def __len__(self) -> int:
        return len(self._open)

    def open(self, kind: str, out: Outgoing) -> tuple[Request, list[bytes]]:
        """Return a new open request and its frames.

        Raises ValueError if its label is invalid or that of an open request, or if the options are invalid or too long.
        """
        self._count += 1
        label = out.options.get("label", f"{self._token}-{self._count}")
        if not isinstance(label, str) or not label:
            raise ValueError(f"options: label: {label!r}: invalid; a text of one character or more")
        if label in self._open:
            raise ValueError(f"label: {label!r}: a request with this label is open")
        options = _octets({**out.options, "label": label}, out.options, "options")
        _check_length("options", options)
        if len(self._open) >= self._most:
            self._open.pop(next(iter(self._open))).end(f"more than {self._most} requests are open")
        request = self._open[label] = Request(label, kind, self.run)
        return request, [out.envelope, out.body, options]

    def forget(self, request: Request) -> None:
        """Remove a request that was not sent."""
        self._open.pop(request.label, None)

    def close(self) -> None:
        """End all requests."""
        self._end(list(self._open.values()), "the client was closed")

    def report(self, frames: list[bytes]) -> None:
        """Take a confirm or a status. A status of a new run ends the requests of the former one."""
        told = object_of(frames)
        if told is None:
            return
        if frames[0] == STATUS:
            self.run = str(told.get("run", ""))
            self.statuses += 1
            former = [one for one in self._open.values() if one.run not in (None, self.run)]
            self._end(former, "the station was restarted")
        elif (request := self._open.get(str(told.get("label")))) is not None:
            request.feed(told)
            if request.is_over:
                del self._open[request.label]

    def _end(self, requests: list[Request], why: str) -> None:
        for one in requests:
            del self._open[one.label]
            one.end(why)
