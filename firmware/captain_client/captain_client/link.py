"""Blocking link to a station: sockets for requests, confirms and subscriptions, without threads."""

import os
import socket
import time
from collections.abc import Iterator

import zmq

from captain_client.address import Address
from captain_client.errors import StationError, UnreachableError
from captain_client.requests import STATUS, Outgoing, Request, Requests
from captain_client.sockets import (
    AT_ONCE,
    CONFIRM,
    EVENT_MS,
    HIGH_WATER_OF_REPORTS,
    OPEN,
    ask_for_status,
    check_open,
    connect,
    connections_of,
    has_connected,
    ms_until,
    offered,
    unreachable,
)

PROBE_S = 0.5  # time limit for a TCP connection that finds out why no station answers


class Link:
    """Sockets to one station, proven by a status and by the connection to the PULL port.

    timeout_s  seconds to wait for the station: in the constructor, in send() and for each subscription.

    Raises UnreachableError if no station answers in time, and ValueError for an invalid host name.
    """

    def __init__(self, address: Address, timeout_s: float) -> None:
        self._address = address
        self._timeout_s = timeout_s
        self._requests = Requests()
        self._process = os.getpid()
        self._proof = 1  # number of the status that proves the subscriptions of _reports
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        OPEN.add(self._context)
        try:
            self._reports = self._context.socket(zmq.SUB)
            connect(self._reports, address.url(address.report), CONFIRM, STATUS, most=HIGH_WATER_OF_REPORTS)
            self._push = self._context.socket(zmq.PUSH)
            self._connections = connections_of(self._push)
            deadline = time.monotonic() + timeout_s
            self._join(deadline)
            connect(self._push, address.url(address.pull))
            self._writable(deadline)
            has_connected(self._connections, EVENT_MS)  # later ones are interruptions
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self._context.destroy()
        OPEN.discard(self._context)
        self._requests.close()

    def send(self, kind: str, out: Outgoing) -> Request:
        """Send a request.

        Raises UnreachableError if the station does not take it in time, and StationError after close().
        """
        self._check_use(self._push)
        deadline = time.monotonic() + self._timeout_s
        self._take_reports()
        while True:
            self._writable(deadline)
            self._join(deadline)
            if (request := offered(self._push, self._requests, kind, out)) is not None:
                return request

    def wait_for(self, request: Request, timeout_s: float) -> None:
        """Read confirms until a request is over, at most timeout_s seconds. Raises StationError in a child process."""
        self._check_process()
        deadline = time.monotonic() + timeout_s
        while not request.is_over:
            self._take_reports()
            if request.is_over or not (left_ms := ms_until(deadline)):
                return
            self._reports.poll(left_ms)

    def subscribe(self, topics: tuple[bytes, ...]) -> "zmq.Socket[bytes]":
        """Return a new socket, subscribed in the background to topics and to a status.

        Raises StationError after close().
        """
        self._check_use(self._push)
        end = self._context.socket(zmq.SUB)
        connect(end, self._address.url(self._address.report), *topics, STATUS)
        return end

    def first_status(self, end: "zmq.Socket[bytes]") -> Iterator[list[bytes]]:
        """Yield the messages of a new socket up to the first status, which proves its subscriptions.

        Raises UnreachableError if none comes in time.
        """
        deadline = time.monotonic() + self._timeout_s
        while (frames := self.receive(end, deadline - time.monotonic())) is not None:
            yield frames
            if frames[0] == STATUS:
                return
        raise self.unreachable(self._address.report)

    def receive(self, end: "zmq.Socket[bytes]", timeout_s: float | None) -> list[bytes] | None:
        """Return the next message of a socket; None after the timeout in seconds. Reads confirms meanwhile.

        Raises StationError if the socket is closed.
        """
        self._check_use(end)
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        poller = zmq.Poller()
        poller.register(end, zmq.POLLIN)
        poller.register(self._reports, zmq.POLLIN)
        while ready := dict(poller.poll(None if deadline is None else ms_until(deadline))):
            if self._reports in ready:
                self._take_reports()
            if end in ready:
                return end.recv_multipart()
        return None

    def unreachable(self, port: int) -> UnreachableError:
        """Return the error for a port at which no station answers, with the cause."""
        try:
            socket.create_connection((self._address.host, port), PROBE_S).close()
        except (OSError, UnicodeError) as error:  # UnicodeError: an invalid host name
            return unreachable(self._address, port, getattr(error, "strerror", None) or str(error))
        return unreachable(self._address, port, "")

    def _check_use(self, end: "zmq.Socket[bytes]") -> None:
        check_open(end)
        self._check_process()

    def _check_process(self) -> None:
        """Raise StationError in a child process: it has no thread of libzmq, and would wait without end."""
        if os.getpid() != self._process:
            raise StationError(f"the client is that of process {self._process}", "create a Station in each process")

    def _writable(self, deadline: float) -> None:
        """Wait for the connection to the PULL port, and for its event. Raises UnreachableError at the deadline."""
        if self._push.poll(0, zmq.POLLOUT):
            return
        if not self._push.poll(ms_until(deadline), zmq.POLLOUT):
            raise self.unreachable(self._address.pull)
        self._connections.poll(EVENT_MS)

    def _join(self, deadline: float) -> None:
        """Wait for a status at the start and after an interruption: it proves the subscription to confirms.

        Raises UnreachableError at the deadline.
        """
        while True:
            if has_connected(self._connections):
                while self._reports.poll(0):
                    self._take_reports()
                self._proof = self._requests.statuses + 1
                ask_for_status(self._reports)
            if self._requests.statuses >= self._proof:
                return
            if not self._reports.poll(ms_until(deadline)):
                raise self.unreachable(self._address.report)
            self._take_reports()

    def _take_reports(self) -> None:
        """Give the confirms and statuses that have arrived to the open requests."""
        for _ in range(AT_ONCE):
            try:
                frames = self._reports.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            self._requests.report(frames)
