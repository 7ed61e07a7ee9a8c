"""`tpjb view` as somebody uses it: in a browser, on this machine only."""

import contextlib
import http.client
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import tpjb_ident as ti
from tpjb_ident.rounding import with_interval

pytest.importorskip("bokeh", reason="the extra view is not installed")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "rigdata" / "samples" / "demo.h5"
IDLE = "window.Bokeh && Bokeh.documents.length > 0 && Bokeh.documents[0].is_idle"
#: The first section of the report's style inside the elements of Bokeh.
DEEP = """(function find(root) {
  for (const e of root.querySelectorAll("*")) {
    if (e.matches("figure")) return e;
    const found = e.shadowRoot && find(e.shadowRoot);
    if (found) return found;
  }
  return null;
})(document)"""


@contextlib.contextmanager
def viewing(*arguments):
    """Run the command and give its address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tpjb_ident", "view", *map(str, arguments), "--no-browser", "--seconds", "600"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONFAULTHANDLER": "1"},
    )  # fmt: skip
    try:
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:(\d+)/[\w-]{32}/", line)
        assert found, line + (process.stderr.read() if process.poll() is not None else "")
        yield found[0], int(found[1])
    finally:
        process.terminate()
        try:
            process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGABRT)
            pytest.fail(f"did not end on SIGTERM; it was here:\n{process.communicate()[1]}")


@pytest.fixture(scope="module")
def view_of_demo():
    """Address and port of one server for all tests that look at the demo: every tab is a session of its own."""
    with viewing(DEMO) as found:
        yield found


def model(name: str, what: str) -> str:
    return f"Bokeh.documents[0].get_model_by_name('{name}').{what}"


def test_beside_a_channel_stand_those_of_its_quantity():
    from tpjb_ident.view.records_tab import records_tab

    tab = records_tab(ti.load_campaign(DEMO))
    channel, others, plot = (tab.select_one({"name": name}) for name in ("channel", "others", "time-plot"))
    assert (channel.value, others.options) == ("X1A", ["X1B"])
    others.value = ["X1B"]
    assert plot.renderers[0].data_source.data["name"] == ["X1A", "X1B"]
    channel.value = "L1H"
    assert others.options == ["L1V"]
    assert plot.renderers[0].data_source.data["name"] == ["L1H"]


def test_a_campaign_can_be_browsed_and_the_model_moved(chromium, view_of_demo):
    address, _ = view_of_demo
    with chromium() as tab:
        tab.size(1280)
        tab.open(address)
        tab.until(IDLE, 90)
        assert tab.js(model("tabs", "tabs.map((t) => t.title)"))[:2] == ["verdict", "records"]
        tab.until(f"{model('tabs', 'tabs.length')} === 4", 120)
        assert tab.js(model("tabs", "tabs.map((t) => t.title)")) == [
            "verdict", "records", "points and windows", "prediction and measurement"]  # fmt: skip
        verdict = tab.js(model("verdict", "text"))
        for words in (
            "7 operating points, all to be trusted",
            "22 Hz (1320 rpm)",
            "66.00\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}0.54",
            "measured pivots",
        ):
            assert words in verdict
        before = tab.js(model("run-facts", "text"))
        assert "dynamic, 2.5 kN" in before
        tab.js(model("run", "value = 'p-1-up'"))
        tab.until(f"{model('run-facts', 'text')} !== {before!r}", 30)
        assert "dry_pivot" in tab.js(model("run-facts", "text"))
        point = ti.identify(ti.load_campaign(DEMO)).points[0]
        windows = tab.js(model("windows", "text"))
        assert windows.count("<title>") >= 54
        assert "Robust weight of 54 windows; flags: none" in windows
        low, high = (bound[0] for bound in point.stiffness.interval())
        words = with_interval(point.stiffness.vector[0], low, high, 1e6).replace(" ", "\N{NO-BREAK SPACE}")
        assert words in tab.js(model("coefficients", "text"))
        assert tab.js(model("residuals", "text")).count("root mean square") == 3
        curves = tab.js(model("curves", "text"))
        assert re.search(r"<title>measured pivots: kxx 53[.\d]* MN/m at excitation frequency 25 Hz", curves)
        assert "1 measured point at" in curves
        tab.size(400)
        tab.until("document.documentElement.scrollWidth <= 400", 30)  # every tab is as wide as the widest
        tab.js(model("load", "value = 5.0"))
        tab.js(model("load", "value_throttled = 5.0"))
        tab.until(f"{model('curves', 'text')}.includes('at 5 kN')", 60)
        curves = tab.js(model("curves", "text"))
        assert "3 measured points" in curves
        assert "<title>rigid pivots: kyy" in curves
        tab.prefer("dark")
        assert "invert(1)" in tab.js("getComputedStyle(document.body).filter")
        tab.js(model("tabs", "active = 3"))
        tab.until(f"{DEEP} !== null", 30)
        assert tab.js(f"getComputedStyle({DEEP}).color") == "rgb(232, 234, 237)"
        assert [r for r in tab.requested if not r.startswith((address, "data:"))] == []
        assert tab.logged == []


def status(port: int, path: str, **headers: str) -> int:
    """Status that a request is answered with."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse().status
    connection.close()
    return answer


def socket_to(address: str, **options: object):
    """A WebSocket to the page, as its script opens it."""
    websocket = pytest.importorskip("websocket")
    return websocket.create_connection(
        address.replace("http:", "ws:") + "ws", timeout=20, subprotocols=["bokeh", "token"], **options
    )


def test_it_answers_this_machine_its_own_page_and_nobody_else(view_of_demo):
    websocket = pytest.importorskip("websocket")
    address, port = view_of_demo
    path = "/" + address.split("/", 3)[3]
    assert status(port, path) == 200
    assert status(port, path, Host=f"localhost:{port}") == 200
    # another user of this machine, who does not know the path
    for guess in ("/", "/ws", "/static/js/bokeh.min.js", "/autoload.js", f"{path[:-2]}/", f"/x{path}"):
        assert status(port, guess) == 404, guess
    # a page elsewhere whose name has been pointed at this machine
    for host in (f"rebound.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}", f"127.0.0.1.nip.io:{port}", ""):
        assert status(port, path, Host=host) in (400, 403), host
    # a script without a page, a page elsewhere, a rebound page that names itself
    own = f"http://127.0.0.1:{port}"
    for options in (
        {"suppress_origin": True},
        {"origin": "http://example.invalid"},
        {"origin": "null"},
        {"origin": f"https://127.0.0.1:{port}"},
        {"origin": own, "host": f"rebound.example:{port}"},
    ):
        with pytest.raises(websocket.WebSocketBadStatusException, match="403"):
            socket_to(address, **options)
    with pytest.raises(websocket.WebSocketBadStatusException, match="404"):
        socket_to(f"{own}/", origin=own)


def test_it_listens_on_loopback_only(view_of_demo):
    _, port = view_of_demo
    with socket.create_connection(("127.0.0.1", port), timeout=10):
        pass
    # 127.0.0.2 is this machine too: a server that listens on every address would answer there
    with pytest.raises(OSError), socket.create_connection(("127.0.0.2", port), timeout=10):
        pass


def test_the_browser_is_led_by_a_file_that_only_this_user_reads():
    from tpjb_ident.view.server import private_link

    with private_link("http://127.0.0.1:1/secret/") as link:
        path = Path(link.removeprefix("file://"))
        assert "secret" not in link
        assert "http://127.0.0.1:1/secret/" in path.read_text(encoding="utf-8")
        if os.name == "posix":
            assert path.stat().st_mode & 0o077 == 0
    assert not path.exists()


def test_a_folder_of_results_shows_its_tables(chromium, located):
    with viewing(located) as (address, _), chromium() as tab:
        tab.open(address)
        tab.until(IDLE, 60)
        assert tab.js(model("table", "options")) == ["locus", "clearance"]
        tab.js(model("table", "value = 'locus'"))
        tab.until(f"{model('grid', 'columns.map((c) => c.title)')}.includes('x_m')", 30)
        assert tab.logged == []


def test_without_its_library_it_names_the_extra(monkeypatch):
    from tpjb_ident.view.server import Session, ViewError, serve

    monkeypatch.setitem(sys.modules, "bokeh.server.server", None)
    with pytest.raises(ViewError, match=r"tpjb-ident\[view\]"):
        serve(Session("x"), 0, print)
