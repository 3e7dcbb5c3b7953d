"""Bearers at run time: report a modem's link to the drivers that use it."""

from collections.abc import Mapping

from drivers.contract import Borne
from firmware.station.interface_supervisor import InterfaceSupervisor


def join(interfaces: Mapping[str, InterfaceSupervisor]) -> None:
    """Connect each driver that has a bearer to the link of that bearer, for all interfaces of a station by name."""
    for follower in interfaces.values():
        driver = follower.interface.driver
        if isinstance(driver, Borne) and driver.bearer:
            BearerLink(driver, follower, interfaces[driver.bearer])


class BearerLink:
    """Connection between a bearer and a driver that uses it: reports the link to the driver."""

    def __init__(self, driver: Borne, follower: InterfaceSupervisor, bearer: InterfaceSupervisor) -> None:
        self._driver = driver
        self._follower = follower
        self._bearer = bearer.interface
        self._told: tuple[object, ...] = ()
        follower.follower = self
        self._bearer.followers.append(self)

    def driver_started(self) -> None:
        """Report the link to a driver that was just started."""
        self._told = ()
        self.bearer_link_changed()

    def bearer_link_changed(self) -> None:
        """Report a new link state, device or address, or a new reason of a link that is not up."""
        bearer = self._bearer
        device, addresses = bearer.details.get("device", ""), bearer.details.get("addresses")
        link = ("up", device, addresses) if bearer.is_up else (bearer.link_state, bearer.why)
        if self._follower.is_running and link != self._told:
            self._told = link
            self._driver.bearer_changed(bearer.link_state, str(device) if bearer.is_up else "", bearer.why)
