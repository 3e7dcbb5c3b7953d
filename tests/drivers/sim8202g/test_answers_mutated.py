"""Modem with well-formed unexpected answers: the driver goes on."""

import random
import re

import pytest

PATIENCE_S = 0.0  # ptys tell when octets are on their way
COLUMNS = ["", "0", "1", "2", "99", "-1", '"x"', '"', "Online", "LTE", "262-01", "0x1", "NR5G", "7"]
ENDS = ["OK", "ERROR", "+CME ERROR: 14", "+CME ERROR: x"]

PRINTED = {
    "--wds-noop": "CID: '2'",
    "--wds-start-network": "Packet data handle: '1'\nCID: '2'",
    "get-current-settings": "IPv4 address: 10.0.0.2\nIPv4 subnet mask: 255.255.255.252\n",
    "--wds-get-packet-service-status": "Connection status: 'connected'",
    "udhcpc": "lease of 10.0.0.2 obtained",
}


def mutated(chance: random.Random, text: str) -> str | None:
    """Now and then an answer with the command's own prefix, and columns by chance."""
    name = re.match(r"AT([+$]\w+)", text)
    if name is None or chance.random() > 0.3:
        return None
    columns = ",".join(chance.choice(COLUMNS) for _ in range(chance.randint(0, 8)))
    return f"\r\n{name[1]}: {columns}\r\n\r\n{chance.choice(ENDS)}\r\n"


@pytest.mark.parametrize("seed", range(12))
def test_whatever_a_modem_answers_its_driver_goes_on(make_modem, loop, seed):
    chance = random.Random(seed)
    bench = make_modem(apn="internet", bearer=["none", "qmi", "rndis", "at"][seed % 4])
    bench.system.printed = dict(PRINTED)
    bench.modem.lies = lambda text: mutated(chance, text)
    bench.start()
    loop.run_for(300)
    bench.modem.lies = lambda text: None
    loop.run_until(lambda: bench.station.is_up, within=2400)


@pytest.mark.parametrize("line", ["+CGDCONT: 1", "+CGDCONT: ", "+CGDCONT: 1,", '+CGDCONT: 1,"', '+CGDCONT: x,"IP"'])
def test_a_packet_context_with_fewer_columns_is_one_that_has_to_be_set(make_modem, line):
    bench = make_modem(apn="internet")
    bench.modem.lies = lambda text: f"\r\n{line}\r\n\r\nOK\r\n" if text == "AT+CGDCONT?" else None
    bench.up()
    assert bench.modem.context == ("IPV4V6", "internet")
