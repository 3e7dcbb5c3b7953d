"""Mobile network of three network namespaces: vehicle, router, broker.

    vehicle: wwan0 10.77.1.2..250 --- cell0 10.77.1.1 :between: core0 10.77.2.2 --- broker0 10.77.2.1 :broker's

The middle drops silently (blackhole routes), the vehicle's device goes down or gets another address, or queues let
little pass (tc-tbf). All of it ends with the process that made it.
"""

import os
import subprocess
from itertools import cycle
from pathlib import Path

from firmware.lab import netns
from firmware.lab.netns import Namespace
from tests.proof.outage.pattern import NEW_ADDRESS, Kind, Trouble

DEVICE = "wwan0"
BROKER = "10.77.2.1"
GATEWAY = "10.77.1.1"
ADDRESSES = [f"10.77.1.{last}" for last in range(2, 251)]
NETWORKS = ("10.77.1.0/24", "10.77.2.0/24")

# What a slow cell's buffer holds for one who uses it. At 16 kbit/s it is a second and a half.
BUFFER = 3000  # octets
BURST = 1600  # a whole packet


class Link:
    """The calling process is left in the vehicle's namespace. Raises StationError where the kernel allows none.

    users  that share it: a slow one gives each of them what the pattern gives to one.
    """

    def __init__(self, users: int = 1) -> None:
        self._users = users
        netns._leave_for_new_network(as_user=os.geteuid() != 0)
        self.vehicle, self.between, self.broker = Namespace(), self._new(), self._new()
        self.vehicle._enter()
        self._cable(self.vehicle, DEVICE, self.between, "cell0")
        self._cable(self.between, "core0", self.broker, "broker0")
        for namespace, device, address in (
            (self.between, "cell0", GATEWAY),
            (self.between, "core0", "10.77.2.2"),
            (self.broker, "broker0", BROKER),
        ):
            with namespace.inside():
                ip("address", "add", f"{address}/24", "dev", device)
        with self.between.inside():
            Path("/proc/sys/net/ipv4/ip_forward").write_text("1")
        with self.broker.inside():
            ip("route", "add", "default", "via", "10.77.2.2")
        self._addresses = cycle(ADDRESSES)
        self.address = ""
        self._move()

    def begin(self, trouble: Trouble) -> None:
        if trouble.kind is Kind.SLOW:
            self._slow(trouble.rate_bit_s)
        elif trouble.kind is Kind.LOSS:
            ip("link", "set", DEVICE, "down")
        else:
            self._swallow("add")

    def end(self, trouble: Trouble) -> None:
        if trouble.kind is Kind.SLOW:
            self._slow(0)
            return
        if trouble.kind is Kind.LOSS:
            ip("link", "set", DEVICE, "up")
            self._route()
            return
        if trouble.kind in NEW_ADDRESS:
            self._move()
        self._swallow("delete")

    def _move(self) -> None:
        """The vehicle gets another address, and has the one before no more."""
        before, self.address = self.address, next(self._addresses)
        if before:  # first: with it go all others of its network
            ip("address", "delete", f"{before}/24", "dev", DEVICE)
        ip("address", "add", f"{self.address}/24", "dev", DEVICE)
        self._route()

    def _route(self) -> None:
        ip("route", "replace", "default", "via", GATEWAY, "src", self.address)

    def _swallow(self, how: str) -> None:
        """Whatever is routed in between is gone without a word; more specific than the networks, so that those stay."""
        with self.between.inside():
            for network in NETWORKS:
                half = network.replace("/24", "/25")
                ip("route", how, "blackhole", half)
                ip("route", how, "blackhole", half.replace(".0/", ".128/"))

    def _slow(self, rate_bit_s: int) -> None:
        for namespace, device in ((self.vehicle, DEVICE), (self.between, "cell0")):
            with namespace.inside():
                if rate_bit_s:
                    run("tc", "qdisc", "replace", "dev", device, "root", "tbf", "rate", f"{rate_bit_s * self._users}bit",
                        "burst", str(BURST), "limit", str(BUFFER * self._users))  # fmt: skip
                else:
                    run("tc", "qdisc", "delete", "dev", device, "root")

    @staticmethod
    def _new() -> Namespace:
        netns._leave_for_new_network(as_user=False)
        return Namespace()

    @staticmethod
    def _cable(near: Namespace, first: str, far: Namespace, second: str) -> None:
        # `ip` takes a namespace as a path, too: that of our own descriptor of it.
        there = f"/proc/{os.getpid()}/fd/{far._descriptor}"
        with near.inside():
            ip("link", "add", first, "type", "veth", "peer", "name", second, "netns", there)
        for namespace, device in ((near, first), (far, second)):
            with namespace.inside():
                ip("link", "set", "lo", "up")
                ip("link", "set", device, "up")


def ip(*arguments: str) -> None:
    run("ip", *arguments)


def run(*command: str) -> None:
    """Raises RuntimeError with what the program says."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
