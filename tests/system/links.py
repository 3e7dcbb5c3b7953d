"""Links: far ends of each kind of interface, with wire protocols by hand."""

import os
import socket
import struct
import subprocess
import time
import tty
from base64 import b64decode
from collections.abc import Mapping, Sequence
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Protocol
from zlib import crc32

import zmq

from drivers.message import NO_RX_INFO
from drivers.sim.radio.control import VARIABLE
from drivers.wire import morse, raw
from tests.broker.client import Client
from tests.system.air import BEACON, GEONETWORKING, Air, single_hop, unframed
from tests.system.station import BETWEEN, PATIENCE, Table
from tests.system.v2n import HOST, text

LONGEST = 1500


class Link(Protocol):
    """Far end of an interface.

    table        table of the interface in captain.toml.
    endpoint     keys of [endpoint] in captain.toml that the interface needs.
    environment  environment variables of the station's process.
    longest      octets of the longest PDU.
    way_in       options of `captain replay` that send to this interface; empty if it accepts no frames.
    """

    table: Table
    endpoint: Table
    environment: Mapping[str, str]
    longest: int
    way_in: Sequence[str]

    def send(self, pdu: bytes, port: int = 2001) -> None: ...
    def hear(self) -> bytes:
        """Return the next PDU from the station."""

    def close(self) -> None: ...


class Plain:
    """Defaults of most links."""

    def __init__(self, table: Table, way_in: Sequence[str] = ()) -> None:
        self.table = table
        self.endpoint: Table = {}
        self.environment: Mapping[str, str] = {}
        self.longest = LONGEST
        self.way_in = way_in


class InTheAir(Plain):
    """Peer that sends and receives datagrams."""

    def __init__(self, air: Air, table: Table, way_in: Sequence[str]) -> None:
        super().__init__(table, way_in)
        self._air = air

    def send(self, pdu: bytes, port: int = 2001) -> None:
        self._air.send(pdu, port)

    def hear(self) -> bytes:
        return self._air.hear().pdu

    def close(self) -> None:
        self._air.close()


class Datagrams(InTheAir):
    """Peer of a udp interface."""

    def __init__(self, air: Air) -> None:
        super().__init__(air, air.table, ["--udp", "{}:{}".format(*air.station), "--framing", air.framing])


class Radio(InTheAir):
    """Another station in range of a simulated SOM301-E."""

    def __init__(self, library: str, port: int, control: int) -> None:
        air = Air("ethernet", port)
        super().__init__(air, {"driver": "som301e", "library": library}, ["--udp", f"127.0.0.1:{port}"])
        words = f"listen=127.0.0.1:{port} control=127.0.0.1:{control} peers=127.0.0.1:{air.port} rssi=-71"
        self.environment = {VARIABLE: words}


class Broker(Plain):
    """Client of the broker to which the station is connected."""

    def __init__(self, observer: Client, table: Table) -> None:
        super().__init__(table)
        self._observer = observer

    def send(self, pdu: bytes, port: int = 2001) -> None:
        self._observer.publish(f"v2x/btp/{port}", text("other", port, pdu))

    def hear(self) -> bytes:
        while not (message := self._observer.next()).payload.startswith(f"{HOST}(".encode()):
            pass
        return b64decode(message.payload.partition(b"<")[2].rstrip(b">"))

    def close(self) -> None: ...


class Serial(Plain):
    """Serial line, as a pty. Frames: 56 32, length, BTP port, PDU, CRC-32 of the octets between. It always reads."""

    def __init__(self) -> None:
        self._end, self._station = os.openpty()
        tty.setraw(self._station)
        super().__init__({"driver": "uart", "device": os.ttyname(self._station), "baud": 4_000_000})
        self._heard: SimpleQueue[bytes] = SimpleQueue()
        self._reader = Thread(target=self._read)
        self._reader.start()

    def send(self, pdu: bytes, port: int = 2001) -> None:
        body = struct.pack(">HH", len(pdu) + 2, port) + pdu
        os.write(self._end, b"V2" + body + struct.pack(">I", crc32(body)))

    def hear(self) -> bytes:
        return self._heard.get(timeout=PATIENCE)

    def _read(self) -> None:
        waiting = b""
        while waiting[:2] in (b"", b"V", b"V2"):
            waiting += os.read(self._end, LONGEST)
            while waiting[:2] == b"V2" and len(waiting) >= (size := int.from_bytes(waiting[2:4]) + 8):
                self._heard.put(waiting[6 : size - 4])
                waiting = waiting[size:]

    def close(self) -> None:
        os.write(self._station, b"no frame")
        self._reader.join()
        os.close(self._station)
        os.close(self._end)


class Whistle(Plain):
    """Directories with sound files, for the interface `morse`."""

    UNIT_MS = 5

    def __init__(self, folder: Path) -> None:
        self._speak, self._listen = folder / "by-us", folder / "by-others"
        ways = {"speak": str(self._speak), "listen": str(self._listen)}
        super().__init__({"driver": "morse", "unit_ms": self.UNIT_MS, **ways})
        self.longest = morse.MAX_PDU
        for each in (self._speak, self._listen):
            each.mkdir()
        self._number = 0

    def send(self, pdu: bytes, port: int = 2001) -> None:
        self._number += 1
        part = self._listen / "part"
        part.write_bytes(b"".join(morse.wav(morse.encode(pdu), self.UNIT_MS)))
        part.rename(self._listen / f"{self._number:06}.wav")

    def hear(self) -> bytes:
        end = time.monotonic() + PATIENCE
        while not (found := sorted(self._speak.glob("*.wav"))):
            assert time.monotonic() < end, "nothing was spoken"
            time.sleep(BETWEEN)
        ear = morse.ToneDecoder()
        ear.receive(found[0].read_bytes())
        found[0].unlink()
        pdu = morse.decode(ear.end())
        assert isinstance(pdu, bytes), pdu
        return pdu

    def close(self) -> None: ...


class Process(Plain):
    """Interface process: publishes RawRxMessages to the station, receives envelopes and PDUs."""

    def __init__(self, folder: Path) -> None:
        into, out = f"ipc://{folder}/in", f"ipc://{folder}/out"
        super().__init__({})
        self.endpoint = {"ipc_in": into, "ipc_out": out}
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._pub, self._sub = self._context.socket(zmq.PUB), self._context.socket(zmq.SUB)
        for each, address in ((self._pub, into), (self._sub, out)):
            each.linger = 0
            each.rcvtimeo = int(PATIENCE * 1000)
            each.reconnect_ivl = 10
            each.connect(address)
        self._sub.subscribe(b"")

    def send(self, pdu: bytes, port: int = 2001) -> None:
        self._pub.send(raw.build(pdu, time.time_ns(), NO_RX_INFO))

    def hear(self) -> bytes:
        return self._sub.recv_multipart()[-1]

    def close(self) -> None:
        self._context.destroy(linger=0)


class Device(Plain):
    """Other end of a virtual Ethernet link, which it creates in this process's own network namespace."""

    def __init__(self, name: str) -> None:
        there = f"{name}-peer"
        for words in ("link add {0} type veth peer name {1}", "link set {0} up", "link set {1} up"):
            subprocess.run(["ip", *words.format(name, there).split()], check=True)
        super().__init__({"driver": "ethernet", "device": name}, ["--ethernet", there])
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        self._socket.bind((there, GEONETWORKING))
        self._socket.settimeout(PATIENCE)

    def send(self, pdu: bytes, port: int = 2001) -> None:
        self._socket.send(single_hop(pdu, port))

    def hear(self) -> bytes:
        while (octets := self._socket.recv(4096))[19] == BEACON:
            pass
        return unframed("ethernet", octets).pdu

    def close(self) -> None:
        self._socket.close()
