"""A stand-in for the child process of `rigdata.readers.formats.walled` that reads one file after the other until it
dies.

The wall starts an interpreter and imports asammdf for every file: a second, in which a fuzzer wants a hundred files.
Here one forked child keeps its imports and answers like the real one, with the same limits of memory; what differs is
that it has read other files before, and a shorter time limit.
"""

from __future__ import annotations

import io
import os
import select
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rigdata.readers.formats import walled

#: Files that a child reads before it is replaced: what a library leaks must not become a finding of a later file.
CASES = 500
#: Seconds that a file of the fuzzer's size may take (the real wall gives it 60).
SECONDS = 3.0


class WarmWall:
    """`run` takes the place of `subprocess.run` in `rigdata.readers.formats.walled`."""

    def __init__(self) -> None:
        self.child = self.owner = self.cases = 0
        self.asks = self.answers = -1

    def run(self, command: list[str], env: dict[str, str], **_: Any) -> subprocess.CompletedProcess[bytes]:
        """Answer like ``subprocess.run([python, -m, rigdata.readers.formats.walled, module, path])``."""
        if self.owner != os.getpid() or not self.child or self.cases >= CASES:
            self.end()
            self._fork()
        self.cases += 1
        os.write(self.asks, "\t".join([command[3], command[4], env["TMPDIR"]]).encode() + b"\n")
        head = self._answer(8)
        if len(head) < 8:
            return subprocess.CompletedProcess(command, self.end() or 1, b"", b"")
        return subprocess.CompletedProcess(command, 0, self._answer(struct.unpack("<q", head)[0]), b"")

    def _answer(self, size: int) -> bytes:
        """`size` bytes, fewer where the child has died."""
        until = time.monotonic() + SECONDS
        got = bytearray()  # a bomb unpacks to hundreds of megabytes, which come in small pieces
        while len(got) < size:
            ready, _, _ = select.select([self.answers], [], [], max(until - time.monotonic(), 0.0))
            if not ready:
                self.end()
                raise subprocess.TimeoutExpired("", SECONDS)
            piece = os.read(self.answers, size - len(got))
            if not piece:
                break
            got += piece
        return bytes(got)

    def end(self) -> int:
        """End the child; its exit status."""
        if self.owner != os.getpid() or not self.child:
            self.child = 0
            return 0
        os.close(self.asks)
        os.close(self.answers)
        os.kill(self.child, signal.SIGKILL)
        _, status = os.waitpid(self.child, 0)
        self.child = 0
        return status

    def _fork(self) -> None:
        (question, self.asks), (self.answers, reply) = os.pipe(), os.pipe()
        self.owner, self.cases = os.getpid(), 0
        self.child = os.fork()
        if self.child:
            os.close(question)
            os.close(reply)
            return
        try:
            os.close(self.asks)
            os.close(self.answers)
            sys.settrace(None)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # the real wall swallows it too
            _serve(question, reply)
        finally:
            os._exit(70)


def _serve(question: int, reply: int) -> None:
    with open(question, "rb") as asked, open(reply, "wb") as out:
        for line in asked:
            module, path, tempfile.tempdir = line.decode().rstrip("\n").split("\t")
            sys.stdout = told = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
            walled.main(module, Path(path))
            said = told.buffer.getvalue()  # type: ignore[attr-defined]
            out.write(struct.pack("<q", len(said)) + said)
            out.flush()
