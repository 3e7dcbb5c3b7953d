"""Run by test_devices.py in a network namespace: what is replayed by one device comes out at another.

usage: python devices_program.py CAPTURE LOSS COUNT

CAPTURE -> captain replay -> a0 ~ a1 -> captain impair -> b1 ~ b0, where COUNT frames are heard. Prints what each says.
"""

import json
import signal
import socket
import subprocess
import sys

CAPTAIN = [sys.executable, "-m", "firmware"]
GEONETWORKING = 0x8947


def main(path: str, loss: str, count: str) -> None:
    for one in "ab":
        ip("link", "add", f"{one}0", "type", "veth", "peer", "name", f"{one}1")
        for end in "01":
            ip("link", "set", f"{one}{end}", "up")
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as ear:
        ear.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        ear.bind(("b0", GEONETWORKING))
        ear.settimeout(10)
        way = subprocess.Popen(
            [*CAPTAIN, "impair", "ethernet:a1", "ethernet:b1", "--json", "--loss", loss],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        assert way.stdout is not None
        assert way.stderr is not None
        way.stderr.readline()  # it stands there
        replay = [*CAPTAIN, "replay", path, "--ethernet", "a0", "--rate", "1000", "--json"]
        replayed = json.loads(subprocess.run(replay, stdout=subprocess.PIPE, check=True).stdout)
        heard = [ear.recv(2048).hex() for _ in range(int(count))]
        way.send_signal(signal.SIGTERM)
        told = json.loads(way.stdout.read())["ways"]
        way.wait()
    print(json.dumps({"replay": replayed, "ways": told, "heard": heard}))


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
