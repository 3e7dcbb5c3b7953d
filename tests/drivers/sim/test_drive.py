"""Drive around a block: signal strength and losses, compared with an independent formula."""

from itertools import pairwise
from math import cos, hypot, log10, radians

import pytest

from drivers.message import Ego, Position
from drivers.sim import drive
from drivers.sim.track import METRES
from drivers.wire import frame
from drivers.wire.geonet.protocol import GeoNetworking, Mib
from tests.drivers.host import CAM, request
from tests.drivers.radio import PATIENCE_S, Air, SimulatedRadio, all_work
from tests.drivers.som301e.test_driver import TWO, leave

MAC = bytes.fromhex("020000000077")
PARKED = drive.at(drive.PARKED)
STEPS = 20_000  # parts of the line of sight


@pytest.fixture
def parked(loop, host):
    """Return another station on the air, and a function that starts a radio at the place of the standing station."""
    loop.patience_s = PATIENCE_S
    air, drivers = Air(), []

    def start(words):
        radio = SimulatedRadio(f"{drive.radio(words)} {PARKED}", (air.address,))
        driver = radio.driver(casters=TWO)
        drivers.append(driver)
        driver.start(host)
        loop.run_until(lambda: all_work(host))
        return radio

    yield air, start
    leave(loop, *drivers)
    air.close()


def cam_from(position, number):
    """Return a frame with a numbered CAM, sent from a position."""
    core = GeoNetworking(MAC, Mib(beacon_s=0.0))
    pdu = CAM[:6] + number.to_bytes(2)
    return frame.wrap(MAC, core.encode(request(pdu), 0.0, Ego(0, position, is_known=True)))


def metres(position):
    """Return metres to the east and north of the block's south-west corner."""
    corner = drive.fixed(drive.point_at(0, 0))
    north = (position.latitude - corner.latitude) * 1e-7 * METRES
    return (position.longitude - corner.longitude) * 1e-7 * METRES * cos(radians(corner.latitude / 1e7)), north


def power_dbm(position):
    """Return the received power: free-space loss, and losses by walls and building metres along the line of sight."""
    (east, north), (here_east, here_north) = metres(position), metres(drive.fixed(drive.PARKED))
    length = max(1.0, hypot(east - here_east, north - here_north))
    inside = [
        0 < here_east + (east - here_east) * step / STEPS < drive.WIDTH_M
        and 0 < here_north + (north - here_north) * step / STEPS < drive.LENGTH_M
        for step in range(STEPS + 1)
    ]
    cuts = sum(one != other for one, other in pairwise(inside))
    free = 32.45 + 20 * log10(5900) + 20 * log10(length / 1000)  # ITU-R P.525: MHz, km
    return 23 - free - 9 * cuts - 0.4 * length * sum(inside) / STEPS


def test_the_way_is_around_the_block_in_the_middle_of_its_streets():
    track = drive.drive()
    assert track.length_m == pytest.approx(2 * (120 + 270), abs=0.1)
    at = [metres(Position(*track.at(way / drive.SPEED_M_S)[:2])) for way in (0, 60, 120, 255, 390, 450, 510, 645)]
    expected = [(-10, -10), (50, -10), (110, -10), (110, 125), (110, 260), (50, 260), (-10, 260), (-10, 125)]
    assert [(round(east), round(north)) for east, north in at] == expected


def test_each_frame_arrives_as_strong_as_free_space_and_walls_let_it(parked, loop, host):
    air, start = parked
    radio = start("fading=0 sensitivity=-200")
    track = drive.drive()
    places = [Position(*track.at(second)[:2]) for second in range(0, 94, 3)]
    places += [drive.fixed(drive.point_at(50, 125)), drive.fixed(drive.point_at(-10, 50))]  # indoors; straight ahead
    for number, position in enumerate(places):
        air.say_frame(cam_from(position, number), radio)
        loop.run_until(lambda number=number: host.count == number + 1)
    strengths = [rx.rssi_dbm for _, _, rx in host.indications]
    assert strengths == pytest.approx([power_dbm(position) for position in places], abs=0.6)
    assert max(strengths) < -20
    assert min(strengths) < -130


def test_behind_the_block_all_is_lost_and_in_sight_nothing_and_each_loss_is_counted(parked, loop, host):
    air, start = parked
    radio = start("")
    track = drive.drive()
    seen, hidden = [], []
    for number in range(936):  # a lap at 10 Hz
        position = Position(*track.at(number / 10)[:2])
        air.say_frame(cam_from(position, number), radio)
        counters = radio.control.ask()
        if number % 20 == 19:
            loop.run_until(lambda number=number: radio.control.ask()["faded"] + host.count == number + 1)
        east, north = metres(position)
        if round(east) == -10 or round(north) == -10:
            seen.append(number)
        elif east > 20 and north > 20:
            hidden.append(number)
    loop.run_until(lambda: radio.control.ask()["faded"] + host.count == 936)
    counters = radio.control.ask()
    got = {int.from_bytes(pdu[6:]) for pdu in host.pdus}
    assert set(seen) <= got
    assert not got & set(hidden)
    assert counters["faded"] == 936 - len(got) == 441  # number for this seed
    assert counters["lost"] == 0
