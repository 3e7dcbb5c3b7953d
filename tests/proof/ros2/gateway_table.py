"""The lab test from the side of ROS: two stations, two gateways, ten types of message, each at 10 Hz both ways."""

import json
from collections.abc import Sequence
from pathlib import Path

from tests.proof.ros2 import ros, stations
from tests.proof.ros2.metered import measured, metered
from tests.proof.ros2.rows import Row

RATE_HZ = 10.0


def run(codec: Path, prefix: Path, duration_s: float, handlers: Sequence[str] = tuple(stations.TYPES)) -> list[Row]:
    """A row for each type and way; the whole table is in build/ros2/gateway.md."""
    pdus = stations.messages(codec, handlers)
    library = stations.load(codec)
    given = {}
    for handler, pdu in pdus.items():
        message = library.find(stations.TYPES[handler])
        given[handler] = (message.ros2_type("etsi_its"), message.to_cdr(pdu, "etsi_its")[0].hex())
    path = ros.MADE / "gateway_messages.json"
    path.write_text(json.dumps(given))
    chosen = f"handlers:=[{', '.join(given)}]"
    with stations.pair() as (a, b):
        nodes = [
            stations.gateway(
                codec, station.ports, ros.MADE / f"gateway_{name}.log", prefix, "-p", chosen, "-r", f"__ns:=/{name}"
            )
            for station, name in ((a, "a"), (b, "b"))
        ]
        with nodes[0], nodes[1], metered({"A": a, "B": b}, ros.MADE / "gateway_meter.html") as told:
            before = [node.processor_s() for node in nodes]
            said = stations.inside("gateway_table.py", path, str(duration_s), str(RATE_HZ), codec=codec, prefix=prefix)
            used = [node.processor_s() - one for node, one in zip(nodes, before, strict=True)]
        drops = [station.drops() for station in (a, b)]
    rows = [_row(row) for row in said["rows"]]
    sums = {key: sum(row[key] for row in said["rows"]) for key in ("sent", "received", "equal", "lost")}
    share = ", ".join(f"{100 * one / said['took_s']:.0f} %" for one in used)
    found = f"{sums['sent']} sent, {sums['received']} received, {sums['equal']} equal, {sums['lost']} lost"
    rows.append(Row(f"all in {said['took_s']:.0f} s", f"{found}; gateways used {share} of a processor", _wrong(sums)))
    rows.append(measured(told, sums["sent"]))
    rows += [Row("station", f"dropped {found}", "nothing was to be dropped") for found in drops if found]
    _write(said["rows"], sums)
    return rows


def _row(row: dict[str, object]) -> Row:
    found = f"{row['sent']} sent, {row['received']} received, {row['equal']} equal, {row['lost']} lost"
    return Row(f"{row['type']} of {row['octets']} octets, from {row['from']}", found, _wrong(row))


def _wrong(row: dict[str, object]) -> str:
    return "" if row["sent"] == row["received"] == row["equal"] else "all have to be equal"


def _write(rows: list[dict[str, object]], sums: dict[str, object]) -> None:
    names = ("type", "from", "octets", "sent", "received", "equal", "lost")
    lines = ["| " + " | ".join(names) + " |", "|---" * len(names) + "|"]
    lines += [
        "| " + " | ".join(str(row.get(name, "")) for name in names) + " |" for row in [*rows, {"type": "all"} | sums]
    ]
    (ros.MADE / "gateway.md").write_text("\n".join(lines) + "\n")
