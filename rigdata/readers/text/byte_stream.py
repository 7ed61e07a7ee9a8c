"""A text file as a stream of bytes in which digits, delimiters and line ends are ASCII."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

#: How much of a file is looked at to find its dialect; the names must stand in it [bytes].
HEAD = 2**18
#: Longer lines come in pieces [bytes].
_PIECE = 2**20
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_LINE = re.compile(rb"\r\n|\n|\r")


def text_encoding(path: Path, stated: str | None) -> str:
    """Codec of a text file: its byte-order mark, else what is stated, else detected."""
    with path.open("rb") as stream:
        head = stream.read(65536)
    for mark, codec in _BOMS:
        if head.startswith(mark):
            return codec
    if stated is not None:
        return stated
    if len(head) >= 4 and head[1:400:2].count(0) > len(head[1:400:2]) * 0.9:
        return "utf-16-le"
    if len(head) >= 4 and head[0:400:2].count(0) > len(head[0:400:2]) * 0.9:
        return "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)  # the head may end inside a character
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def is_ascii_based(encoding: str) -> bool:
    """Whether digits, delimiters and line ends are single ASCII bytes in `encoding`."""
    if encoding in {"utf-8-sig", "utf-8"}:
        return True
    sample = '\t\r\n",.;|+-0123456789 eE'
    return sample.encode(encoding) == sample.encode("ascii")


def codec_of_bytes(encoding: str) -> str:
    """Codec of the bytes that `open_ascii` gives for a file in `encoding`."""
    return encoding if is_ascii_based(encoding) and encoding != "utf-8-sig" else "utf-8"


class _Rewritten(io.RawIOBase):
    """A stream that gives its bytes in another form, block by block; what is written anew may grow or shrink."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._rest = b""

    def _form(self, block: bytes) -> bytes:
        """The next block in the other form; an empty one is the end."""
        raise NotImplementedError

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        while not self._rest:
            block = self._stream.read(2**18)
            self._rest = self._form(block)
            if not block:
                break
        size = min(len(buffer), len(self._rest))
        buffer[:size] = self._rest[:size]
        self._rest = self._rest[size:]
        return size

    def close(self) -> None:
        self._stream.close()
        super().close()


class _Transcoder(_Rewritten):
    """Reads a file of any encoding as UTF-8."""

    def __init__(self, path: Path, encoding: str) -> None:
        super().__init__(path.open("rb"))
        self._decoder = codecs.getincrementaldecoder(encoding)("replace")

    def _form(self, block: bytes) -> bytes:
        return self._decoder.decode(block, final=not block).encode("utf-8", "replace")


def open_ascii(path: Path, encoding: str) -> BinaryIO:
    """Open a text file for reading as bytes, transcoded to UTF-8 where needed, after its byte-order mark."""
    if not is_ascii_based(encoding):
        stream = io.BufferedReader(_Transcoder(path, encoding), 2**18)
        if stream.peek(3)[:3] == codecs.BOM_UTF8:
            stream.read(3)
        return stream  # type: ignore[return-value]
    raw = path.open("rb")
    if raw.read(3) != codecs.BOM_UTF8:
        raw.seek(0)
    return raw


def skip_to(stream: BinaryIO, offset: int) -> None:
    """Move forward to byte `offset` of a stream from `open_ascii` (which may not be seekable)."""
    while offset > 0:
        block = stream.read(min(offset, 2**20))
        if not block:
            return
        offset -= len(block)


def head_lines(path: Path, encoding: str) -> list[tuple[bytes, int]]:
    """Lines of the head of a file, without their ends, each with the byte it starts at."""
    with open_ascii(path, encoding) as stream:
        head = stream.read(HEAD)
        complete = len(head) < HEAD
    lines, at = [], 0
    for match in _LINE.finditer(head):
        lines.append((head[at : match.start()], at))
        at = match.end()
    if at < len(head) and complete:
        lines.append((head[at:], at))
    return lines


def all_lines(path: Path, encoding: str) -> Iterator[bytes]:
    """Every line of a file, without its end; lines beyond a megabyte come in pieces."""
    with open_ascii(path, encoding) as stream:
        text = b""
        while block := stream.read(2**20):
            text += block
            parts = _LINE.split(text)
            # A carriage return at the very end may be half of a line end.
            if text.endswith(b"\r"):
                parts = _LINE.split(text[:-1])
                parts[-1] += b"\r"
            text = parts.pop()
            yield from parts
            while len(text) > _PIECE:
                yield text[:_PIECE]
                text = text[_PIECE:]
        if text:
            yield text.rstrip(b"\r")


class AsciiOnly(io.RawIOBase):
    """A stream in which every byte beyond ASCII has become DEL.

    Numbers, delimiters and line ends are ASCII; pyarrow takes all text for UTF-8 and must not meet other.
    """

    _TABLE = bytes(range(128)) + b"\x7f" * 128

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def readable(self) -> bool:
        """Whether it can be read: always."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Read up to `size` bytes."""
        return self._stream.read(size).translate(self._TABLE)


def squeeze_blanks(stream: BinaryIO) -> BinaryIO:
    """Turn every run of blanks between cells into one tab, for files parted by white space."""
    return io.BufferedReader(_Squeezer(stream), 2**18)  # type: ignore[return-value]


class _Squeezer(_Rewritten):
    """See `squeeze_blanks`."""

    _line_part = b""

    def _form(self, block: bytes) -> bytes:
        text = self._line_part + block
        cut = len(text) if not block else text.rfind(b"\n") + 1
        self._line_part = text[cut:]
        return re.sub(rb"[ \t]+", b"\t", re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", text[:cut]))
