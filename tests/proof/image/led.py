"""The ACT LED, which QEMU's machine lacks: one at a line of its GPIO controller, and what the kernel makes it blink."""

import itertools
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests.proof.image.login import Key, said
from tests.proof.image.machine import BARE_VIRT, Guest, Machine, Ports, virt

LINE = 5  # of the controller: 3 is the power key
WATCHED_S = 12.0  # the longest group takes 2 s, the pause behind it 1.8
PAUSE_S = 1.0  # longer than between two blinks of a group, which is 0.3 s
_LED = """
/ { leds { compatible = "gpio-leds"; led-act { label = "ACT"; gpios = <%s 0>; }; }; };
"""
_CONTROLLER = re.compile(r"^\tgpio-keys \{.*?gpios = <(0x[0-9a-f]+) ", re.MULTILINE | re.DOTALL)
# Each change with its moment: reading takes far less than a blink, even where it is emulated.
_WATCH = r"""perl -e '
sub of { open my $file, "<", $_[0] or die "$_[0]: $!\n"; return (split " ", <$file>)[0] }
my ($last, $end) = ("", of("/proc/uptime") + WATCHED);
while ((my $now = of("/proc/uptime")) < $end) {
    my $is = of("/sys/class/leds/ACT/brightness") > 0 ? 1 : 0;
    print "$now $is\n" if $is ne $last;
    $last = $is;
    select undef, undef, undef, 0.02;
}'"""


class Change(NamedTuple):
    """moment_s: since the guest's start."""

    moment_s: float
    is_on: bool


def machine(folder: Path) -> Machine:
    """QEMU's own with a LED at it."""
    made, source, tree = (folder / f"led.{kind}" for kind in ("made", "dts", "dtb"))
    words = [word.replace("virt", f"virt,acpi=off,dumpdtb={made}") if word == "virt" else word for word in BARE_VIRT]
    subprocess.run(["qemu-system-aarch64", *words, "-display", "none", "-nic", "none"], check=True, capture_output=True)
    text = subprocess.run(
        ["dtc", "-q", "-I", "dtb", "-O", "dts", made], check=True, capture_output=True
    ).stdout.decode()
    found = _CONTROLLER.search(text)
    assert found is not None, "QEMU's machine has no power key at its GPIO controller"
    source.write_text(text + _LED % f"{found[1]} {LINE}")
    subprocess.run(["dtc", "-q", "-I", "dts", "-O", "dtb", "-o", tree, source], check=True)

    def with_led(card: Path, ports: Ports) -> list[str]:
        words = virt(card, ports)
        words[words.index("virt")] = "virt,acpi=off"
        return [*words, "-dtb", str(tree)]

    return with_led


def blinks(guest: Guest, key: Key) -> list[int]:
    """How often it blinks from pause to pause: of groups that were seen whole."""
    told = said(guest, key, _WATCH.replace("WATCHED", f"{WATCHED_S}"))
    return counted([Change(float(words[0]), words[1] == "1") for words in map(str.split, told.splitlines())])


def counted(changes: Sequence[Change]) -> list[int]:
    """Blinks of each group that has a pause on both sides."""
    lit = [one.moment_s for one in changes if one.is_on]
    ends = [after.moment_s for one, after in itertools.pairwise(changes) if one.is_on]
    groups: list[int] = []
    count = 0
    has_begun = False
    for end, following in zip(ends, lit[1:], strict=False):
        count += 1
        if following - end > PAUSE_S:
            if has_begun:
                groups.append(count)
            count, has_begun = 0, True
    return groups
