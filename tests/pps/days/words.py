"""Messages of a simulated receiver, by true time and troubles."""

from dataclasses import dataclass

from board.time.scales import EPOCH, GPS_LEAD, GPS_LEAPS, Fix, FixKind, LeapEvent, TimeMark
from pps.statements import WEEK_S
from tests.pps.days.trouble import Kind, Trouble

GOOD_NS = 22
SILENT_S, BLIND_S = 3, 8  # of a restart
COASTING_NS = 40  # a second without satellites
ANNOUNCED_S = 6 * 3600  # satellites say a leap second weeks ahead; here it comes up within the day


@dataclass(frozen=True)
class Leaping:
    """Leap seconds: GPS less UTC before the event, and the event; whether satellites tell of it before."""

    seconds: int = 18
    event: LeapEvent | None = None
    is_announced: bool = True

    def at(self, its_s: int) -> int:
        event = self.event
        return self.seconds if event is None or its_s < event.its_s else self.seconds + event.change

    def unix_s(self, its_s: int) -> int:
        return its_s + EPOCH + GPS_LEAPS - self.at(its_s)

    def said(self, its_s: int) -> tuple[int, LeapEvent | None]:
        """What NAV-TIMELS says in the second before: the new count is there a second after the event."""
        event = self.event
        if event is None or not self.is_announced or its_s > event.its_s + 1 or its_s < event.its_s - ANNOUNCED_S:
            return self.at(its_s), None
        return self.seconds, event


class Words:
    """NAV-PVT of a second, and TIM-TP of the next one, at the moments that the loop's clock shows."""

    def __init__(self, leaping: Leaping) -> None:
        self._leaping = leaping

    def fix(self, its_s: int, monotonic: float, accuracy_ns: int | None = GOOD_NS) -> Fix:
        """NAV-PVT. accuracy_ns: None: date and time are not beyond doubt."""
        return Fix(
            monotonic,
            FixKind.FULL,
            utc_ns=None if accuracy_ns is None else self._leaping.unix_s(its_s) * 1_000_000_000 - 412,
            utc_accuracy_ns=accuracy_ns,
            tow_ms=(its_s + GPS_LEAD) % WEEK_S * 1000,
        )

    def mark(self, its_s: int, monotonic: float, accuracy_ns: int | None = GOOD_NS, is_locked: bool = True) -> TimeMark:
        """TIM-TP. accuracy_ns: None: leap seconds are the firmware's guess."""
        if accuracy_ns is None:
            return TimeMark(monotonic, None, 0xFFFF_FFFF, None, False, None, its_s)
        leaps, event = self._leaping.said(its_s)
        unix_s = self._leaping.unix_s(its_s)
        return TimeMark(monotonic, unix_s, accuracy_ns, 3_000, is_locked, leaps, its_s, event)

    def troubled_fix(self, second: int, its_s: int, troubles: list[Trouble]) -> Fix | None:
        """NAV-PVT of a second of the day amid troubles, its moment still open."""
        accuracy_ns: int | None = GOOD_NS
        for trouble in troubles:
            gone = second - trouble.at
            match trouble.kind:
                case Kind.RESTART:
                    if gone < SILENT_S:
                        return None
                    accuracy_ns = None
                case Kind.LOSS if accuracy_ns is not None:
                    accuracy_ns += COASTING_NS * gone
                case Kind.VAGUE if accuracy_ns is not None:
                    accuracy_ns = round(trouble.amount)
                case Kind.EPOCH | Kind.BOTH:
                    its_s += round(trouble.amount)
        return self.fix(its_s, 0.0, accuracy_ns)

    def troubled_mark(self, second: int, its_s: int, troubles: list[Trouble]) -> TimeMark | None:
        """TIM-TP that is said in a second of the day, of the next one."""
        accuracy_ns: int | None = GOOD_NS
        is_locked = True
        for trouble in troubles:
            gone = second - trouble.at
            match trouble.kind:
                case Kind.RESTART:
                    if gone < SILENT_S:
                        return None
                    accuracy_ns = None
                case Kind.LOSS:
                    is_locked = False
                    accuracy_ns = accuracy_ns and accuracy_ns + COASTING_NS * gone
                case Kind.VAGUE if accuracy_ns is not None:
                    accuracy_ns = round(trouble.amount)
                case Kind.MARK | Kind.BOTH:
                    its_s += round(trouble.amount)
        return self.mark(its_s + 1, 0.0, accuracy_ns, is_locked)

    @staticmethod
    def has_pulse(second: int, troubles: list[Trouble]) -> bool:
        """Whether the receiver gives one: it gives none without satellites."""
        return not any(
            trouble.kind is Kind.LOSS or (trouble.kind is Kind.RESTART and second - trouble.at < BLIND_S)
            for trouble in troubles
        )
