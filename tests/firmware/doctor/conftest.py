from tests.broker.fixtures import brokers, certificates
from tests.firmware.commands.conftest import block, no_service, runtime_folder

__all__ = ["block", "brokers", "certificates", "no_service", "runtime_folder"]
