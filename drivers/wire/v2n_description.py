"""A profile as it is written down: topics, payloads and rules. drivers/profiles/template.toml explains each key."""

from dataclasses import dataclass, field
from typing import Literal

from board.errors import ConfigurationError
from drivers.wire.v2n_topic import Template

Form = Literal["vcaptain", "binary", "base64", "orange", "nap", "nap-body"]


@dataclass(frozen=True)
class Row:
    """Where messages are published, or from where they are taken.

    topic    template.
    payload  form of what is there.
    types    that go there; empty: all.
    """

    topic: str
    payload: Form
    types: tuple[str, ...] = ()


@dataclass(frozen=True)
class PublishRow(Row):
    """Where messages are published."""

    def __post_init__(self) -> None:
        Template(self.topic)


@dataclass(frozen=True)
class SubscribeRow(Row):
    """From where messages are taken."""

    def __post_init__(self) -> None:
        Template(self.topic, is_filter=True)


@dataclass(frozen=True)
class TypeRule:
    """What differs for one type of message.

    topic            its name in topics; empty: its own.
    qos, retain      as in the profile where absent.
    expiry_s         after which a broker forgets it.
    accept_retained  take what a broker had kept.
    """

    topic: str = ""
    qos: int | None = None
    retain: bool | None = None
    expiry_s: int | None = None
    accept_retained: bool = False

    def __post_init__(self) -> None:
        _check_qos(self.qos)
        if self.expiry_s is not None and self.expiry_s < 1:
            raise ConfigurationError(f"expiry_s: {self.expiry_s} is no time", "give seconds, at least 1")


@dataclass(frozen=True)
class Status:
    """What the station says of itself; {host}, {station}, {uuid} and {prefix} are filled in.

    topic                     empty: says nothing.
    lost_topic                of the last will; empty: topic.
    connected, closing, lost  texts; empty: not said.
    """

    topic: str = ""
    lost_topic: str = ""
    connected: str = ""
    closing: str = ""
    lost: str = ""
    qos: int = 1
    retain: bool = False

    def __post_init__(self) -> None:
        _check_qos(self.qos)
        for text in filter(None, (self.topic, self.lost_topic, self.connected, self.closing, self.lost)):
            wrong = Template(text).variables - {"host", "station", "uuid", "prefix"}
            for name in sorted(wrong):
                raise ConfigurationError(f"{text!r}: {{{name}}} is of a message", "take {host}, {station} or {uuid}")


@dataclass(frozen=True)
class ProfileDescription:
    """A profile.

    name       by which status and mistakes call it.
    prefix     value of {prefix} unless the interface sets one.
    qos        of publications and subscriptions, 0..2.
    retain     of publications.
    expiry_s   of publications; absent: they do not expire.
    types      rules by name of the type; its messageID where it has none.
    """

    name: str
    publish: tuple[PublishRow, ...]
    subscribe: tuple[SubscribeRow, ...]
    description: str = ""
    prefix: str = ""
    qos: int = 1
    retain: bool = False
    expiry_s: int | None = None
    status: Status = field(default_factory=Status)
    types: dict[str, TypeRule] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_qos(self.qos)


def _check_qos(qos: int | None) -> None:
    if qos not in (None, 0, 1, 2):
        raise ConfigurationError(f"qos: {qos} is no quality of service", "give 0, 1 or 2")
