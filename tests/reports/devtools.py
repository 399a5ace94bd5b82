"""A browser for the tests: Chromium without a network, driven over its DevTools protocol."""

from __future__ import annotations

import base64
import itertools
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--hide-scrollbars",
    "--remote-debugging-port=0", "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip
PATIENCE = 60.0


class Page:
    """One tab; what it asked for and complained about is in ``requests`` and ``complaints``."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._number = socket, itertools.count(1)
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._navigated = 0
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Result of a command; events that come in between are noted."""
        number = next(self._number)
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            reported = json.loads(self._socket.recv(timeout=PATIENCE))
            if reported.get("id") == number:
                assert "error" not in reported, reported
                return dict(reported["result"])
            self._note(reported)

    def _note(self, event: dict[str, Any]) -> None:
        params = event.get("params", {})
        match event.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])
            case "Page.frameNavigated":
                self._navigated += 1
            case "Runtime.exceptionThrown":
                self.complaints.append(json.dumps(params["exceptionDetails"]))
            case "Runtime.consoleAPICalled" if params["type"] in ("error", "warning", "assert"):
                self.complaints.append(json.dumps(params["args"]))
            case "Log.entryAdded" if params["entry"]["level"] in ("error", "warning"):
                self.complaints.append(json.dumps(params["entry"]))

    def run(self, script: str) -> Any:
        """Value of a JavaScript expression; promises are awaited."""
        reported = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in reported, reported["exceptionDetails"]
        return reported["result"].get("value")

    def wait(self, condition: str) -> None:
        """Wait until a JavaScript expression is true."""
        end = time.monotonic() + PATIENCE
        while not self.run(f"Boolean({condition})"):
            assert time.monotonic() < end, f"the page never came to: {condition}; it complained: {self.complaints}"
            time.sleep(0.05)

    def open(self, path: Path, width: int = 1440, height: int = 900, *, dark: bool = False, fragment: str = "") -> None:
        """Load a page from disk into a window of this size."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", media="", features=[scheme])
        self.call("Page.navigate", url=path.as_uri() + fragment)
        self.wait(f"document.readyState === 'complete' && location.pathname === {json.dumps(path.as_uri()[7:])}")

    def reload(self) -> None:
        """Load the page again. Nothing is asked until the new one is there: the old one, while it goes, answers with an error."""
        before = self._navigated
        self.call("Page.reload")
        while self._navigated == before:
            self._note(json.loads(self._socket.recv(timeout=PATIENCE)))

    def mouse(self, x: float, y: float, kind: str = "mouseMoved") -> None:
        """Move or press the mouse at a place of the window."""
        button = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **button)

    def click(self, selector: str) -> None:
        """Scroll an element into view and click its middle, once the page has come to rest: charts are drawn when they are seen."""
        place = (
            f"(e => {{ e.scrollIntoView({{block: 'center'}}); const r = e.getBoundingClientRect();"
            f" return [r.x + r.width / 2, r.y + r.height / 2]; }})(document.querySelector({json.dumps(selector)}))"
        )
        end, before, box = time.monotonic() + PATIENCE, None, self.run(place)
        while box != before:
            assert time.monotonic() < end, f"{selector} never stands still"
            time.sleep(0.05)
            before, box = box, self.run(place)
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.mouse(*box, kind)

    def key(self, name: str) -> None:
        """Press a key on what has the focus."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name)

    def screenshot(self, path: Path) -> None:
        """What the window shows, as PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))


@contextmanager
def browser(profile: Path) -> Iterator[Page]:
    """A page of a fresh Chromium with its network off; the browser ends with the block."""
    from websockets.sync.client import connect

    assert CHROMIUM is not None
    process = subprocess.Popen(
        [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        port = profile / "DevToolsActivePort"
        end = time.monotonic() + PATIENCE
        while not (port.exists() and port.read_text().count("\n") >= 1):
            assert process.poll() is None, "chromium ended at once"
            assert time.monotonic() < end, "chromium never opened its DevTools"
            time.sleep(0.05)
        number, path = port.read_text().split("\n")[:2]
        root = f"ws://127.0.0.1:{number}"
        with connect(root + path, max_size=None, proxy=None) as control:
            control.send(json.dumps({"id": 1, "method": "Target.createTarget", "params": {"url": "about:blank"}}))
            while (reported := json.loads(control.recv(timeout=PATIENCE))).get("id") != 1:
                pass
        target = reported["result"]["targetId"]
        with connect(f"{root}/devtools/page/{target}", max_size=None, proxy=None) as socket:
            yield Page(socket)
    finally:
        process.terminate()
        try:
            process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
