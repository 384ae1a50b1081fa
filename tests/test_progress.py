"""What a long command says while it works."""

import io
import re
import time

import pytest

from powertrain_ctrl.report import progress as module
from powertrain_ctrl.report.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(module, "QUIET", 0.06)
    monkeypatch.setattr(module, "TICK", 0.01)
    monkeypatch.setattr(module, "INSTANT", 0.005)


def said(out, *steps):
    with Progress(out) as progress:
        for step, seconds in steps:
            progress(step)
            time.sleep(seconds)
    return out.getvalue()


def test_each_step_is_one_line_with_its_seconds():
    lines = said(io.StringIO(), ("Load change", 0.02), ("Nothing", 0.0), ("Launch", 0.02)).splitlines()
    assert [re.sub(r" +\d+\.\d s$", "", line) for line in lines] == ["  Load change", "  Launch"]


def test_a_long_step_gives_signs_of_life_and_a_short_one_none():
    text = said(io.StringIO(), ("Load change", 0.02), ("Launch", 0.2))
    assert text.count("Launch … 0 s\n") >= 2
    assert "Load change …" not in text
    assert "\r" not in text


def test_a_terminal_sees_one_line_that_is_drawn_over():
    text = said(Terminal(), ("Launch", 0.1))
    assert text.count("\n") == 1
    assert text.count("\r\033[K  Launch … ") >= 2
    assert text.splitlines()[-1].endswith(" s")


def test_a_step_that_fails_is_not_said_to_be_done():
    def fails(out):
        with Progress(out) as progress:
            progress("Launch")
            time.sleep(0.02)
            raise RuntimeError("no")

    out = io.StringIO()
    with pytest.raises(RuntimeError):
        fails(out)
    assert out.getvalue() == ""


def test_nobody_who_listens_is_no_error_of_the_clock():
    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        said(Gone(), ("Launch", 0.1))
