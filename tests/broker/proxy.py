"""A network between a client and a broker: slow, stalled, cut, dark, refusing. TCP on loopback, either end may be TLS.

In a thread of the test; a measurement runs it as a process: python -m tests.broker.proxy --to 8883 --delay 0.5
"""

import argparse
import asyncio
import signal
import socket
import struct
import sys
import threading
from collections.abc import Coroutine
from typing import Any, NamedTuple, Self, TypeVar

from tests.system.ports import Ports

PATIENCE = 5.0  # s; reached only by a test that fails
CHUNK = 1 << 16  # octets
ON_THE_WAY = 512  # chunks, each way: what a long line holds
RESET = struct.pack("ii", 1, 0)  # SO_LINGER: close with RST

Result = TypeVar("Result")


class _Line(NamedTuple):
    """A connection: towards the client, and towards the broker."""

    client: asyncio.StreamWriter
    broker: asyncio.StreamWriter


class Proxy:
    """Forwards to a port, and does what it is told to what it forwards.

    to, host       where.
    delay_s        each octet needs so long, each way; may be set while it runs.
    octets_per_s   at most so many, each way; 0: no limit. May be set while it runs.
    """

    def __init__(self, to: int, host: str = "127.0.0.1", delay_s: float = 0.0, octets_per_s: float = 0.0) -> None:
        self.delay_s = delay_s
        self.octets_per_s = octets_per_s
        self.accepted = 0  # connections since the start
        self._to = (host, to)
        self._ports = Ports()
        self.port = self._ports.take()
        self._lines: set[_Line] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._is_dark = False
        self._flowing = asyncio.Event()
        self._listener: socket.socket | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)

    def start(self) -> Self:
        self._thread.start()
        self._do(self._listen())
        self._do(self._set_flowing(True))
        return self

    def close(self) -> None:
        if self._thread.is_alive():
            self._do(self._end())
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(PATIENCE)
        self._loop.close()
        self._ports.release()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def lines(self) -> int:
        """Connections that are open now."""
        return len(self._lines)

    def stall(self) -> None:
        """Nothing is read nor forwarded, as in a tunnel: the kernels' buffers fill, nobody is told. Until flow()."""
        self._do(self._set_flowing(False))

    def flow(self) -> None:
        self._do(self._set_flowing(True))

    def cut(self) -> None:
        """All connections end at once, with RST both ways. New ones are forwarded."""
        self._do(self._cut())

    def go_dark(self) -> None:
        """Half open: what either side sends, its good bye as well, is swallowed, and new connections meet silence.

        What was swallowed is gone: end it with light(), then cut(). The other way round a line that comes between the two
        stays silent.
        """
        self._is_dark = True

    def light(self) -> None:
        self._is_dark = False

    def refuse(self) -> None:
        """Nobody listens: ECONNREFUSED. What is connected stays. Until accept()."""
        self._do(self._unlisten())

    def accept(self) -> None:
        self._do(self._listen())

    # ---------------------------------------------------------------- in the thread

    def _do(self, what: Coroutine[Any, Any, Result]) -> Result:
        return asyncio.run_coroutine_threadsafe(what, self._loop).result(PATIENCE)

    async def _listen(self) -> None:
        if self._listener is None:
            self._listener = socket.create_server(("127.0.0.1", self.port))
            self._listener.setblocking(False)
            self._loop.add_reader(self._listener, self._accept, self._listener)

    async def _unlisten(self) -> None:
        if self._listener is not None:
            self._loop.remove_reader(self._listener)
            self._listener.close()
            self._listener = None

    async def _set_flowing(self, is_flowing: bool) -> None:
        if is_flowing:
            self._flowing.set()
        else:
            self._flowing.clear()

    async def _cut(self) -> None:
        for line in list(self._lines):
            _reset(line.client)
            _reset(line.broker)

    async def _end(self) -> None:
        await self._unlisten()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.sleep(0)  # what was reset is closed in the loop's next turn

    def _accept(self, listener: socket.socket) -> None:
        """Not asyncio's own server: one that is closed while it accepts leaves a socket behind."""
        try:
            accepted, _ = listener.accept()
        except BlockingIOError:
            return  # it has gone again
        self.accepted += 1
        task = self._loop.create_task(self._serve(accepted))
        self._tasks.add(task)  # else nobody keeps it
        task.add_done_callback(self._tasks.discard)
        task.add_done_callback(lambda _: accepted.close())

    async def _serve(self, accepted: socket.socket) -> None:
        reader, writer = await asyncio.open_connection(sock=accepted, limit=CHUNK)
        try:
            there, back = await asyncio.open_connection(*self._to, limit=CHUNK)
        except OSError:
            _reset(writer)
            return
        except asyncio.CancelledError:
            _reset(writer)
            raise
        line = _Line(writer, back)
        self._lines.add(line)
        try:
            async with asyncio.TaskGroup() as both:
                for source, sink in ((reader, back), (there, writer)):
                    way: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(ON_THE_WAY)
                    both.create_task(self._read(source, way))
                    both.create_task(self._forward(way, sink))
        finally:
            _reset(writer)
            _reset(back)
            self._lines.discard(line)

    async def _read(self, reader: asyncio.StreamReader, way: "asyncio.Queue[tuple[float, bytes]]") -> None:
        """Until its sender has ended it, or the line is cut: what it then finds is nothing."""
        octets = b"-"
        while octets:
            await self._flowing.wait()
            try:
                octets = await reader.read(CHUNK)
            except OSError:
                octets = b""
            await way.put((self._loop.time() + self.delay_s, octets))

    async def _forward(self, way: "asyncio.Queue[tuple[float, bytes]]", writer: asyncio.StreamWriter) -> None:
        octets = b"-"
        while octets:
            due, octets = await way.get()
            if (early := due - self._loop.time()) > 0:
                await asyncio.sleep(early)
            await self._flowing.wait()
            while self._is_dark and not octets:
                await asyncio.sleep(0.01)  # its good bye is not told, until the line is cut
                if writer.is_closing():
                    return
            if self._is_dark or writer.is_closing():
                continue
            try:
                await self._write(octets, writer)
            except OSError:
                octets = b"-"  # the other side is gone: what still comes is read away

    async def _write(self, octets: bytes, writer: asyncio.StreamWriter) -> None:
        if not octets:
            if writer.can_write_eof():
                writer.write_eof()
            return
        if self.octets_per_s:
            await asyncio.sleep(len(octets) / self.octets_per_s)
        writer.write(octets)
        await writer.drain()


def _reset(writer: asyncio.StreamWriter) -> None:
    line: socket.socket | None = writer.get_extra_info("socket")
    if line is not None and line.fileno() >= 0:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    writer.transport.abort()


def main() -> int:
    """Prints its port, then a line from stdin is a command: cut, stall, flow, dark, light, refuse, accept."""
    parser = argparse.ArgumentParser(prog="python -m tests.broker.proxy", description=__doc__)
    parser.add_argument("--to", type=int, required=True)
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--octets-per-s", type=float, default=0.0)
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    with Proxy(arguments.to, delay_s=arguments.delay, octets_per_s=arguments.octets_per_s) as proxy:
        print(proxy.port, flush=True)
        dos = {name: getattr(proxy, name) for name in ("cut", "stall", "flow", "light", "refuse", "accept")}
        for line in sys.stdin:
            (dos | {"dark": proxy.go_dark})[line.strip()]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
