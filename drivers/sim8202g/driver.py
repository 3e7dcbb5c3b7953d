"""Driver for the SIMCom SIM8202G-M2, a 5G modem used as a bearer: bring-up, watch, recovery.

It carries no PDUs itself. Its link is up while the network can carry packets of other interfaces. The driver never
switches power: if only a power cycle can help, it calls host.fail(StuckError).

    step           done when                                                                at most
    port           the tty exists and the modem answers AT                                  90 s
    identity       model and firmware are known, the USB composition is that of the bearer  60 s
    sim            the card is ready, and its PIN entered                                   60 s
    configuration  radio is on, network mode and access point are set                       90 s
    registration   one of 5G, LTE, 3G is registered, at home or roaming                     180 s
    attach         the packet service is attached                                           200 s
    bearer         the network device has an address                                        120 s

If a step exceeds its time, recovery begins (recovery.py). An absent or locked card blocks the modem until an operator
changes something; the driver checks every 30 s.
"""

from collections.abc import Mapping
from typing import ClassVar

from board.runtime.errors import RequestError
from drivers.contract import Answer, Can, Capabilities, Host, Sent, Shared
from drivers.message import Request
from drivers.sim8202g.operator import Operations
from drivers.sim8202g.options import ModemOptions
from drivers.sim8202g.running import ModemHistory, RunningModem
from drivers.sim8202g.system import System


class Sim8202g:
    """Driver of one modem.

    system  programs and devices of the machine; None: those of shared.machine.
    """

    Options: ClassVar[type] = ModemOptions
    capabilities: ClassVar[Capabilities] = Capabilities(Can.BEARER, "5g", 0)

    def __init__(self, options: ModemOptions, shared: Shared, system: System | None = None) -> None:
        self._options = options
        self._system = system or System(shared.machine)
        self._history = ModemHistory(options)
        self._modem: RunningModem | None = None  # stays after stop(), until the next start() replaces it

    def start(self, host: Host) -> None:
        """Open the AT port and start the bring-up. Raises InterfaceError if the port does not exist."""
        modem = RunningModem(self._options, self._system, host, self._history)
        modem.open()
        self._modem = modem
        modem.start()

    def send(self, request: Request) -> Sent:
        """Refuse a request. Always raises RequestError: a bearer sends no messages."""
        name = self._modem.host.name if self._modem else self.capabilities.technology
        raise RequestError(f"{name} is a bearer, which sends no messages")

    def refresh(self) -> None:
        """Report details again, because the ages of the values in them have grown."""
        if self._modem is not None:
            self._modem.report()

    def stop(self) -> None:
        if self._modem is not None:
            self._modem.stop()

    # -- drivers.contract.Operated

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """Execute the command `status`, `at` or `reset` of operator.py."""
        modem = self._modem
        port, reset = (None, _nothing) if modem is None else (modem.port, modem.reset)
        Operations(port, self._history.known, reset).operate(do, arguments, answer)


def _nothing() -> None:
    """Do nothing; the reset function of a modem that was never started."""
