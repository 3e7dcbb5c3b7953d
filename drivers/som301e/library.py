"""Vendor's library libeu_v2xcast.so by ctypes: its calls, and its errors by their texts.

Errors are classified by text, because error numbers change between versions of the SDK. For example, -6171 is a timeout
in 1.7, and a too long packet in 1.13. Each handler belongs to the thread that created it: only this thread may receive,
transmit, and release it. All calls block, but other Python threads run meanwhile.
"""

import ctypes
from ctypes import POINTER, c_char_p, c_int, c_long, c_size_t, c_uint16, c_void_p
from enum import Enum, auto
from typing import NamedTuple

from board.runtime.errors import InterfaceError
from drivers.som301e import shared_library
from drivers.wire.v2xcast import MAX_PAYLOAD, RX_INFO


class CasterKind(Enum):
    """Kind of an error of the library, by its consequence for the caller."""

    TIMEOUT = auto()  # no message arrived in time, which is normal
    THREAD = auto()  # the handler belongs to another thread
    LIMIT = auto()  # the module has no free handler
    ABSENT = auto()  # the module does not answer
    LENGTH = auto()  # this message is too long; the handler still works
    OTHER = auto()


# Kind by a part of the error text in lower case; the first row that fits decides.
BY_TEXT = (
    ("timeout", CasterKind.TIMEOUT),
    ("thread id", CasterKind.THREAD),
    ("over limit", CasterKind.LIMIT),
    ("not available", CasterKind.ABSENT),
    ("overload", CasterKind.LENGTH),
)

# Kind by call and error number, for errors without text: numbers of SDK 1.13 and 1.7. Numbers with different meanings
# in the two versions are left out where the difference matters.
BY_NUMBER: dict[str, dict[int, CasterKind]] = {
    "create": {-6154: CasterKind.LIMIT, -6148: CasterKind.LIMIT, -6156: CasterKind.ABSENT, -6150: CasterKind.ABSENT},
    "tx": {-6163: CasterKind.THREAD, -6157: CasterKind.THREAD, -6171: CasterKind.LENGTH},
    "rx": {-6173: CasterKind.TIMEOUT, -6171: CasterKind.TIMEOUT, -6175: CasterKind.THREAD, -6167: CasterKind.THREAD},
}

# Initial content of the buffer for a handler. Some SDK versions write 8 bits of it, some 32; octets that are still 0xFF
# show which.
_UNTOUCHED = b"\xff" * 8

CALLS: dict[str, tuple[type, list[type]]] = {
    "eu_caster_init": (c_int, []),
    "eu_caster_deinit": (c_int, []),
    "eu_caster_create": (c_int, [c_void_p, c_void_p]),
    "eu_caster_tx": (c_int, [c_long, c_char_p, c_char_p, c_size_t]),
    "eu_caster_rx_timeout": (c_int, [c_long, c_void_p, c_void_p, c_size_t, POINTER(c_size_t), c_int]),
    "eu_caster_release": (c_int, [c_long]),
}
TEXTS = ("error_msg", "eu_caster_strerror")  # functions that return the text of an error; a version has one of them


class CallError(InterfaceError):
    """A call of the library failed; the message has the library's own text and its error number."""

    def __init__(self, kind: CasterKind, message: str) -> None:
        super().__init__(message)
        self.kind = kind


class _Config(ctypes.Structure):
    _fields_ = (("ip", c_char_p), ("caster_id", c_uint16), ("mode", c_int))


class Got(NamedTuple):
    """A received message: the rx_info structure as the library wrote it, and the PDU."""

    rx_info: bytes
    pdu: bytes


class Buffers:
    """Receive buffers of one thread: rx_info, PDU and its length."""

    def __init__(self) -> None:
        self.info = ctypes.create_string_buffer(RX_INFO.size)
        self.octets = ctypes.create_string_buffer(MAX_PAYLOAD)
        self.length = c_size_t()


class Library:
    """The vendor's library, loaded from a path. Raises InterfaceError with a remedy if it cannot be used."""

    def __init__(self, path: str) -> None:
        shared_library.check(path)
        try:
            self._library = ctypes.CDLL(path)
        except OSError as error:
            hint = "it needs another library, or is damaged: `ldd` tells"
            raise InterfaceError(f"{path}: cannot be loaded: {error}", hint) from error
        missing = [name for name in CALLS if not hasattr(self._library, name)]
        if missing:
            hint = "take libeu_v2xcast.so of the V2Xcast SDK, with EU casters"
            raise InterfaceError(f"{path}: has no {', '.join(missing)}", hint)
        for name, (result, arguments) in CALLS.items():
            call = getattr(self._library, name)
            call.restype, call.argtypes = result, arguments
        self._texts = [getattr(self._library, name) for name in TEXTS if hasattr(self._library, name)]
        for text in self._texts:
            text.restype, text.argtypes = c_char_p, [c_int]

    def init(self) -> None:
        """Initialize the library. Raises CallError for a negative result."""
        self._check("init", self._library.eu_caster_init())

    def deinit(self) -> None:
        """End the use of the library. Raises CallError for a negative result."""
        self._check("deinit", self._library.eu_caster_deinit())

    def create(self, ip: str, caster_id: int, mode: int) -> int:
        """Create a handler for this thread; return its number. Raises CallError for a negative result.

        ip         IPv4 address of the module.
        caster_id  identifier of the caster on the module.
        mode       direction: RX or TX of drivers/wire/v2xcast.py.
        """
        handler = ctypes.create_string_buffer(_UNTOUCHED, len(_UNTOUCHED))
        config = _Config(ip.encode(), caster_id, mode)
        self._check("create", self._library.eu_caster_create(handler, ctypes.byref(config)))
        return handler_number(handler.raw)

    def transmit(self, handler: int, tx_info: bytes, pdu: bytes) -> None:
        """Send a PDU; return when the module has accepted it. Raises CallError for a negative result."""
        self._check("tx", self._library.eu_caster_tx(handler, tx_info, pdu, len(pdu)))

    def receive(self, handler: int, to: Buffers, timeout_ms: int) -> Got | None:
        """Return the next message, or None if none arrives within timeout_ms.

        Raises CallError for a negative result other than that of a timeout.
        """
        code = self._library.eu_caster_rx_timeout(
            handler, to.info, to.octets, MAX_PAYLOAD, ctypes.byref(to.length), timeout_ms
        )
        if code >= 0:
            return Got(to.info.raw, ctypes.string_at(to.octets, min(to.length.value, MAX_PAYLOAD)))
        error = self._error("rx", code)
        if error.kind is CasterKind.TIMEOUT:
            return None
        raise error

    def release(self, handler: int) -> None:
        """Release a handler. Raises CallError for a negative result."""
        self._check("release", self._library.eu_caster_release(handler))

    def _check(self, call: str, code: int) -> None:
        if code < 0:
            raise self._error(call, code)

    def _error(self, call: str, code: int) -> CallError:
        text = next(filter(None, (_text(one(code)) for one in self._texts)), "")
        return CallError(classify(call, code, text), f"{text or call + ' failed'} ({code})")


def handler_number(written: bytes) -> int:
    """Return the handler's number from a buffer of 8 octets, of which the library wrote 1 or 4; the others are 0xFF."""
    if written[1:4] == _UNTOUCHED[1:4]:
        return written[0]
    return c_int.from_buffer_copy(written).value


def classify(call: str, code: int, text: str) -> CasterKind:
    """Return the kind of an error, by the library's text; without a text, by its number."""
    text = text.lower()
    for words, kind in BY_TEXT:
        if words in text:
            return kind
    return CasterKind.OTHER if text else BY_NUMBER.get(call, {}).get(code, CasterKind.OTHER)


def _text(octets: bytes | None) -> str:
    return (octets or b"").decode("utf-8", "replace").strip()
