"""One self-contained HTML page from headings, sentences, tables and figures; everything from outside is escaped."""

import base64
import datetime
import functools
import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import markupsafe

from tpjb_ident.report.figure import Panel, inline_svg, is_wide, save_panels, svg_text
from tpjb_ident.runtime.provenance import versions
from tpjb_ident.runtime.tables import printable, readable, write_text

#: A number with what may stand beside it, such as its interval or unit.
_NUMBER = re.compile(r"–|[-−+#(]*\d(?!.*[A-Za-z]{3}).*")
#: Characters of a number with its interval; a cell that holds more must wrap on a phone.
_LONG = 26


@dataclass(frozen=True)
class Table:
    """A table of ready-made text cells."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def text_columns(self) -> set[int]:
        """Columns of words, which stand left and wrap: the first, and those of long cells or mostly no numbers."""
        words = {0}
        for index in range(len(self.columns)):
            cells = [row[index] for row in self.rows if row[index]]
            numbers = sum(bool(_NUMBER.fullmatch(cell)) for cell in cells)
            if 2 * numbers < len(cells) or max(map(len, cells), default=0) > _LONG:
                words.add(index)
        return words


def table_of(caption: str, cells: Mapping[str, Iterable[str]]) -> Table:
    """A table of columns of cells, by their headings."""
    return Table(caption, list(cells), list(zip(*cells.values(), strict=True)))


@dataclass(frozen=True)
class Section:
    """A heading with what stands under it; a page leaves out a table without rows and a section without anything."""

    heading: str
    notes: Sequence[str] = ()
    panels: Sequence[Panel] = ()
    tables: Sequence[Table] = ()

    def __bool__(self) -> bool:
        return bool(self.notes or self.panels or any(table.rows for table in self.tables))


@dataclass(frozen=True)
class Page:
    """A report; what stands before its sections is its first screen."""

    title: str
    subtitle: str
    sentences: Sequence[str]  #: what came out, the answer first
    facts: Mapping[str, str] = field(default_factory=dict)  #: what was tested
    key_table: Table | None = None
    values: Table | None = None  #: K and C at one point
    flags: str = ""
    lead: str = ""  #: what the name of the panel on the first screen begins with
    then: str = ""
    sections: Sequence[Section] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    refresh: int = 0
    beside: str = "Figures are beside this file as SVG and PNG, tables as CSV and Parquet."

    @functools.cached_property
    def picture(self) -> Panel | None:
        """The panel of the first screen; its section does without it."""
        return next((panel for panel in self.panels if self.lead and panel.name.startswith(self.lead)), None)

    @property
    def panels(self) -> list[Panel]:
        """All panels, in order of the sections."""
        panels: list[Panel] = []
        for section in self.sections:
            panels += section.panels
        return panels


def render_page(page: Page, svg: Mapping[str, str]) -> str:
    """Render a report as HTML."""
    script = _TEMPLATES.get_template("sort.js").render()
    running = printable(f"{page.title} \N{MIDDLE DOT} {page.facts.get('Bearing', page.subtitle)}")
    # in a style sheet: letters and digits as they are, everything else by its number, that no sign can end a string
    running = "".join(c if c.isascii() and c.isalnum() else f"\\{ord(c):06x}" for c in running)
    return _TEMPLATES.get_template("report.html").render(
        page=page,
        drawn=_drawings(page.panels, svg),
        # our own text; the one text from outside is escaped, character by character
        style=markupsafe.Markup(_TEMPLATES.get_template("style.css").render(running=markupsafe.Markup(running))),
        script=markupsafe.Markup(script),  # likewise
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        versions=versions(),
        finished=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


def render_section(section: Section) -> str:
    """Render one section with its style, as the text of an element that has a shadow root of its own."""
    svg = {panel.name: svg_text(panel.figure, panel.name) for panel in section.panels}
    style = _TEMPLATES.get_template("style.css").render(running="").replace(":root", ":host")
    macros: Any = _TEMPLATES.get_template("section.html").module
    html = macros.section(section, _drawings(section.panels, svg), "")
    return f"<style>{style} :host {{ background: var(--paper); color: var(--ink); }}</style>{html}"


def write_page(folder: Path, page: Page) -> Path:
    """Write ``report.html`` and its figures, as SVG and PNG in ``figures``."""
    texts = save_panels(page.panels, folder / "figures")
    path = folder / "report.html"
    write_text(path, render_page(page, texts))
    return path


def _drawings(panels: Iterable[Panel], svg: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Drawings of panels by name: each as an element of a page, and whether it takes a whole row."""
    drawings = {}
    for panel in panels:
        # matplotlib has escaped the labels inside the drawing already; the title is ours to escape
        title = str(markupsafe.escape(printable(panel.title)))
        element = markupsafe.Markup(inline_svg(svg[panel.name], panel.name, title))
        drawings[panel.name] = {"element": element, "wide": is_wide(svg[panel.name])}
    return drawings


def _printable_cell(value: object) -> object:
    if isinstance(value, list | tuple):  # a setting with several values, or with none
        value = ", ".join(map(str, value)) or None
    return value if isinstance(value, markupsafe.Markup) else readable("none" if value is None else str(value))


_SETTINGS: dict[str, Any] = {
    "loader": jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    "undefined": jinja2.StrictUndefined,
    "trim_blocks": True,
    "lstrip_blocks": True,
}
_TEMPLATES = jinja2.Environment(autoescape=True, finalize=_printable_cell, **_SETTINGS)


def plain_templates() -> jinja2.Environment:
    """Templates of plain text, of which a paragraph is a line: a value has no line of its own."""
    return jinja2.Environment(finalize=lambda value: " ".join(str(value).splitlines()), **_SETTINGS)
