"""Lines of authorized_keys: public keys, and what else people paste."""

import base64
import random
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

from firmware.card import ssh_keys
from tests.firmware.card.conftest import KEY, Look, keys_of, mistakes, noted, refused, remarks

KIND, WRITTEN, _ = KEY.split()


def packed(kind: str, *fields: bytes) -> str:
    octets = b"".join(len(each).to_bytes(4) + each for each in (kind.encode(), *fields))
    return f"{kind} {base64.b64encode(octets).decode()}"


def rsa(bits: int) -> str:
    return packed("ssh-rsa", b"\1\0\1", b"\0" + b"\xff" * (bits // 8))


# G of P-256. Source: NIST SP 800-186, clause 3.2.1.3.
BASE_POINT = bytes.fromhex(
    "046b17d1f2e12c4247f8bce6e563a440f277037d812deb33a0f4a13945d898c296"
    "4fe342e2fe1a7f9b8ee7eb4a7c0f9e162bce33576b315ececbb6406837bf51f5"
)
OFF_CURVE = BASE_POINT[:-1] + bytes([BASE_POINT[-1] ^ 1])
SOUND = [
    KEY,
    f"{KIND}\t{WRITTEN}",
    f'from="10.0.0.*,!10.0.0.7",command="echo \\"a b\\"" {KEY}',
    f"restrict \t {KEY}",
    f'No-PTY,environment="A=\\ b",expiry-time="20990101" {KEY}',
    f'command="cat {KEY}" {KEY}',
    f",no-Touch-Required,,X11-forwarding, {KEY}",
    rsa(2048),
    packed("ecdsa-sha2-nistp256", b"nistp256", BASE_POINT),
    packed("sk-ssh-ed25519@openssh.com", bytes(32), b"ssh:"),
    packed("sk-ecdsa-sha2-nistp256@openssh.com", b"nistp256", BASE_POINT, b"ssh:"),
]
DAMAGED = [
    KEY[:40],
    KEY.replace("AAAAC3", "AAAAC4", 1),
    f"{KIND} {WRITTEN}=",
    f"{KIND} {WRITTEN[:30]}\xa0{WRITTEN[30:]}",
    rsa(768),
    packed("ssh-ed25519", bytes(10)),
    packed("ssh-rsa", b"\1\0\1"),
    packed("ecdsa-sha2-nistp256", b"nistp384", b"\4" + bytes(96)),
    packed("ecdsa-sha2-nistp256", b"nistp256", OFF_CURVE),
]
OTHER = ["ssh-ed25519", "hello world", KEY.replace(" ", "\xa0", 1)]
# Before a sound key; sshd of OpenSSH 9.2 refused each such line, and took the options of SOUND.
NO_OPTIONS = [
    "- ", "* ", "$ ", "x", "foo ", "AuthorizedKeys: ", "ssh-ed25519 ", "restrict\v", "restrict, pty ", "no-restrict ",
    "restrict", "pty=\"x\" ", "command ", 'command="ls ', 'restrict"pty" ', 'environment="A=\\\\" ', "restrict pty ", "\ufffd ",
]  # fmt: skip


@pytest.mark.parametrize("kind", ["ed25519", "ecdsa", "rsa"])
def test_key_that_ssh_keygen_makes_is_taken(tmp_path: Path, kind: str):
    command = ["ssh-keygen", "-q", "-t", kind, "-N", "", "-C", "me at home", "-f", str(tmp_path / "key")]
    subprocess.run(command, check=True)
    line = (tmp_path / "key.pub").read_text().strip()
    assert keys_of(f"# of the workshop\n\n{line}\n") == ([line], [])


@pytest.mark.parametrize("line", SOUND)
def test_line_with_a_sound_key_is_taken_as_it_is(line: str):
    assert keys_of(line) == ([line], [])


@pytest.mark.parametrize(
    ("line", "value"),
    [
        *((line, "AAAA") for line in DAMAGED),
        *((line, "is not a public key; copy the whole line again") for line in OTHER),
        *((f"{words}{KEY}", f"before the key {ssh_keys.short(KEY)}") for words in NO_OPTIONS),
        (f'"{KEY}"', "before the key"),
        ("ssh-dss AAAA me", "make a new key pair"),
        (f"restrict ssh-ed25519-cert-v01@openssh.com {WRITTEN}", "put the .pub file of another key here"),
        (rsa(768), "make a new key pair"),
        (f"{KEY}{KEY}", "more than one key"),
        (f"{KEY}restrict {KEY}", "more than one key"),
        ("-----BEGIN OPENSSH PRIVATE KEY-----\nb3BlbnNzaC1rZXktdjE\n", ".pub"),
        ("PuTTY-User-Key-File-3: ssh-ed25519\nEncryption: none\n", ".pub"),
        ("---- BEGIN SSH2 PUBLIC KEY ----\nComment: x\n", "ssh-keygen -i -f FILE"),
    ],
)
def test_line_without_a_sound_key_is_named_once_and_spoils_no_other(line: str, value: str):
    keys, told = keys_of(f"{KEY}\n{line}")
    assert keys == [KEY]
    assert [text.partition(": ")[0] for text in told] == ["authorized_keys:2"]
    assert value in told[0]


def test_line_that_was_broken_in_two_is_named_twice():
    keys, told = keys_of(f"{KEY}\n{KEY[:30]}\n{KEY[30:]}\n{KEY}")
    assert keys == [KEY, KEY]
    assert [text.split(": ")[0] for text in told] == ["authorized_keys:2", "authorized_keys:3"]


def test_key_that_is_shown_has_its_beginning_and_end_alone():
    assert ssh_keys.short(KEY) == "AAAAC3Nz...SxVTpF"
    assert ssh_keys.short(f"{KIND} AAAA{20 * 'x'}") == f'"AAAA{20 * "x"}"'
    assert ssh_keys.short(f"{KIND} AAAA{21 * 'x'}") == "AAAAxxxx...xxxxxx"


PIECES = some.sampled_from([KEY, KEY[:40], "\n", "\n", "restrict", ",", '"', "#", " ", "\v", "ssh-dss AAAA ", "from="])


@given(text=some.text(max_size=200) | some.lists(PIECES, max_size=20).map("".join))
def test_text_of_any_letters_is_taken_or_named(text: str):
    keys, told = keys_of(text)
    lines = [line.strip() for line in text.split("\n")]
    assert len(keys) + len(told) == len([line for line in lines if line and not line.startswith("#")])


# Of a computer: it is missing; slow; run by a user without a name, as in a container; of another kind.
@pytest.mark.parametrize(
    ("script", "value", "remedy"),
    [
        ("", "does not run here", "install openssh-client"),
        ("exec sleep 20", "timeout", "another computer"),
        ("echo No user exists for uid 1234 >&2; exit 255", '"No user exists for uid 1234"', "another user"),
        ("echo unknown option -- l >&2; exit 1", '"unknown option -- l"', "another computer"),
        ("kill -9 $$", '""', "another computer"),
    ],
)
def test_computer_without_ssh_keygen_takes_what_looks_like_a_key_and_says_so(
    look: Look, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch,
    script: str, value: str, remedy: str,
):  # fmt: skip
    folder = tmp_path_factory.mktemp("bin")
    if script:
        (folder / "ssh-keygen").write_text(f"#!/bin/sh\n{script}\n")
        (folder / "ssh-keygen").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin" if script else str(folder))
    if "sleep" in script:
        monkeypatch.setattr(ssh_keys, "LIMIT_S", 0.2)
    found = look({"authorized_keys": f"{KEY}\nhello\n"}, is_box=False)
    assert (found.keys, refused(found), noted(found)) == ([KEY], ["authorized_keys:2"], ["authorized_keys"])
    assert [word for word in ("ssh-keygen", value, remedy) if word not in remarks(found)[0]] == []


def test_comment_of_another_encoding_spoils_no_key(look: Look):
    other = KEY.replace("me", "m\xfcller").encode("latin-1")
    found = look({"authorized_keys": b"# m\xfcnchen\n" + other + f"\n{KEY}\n".encode()})
    assert mistakes(found) == []
    assert [key.split()[:2] for key in found.keys] == [[KIND, WRITTEN]] * 2


@pytest.mark.parametrize("place", [3, 20])
def test_key_with_an_octet_of_another_encoding_is_named_in_its_line(look: Look, place: int):
    octets = bytearray(KEY.encode())
    octets[place] = 0xFC
    found = look({"authorized_keys": f"{KEY}\n".encode() + octets})
    assert (found.keys, refused(found)) == ([KEY], ["authorized_keys:2"])


def test_octets_that_are_no_text_are_refused(look: Look):
    assert refused(look({"authorized_keys": random.Random(4).randbytes(4000)})) == ["authorized_keys:1"]


def test_keys_of_several_lines_in_a_user_data_block_are_taken(look: Look):
    text = f"#cloud-config\nssh_authorized_keys:\n  - |\n    {KEY}\n    {KIND} {WRITTEN} second\n  - {KEY[:40]}\n"
    found = look({"user-data": text})
    assert (found.keys, refused(found)) == ([KEY, f"{KIND} {WRITTEN} second"], ["user-data:6"])


def test_keys_of_many_users_are_asked_for_at_once_and_a_private_one_ends_its_item(
    look: Look, monkeypatch: pytest.MonkeyPatch
):
    calls = []
    run = subprocess.run
    monkeypatch.setattr(subprocess, "run", lambda *words, **named: calls.append(words) or run(*words, **named))
    items = "".join(f"  - name: u{number}\n    ssh_authorized_keys: [{KEY}]\n" for number in range(40))
    private = "    ssh_authorized_keys:\n      - |\n        -----BEGIN RSA PRIVATE KEY-----\n        MIIE\n"
    found = look({"user-data": f"#cloud-config\nusers:\n{items}  - name: x\n{private}      - {KEY}\n"})
    assert (len(found.keys), len(calls)) == (41, 1)
    assert refused(found) == ["user-data:86"]
    assert "as operator" in remarks(found)[0]
