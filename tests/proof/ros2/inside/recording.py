"""A recording read by mcap-ros2-support: a JSON object on stdout.

    recording.py FOLDER FILE

FOLDER holds captain_messages, of some editions. Counted per type: messages that were decoded, and those whose octets in
the metadata are a message of the lab; of these editions: CDR as to_cdr writes it. Drawn beside the file: how many came when.
"""

import json
import re
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[4]
sys.path[:0] = [sys.argv[1], str(ROOT)]

import captain_messages
import pygal
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

NOT_DRAWN = re.compile(rb"<!--.*?-->|<script.*?</script>", re.DOTALL)  # of pygal's picture
VECTORS = {bytes.fromhex(one["hex"]) for one in json.loads((ROOT / "firmware" / "vectors.json").read_bytes())}


def main(path: Path) -> dict[str, object]:
    typed: Counter[str] = Counter()
    octets: Counter[str] = Counter()
    cdr: dict[str, list[bytes]] = {}
    times: dict[str, list[float]] = {}
    known = {one.name for one in captain_messages.all()}
    hashes, compared, same = set(), 0, 0
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        first_ns = reader.get_summary().statistics.message_start_time
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            name = channel.topic.partition("/")[0]
            if not channel.topic.endswith("/metadata"):
                typed[name] += decoded.header is not None
                hashes.add((name, channel.metadata["topic_type_hash"]))
                cdr.setdefault(name, []).append(message.data)
                times.setdefault(schema.name, []).append((message.log_time - first_ns) / 1e9)
                continue
            pdu = bytes(decoded.pdu)
            octets[name] += pdu in VECTORS
            if decoded.edition in known:
                compared += 1
                same += captain_messages.find(decoded.edition).to_cdr(pdu)[0] == cdr[name][decoded.sequence - 1]
    draw(times, path.with_suffix(".svg"))
    return {"typed": typed, "octets": octets, "compared": compared, "same": same, "hashes": len(hashes)}


def draw(times: dict[str, list[float]], path: Path) -> None:
    """How many of each type came in each half second."""
    halves = range(int(max(map(max, times.values())) * 2) + 1)
    chart = pygal.Dot(
        js=(), title=f"{path.stem}.mcap: messages in half a second", x_title="s", width=1000, height=450, show_legend=False,
        show_y_labels=True, x_label_rotation=0, value_formatter=str, print_values=True, print_zeroes=False,
    )  # fmt: skip
    chart.x_labels = [str(half / 2) for half in halves]
    for name in sorted(times, reverse=True):
        chart.add(name.replace("/msg/", "/"), [sum(int(one * 2) == half for one in times[name]) for half in halves])
    path.write_bytes(NOT_DRAWN.sub(b"", chart.render()))


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[2]))))
