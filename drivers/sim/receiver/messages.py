"""UBX messages and NMEA sentences of a simulated receiver for an epoch."""

import calendar
import time
from dataclasses import dataclass
from typing import NamedTuple

from board.time.scales import GPS_EPOCH, Carrier, FixKind
from drivers.sim.track import Motion
from drivers.wire.gnss import nmea
from drivers.wire.gnss.time import WEEK, Leap
from drivers.wire.ublox.health import MonRf, RfBlock, SecSig
from drivers.wire.ublox.messages import NavPvt, NavStatus
from drivers.wire.ublox.time import NavTimeLs, TimTp


@dataclass(frozen=True)
class Sky:
    """Surroundings of the antenna, and errors of the time; a test replaces it while the receiver runs.

    jamming, spoofing  states of SEC-SIG: 1 none, 2 and 3 increasing.
    antenna            state of MON-RF: 2 ok, 3 short circuit, 4 open.
    offset             error of the position to the north, 1e-7 degree.
    has_epochs         False: NAV-PVT and NMEA sentences are left out.
    epoch_error_s      seconds by which their time is ahead of the true time.
    has_marks          False: TIM-TP is left out.
    mark_error_s       seconds by which the time in TIM-TP is ahead.
    is_locked          False: pulses do not follow the satellites, and TIM-TP reports that.
    time_accuracy_ns   time accuracy in NAV-PVT once time is resolved.
    """

    satellites: int = 28
    jamming: int = 1
    spoofing: int = 1
    antenna: int = 2
    offset: int = 0
    has_epochs: bool = True
    epoch_error_s: int = 0
    has_marks: bool = True
    mark_error_s: int = 0
    is_locked: bool = True
    time_accuracy_ns: int = 22


class Civil(NamedTuple):
    """Second of UTC; second is 60 in a leap second."""

    year: int
    month: int
    day: int
    hour: int
    minute: int
    second: int


class Moment(NamedTuple):
    """State of a receiver at an epoch.

    gps_ms       GPS time since its epoch.
    leap         true leap seconds.
    is_resolved  True if the receiver has leap seconds from satellites; else it uses default_leap.
    age          age of corrections, as an index in CORRECTION_AGE_S.
    """

    gps_ms: int
    leap: Leap
    is_resolved: bool
    default_leap: int
    kind: FixKind
    carrier: Carrier
    age: int
    motion: Motion
    sky: Sky
    since_boot_ms: int
    first_fix_ms: int

    @property
    def itow_ms(self) -> int:
        return self.gps_ms % (WEEK * 1000)

    @property
    def told(self) -> "Moment":
        """Moment with the time that the receiver reports, including epoch_error_s."""
        return self._replace(gps_ms=self.gps_ms + self.sky.epoch_error_s * 1000)

    @property
    def counted(self) -> Leap:
        """Leap seconds that the receiver uses."""
        return self.leap if self.is_resolved else Leap(self.default_leap)


def civil(gps: int, leap: Leap) -> Civil:
    """Return the UTC of a second of GPS time."""
    is_leap_second = leap.change > 0 and gps == leap.event
    fields = time.gmtime(leap.unix(gps))[:6]
    return Civil(*fields)._replace(second=60) if is_leap_second else Civil(*fields)


def nav_pvt(moment: Moment) -> NavPvt:
    moment = moment.told
    seconds, milli = divmod(moment.gps_ms, 1000)
    when = civil(seconds, moment.counted)
    has_fix = moment.kind in (FixKind.FLAT, FixKind.FULL)
    motion = moment.motion
    accuracy = {Carrier.NONE: 1200, Carrier.FLOAT: 180, Carrier.FIXED: 14}[moment.carrier] if has_fix else 4_294_967_295
    return NavPvt(
        moment.itow_ms,
        *when,
        valid=0x07 if moment.is_resolved else 0x03,
        time_accuracy_ns=moment.sky.time_accuracy_ns if moment.is_resolved else 1_000_000_000,
        # A negative value: the receiver's clock is slightly early, so the epoch is just before the full second.
        nano=milli * 1_000_000 - 412,
        fix_type=moment.kind,
        flags=has_fix | (moment.carrier is not Carrier.NONE) << 1 | moment.carrier << 6,
        flags2=0xE0 if moment.is_resolved else 0x20,
        satellites=moment.sky.satellites if has_fix else 0,
        longitude=motion.longitude,
        latitude=motion.latitude + moment.sky.offset,
        height_mm=motion.altitude_mm,
        above_sea_mm=motion.altitude_mm - 46_600,
        horizontal_mm=accuracy,
        vertical_mm=min(accuracy * 2, 4_294_967_295),
        north_mm_s=0,
        east_mm_s=0,
        down_mm_s=0,
        speed_mm_s=motion.speed_mm_s,
        heading=motion.heading,
        speed_accuracy_mm_s=70,
        heading_accuracy=90_000,
        pdop=118 if has_fix else 9999,
        flags3=(not has_fix) | moment.age << 1,
        vehicle_heading=0,
        declination=0,
        declination_accuracy=0,
    )


def nav_status(moment: Moment) -> NavStatus:
    has_fix = moment.kind in (FixKind.FLAT, FixKind.FULL)
    flags2 = moment.sky.spoofing << 3 | moment.carrier << 6
    return NavStatus(moment.itow_ms, moment.kind, 0x0C | has_fix, 0, flags2, moment.first_fix_ms, moment.since_boot_ms)


def nav_timels(moment: Moment) -> NavTimeLs:
    gps, leap = moment.gps_ms // 1000, moment.leap
    if not moment.is_resolved:
        return NavTimeLs(moment.itow_ms, 0, 0, moment.default_leap, 0, 0, 0, 0, 0, 0)
    if leap.event is None:
        return NavTimeLs(moment.itow_ms, 0, 2, leap.seconds, 0, 0, 0, 0, 0, 1)
    has_passed = gps > leap.event
    last_day = (leap.event - leap.seconds) // 86_400 - 1
    return NavTimeLs(
        moment.itow_ms,
        0,
        2,
        leap.seconds + leap.change * has_passed,
        2,
        leap.change,
        leap.event - gps,
        last_day // 7,
        last_day % 7 + 1,
        3,
    )


def tim_tp(moment: Moment, is_utc: bool, repeats: bool) -> TimTp:
    """Return the TIM-TP of the next pulse.

    repeats  True: a leap second has the number of the second before it. False: of the second after it.
    """
    gps, leap = moment.gps_ms // 1000 + 1 + moment.sky.mark_error_s, moment.counted
    is_leap_second = leap.change > 0 and gps == leap.event
    count = gps
    if is_utc:
        count = leap.unix(gps) - GPS_EPOCH + (is_leap_second and not repeats)
    is_locked = moment.kind is not FixKind.NONE and moment.sky.is_locked
    flags = (0x03 if is_utc else 0x02) | (0 if is_locked else 0x20)
    # The quantisation error of the pulse drifts through 8 ns, a period of the 125 MHz clock.
    quantisation_ps = gps * 1733 % 8000 - 4000
    return TimTp(count % WEEK * 1000, 0, quantisation_ps, count // WEEK, flags, 0x30 if is_utc else 0xF0)


def mon_rf(moment: Moment) -> MonRf:
    sky = moment.sky
    indicator = {1: 4, 2: 90, 3: 230}.get(sky.jamming, 0)
    first = RfBlock(0, sky.jamming, sky.antenna, 1, 0, 88, 5200, indicator, 9, 170, -3, 168)
    return MonRf(0, (first, first._replace(block=1)))


def sec_sig(moment: Moment) -> SecSig:
    return SecSig(1, True, moment.sky.jamming, True, moment.sky.spoofing)


def sentences(moment: Moment) -> dict[str, bytes]:
    """Return the NMEA sentences of an epoch, by formatter."""
    moment = moment.told
    seconds, milli = divmod(moment.gps_ms, 1000)
    when = civil(seconds, moment.counted)
    clock = f"{when.hour:02}{when.minute:02}{when.second:02}.{milli // 10:02}"
    motion = moment.motion
    has_fix = moment.kind in (FixKind.FLAT, FixKind.FULL)
    latitude = _minutes(motion.latitude + moment.sky.offset, "NS", 2) if has_fix else ","
    longitude = _minutes(motion.longitude, "EW", 3) if has_fix else ","
    quality = {Carrier.NONE: 1, Carrier.FLOAT: 5, Carrier.FIXED: 4}[moment.carrier] if has_fix else 0
    height = f"{(motion.altitude_mm - 46_600) / 1000:.3f},M,46.600,M" if has_fix else ",M,,M"
    speed = f"{motion.speed_mm_s * 3.6 / 1852:.3f}" if has_fix else ""
    course = f"{motion.heading / 1e5:.2f}" if has_fix else ""
    kmh = f"{motion.speed_mm_s * 3.6 / 1000:.3f}" if has_fix else ""
    satellites = moment.sky.satellites if has_fix else 0
    bodies = {
        "GGA": f"{clock},{latitude},{longitude},{quality},{satellites:02},0.62,{height},,",
        "RMC": f"{clock},{'AV'[not has_fix]},{latitude},{longitude},{speed},{course},"
        f"{when.day:02}{when.month:02}{when.year % 100:02},,,{'AN'[not has_fix]}",
        "GSA": f"A,{3 if has_fix else 1},05,12,,,,,,,,,,,1.18,0.62,1.00",
        "VTG": f"{course},T,,M,{speed},N,{kmh},K,A",
        "ZDA": f"{clock},{when.day:02},{when.month:02},{when.year},00,00",
    }
    return {formatter: nmea.encode(f"GN{formatter},{body}") for formatter, body in bodies.items()}


def _minutes(angle: int, sides: str, digits: int) -> str:
    """Return an angle as degrees and minutes, exact to 1e-7 degree, with its side (N, S, E, W)."""
    degrees, rest = divmod(abs(angle), 10**7)
    minutes, fraction = divmod(rest * 60, 10**7)
    return f"{degrees:0{digits}}{minutes:02}.{fraction:07},{sides[angle < 0]}"


def gps_of(year: int, month: int, day: int, hour: int = 0, minute: int = 0, second: int = 0, leap: int = 18) -> int:
    """Return the GPS time of a UTC date and time."""
    return calendar.timegm((year, month, day, hour, minute, second)) - GPS_EPOCH + leap
