"""In the guest: what the station and its helpers write, by their own code, until the power goes.

Process 1 of a machine that has the image's own kernel, early boot and data partition, and no systemd. First it checks
the data that the early boot has repaired and says what it has found; after the line `go {...}` it writes. Each line on the
console is `@word {...}`: what is begun, what is acknowledged, what was found. The host does everything else.
"""

import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

from board.runtime import state_file
from drivers.sim8202g.session import Session, SessionFile
from firmware.card.store import Store
from firmware.tap.counts import Taken
from firmware.tap.recording import Recording, Rotation

DATA = Path("/data")
STATES = [DATA / "captain" / f"state-{number}.json" for number in range(3)]
SESSION = DATA / "captain" / "1-1.2-qmi.json"
OWNER = DATA / "owner"
RECORDS = DATA / "captain" / "records"
IDENTITY = {"machine-id": DATA / "identity/machine-id", "ssh": DATA / "ssh/ssh_host_ed25519_key"}
NOTES = Path("/run/early")
BY_PARTUUID = Path("/dev/disk/by-partuuid")
RECORDS_HZ = 20
LITTER = DATA / "litter"
LITTER_OCTETS, LITTER_BLOCKS, LITTER_ROUNDS, LITTER_HZ = 8 << 20, 16, 100, 20
BLOCK = 4096
# What nobody waits for is on its way to the card soon, so that the drive's cache has some of it whenever the power goes.
WRITEBACK = {"dirty_writeback_centisecs": "10", "dirty_expire_centisecs": "20"}
PDU = bytes.fromhex("020200000539") + bytes(300)
SLOT_OCTETS = 2 << 20  # of the end of the slot that does not run: an update in small
MIB = 1 << 20


def main() -> None:
    disk = _disk()
    say("found", {"fsck": fsck(), "kept": found(), "notes": NOTES.read_text().splitlines()[1:], "fs": _mounted()[1]})
    given = json.loads(sys.stdin.readline().removeprefix("go "))
    for process in (record, litter):
        if os.fork() == 0:
            process()
    random, numbers = Random(given["seed"]), given["numbers"]
    works: dict[str, Callable[[int, Random], None]] = {
        **{path.name: _state(path) for path in STATES},
        "session": _session,
        "owner": _owner,
        "counters": _counters,
        "slot": lambda number, random: _slot(disk, number),
    }
    weights = {"counters": 2, "slot": 1, "owner": 3}
    while True:
        name = random.choices(list(works), [weights.get(name, 4) for name in works])[0]
        number = numbers[name] = numbers.get(name, 0) + 1
        say("begin", {"what": name, "number": number})
        works[name](number, random)
        say("done", {"what": name, "number": number})


def say(word: str, told: dict[str, object]) -> None:
    os.write(1, f"\n@{word} {json.dumps(told)}\n".encode())


def fsck() -> str:
    """What e2fsck has against the data partition, which the early boot has repaired and mounted; empty: nothing."""
    device, kind, options = _mounted()
    if kind != "ext4" or not device.startswith("/dev/"):
        return f"{device} is no partition"
    subprocess.run(["umount", "/data"], check=True)
    ended = subprocess.run(["e2fsck", "-fn", device], capture_output=True, text=True, check=False)
    subprocess.run(["mount", "-t", "ext4", "-o", options, device, "/data"], check=True)
    return "" if ended.returncode == 0 else f"{ended.returncode}: {ended.stdout[-600:]}"


def found() -> dict[str, object]:
    """Of each thing its number as it is on the card, -1 where it has none, or what is wrong with it."""
    kept: dict[str, object] = {path.name: _read_state(path) for path in STATES}
    session = SessionFile(SESSION).load()
    kept["session"] = int(session.client) if session else -1
    kept["owner"] = read_owner()
    kept["records"] = _read_records()
    for name, path in IDENTITY.items():
        kept[name] = hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path.exists() else ""
    kept["left"] = sorted(path.name for path in (DATA / "captain").iterdir() if path.suffix == ".new")
    return kept


def record() -> None:
    """As captain v2n-tap does, in a process of its own: never ends."""
    for path in RECORDS.glob("*") if RECORDS.is_dir() else ():
        path.unlink()
    RECORDS.mkdir(exist_ok=True)
    recording = Recording(RECORDS / "drive.jsonl", Rotation(octets=65_536, keep=8))
    number = 0
    while True:
        made_ns = time.monotonic_ns()
        recording.write(Taken(PDU, 2001, f"{number}", "v2x", made_ns))
        if number % 2 == 0:
            say("record", {"number": number, "made_ns": made_ns})
        number += 1
        time.sleep(1 / RECORDS_HZ)
        recording.idle()


def litter() -> None:
    """As a data base without care: blocks all over a file, which grows, gets another name, and goes. Never ends."""
    for name, value in WRITEBACK.items():
        (Path("/proc/sys/vm") / name).write_text(value)
    LITTER.mkdir(exist_ok=True)
    random = Random(0)
    while True:
        file = os.open(LITTER / "new", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        for _ in range(LITTER_ROUNDS):
            for _ in range(LITTER_BLOCKS):
                os.pwrite(file, random.randbytes(BLOCK), random.randrange(LITTER_OCTETS // BLOCK) * BLOCK)
            time.sleep(1 / LITTER_HZ)
        os.close(file)
        (LITTER / "new").rename(LITTER / "old")


def _state(path: Path) -> Callable[[int, Random], None]:
    def write(number: int, random: Random) -> None:
        pad = random.randbytes(random.choice([20, 3_000, 40_000])).hex()
        text = json.dumps({"number": number, "pad": pad})
        state_file.keep(path, f"{text}\n{_digest(text)}".encode())

    return write


def _read_state(path: Path) -> object:
    octets = state_file.read(path, MIB)
    if octets is None:
        return -1
    text, _, digest = octets.decode("utf-8", "replace").rpartition("\n")
    return json.loads(text)["number"] if _digest(text) == digest else f"torn: {len(octets)} octets"


def _session(number: int, random: Random) -> None:
    SessionFile(SESSION).keep(Session(str(number), "7"))


def _owner(number: int, random: Random) -> None:
    """A configuration of the owner, as one set: each file names the set's number."""
    files = {name: f"# {number}\n".encode() * random.randrange(1, 200) for name in ("captain.toml", "mqtt/ca.pem")}
    Store(OWNER).accept(_digest(str(number))[:16], [f"ssh-ed25519 {number}"], files, {})


def read_owner() -> object:
    """The number of the set in force; -1: there is none, or the whole system has put the boot partition's in force."""
    current, looked = OWNER / "current", OWNER / "looked"
    if not current.exists():
        return -1 if not current.is_symlink() else "the link leads nowhere"
    if not (current / "captain.toml").exists():
        is_box_own = looked.exists() and looked.read_text().split("\n")[0] == os.readlink(current)
        return -1 if is_box_own else "a set without captain.toml"
    texts = [(current / name).read_text() for name in ("captain.toml", "mqtt/ca.pem", "authorized_keys")]
    numbers = {word for text in texts for word in text.split() if word not in ("#", "ssh-ed25519")}
    return int(numbers.pop()) if len(numbers) == 1 else f"a set of {sorted(numbers)}"


def _counters(number: int, random: Random) -> None:
    _set("BOOT_A_LEFT", number)


def _slot(disk: str, number: int) -> None:
    """As an update does: the slot counts as bad, is written, is waited for, and counts as good."""
    _set("BOOT_B_LEFT", 0)
    file = os.open(f"/dev/{disk}3", os.O_WRONLY)
    size = os.lseek(file, 0, os.SEEK_END)
    for at in range(size - SLOT_OCTETS, size, MIB):
        os.pwrite(file, number.to_bytes(8, "big") * (MIB // 8), at)
    os.fsync(file)
    os.close(file)
    _set("BOOT_B_LEFT", number)


def _set(name: str, number: int) -> None:
    subprocess.run(["fw_setenv", name, f"{number:x}"], check=True, stdout=subprocess.DEVNULL)


def _read_records() -> dict[str, object]:
    """Numbers of the recording's messages up to the first bad one, and when the last of them was made."""
    last, made_ns, torn, gaps = -1, 0, 0, 0
    for line in _lines():
        try:
            row = json.loads(line)
            number, received = int(row["source"]), int(row["received"] * 1e9)
        except (ValueError, KeyError):
            torn += 1
            break
        gaps += last >= 0 and number != last + 1
        last, made_ns = number, received
    return {"last": last, "made_ns": made_ns, "torn": torn, "gaps": gaps}


def _lines() -> Iterator[str]:
    for path in sorted(RECORDS.glob("*.jsonl")) if RECORDS.is_dir() else ():
        yield from path.read_text("utf-8", "replace").splitlines()


def _mounted() -> tuple[str, str, str]:
    """Device, kind and options of /data."""
    return next((row[0], row[2], row[3]) for row in reversed(_mounts()) if row[1] == "/data")


def _mounts() -> list[list[str]]:
    return [line.split() for line in Path("/proc/mounts").read_text().splitlines()]


def _disk() -> str:
    """The card's name; udev, which is not there, would have made the names of its partitions."""
    slot = next(row[0] for row in _mounts() if row[1] == "/" and row[0].startswith("/dev/"))
    disk = slot.removeprefix("/dev/").rstrip("0123456789")
    label = next(word for word in Path("/proc/cmdline").read_text().split() if word.startswith("root=PARTUUID="))
    BY_PARTUUID.mkdir(parents=True, exist_ok=True)
    for number in (2, 3, 5, 6):
        (BY_PARTUUID / f"{label.removeprefix('root=PARTUUID=')[:8]}-{number:02}").symlink_to(f"../../{disk}{number}")
    return disk


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


if __name__ == "__main__":
    main()
