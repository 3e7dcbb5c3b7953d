"""Sets on the data partition: one in force, as a whole, wherever the power goes."""

import os
import pwd
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from firmware.card.box_file import BoxOptions, ConsoleOptions, Ethernet, Wifi
from firmware.card.store import STATION, Store
from firmware.card.system_files import SystemFile, system_files
from pps.chrony import configuration
from tests.firmware.card.conftest import KEY

A, B = "aaaaaaaa", "bbbbbbbb"
FILES = {"captain.toml": b"[station]\n", "mqtt/box.key": b"key"}


def content(folder: Path) -> dict[str, bytes]:
    """Of the set in force."""
    current = folder / "current"
    return {
        path.relative_to(current).as_posix(): path.read_bytes() for path in sorted(current.rglob("*")) if path.is_file()
    }


def modes(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): oct(stat.S_IMODE(path.stat().st_mode))
        for path in sorted(folder.rglob("*"))
    }


def test_set_that_is_accepted_lies_there_with_its_keys_and_made_files(tmp_path: Path):
    Store(tmp_path / "owner").accept(
        A, [KEY], FILES, {"etc/hostname": SystemFile("x\n"), "etc/localtime": SystemFile(target="/z")}
    )
    assert os.readlink(tmp_path / "owner/current") == A
    assert content(tmp_path / "owner") == {
        "authorized_keys": f"{KEY}\n".encode(),
        "captain.toml": b"[station]\n",
        "made/etc/hostname": b"x\n",
        "mqtt/box.key": b"key",
    }
    assert os.readlink(tmp_path / "owner/current/made/etc/localtime") == "/z"


def test_files_of_a_set_have_modes_for_their_one_reader(tmp_path: Path):
    Store(tmp_path).accept(A, [KEY], FILES, {"etc/x": SystemFile("secret", 0o600)})
    found = modes(tmp_path / A)
    assert found["mqtt/box.key"] == "0o600"
    assert found["mqtt"] == "0o750"
    assert found["authorized_keys"] == "0o644"
    assert found["captain.toml"] == "0o640"
    assert found["made/etc/x"] == "0o600"


def test_files_of_a_set_are_given_to_the_station_where_it_has_a_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    given: list[tuple[str, int, int]] = []
    user = SimpleNamespace(pw_uid=801, pw_gid=802)
    monkeypatch.setattr(pwd, "getpwnam", lambda name: user if name == STATION else None)
    monkeypatch.setattr(os, "chown", lambda path, uid, gid: given.append((Path(path).name, uid, gid)))
    Store(tmp_path).accept(A, [KEY], FILES, {"etc/x": SystemFile("x")})
    assert sorted(given) == [("box.key", 801, 802), ("captain.toml", -1, 802), ("mqtt", -1, 802)]


def test_set_before_the_accepted_one_is_forgotten(tmp_path: Path):
    store = Store(tmp_path)
    store.keep_keys(A, [KEY])
    store.accept(A, [KEY], FILES, {})
    store.accept(B, [], FILES, {})
    store.tell(B, 0, ["x"])
    assert sorted(path.name for path in tmp_path.iterdir()) == [B, "current", "looked"]
    assert (tmp_path / "looked").read_text() == f"{B}\n0\nx\n"


def test_keys_of_a_refused_set_are_kept_until_one_is_accepted(tmp_path: Path):
    store = Store(tmp_path)
    store.keep_keys(A, [KEY])
    assert (tmp_path / "spare/authorized_keys").read_text() == f"{KEY}\n"
    assert not store.has_current
    store.accept(B, [], {}, {})
    assert not (tmp_path / "spare").exists()


class CutError(Exception):
    """The power has gone."""


def cut(patched: pytest.MonkeyPatch, calls: int) -> None:
    """After so many calls to the system."""
    left = iter(range(calls))

    def counted(real: Callable[..., object]) -> Callable[..., object]:
        def call(*words: object, **more: object) -> object:
            if next(left, None) is None:
                raise CutError
            return real(*words, **more)

        return call

    for name in ("rename", "fsync", "open", "fchmod", "readlink"):
        patched.setattr(os, name, counted(getattr(os, name)))


def test_set_whose_write_is_cut_anywhere_is_in_force_as_a_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Each call to the system is the first that is not made once; then the box starts again."""
    new = {"captain.toml": b"new", "mqtt/box.key": b"new"}

    whole = Store(tmp_path / "whole")
    whole.accept(A, [KEY], FILES, {"etc/hostname": SystemFile("a\n")})
    whole.accept(B, [], new, {"etc/hostname": SystemFile("b\n")})
    after = content(tmp_path / "whole")
    seen = set()
    for last in range(60):
        folder = tmp_path / str(last)
        store = Store(folder)
        store.accept(A, [KEY], FILES, {"etc/hostname": SystemFile("a\n")})
        before = content(folder)
        with monkeypatch.context() as patched, suppress(CutError):
            cut(patched, last)
            store.accept(B, [], new, {"etc/hostname": SystemFile("b\n")})
        found = content(folder)
        assert found in (before, after)
        seen.add(found == before)
        store.accept(B, [], new, {"etc/hostname": SystemFile("b\n")})
        assert content(folder)["captain.toml"] == b"new"
        assert sorted(path.name for path in folder.iterdir()) == [B, "current"]
    assert seen == {True, False}


def test_wifi_name_of_any_letters_is_written_in_hexadecimal():
    wifi = Wifi("DE", 'a"b\\\n', "12345678", None, True)
    text = system_files(BoxOptions(wifi=wifi), set())["etc/wpa_supplicant/wpa_supplicant-wlan0.conf"]
    assert text.mode == 0o600
    assert text.text == (
        "country=DE\nctrl_interface=/run/wpa_supplicant\nnetwork={\n    ssid=6122625c0a\n    scan_ssid=1\n"
        '    key_mgmt=WPA-PSK WPA-PSK-SHA256 SAE\n    psk="12345678"\n    ieee80211w=1\n}\n'
    )


def test_wifi_without_password_or_with_a_made_key_is_written_for_wpa_supplicant():
    path = "etc/wpa_supplicant/wpa_supplicant-wlan0.conf"
    assert "key_mgmt=NONE" in system_files(BoxOptions(wifi=Wifi("DE", "x")), set())[path].text
    text = system_files(BoxOptions(wifi=Wifi("DE", "x", None, "AB" * 32)), set())[path].text
    assert f"    psk={'ab' * 32}\n" in text
    assert "SAE" not in text


def test_options_of_the_box_are_written_where_its_services_look():
    options = BoxOptions(
        "Captain-7", "Europe/Berlin", None, ConsoleOptions(False), Ethernet("10.0.0.2/24", "10.0.0.1", ("9.9.9.9",))
    )
    found = system_files(options, {"captain.toml", "board.toml", "mqtt/x"})
    assert found["etc/hostname"].text == "captain-7\n"
    assert found["etc/localtime"].target == "/usr/share/zoneinfo/Europe/Berlin"
    assert found["run/systemd/network/20-eth0.network.d/owner.conf"].text == (
        "[Network]\nDHCP=no\nLinkLocalAddressing=ipv6\nAddress=10.0.0.2/24\nGateway=10.0.0.1\nDNS=9.9.9.9\n"
    )
    assert found["run/captain-image/environment"].text == (
        "CAPTAIN_CONFIG=/data/owner/current/captain.toml\nCAPTAIN_BOARD=/data/owner/current/board.toml\nCAPTAIN_SHELL=\n"
    )


def test_time_servers_are_written_where_chronyd_looks():
    place = f"{configuration.SOURCES.removeprefix('/')}/owner.sources"
    found = system_files(BoxOptions(time_servers=("ptbtime1.ptb.de", "192.0.2.1")), set())
    assert found[place].text == "server ptbtime1.ptb.de iburst\nserver 192.0.2.1 iburst\n"
    assert f"\nsourcedir {configuration.SOURCES}\n" in configuration.configuration()


def test_options_that_say_nothing_write_nothing():
    assert system_files(BoxOptions(), set()) == {"run/captain-image/environment": SystemFile("")}
