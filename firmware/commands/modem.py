"""captain modem: shows the cellular modems of a station, sends commands, resets them."""

import argparse
import json
from collections.abc import Mapping

from board.runtime.errors import UsageError
from drivers.sim8202g.step import words
from firmware.client.arguments import add_control
from firmware.client.show.status import modules
from firmware.client.show.status.modules import Kind, joined
from firmware.client.show.table import Table, counted, span
from firmware.untrusted import number, text, texts, within

DESCRIPTION = """\
Shows the cellular modems of a station: progress of the start, network, cell
and signal. Or sends an AT command to one, or resets it.

A command that may change the modem, lock its SIM or cost money needs --force.
The answer is shown unchanged and may contain data of the SIM's owner. The
journal hides these.
"""
EPILOG = """\
examples:
  captain modem status
  captain modem at AT+CPSI?
  captain modem at AT+COPS=? --force      networks in reach; takes minutes and
                                          may end data connections
  captain modem reset                     ready again after half a minute
  captain modem status --json | jq '.cellular.details.cell'

exit codes:
  0    done; for `at`: the modem answered OK
  1    no station answers, the modem is unknown, or it did not answer OK
  2    wrong usage
"""
KIND = Kind("modem", "modem", "driver", ("sim8202g",), "sim8202g", "--interface:")
LONGEST_S = 310.0  # seconds; AT+COPS=? may take 300


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ask", choices=("status", "at", "reset"), help="action")
    parser.add_argument("command", metavar="COMMAND", nargs="?", default="", help="AT command for `at`, such as AT+CSQ")
    parser.add_argument("--interface", metavar="NAME", default="", help="interface of the modem, if there are several")
    parser.add_argument("--force", action="store_true", help="also send commands that may change the modem")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    """Show, query or reset a modem. Raises UsageError for `at` without COMMAND, and for COMMAND with another action."""
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


# -- the table of one modem; missing and malformed values are omitted


def table(name: str, one: Mapping[str, object]) -> Table:
    """Return the table of a modem; rows without a value are omitted."""
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
    """Return a value with its age, if known."""
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
