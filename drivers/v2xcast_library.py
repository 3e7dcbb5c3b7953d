"""The vendor's library libeu_v2xcast.so by ctypes: its calls, and its errors told by what they say.

Its numbers move between versions of the SDK, its texts do not: -6171 is a timeout in 1.7 and a packet that is too
long in 1.13. Each handler belongs to the thread that made it: create, receive or transmit, and release it there.
All calls block, and let other threads of Python run meanwhile.
"""

import ctypes
from ctypes import POINTER, c_char_p, c_int, c_long, c_size_t, c_uint16, c_void_p
from enum import Enum, auto
from typing import NamedTuple

from board.errors import InterfaceError
from drivers import shared_library
from drivers.wire.v2xcast import MAX_PAYLOAD, RX_INFO


class Kind(Enum):
    """What an error means for who made the call."""

    TIMEOUT = auto()  # nothing came: that is no error
    THREAD = auto()  # the handler belongs to another thread
    LIMIT = auto()  # the module has no place for one more
    ABSENT = auto()  # the module does not answer
    LENGTH = auto()  # the message is too long: the next one is not
    OTHER = auto()


# In the order in which they are looked for, in lower case.
BY_TEXT = (
    ("timeout", Kind.TIMEOUT),
    ("thread id", Kind.THREAD),
    ("over limit", Kind.LIMIT),
    ("not available", Kind.ABSENT),
    ("overload", Kind.LENGTH),
)

# Where the library says nothing: numbers of SDK 1.13 and 1.7, by call. Those that mean one thing in the first and
# another in the second are left out where that would matter.
BY_NUMBER: dict[str, dict[int, Kind]] = {
    "create": {-6154: Kind.LIMIT, -6148: Kind.LIMIT, -6156: Kind.ABSENT, -6150: Kind.ABSENT},
    "tx": {-6163: Kind.THREAD, -6157: Kind.THREAD, -6171: Kind.LENGTH},
    "rx": {-6173: Kind.TIMEOUT, -6171: Kind.TIMEOUT, -6175: Kind.THREAD, -6167: Kind.THREAD},
}

# Some versions write 8 bits of a handler, some 32: what they leave alone stays as it was.
_UNTOUCHED = b"\xff" * 8

CALLS: dict[str, tuple[type, list[type]]] = {
    "eu_caster_init": (c_int, []),
    "eu_caster_deinit": (c_int, []),
    "eu_caster_create": (c_int, [c_void_p, c_void_p]),
    "eu_caster_tx": (c_int, [c_long, c_char_p, c_char_p, c_size_t]),
    "eu_caster_rx_timeout": (c_int, [c_long, c_void_p, c_void_p, c_size_t, POINTER(c_size_t), c_int]),
    "eu_caster_release": (c_int, [c_long]),
}
TEXTS = ("error_msg", "eu_caster_strerror")  # one of them, by version


class CallError(InterfaceError):
    """A call failed; the message is the library's own text with its number."""

    def __init__(self, kind: Kind, message: str) -> None:
        super().__init__(message)
        self.kind = kind


class _Config(ctypes.Structure):
    _fields_ = (("ip", c_char_p), ("caster_id", c_uint16), ("mode", c_int))


class Got(NamedTuple):
    """A message: the rx_info as the library wrote it, and the PDU."""

    rx_info: bytes
    pdu: bytes


class Buffers:
    """Where one thread's messages are received."""

    def __init__(self) -> None:
        self.info = ctypes.create_string_buffer(RX_INFO.size)
        self.octets = ctypes.create_string_buffer(MAX_PAYLOAD)
        self.length = c_size_t()


class Library:
    """The library at a path, loaded. Raises InterfaceError with what to do when it cannot be used."""

    def __init__(self, path: str) -> None:
        shared_library.check(path)
        try:
            self._library = ctypes.CDLL(path)
        except OSError as error:
            hint = "it needs another library, or is damaged: `ldd` tells"
            raise InterfaceError(f"{path}: cannot be loaded: {error}", hint) from error
        missing = [name for name in CALLS if not hasattr(self._library, name)]
        if missing:
            hint = "is it libeu_v2xcast.so of the V2Xcast SDK, with EU casters?"
            raise InterfaceError(f"{path}: has no {', '.join(missing)}", hint)
        for name, (result, arguments) in CALLS.items():
            call = getattr(self._library, name)
            call.restype, call.argtypes = result, arguments
        self._texts = [getattr(self._library, name) for name in TEXTS if hasattr(self._library, name)]
        for text in self._texts:
            text.restype, text.argtypes = c_char_p, [c_int]

    def init(self) -> None:
        self._check("init", self._library.eu_caster_init())

    def deinit(self) -> None:
        self._check("deinit", self._library.eu_caster_deinit())

    def create(self, ip: str, caster_id: int, mode: int) -> int:
        """A handler of this thread. Raises CallError, as all that follow."""
        handler = ctypes.create_string_buffer(_UNTOUCHED, len(_UNTOUCHED))
        config = _Config(ip.encode(), caster_id, mode)
        self._check("create", self._library.eu_caster_create(handler, ctypes.byref(config)))
        return handler_number(handler.raw)

    def transmit(self, handler: int, tx_info: bytes, pdu: bytes) -> None:
        """Send a PDU; returns when the module has taken it."""
        self._check("tx", self._library.eu_caster_tx(handler, tx_info, pdu, len(pdu)))

    def receive(self, handler: int, to: Buffers, timeout_ms: int) -> Got | None:
        """The next message, or None when none comes within so many milliseconds."""
        code = self._library.eu_caster_rx_timeout(
            handler, to.info, to.octets, MAX_PAYLOAD, ctypes.byref(to.length), timeout_ms
        )
        if code >= 0:
            return Got(to.info.raw, ctypes.string_at(to.octets, min(to.length.value, MAX_PAYLOAD)))
        error = self._error("rx", code)
        if error.kind is Kind.TIMEOUT:
            return None
        raise error

    def release(self, handler: int) -> None:
        self._check("release", self._library.eu_caster_release(handler))

    def _check(self, call: str, code: int) -> None:
        if code < 0:
            raise self._error(call, code)

    def _error(self, call: str, code: int) -> CallError:
        text = next(filter(None, (_text(one(code)) for one in self._texts)), "")
        return CallError(classify(call, code, text), f"{text or call + ' failed'} ({code})")


def handler_number(written: bytes) -> int:
    """The handler in a buffer of 8 octets that were 0xFF before the library wrote 1 or 4 of them."""
    if written[1:4] == _UNTOUCHED[1:4]:
        return written[0]
    return c_int.from_buffer_copy(written).value


def classify(call: str, code: int, text: str) -> Kind:
    """What an error means, by the library's text, by its number where there is none."""
    text = text.lower()
    for words, kind in BY_TEXT:
        if words in text:
            return kind
    return Kind.OTHER if text else BY_NUMBER.get(call, {}).get(code, Kind.OTHER)


def _text(octets: bytes | None) -> str:
    return (octets or b"").decode("utf-8", "replace").strip()
