"""What a page is made of, for tests that ask whether a stranger's words became part of it."""

import html.parser

VOID = frozenset({"meta", "br", "img", "link", "input", "hr"})


class Page(html.parser.HTMLParser):
    """Every start tag with its attributes, in order, and the scripts; elements are closed in the order of opening."""

    def __init__(self, text: str, well_formed: bool = True) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self._open: list[str] = []
        self._well_formed = well_formed
        self.feed(text)
        assert not (well_formed and self._open)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        closed = self._open.pop() if self._open else None
        assert closed == tag or not self._well_formed

    def handle_data(self, data):
        if self._open[-1:] == ["script"]:
            self.scripts.append(data)
