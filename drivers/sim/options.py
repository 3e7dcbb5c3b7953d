"""Options of the simulated neighbour stations, as in a board file."""

from dataclasses import dataclass
from typing import Annotated

from board.runtime.address import address
from board.runtime.describe import Range


@dataclass(frozen=True)
class NeighboursOptions:
    """Simulated stations around this one.

    listen     address and port at which they receive. Port 0: any free port.
    to         address and port that they send to.
    count      number of stations. Their stationIDs start at 4711.
    cam_hz     CAMs per second of each station.
    denm_hz    DENMs per second of each station. 0: none.
    latitude   of the centre of their circles, WGS84.
    longitude  of the centre of their circles, WGS84.
    """

    listen: str = "127.0.0.1:8949"
    to: str = "127.0.0.1:8947"
    count: Annotated[int, Range(1, 200)] = 2
    cam_hz: Annotated[float, Range(0.01, 1000.0)] = 10.0
    denm_hz: Annotated[float, Range(0.0, 1000.0)] = 1.0
    latitude: Annotated[float, Range(-89.0, 89.0)] = 48.7668616
    longitude: Annotated[float, Range(-179.0, 179.0)] = 11.432068

    def __post_init__(self) -> None:
        for text in (self.listen, self.to):
            address(text)
