"""paho-mqtt that remembers why its socket failed, which it otherwise only writes to a log."""

import socket
import ssl
from typing import Any

from paho.mqtt.client import Client as PahoClient


class Client(PahoClient):
    """failure  what the socket raised last; None: nothing."""

    failure: OSError | None = None

    def _ssl_wrap_socket(self, tcp_sock: socket.socket) -> ssl.SSLSocket:
        """As paho's, but for that a socket whose handshake failed is closed."""
        assert self._ssl_context is not None
        wrapped = self._ssl_context.wrap_socket(tcp_sock, server_hostname=self._host, do_handshake_on_connect=False)
        try:
            wrapped.settimeout(self.connect_timeout)
            wrapped.do_handshake()
        except OSError:
            wrapped.close()
            raise
        return wrapped

    def _sock_recv(self, bufsize: int) -> bytes:
        try:
            return super()._sock_recv(bufsize)
        except BlockingIOError:
            raise  # nothing is there yet
        except OSError as error:
            self.failure = error
            raise

    def _sock_send(self, buf: Any) -> int:
        try:
            return super()._sock_send(buf)
        except BlockingIOError:
            raise
        except OSError as error:
            self.failure = error
            raise
