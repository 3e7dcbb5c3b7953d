"""Registry of handlers by name.

A new handler needs a file in this folder and an entry here.
"""

from .cam import CAM, CAM_TS, CAM_V1
from .charging import EV_RSR, EVCSN, TISTPG
from .cpm import CPM, CPM_TR
from .denm import DENM, DENM_TS, DENM_V1
from .imzm import IMZM
from .ivim import IVIM
from .kind import Kind
from .mapem import MAPEM
from .mcm import MCM
from .poi import POI
from .rtcmem import RTCMEM
from .spatem import SPATEM
from .srem import SREM
from .ssem import SSEM
from .vam import VAM

KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        CAM, CAM_TS, DENM, DENM_TS, CPM, CPM_TR, VAM, IVIM, MAPEM, SPATEM, SREM, SSEM, RTCMEM, POI, IMZM, EVCSN, EV_RSR,
        TISTPG, MCM, CAM_V1, DENM_V1,
    )
}  # fmt: skip
