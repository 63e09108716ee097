"""What a result was asked for: its file records it, so that a finished one is not replaced by one of other settings."""

import contextlib
import hashlib
import json
from contextvars import ContextVar

from jampetsc.io.checksums import identity_of

NO_SETTINGS = ("last", "threads")  # which change no number of a result
LONGEST = 200  # characters of a value; of a longer one its hash is kept

_asked = ContextVar("the request that results record", default=None)


class Request:
    """The settings of one run: its command and options, and what its input files hold.

    options     {parameter: value} of those that are given
    same        whether two values of a parameter mean the same
    held        what inputs in memory hold: hashes
    """

    def __init__(self, command, options: dict, overwrite=False, same=lambda name, one, other: False, held=()):
        self.overwrite, self.same, self.held = bool(overwrite), same, list(held)
        self.options = {
            name: value for name, value in options.items() if name not in NO_SETTINGS and value is not None
        }
        self.settings = {"command": command} | {n: _short(v) for n, v in self.options.items()}

    def read(self, inputs) -> None:
        """Take the files at `inputs` by what they hold, however they are called."""
        names = {str(path) for path in inputs}
        self.settings = {"command": self.settings["command"]}
        for name, value in self.options.items():
            if not names.issuperset(map(str, value if isinstance(value, list) else [value])):
                self.settings[name] = _short(value)
        held = sorted([*self.held, *(str(identity_of(path)) for path in inputs)])
        self.settings |= {"inputs": _short(held)} if held else {}

    def differences(self, text: str) -> str:
        """In what the recorded request `text` is another one, in words; empty where it is the same."""
        found = json.loads(text)
        changed = [
            name
            for name in {**self.settings, **found}
            if found.get(name) != self.settings.get(name)
            and not self.same(name, found.get(name), self.settings.get(name))
        ]
        return "; ".join(_told(name, found.get(name), self.settings.get(name)) for name in changed)


@contextlib.contextmanager
def asked(request: Request | None):
    """Results written inside record what was asked for; None: nothing, as packings, whose records say it."""
    token = _asked.set(request)
    try:
        yield
    finally:
        _asked.reset(token)


def current() -> Request | None:
    """The request of the command that runs, if one does."""
    return _asked.get()


def recorded() -> dict:
    """The attribute of a result that says what was asked for."""
    request = current()
    return {} if request is None else {"request": json.dumps(request.settings, sort_keys=True)}


def _short(value):
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    return text if len(text) <= LONGEST else f"sha256 {hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _told(name, old, new):
    if name == "inputs":
        return "other inputs"
    without = {"true": "false", "false": "true"}.get(
        old or new, "none"
    )  # of a switch: how it is without a word
    return f"{name} = {old or without}, not {new or without}"
