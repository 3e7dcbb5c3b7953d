"""Charging of electric vehicles: TS 101 556."""

from .kind import Kind

EVCSN = Kind(name="evcsn", editions=("evcsn-1.1.1",))
EV_RSR = Kind(name="ev_rsr", editions=("ev_rsr-1.1.1",))
TISTPG = Kind(name="tistpgtransaction", editions=("tistpgtransaction-1.1.1",))
