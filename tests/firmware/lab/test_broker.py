"""The broker of the lab test: what it says where it cannot be had, and what it leaves."""

import shutil
import socket
import ssl
from pathlib import Path

import pytest

from board.runtime.errors import StationError
from drivers.mqtt.options import MqttOptions
from firmware.config import captain_toml
from firmware.lab.broker import Broker
from tests.said import tells

HOST = "127.0.0.1"


@pytest.fixture
def port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])


def test_broker_without_mosquitto_is_refused_with_its_package(
    monkeypatch: pytest.MonkeyPatch, port: int, tmp_path: Path
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name, path: None)
    with pytest.raises(StationError, match="the program mosquitto is missing") as caught:
        Broker(HOST, port, tmp_path)
    assert tells(caught.value.hint, "install", "mosquitto")


def test_without_openssl_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, port: int, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(StationError, match="the program openssl is missing"):
        Broker(HOST, port, tmp_path)


def test_a_port_that_is_taken_is_told_in_mosquittos_own_words(tmp_path: Path) -> None:
    with socket.socket() as holder:
        holder.bind((HOST, 0))  # and does not listen
        with pytest.raises(StationError, match="Address already in use"):
            Broker(HOST, holder.getsockname()[1], tmp_path)


def test_it_speaks_tls_to_those_with_a_certificate_alone_and_is_gone_when_stopped(port: int, tmp_path: Path) -> None:
    broker = Broker(HOST, port, tmp_path)
    try:
        board = tmp_path / "board.toml"
        board.write_text(f'name = "lab"\n{broker.interface("lab-A")}')
        (found,) = captain_toml.load(None, (), str(board)).interfaces
        options = found.options
        assert isinstance(options, MqttOptions)
        context = ssl.create_default_context(cafile=options.ca)
        context.load_cert_chain(options.certificate, options.key)
        with context.wrap_socket(socket.create_connection((HOST, port)), server_hostname=HOST) as made:
            assert made.version() == "TLSv1.3"
        stranger = ssl.create_default_context(cafile=options.ca)
        refused = stranger.wrap_socket(socket.create_connection((HOST, port)), server_hostname=HOST)
        with refused, pytest.raises(ssl.SSLError, match="certificate required"):
            refused.recv(1)
    finally:
        broker.stop()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((HOST, port))
