"""A run on a page of this machine alone: a server on the loopback that shows one page and its numbers, and no file.

Another user of the machine, or a page of another site in the same browser, does not know the secret in the address;
requests that name another host are refused.
"""

from __future__ import annotations

import base64
import json
import secrets
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any

from pgfmd.errors import ResultError
from pgfmd.files.storage import reason
from pgfmd.host.streams import say
from pgfmd.plots.curves import axis_unit, labelled
from pgfmd.reporting.charts import Chart, parts_of
from pgfmd.reporting.maps import png

from .view import Glimpse, View, heading, line_of

HOST = "127.0.0.1"
GRACE = 10.0
"""Time [s] that an open page has to fetch the end of a run."""
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Server(ThreadingHTTPServer):
    """Serves one page and what it shows now. address: of the page; served: whether its newest content was fetched."""

    daemon_threads = True

    def __init__(self, port: int = 0):
        """port: 0 for any free one. ResultError if it can't be had."""
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as problem:
            raise ResultError(f"port {port} of {HOST} can't be used: {reason(problem)}; leave --port out") from problem
        self.secret = secrets.token_urlsafe(12)
        self.hosts = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}
        self.page = page_of().encode()
        self.content, self.served, self.asked = b"{}", threading.Event(), False

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://{HOST}:{self.server_port}/{self.secret}/"

    def show(self, content: dict[str, Any]) -> None:
        """From now on the page shows this."""
        self.served.clear()
        self.content = json.dumps(content, ensure_ascii=False, allow_nan=False).encode()

    def answer(self, path: str) -> tuple[str, bytes] | None:
        """Kind and content of an address; None for one that there is not."""
        if path == f"/{self.secret}/":
            return "text/html; charset=utf-8", self.page
        if path == f"/{self.secret}/data":
            self.asked = True
            return "application/json", self.content
        return None


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD; anything else is refused by the base class."""

    server: Server
    server_version, sys_version = "pgfmd", ""

    def do_GET(self) -> None:
        found = self.server.answer(self.path) if self.headers.get("Host") in self.server.hosts else None
        if found is None:
            self.send_error(404)
            return
        kind, content = found
        self.send_response(200)
        for name, text in (
            ("Content-Type", kind), ("Content-Length", str(len(content))), ("Cache-Control", "no-store"),
            ("Content-Security-Policy", POLICY), ("X-Content-Type-Options", "nosniff"), ("Referrer-Policy", "no-referrer"),
        ):  # fmt: skip
            self.send_header(name, text)
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(content)
            if content is self.server.content:
                self.server.served.set()

    do_HEAD = do_GET

    def log_message(self, format: str, *arguments: Any) -> None:
        """Nothing: it would disturb what the command prints."""


def page_of() -> str:
    """The page, with style and scripts in it."""

    def text(name: str, package: str = "reporting") -> str:
        return (files(f"pgfmd.{package}") / "templates" / name).read_text(encoding="utf-8")

    page = text("live.html", "watching")
    for mark, content in (
        ("/*STYLE*/", text("style.css")),
        ("/*SCRIPTS*/", text("charts.js") + text("live.js", "watching")),
    ):
        page = page.replace(mark, content)
    return page


def content_of(glimpse: Glimpse) -> dict[str, Any]:
    """What the page shows, as plain data."""
    return {
        "title": heading(glimpse.status),
        "state": line_of(glimpse.status),
        "over": glimpse.over,
        "progress": glimpse.status.progress,
        "doubts": list(glimpse.doubts),
        "charts": [chart.data() for chart in charts_of(glimpse)],
        "map": map_of(glimpse),
    }


def charts_of(glimpse: Glimpse) -> list[Chart]:
    """Force against indentation, and against time."""
    along = axis_unit([glimpse.force], "N")
    charts = []
    for key, name, values, unit in (
        ("force", "indentation", glimpse.indentation, "m"),
        ("time", "time", glimpse.time, "s"),
    ):
        across = axis_unit([values], unit)
        chart = Chart(key, "", labelled(name, across[1]), labelled("force", along[1]))
        chart.add("force", values / across[0], glimpse.force / along[0], 0, parts=parts_of(1))
        charts.append(chart)
    return charts


def map_of(glimpse: Glimpse) -> dict[str, Any] | None:
    """The newest map as an image, with its legend."""
    found = glimpse.map
    if found is None:
        return None
    greys = [int(each.grey[k : k + 2], 16) for each in found.classes for k in (1, 3, 5)]
    return {
        "image": "data:image/png;base64," + base64.b64encode(png(found.numbers, greys)).decode(),
        "caption": f"newest map: {found.label}, {found.time:.4g} s",
        "legend": [{"colour": each.grey, "text": each.label} for each in found.classes],
    }


def serve(view: View, every: float, port: int = 0, rest: Callable[[float], None] = time.sleep) -> None:
    """Shows a run on a page of the loopback until it ends; prints the address.

    rest: waits so many seconds. Raises ResultError as `View.look` does, or for a port that can't be had; KeyboardInterrupt.
    """
    server = Server(port)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
    thread.start()
    try:
        glimpse = view.look()
        server.show(content_of(glimpse))
        say(f"watching {glimpse.status.folder} at {server.address}    Ctrl-C ends it")
        while not glimpse.over:
            rest(every)
            glimpse = view.look()
            server.show(content_of(glimpse))
        if server.asked:
            server.served.wait(GRACE)
        say(line_of(glimpse.status))
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
