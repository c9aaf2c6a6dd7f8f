"""A small coverage-guided fuzzer: inputs that reach new lines of the project are bred further."""

import random
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

ODD = (b"nan", b"inf", b"-1", b"1e999", b"0", b"\x00", b"\xff", b"", b"@", b";", b",", b"\n")


class CoverageFuzzer:
    """Breeds byte strings from seeds."""

    def __init__(self, seeds: list[bytes], target: Callable[[bytes], None], seed: int) -> None:
        """`target` takes an input and raises for one that breaks it."""
        self.corpus = list(seeds)
        self.lines: set[tuple[str, int]] = set()
        self._target, self._rng = target, random.Random(seed)

    def run(self, count: int) -> None:
        """Try the corpus, then so many offspring. What the target raises comes through."""
        for data in list(self.corpus):
            self._try(data)
        for _ in range(count):
            data = self._mutate(self._rng.choice(self.corpus))
            if self._try(data):
                self.corpus.append(data)

    def _try(self, data: bytes) -> bool:
        """Whether lines were reached that were not before."""
        before = len(self.lines)
        sys.settrace(self._trace)
        try:
            self._target(data)
        finally:
            sys.settrace(None)
        return len(self.lines) > before

    def _trace(self, frame: FrameType, event: str, _argument: Any) -> Any:
        file = frame.f_code.co_filename
        if "/lfd_" not in file:
            return None

        def lines(frame: FrameType, event: str, _argument: Any) -> Any:
            self.lines.add((file, frame.f_lineno))
            return lines

        return lines

    def _mutate(self, data: bytes) -> bytes:
        rng, changed = self._rng, bytearray(data)
        for _ in range(rng.choice((1, 1, 2, 4))):
            at = rng.randrange(len(changed) + 1)
            kind = rng.randrange(6)
            if kind == 0 and changed:
                changed[at % len(changed)] = rng.randrange(256)
            elif kind == 1:
                changed[at:at] = rng.choice(ODD)
            elif kind == 2:
                del changed[at : at + rng.choice((1, 4, 50))]
            elif kind == 3:
                piece = changed[at : at + rng.choice((1, 8, 100))]
                changed[at:at] = piece
            elif kind == 4 and changed:
                changed[at % len(changed)] ^= 1 << rng.randrange(8)
            else:
                other = rng.choice(self.corpus)
                cut = rng.randrange(len(other) + 1)
                changed = changed[:at] + other[cut:]
        return bytes(changed)
