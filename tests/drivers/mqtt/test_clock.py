"""V2N waits until the clock is set: certificates and sent messages depend on it."""

import errno
import os

import pytest

import drivers.mqtt.uplink
from board.runtime.errors import InterfaceError
from drivers.contract import Sent
from drivers.mqtt.driver import Mqtt
from drivers.mqtt.options import MqttOptions
from drivers.mqtt.uplink import CLOCK_S, CLOCKLESS
from tests.drivers.fake_worker import FakeWorker
from tests.drivers.host import CAM, SHARED
from tests.drivers.host import request as made


class Clock:
    def __init__(self) -> None:
        self.is_set = False

    def __call__(self) -> bool:
        return self.is_set


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def driver(host, clock, monkeypatch):
    monkeypatch.setattr(drivers.mqtt.uplink, "Worker", FakeWorker)
    monkeypatch.setattr(FakeWorker, "made", [])
    made = Mqtt(MqttOptions(url="mqtts://broker.example:8883"), SHARED._replace(is_clock_set=clock))
    made.start(host)
    return made


def test_no_process_is_started_and_the_link_says_why(driver, host, loop):
    loop.run_for(60)
    assert FakeWorker.made == []
    assert host.links == [(False, CLOCKLESS)]


def test_a_request_is_kept_by_the_station_meanwhile(driver, host):
    request = made(CAM)
    assert driver.send(request) is Sent.BUSY


def test_once_the_clock_is_set_it_goes_on_as_ever_and_takes_requests(driver, host, loop, clock):
    request = made(CAM)
    driver.send(request)
    loop.run_for(10)
    clock.is_set = True
    loop.run_for(CLOCK_S)
    (worker,) = FakeWorker.made
    worker.run()
    assert worker.told
    assert host.times_writable == 1
    assert driver.send(request) is Sent.LATER


def test_one_that_is_stopped_while_it_waits_starts_nothing_later(driver, loop, clock):
    driver.stop()
    driver.stop()
    driver.part()
    clock.is_set = True
    loop.run_for(60)
    assert FakeWorker.made == []


def test_process_that_cannot_be_started_once_the_clock_is_set_fails_the_interface(
    driver, host, loop, clock, monkeypatch
):
    monkeypatch.setattr(FakeWorker, "starts", False)
    clock.is_set = True
    loop.run_for(CLOCK_S)
    (failure,) = host.failures
    assert isinstance(failure, InterfaceError)
    assert os.strerror(errno.EMFILE) in failure.message


def test_its_bearer_may_come_and_go_meanwhile(driver, host, loop, clock):
    driver.bearer_changed("up", "wwan0", "up")
    driver.bearer_changed("down", "", "no coverage")
    assert host.links == [(False, CLOCKLESS)]
