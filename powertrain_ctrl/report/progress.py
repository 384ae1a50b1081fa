"""What a long command says while it works: one line for each step with its seconds, and signs of life in between."""

from __future__ import annotations

import threading
import time
from types import TracebackType
from typing import TextIO

# A step that takes longer says so every so many seconds; a terminal sees it count.
QUIET, TICK = 4.0, 0.25
# What is over sooner had nothing to do.
INSTANT = 0.05
WIDTH = 44


class Progress:
    """Called with the title of each step when it begins; used in a ``with`` block.

    On a terminal the step under way is a line that is drawn over. Elsewhere nothing is drawn over, and a step that takes
    long says every four seconds that it is still under way.
    """

    def __init__(self, out: TextIO):
        self.out, self.is_terminal = out, out.isatty()
        self._step, self._begun, self._spoke = "", 0.0, 0.0
        self._lock, self._over = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Progress:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._over.set()
        self._thread.join()
        self._end(is_done=error is None)

    def __call__(self, step: str) -> None:
        with self._lock:
            self._end(is_done=True)
            self._step, self._begun = step, time.monotonic()

    def _end(self, is_done: bool) -> None:
        seconds = time.monotonic() - self._begun
        if self._step and is_done and seconds > INSTANT:
            self._say(f"{self._clear}  {self._step:<{WIDTH}}{seconds:7.1f} s\n")
        elif self._step:
            self._say(self._clear)
        self._step = ""

    @property
    def _clear(self) -> str:
        return "\r\033[K" if self.is_terminal else ""

    def _tick(self) -> None:
        while not self._over.wait(TICK):
            with self._lock:
                now = time.monotonic()
                try:
                    if self._step and self.is_terminal:
                        self._say(f"{self._clear}  {self._step} … {now - self._begun:.0f} s")
                    elif self._step and now - max(self._spoke, self._begun) >= QUIET:
                        self._say(f"  {self._step} … {now - self._begun:.0f} s\n")
                except (OSError, ValueError):  # nobody listens any more; the next step finds out
                    return

    def _say(self, text: str) -> None:
        self.out.write(text)
        self.out.flush()
        self._spoke = time.monotonic()
