"""Board file and captain.toml of the bench's stations."""

from pps.chrony.feed import SOCKET

# A stamp in the guest is later than QEMU's raising of the line by 0.16 to 0.8 ms on a quiet machine: its board file
# says so, as that of a real board has the latency of its interrupts.
LATENCY_NS = 800_000

BOARD = f"""\
name = "bench"
[pulse]
device = "/dev/pps0"
latency_ns = {LATENCY_NS}
"""

_CAPTAIN = """\
[station]
name = "{name}"
[endpoint]
address = "0.0.0.0"
[time]
chrony = "{socket}"
[interfaces.gnss]
driver = "zed_f9p"
{place}
receiver_port = "usb"
rate_hz = 1
{more}"""


def captain(name: str, place: str, interfaces: str = "") -> str:
    """Its captain.toml. place: a line that says where the receiver is; interfaces: further tables."""
    return _CAPTAIN.format(name=name, socket=SOCKET, place=place, more=interfaces)
