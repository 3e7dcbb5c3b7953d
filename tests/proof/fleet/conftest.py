from tests.broker.fixtures import brokers, certificates

__all__ = ["brokers", "certificates"]
