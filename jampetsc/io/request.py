"""The settings of a result, which its file records, so that a finished one is not replaced by one of other settings."""

import hashlib
import json
import shlex

from jampetsc.io.checksums import identity_of

NO_SETTINGS = ("last", "threads")  # parameters that change no number of a result
MAX_VALUE_LENGTH = 200  # characters of a value; a longer one is replaced by its hash
MAX_LINE_LENGTH = 10_000  # characters of a command line or a list of files: an HDF5 attribute holds 64 kB


class Request:
    """The settings of one run: its command and options, and what its input files hold.

    job         an `options.job.Job`
    argv        the command line
    overwrite   whether a finished result is computed again and replaced
    """

    def __init__(self, job, argv=(), overwrite=False):
        self.job, self.argv, self.overwrite = job, argv, overwrite
        self.options = {name: value for name, value in job.settings().items() if name not in NO_SETTINGS}
        self.settings = {"command": job.NAME} | {n: _short(v) for n, v in self.options.items()}

    def read(self, inputs) -> None:
        """Replace the names of the files at `inputs` in the settings by hashes of their content."""
        names = {str(path) for path in inputs}
        self.settings = {"command": self.settings["command"]}
        for name, value in self.options.items():
            if not names.issuperset(map(str, value if isinstance(value, list) else [value])):
                self.settings[name] = _short(value)
        digests = sorted([*self.job.input_hashes, *(str(identity_of(path)) for path in inputs)])
        self.settings |= {"inputs": _short(digests)} if digests else {}

    def differences(self, text: str) -> str:
        """How the recorded request `text` differs from this one, in words; empty for the same settings."""
        recorded = _recorded(text)
        if recorded is None:
            return "settings that are not readable"
        changed = [
            name
            for name in {**self.settings, **recorded}
            if recorded.get(name) != self.settings.get(name)
            and not self.job.same(name, recorded.get(name), self.settings.get(name))
        ]
        return "; ".join(_difference(name, recorded.get(name), self.settings.get(name)) for name in changed)

    @property
    def text(self) -> str:
        """The settings as the attribute `request` of a file."""
        return json.dumps(self.settings, sort_keys=True)

    @property
    def recorded(self) -> dict:
        """The attributes of a result that record the request."""
        return {"argv": shortened(shlex.join(map(str, self.argv))), "request": self.text}


def _recorded(text) -> dict | None:
    """The settings {name: text} of an attribute `request`; None where it holds none."""
    try:
        settings = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None
    if not isinstance(settings, dict):
        return None
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in settings.items()}


def shortened(text: str) -> str:
    """`text`, cut off where it is too long for an attribute, as of a large ensemble."""
    return text if len(text) <= MAX_LINE_LENGTH else f"{text[:MAX_LINE_LENGTH]} …"


def _short(value):
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    return (
        text if len(text) <= MAX_VALUE_LENGTH else f"sha256 {hashlib.sha256(text.encode()).hexdigest()[:16]}"
    )


def _difference(name, old, new):
    if name == "inputs":
        return "other inputs"
    without = {"true": "false", "false": "true"}.get(old or new, "its default")  # a switch without a word
    return f"{name} = {old or without}, not {new or without}"
