"""A web server that the guest reaches as 10.0.2.2: files of a folder, in parts if asked for, and faults."""

import http.server
import re
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

HOST = "10.0.2.2"  # this machine, as QEMU's own network has it


class Site:
    """One that runs.

    breaks  octets after which the connection of a file's next answer is closed, by name.
    asked   paths with what was asked for of each.
    """

    def __init__(self, folder: Path, context: ssl.SSLContext | None = None) -> None:
        self.breaks: dict[str, int] = {}
        self.asked: list[tuple[str, str]] = []
        self._scheme = "https" if context else "http"
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _handler(self, folder))
        self._server.daemon_threads = True
        if context:
            self._server.socket = context.wrap_socket(self._server.socket, server_side=True)
        self.thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True)

    def url(self, name: str) -> str:
        return f"{self._scheme}://{HOST}:{self._server.server_address[1]}/{name}"

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self.thread.join(10)


@contextmanager
def serving(folder: Path, context: ssl.SSLContext | None = None) -> Iterator[Site]:
    site = Site(folder, context)
    site.thread.start()
    try:
        yield site
    finally:
        site.close()


def _handler(site: Site, folder: Path) -> type[http.server.BaseHTTPRequestHandler]:
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            name = self.path.strip("/")
            wanted = self.headers.get("Range", "")
            site.asked.append((name, wanted))
            path = folder / name
            if "/" in name or not path.is_file():
                self.send_error(404)
                return
            size = path.stat().st_size
            begin = int(re.findall(r"\d+", wanted)[0]) if wanted else 0
            self.send_response(206 if wanted else 200)
            self.send_header("Content-Length", str(size - begin))
            self.send_header("Content-Range", f"bytes {begin}-{size - 1}/{size}")
            self.send_header("ETag", f'"{path.stat().st_mtime_ns}"')
            self.end_headers()
            left = site.breaks.pop(name, size)
            with path.open("rb") as file, suppress(ConnectionError):  # a box without room for it hangs up
                file.seek(begin)
                while left > 0 and (octets := file.read(min(left, 1 << 16))):
                    self.wfile.write(octets)
                    left -= len(octets)

        def log_message(self, format: str, *arguments: object) -> None:  # noqa: A002
            """Of no use here."""

    return Handler
