"""captain modem: what the cellular modems of a station see, a command to one, its reset."""

import argparse
import json
from collections.abc import Mapping

from board.errors import UsageError
from drivers.modem_step import words
from firmware.user import modules
from firmware.user.arguments import add_control
from firmware.user.modules import Kind, joined
from firmware.user.table import Table, counted, span
from firmware.user.untrusted import number, text, texts, within

DESCRIPTION = """\
Shows what the cellular modems of a station see: how far one has come, its
network, cell and signal; sends it a command; or resets it.

A command that only asks is sent as it is. One that may change the modem, lock
its card or cost money needs --force. The answer is shown as it came, with
whatever it says of the card's owner; the journal hides that.
"""
EPILOG = """\
examples:
  captain modem status
  captain modem at AT+CPSI?
  captain modem at AT+COPS=? --force      networks in reach; takes minutes, and
                                          may end data connections
  captain modem reset                     it is back after half a minute
  captain modem status --json | jq '.cellular.details.cell'

exit codes:
  0    done, and for `at` answered with OK
  1    no station answers, it has no such modem, or the modem did not say OK
  2    wrong usage
"""
KIND = Kind("modem", "modem", "driver", ("sim8202g",), "sim8202g", "--interface:")
LONGEST_S = 310.0  # AT+COPS=? is given 300 s


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ask", choices=("status", "at", "reset"), help="what to do")
    parser.add_argument("command", metavar="COMMAND", nargs="?", default="", help="with at: such as AT+CSQ")
    parser.add_argument("--interface", metavar="NAME", default="", help="which modem, where a station has several")
    parser.add_argument("--force", action="store_true", help="send what may change the modem as well")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    if (arguments.ask == "at") is not bool(arguments.command):
        raise UsageError(f"modem {arguments.ask}: {'give' if arguments.ask == 'at' else 'takes no'} COMMAND")
    found = modules.found(arguments, KIND)
    if arguments.ask == "status":
        modules.show(found, arguments.json, table)
        return 0
    name = modules.the_only(found, KIND)
    if arguments.ask == "reset":
        answer = modules.operate(arguments, name)
        print(json.dumps(answer) if arguments.json else f"{name}: reset begun; `captain modem status` tells more")
        return 0
    answer = modules.operate(arguments, name, LONGEST_S, command=arguments.command, force=arguments.force)
    print(json.dumps(answer) if arguments.json else "\n".join([*texts(answer, "lines"), text(answer, "result")]))
    return 0 if text(answer, "result").partition(":")[0] in ("OK", "CONNECT") else 1


# -- the table of one modem; what a peer left out or wrote otherwise is shown as absent


def table(name: str, one: Mapping[str, object]) -> Table:
    """What is known of a modem; a row that says nothing is left out."""
    details = within(one, "details")
    cell = within(details, "cell")
    leg = within(cell, "leg")
    ages = within(details, "age_s")
    rows = [
        ("step", words(text(details, "step"))),
        ("network", _aged(_network(details, cell), ages, "registration")),
        ("cell", joined(text(cell, "plmn"), *_numbers(cell, "area", "cell"))),
        ("radio", joined(text(cell, "band"), *_numbers(cell, "physical_cell", "channel"))),
        ("signal", _aged(_signal(within(cell, "strength"), details), ages, "cell")),
        ("5G radio", joined(text(leg, "band"), *_numbers(leg, "physical_cell", "channel"))),
        ("5G signal", _signal(within(leg, "strength"), {})),
        ("bearer", joined(text(details, "device"), *texts(details, "addresses"))),
        ("card", _card(details)),
        ("modem", joined(text(details, "model"), text(details, "firmware"), text(details, "usb"))),
        ("temperature", _aged(_temperature(details), ages, "module")),
        ("counted", _counted(details)),
    ]
    return modules.rows_of(name, one, rows)


def _aged(value: str, ages: Mapping[str, object], what: str) -> str:
    """A reading with its age, where that is told."""
    return joined(value, f"{span(number(ages, what))} ago") if value and what in ages else value


def _network(details: Mapping[str, object], cell: Mapping[str, object]) -> str:
    return joined(text(details, "operator"), text(details, "registration"), text(cell, "access"))


def _temperature(details: Mapping[str, object]) -> str:
    return f"{number(details, 'temperature_c'):.0f} C" if "temperature_c" in details else ""


def _numbers(cell: Mapping[str, object], *keys: str) -> list[str]:
    return [f"{key.replace('_', ' ')} {number(cell, key):.0f}" for key in keys if key in cell]


def _signal(strength: Mapping[str, object], details: Mapping[str, object]) -> str:
    measured = [
        f"{word} {number(strength, key):g} {unit}"
        for word, key, unit in (("RSRP", "rsrp_dbm", "dBm"), ("RSRQ", "rsrq_db", "dB"), ("SNR", "snr_db", "dB"))
        if key in strength
    ]
    rssi = f"RSSI {number(details, 'rssi_dbm'):g} dBm" if "rssi_dbm" in details else ""
    return joined(*measured, rssi)


def _card(details: Mapping[str, object]) -> str:
    left = f"{number(details, 'pin_attempts'):.0f} attempts for its PIN" if "pin_attempts" in details else ""
    return joined(text(details, "sim"), left)


def _counted(details: Mapping[str, object]) -> str:
    counts = (("recoveries", "resets"), ("misread", "misread answers"), ("garbage_octets", "garbage octets"))
    return counted((number(details, key), name) for key, name in counts)
