"""Serves the page on this machine only, from Bokeh's own files: nothing is loaded from anywhere else.

Who asks must know the random path that the page has (another user of this machine does not), name this machine as the
host (a page elsewhere whose name was pointed here does not), and a WebSocket must come from the page itself.
"""

from __future__ import annotations

import functools
import html
import os
import secrets
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any

from rigdata.problem import RigError
from tpjb_ident.errors import TpjbError
from tpjb_ident.runtime.tables import printable

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.campaign import Campaign
    from tpjb_ident.results.identification import Identification

#: The only address that is ever listened on.
_LOOPBACK = "127.0.0.1"
#: Without the first a phone shows the page as wide as a desk's and small; no link tells the path; no icon is asked for.
_META = (
    '{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">'
    '<meta name="referrer" content="no-referrer"><link rel="icon" href="data:,">'
    "<style>@media (prefers-color-scheme: dark) { html { background: #000; } "
    "body { background: #fff; filter: invert(1) hue-rotate(180deg); } }</style>{% endblock %}"
)
#: Bytes of the random path.
_TOKEN = 24
_MOST_ROWS = 5000


class ViewError(TpjbError):
    """The page cannot be served; says why and what to do."""


@dataclass
class Session:
    """A campaign with what is identified from it and predicted for it, or the tables of a folder of results."""

    name: str
    campaign: Campaign | None = None
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    identify: Callable[[], Identification] | None = None
    bearing: Any = None
    #: Pivot models by name, as `tpjb_ident.compare.predictions.ModelSettings` takes them.
    pivots: Mapping[str, Any] = field(default_factory=dict)
    lock: Any = field(default_factory=Lock)  #: one page identifies, the others wait for it

    @functools.cached_property
    def identification(self) -> Identification | None:
        """Identified coefficients; None if the campaign has no dynamic runs."""
        return None if self.identify is None else self.identify()


def serve(session: Session, port: int, ready: Callable[[str], None], seconds: float | None = None) -> None:
    """Serve until interrupted; `ready` is called with the page's address."""
    try:
        from bokeh.server.server import BaseServer
        from bokeh.server.util import bind_sockets
        from tornado.httpserver import HTTPServer
        from tornado.ioloop import IOLoop
    except ModuleNotFoundError as error:
        raise ViewError('tpjb view needs Bokeh. Install it: pip install "tpjb-ident[view]"') from error
    try:
        sockets, port = bind_sockets(_LOOPBACK, port)
    except OSError as error:
        raise ViewError(f"port {port} cannot be used ({error.strerror}). Give another with --port, or 0.") from error
    token = secrets.token_urlsafe(_TOKEN)
    application = _application(session, token, {f"{_LOOPBACK}:{port}", f"localhost:{port}"})
    http = HTTPServer(application)
    http.add_sockets(sockets)
    server = BaseServer(IOLoop.current(), application, http)
    server.start()
    if seconds is not None:
        server.io_loop.call_later(seconds, server.io_loop.stop)
    ready(f"http://{_LOOPBACK}:{port}/{token}/")
    try:
        server.io_loop.start()
    finally:
        server.stop()


def _application(session: Session, token: str, hosts: set[str]) -> Any:
    """Bokeh's pages below a random path, for requests that name one of `hosts` and pages that come from there."""
    from bokeh.server.tornado import BokehTornado
    from tornado.web import ErrorHandler

    origins = {f"http://{host}" for host in hosts}

    class LocalPages(BokehTornado):
        def find_handler(self, request: Any, **options: Any) -> Any:
            is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
            if request.host.lower() in hosts and (not is_socket or request.headers.get("Origin") in origins):
                return super().find_handler(request, **options)
            return self.get_handler_delegate(request, ErrorHandler, {"status_code": 403})

    pages = {"/": lambda document: build(document, session)}
    return LocalPages(pages, prefix=token, extra_websocket_origins=sorted(hosts), redirect_root=False)


@contextmanager
def private_link(address: str) -> Iterator[str]:
    """A file that only this user can read and that leads a browser to the page: its command line is for all to see."""
    handle, name = tempfile.mkstemp(prefix="tpjb-view-", suffix=".html")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(f'<meta http-equiv="refresh" content="0; url={html.escape(address)}">')
        yield f"file://{name}"
    finally:
        os.unlink(name)


def build(document: Any, session: Session) -> None:
    """Fill a Bokeh document with the tabs that the session has something for."""
    from bokeh.layouts import column
    from bokeh.models import Div, TabPanel, Tabs

    document.template = _META
    document.title = f"tpjb: {printable(session.name)}"
    panels, verdict = [], Div(text="Identifying; the records can be browsed meanwhile.")
    if session.identify is not None:
        panels.append(TabPanel(child=verdict, title="verdict"))
    if session.campaign is not None and session.campaign.runs:
        from tpjb_ident.view.records_tab import records_tab

        panels.append(TabPanel(child=records_tab(session.campaign), title="records"))
    if session.tables:
        panels.append(TabPanel(child=_tables_tab(session.tables), title="tables"))
    # else as wide as the widest tab, on a phone too
    narrow = ":host(.bk-above) { grid-template-columns: minmax(0, 1fr); }"
    tabs = Tabs(tabs=panels, name="tabs", sizing_mode="stretch_width", stylesheets=[narrow])
    head = Div(text=f"<h1 style='font-size:1.3rem;margin:.3rem 0'>{html.escape(printable(session.name))}</h1>")
    document.add_root(column(head, tabs, sizing_mode="stretch_width"))
    if session.identify is not None:
        # beside the server's loop: the page is there at once
        Thread(target=_add_results, args=(document, session, tabs), daemon=True).start()


def _add_results(document: Any, session: Session, tabs: Any) -> None:
    """Identify, and put the verdict and the tabs of results into the page."""
    from bokeh.models import Div, TabPanel

    from tpjb_ident.view.results_tabs import model_tab, points_tab, verdict_tab

    try:
        with session.lock:
            identification = session.identification
        assert identification is not None
        children = {"verdict": verdict_tab(session, identification), "points and windows": points_tab(identification)}
        if session.bearing is not None:
            children["prediction and measurement"] = model_tab(session, identification)
    except (RigError, TpjbError, ValueError) as error:  # what is wrong with the records stands on the page
        children = {"verdict": Div(text=html.escape(printable(error)), name="verdict")}
    panels = [TabPanel(child=child, title=title) for title, child in children.items()]

    def show() -> None:
        tabs.tabs = [panels[0], *tabs.tabs[1:], *panels[1:]]

    document.add_next_tick_callback(show)


def _tables_tab(tables: Mapping[str, pd.DataFrame]) -> Any:
    """Build the tab."""
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, DataTable, Select, TableColumn

    from tpjb_ident.view.records_tab import follow

    pick = Select(title="table", options=list(tables), value=next(iter(tables)), name="table", width=320)
    source = ColumnDataSource({})
    grid = DataTable(source=source, height=560, sizing_mode="stretch_width", autosize_mode="none", reorderable=False,
                     name="grid")  # fmt: skip

    def update() -> None:
        frame = tables[pick.value].head(_MOST_ROWS)
        shown = frame.map(lambda value: f"{value:.6g}" if isinstance(value, float) else printable(value))
        source.data = {c: list(shown[c]) for c in frame}
        grid.columns = [TableColumn(field=c, title=printable(c), width=7 * max(20, len(str(c)))) for c in frame]

    follow(update, pick)
    return column(pick, grid, sizing_mode="stretch_width")
