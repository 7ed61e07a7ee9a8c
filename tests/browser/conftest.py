"""Headless Chromium over its debugging protocol: open a page, measure it, take its picture."""

import base64
import contextlib
import functools
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
         "--remote-debugging-port=0", "--remote-allow-origins=*", "--no-first-run", "--disable-extensions",
         "--disable-background-networking", "--disable-component-update", "--mute-audio")  # fmt: skip


def find_chromium() -> str | None:
    """Path of a browser: what TPJB_CHROMIUM names, or the first on the PATH."""
    named = os.environ.get("TPJB_CHROMIUM")
    return named or next((found for name in NAMES if (found := shutil.which(name))), None)


class Tab:
    """One page of the browser; everything that it logs is kept."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.count = 0
        self.logged: list[str] = []
        self.requested: list[str] = []
        self.loaded = False
        for domain in ("Page", "Runtime", "Log", "Network", "DOM", "Accessibility"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and wait for its answer."""
        self.count += 1
        mine = self.count
        self.socket.send(json.dumps({"id": mine, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.socket.recv())
            if message.get("id") == mine:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self._event(message)

    def _event(self, message: dict[str, Any]) -> None:
        method, p = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.logged.append(f"exception: {json.dumps(p['exceptionDetails'])[:500]}")
        elif method == "Runtime.consoleAPICalled" and p["type"] in ("error", "warning", "assert"):
            self.logged.append(f"console {p['type']}: {json.dumps(p['args'])[:500]}")
        elif method == "Log.entryAdded" and p["entry"]["level"] in ("error", "warning"):
            self.logged.append(f"log: {p['entry'].get('text', '')[:500]} {p['entry'].get('url', '')}")
        elif method == "Network.requestWillBeSent":
            self.requested.append(p["request"]["url"])
        elif method == "Page.loadEventFired":
            self.loaded = True

    def open(self, url: str, seconds: float = 60.0) -> None:
        """Go to `url` and wait until it is loaded."""
        self.loaded = False
        self.call("Page.navigate", url=url)
        self.until(lambda: self.loaded, seconds)

    def until(self, condition: Any, seconds: float = 30.0) -> None:
        """Wait for a condition: a callable, or JavaScript that becomes true."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if condition() if callable(condition) else self.js(condition):
                return
            self.js("1")  # lets events come in
            time.sleep(0.1)
        raise TimeoutError(f"{condition} did not come true in {seconds} s; logged: {self.logged[:3]}")

    def js(self, code: str) -> Any:
        """Evaluate JavaScript and return its value."""
        result = self.call("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(json.dumps(result["exceptionDetails"])[:800])
        return result["result"].get("value")

    def size(self, width: int, height: int = 900) -> None:
        """Set the window."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def prefer(self, scheme: str) -> None:
        """Choose the colour scheme, "light" or "dark"."""
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def pdf(self, path: Path, width: float = 8.27, height: float = 11.69) -> None:
        """Print to PDF on paper of so many inches."""
        path.write_bytes(base64.b64decode(self.call("Page.printToPDF", paperWidth=width, paperHeight=height)["data"]))

    def accessible(self) -> list[dict[str, Any]]:
        """Nodes of the accessibility tree that are not ignored."""
        return [n for n in self.call("Accessibility.getFullAXTree")["nodes"] if not n.get("ignored")]


@contextlib.contextmanager
def running_browser() -> Iterator[str]:
    """Start Chromium with a profile of its own, give its debugging address, end it for certain."""
    found = find_chromium()
    if found is None:
        raise FileNotFoundError("no Chromium")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [found, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            yield _address(Path(profile) / "DevToolsActivePort", process)
        finally:
            process.terminate()
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(20)


def _address(port_file: Path, process: subprocess.Popen) -> str:
    for _ in range(600):
        if port_file.exists() and port_file.read_text().strip():
            return f"http://127.0.0.1:{port_file.read_text().split()[0]}"
        if process.poll() is not None:
            raise RuntimeError("Chromium ended at once")
        time.sleep(0.1)
    raise TimeoutError("Chromium did not open its debugging port")


@contextlib.contextmanager
def open_tab(address: str, javascript: bool = True) -> Iterator[Tab]:
    """Open a fresh tab of a running browser and close it again."""
    import websocket

    request = urllib.request.Request(f"{address}/json/new?about:blank", method="PUT")
    with urllib.request.urlopen(request, timeout=60) as answer:
        target = json.load(answer)
    socket = websocket.create_connection(target["webSocketDebuggerUrl"], timeout=90)
    try:
        tab = Tab(socket)
        if not javascript:
            tab.call("Emulation.setScriptExecutionDisabled", value=True)
        yield tab
    finally:
        socket.close()
        with urllib.request.urlopen(f"{address}/json/close/{target['id']}", timeout=60):
            pass


@pytest.fixture(scope="session")
def chromium_address() -> Iterator[str]:
    """One browser for all tests of a worker; skipped where none can be found."""
    if find_chromium() is None:
        pytest.skip(f"no Chromium on the PATH ({', '.join(NAMES)}); TPJB_CHROMIUM can name one")
    pytest.importorskip("websocket", reason="the extra test brings websocket-client")
    with running_browser() as address:
        yield address


@pytest.fixture
def chromium(chromium_address):
    """Open a tab: ``with chromium() as tab``."""
    return functools.partial(open_tab, chromium_address)
