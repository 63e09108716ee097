"""What a long run says on standard error: a line for each step where there is no terminal, from rank 0."""

import io
import logging

import jampetsc
from jampetsc.progress import LOG, Progress, duration_text


def test_lines_count_from_what_was_done_before_a_total_that_is_known(capsys, reporting):
    with Progress(5, "sweep", done=2) as progress:
        progress.step("omega 1")
        progress.note("beside")
        progress.step("omega 2")
    with Progress(None, "trade") as progress:
        progress.step("a")
    assert capsys.readouterr().err == "[3/5] omega 1\nbeside\n[4/5] omega 2\n[1] a\n"


def test_a_function_is_silent_unless_its_user_listens(capsys, caplog, monkeypatch):
    """To the logger `jampetsc`, by python's own means."""
    monkeypatch.setattr(LOG, "handlers", [caplog.handler])
    monkeypatch.setattr(LOG, "propagate", False)
    for level, steps in ((logging.WARNING, 0), (logging.INFO, 25)):
        with caplog.at_level(level, logger=LOG.name):
            jampetsc.flow(n=16, phi=0.86, model="RD0", rate=1e-2, strain=0.05)
        assert len([line for line in caplog.messages if "/25] strain" in line]) == steps
    assert capsys.readouterr().err == ""


def test_times_in_words():
    words = {0.123: "0.12 s", 89: "89 s", 90: "1.5 min", 5399: "90 min", 5400: "1.5 h", 9e5: "250 h"}
    assert [duration_text(seconds) for seconds in words] == list(words.values())


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_has_a_bar_that_goes_in_the_end(monkeypatch, reporting):
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    with Progress(5, "sweep", done=2) as progress:
        assert "sweep:  40%" in terminal.getvalue() and "2/5" in terminal.getvalue()
        progress.step("G' = 1")
        progress.note("beside the bar")
        assert progress.bar.n == 3 and progress.bar.postfix == "G' = 1"
    assert progress.bar.disable  # closed
    assert "beside the bar\n" in terminal.getvalue() and "[3/5]" not in terminal.getvalue()


def test_other_ranks_count_in_silence(capsys, monkeypatch, reporting):
    for terminal in (None, Terminal()):
        if terminal:
            monkeypatch.setattr("sys.stderr", terminal)
        with Progress(5, "sweep", rank=1) as progress:
            progress.step("a")
            progress.note("b")
        assert progress.count == 1
        assert (terminal.getvalue() if terminal else capsys.readouterr().err) == ""
