"""Running station, with the far end of its interface."""

from tests.system.conftest import launch, launch_shared

__all__ = ["launch", "launch_shared"]  # fixtures
