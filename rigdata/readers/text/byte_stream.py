"""Text files of any encoding: their lines as text, and their numbers as a stream of ASCII bytes."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterator
from pathlib import Path

#: How much of a file is looked at to find how it is written; the names must be in it [characters].
HEAD = 2**18
#: Longer lines come in pieces [characters].
_PIECE = 2**20
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_ASCII = bytes(range(128)) + b"\x7f" * 128


def text_encoding(path: Path, stated: str | None) -> str:
    """Codec of a text file: its byte-order mark, else what is stated, else detected."""
    with path.open("rb") as stream:
        head = stream.read(65536)
    for mark, codec in _BOMS:
        if head.startswith(mark):
            return codec
    if stated is not None:
        return stated
    for first, codec in ((1, "utf-16-le"), (0, "utf-16-be")):
        half = head[first:400:2]
        if len(head) >= 4 and half.count(0) > 0.9 * len(half):
            return codec
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)  # the head may end inside a character
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def head_lines(path: Path, encoding: str) -> list[str]:
    """Complete lines of the head of a file, without their ends."""
    with path.open(encoding=encoding, errors="replace") as stream:
        text = stream.read(HEAD)
    lines = text.split("\n")
    if len(text) == HEAD or not lines[-1]:
        lines.pop()
    return lines


def all_lines(path: Path, encoding: str) -> Iterator[str]:
    """Every line of a file, without its end; very long lines come in pieces."""
    with path.open(encoding=encoding, errors="replace") as stream:
        while line := stream.readline(_PIECE):
            yield line.removesuffix("\n")


def is_ascii_based(encoding: str) -> bool:
    """Whether digits, delimiters and line ends are single ASCII bytes in `encoding`, from the file's first byte on."""
    sample = '\t\r\n",.;|+-0123456789 eE'
    return sample.encode(encoding) == sample.encode("ascii")


def open_numbers(path: Path, encoding: str, delimiter: str) -> io.BufferedReader:
    """Open a text file for pyarrow: every character beyond ASCII has become DEL, runs of blanks that part cells a tab.

    Numbers, delimiters and line ends are ASCII; pyarrow takes all text for UTF-8 and must not meet other bytes.
    """
    return io.BufferedReader(_NumberStream(path, encoding, squeeze=delimiter == " "), 2**18)


class _NumberStream(io.RawIOBase):
    def __init__(self, path: Path, encoding: str, squeeze: bool) -> None:
        self._file = path.open("rb")
        decoder = codecs.getincrementaldecoder(encoding)
        self._decoder = None if is_ascii_based(encoding) else decoder("replace")
        self._squeeze = squeeze
        self._begun_line = b""
        self._ready = memoryview(b"")
        self._ended = False

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        while not self._ready and not self._ended:
            self._ready = memoryview(self._next_block())
        size = min(len(buffer), len(self._ready))
        buffer[:size] = self._ready[:size]
        self._ready = self._ready[size:]
        return size

    def _next_block(self) -> bytes:
        block = self._file.read(_PIECE)
        self._ended = not block
        if self._decoder is not None:
            block = self._decoder.decode(block, final=self._ended).encode("utf-8", "replace")
        block = block.translate(_ASCII)
        return self._squeezed(block) if self._squeeze else block

    def _squeezed(self, block: bytes) -> bytes:
        text = self._begun_line + block
        end = len(text) if self._ended else text.rfind(b"\n") + 1
        self._begun_line = text[end:]
        trimmed = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", text[:end])
        return re.sub(rb"[ \t]+", b"\t", trimmed)

    def close(self) -> None:
        self._file.close()
        super().close()
