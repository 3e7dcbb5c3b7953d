from tests.firmware.commands.conftest import block, runtime_folder

__all__ = ["block", "runtime_folder"]
