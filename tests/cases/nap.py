"""Examples of Vanetza-NAP: bodies that applications send, and what it says of messages that it received."""

import json
from pathlib import Path
from typing import Any

CASES = Path(__file__).parent
TO_SEND = {path.stem.removeprefix("in_"): path for path in sorted(CASES.glob("nap/in_*.json"))}
RECEIVED = {path.stem.removeprefix("out_"): path for path in sorted(CASES.glob("nap/out_*.json"))}


def body(kind: str) -> dict[str, Any]:
    """What an application publishes to vanetza/in/<type>."""
    found: dict[str, Any] = json.loads(TO_SEND[kind].read_text())
    return found


def fields(kind: str) -> dict[str, Any]:
    """Header and body of vanetza/out/<type>."""
    found: dict[str, Any] = json.loads(RECEIVED[kind].read_text())["fields"]
    return found


def case(name: str) -> dict[str, Any]:
    """A body beside the examples."""
    found: dict[str, Any] = json.loads((CASES / f"nap-{name}.json").read_text())
    return found


def unlike(given: Any, back: Any, path: str = "") -> list[str]:
    """Paths of given values that did not come back; what NAP's programs round is as close as a unit of the ASN.1."""
    if isinstance(given, dict) and isinstance(back, dict):
        return [
            way
            for name, value in given.items()
            for way in (unlike(value, back[name], f"{path}.{name}") if name in back else [f"{path}.{name}: missing"])
        ]
    if isinstance(given, list) and isinstance(back, list) and len(given) == len(back):
        return [
            way
            for at, (one, two) in enumerate(zip(given, back, strict=True))
            for way in unlike(one, two, f"{path}[{at}]")
        ]
    is_close = type(given) in (int, float) and type(back) in (int, float) and abs(given - back) <= _unit(given)
    return [] if given == back or is_close else [f"{path}: {given!r} came back as {back!r}"]


def _unit(given: float) -> float:
    """Half of the coarsest unit where the JSON has a fraction: 0.1; of integers nothing may be lost."""
    return 0.05001 if given != int(given) else 0.0
