"""The identity of a job: its command, parameters and inputs, and the version of the format of its result.

Its digest is the key of a checkpoint, says whether a finished result is that of a job, and names a task of a study. Its
text is the attribute `request` of a file.
"""

import functools
import hashlib
import json
import shlex

from jampetsc.errors import InputError
from jampetsc.io.checksums import identity_of
from jampetsc.version import FORMAT_VERSION

MAX_VALUE_LENGTH = 200  # characters of a value; a longer one is replaced by its hash
MAX_LINE_LENGTH = 10_000  # characters of a command line or a list of files: an HDF5 attribute holds 64 kB


class Request:
    """One run of a job: what identifies its result, and how it was asked for.

    job         an `options.job.Job`
    argv        the command line
    overwrite   whether a finished result is computed again and replaced
    """

    def __init__(self, job, argv=(), overwrite=False):
        self.job, self.argv, self.overwrite = job, argv, overwrite

    @functools.cached_property
    def settings(self) -> dict[str, str]:
        """`settings_of` the job with its inputs, whose files are hashed when this is first asked for."""
        return with_inputs(settings_of(self.job), input_hashes(self.job))

    @property
    def text(self) -> str:
        """The settings as the attribute `request` of a file."""
        return json.dumps(self.settings, sort_keys=True)

    @property
    def digest(self) -> str:
        """The identity of the job, see `digest_of`."""
        return digest_of(self.settings)

    @property
    def recorded(self) -> dict:
        """The attributes of a result that record the request."""
        return {"argv": shortened(shlex.join(map(str, self.argv))), "request": self.text}

    def differences(self, text: str) -> str:
        """How the recorded request `text` differs from this one, in words; empty for the same digest."""
        recorded = _recorded(text)
        if recorded is None:
            return "settings that are not readable"
        if digest_of(recorded) == self.digest:
            return ""
        names = {**self.settings, **recorded}
        changed = [name for name in names if recorded.get(name) != self.settings.get(name)]
        return "; ".join(_difference(name, recorded.get(name), self.settings.get(name)) for name in changed)

    def confirmed_digest(self) -> str:
        """The digest, after the inputs were read. Raises InputError where a file is not the one that was hashed."""
        digest = self.digest
        if digest_of(with_inputs(settings_of(self.job), input_hashes(self.job))) != digest:
            raise InputError(
                f"{', '.join(self.job.paths)}: changed while it was read. Run the same command again."
            )
        return digest


def settings_of(job) -> dict[str, str]:
    """{name: text} of command, version of the format, and parameters that determine the result, without its inputs."""
    files = set(job.paths)
    parameters = {
        name: _short(value)
        for name, value in job.identity().items()
        if not files.issuperset(map(str, value if isinstance(value, list) else [value]))
    }
    return {"command": job.NAME, "format_version": FORMAT_VERSION} | parameters


def input_hashes(job, without=()) -> list[str]:
    """Hashes of the content of the files that a job reads, those `without` excepted, and of its inputs in memory."""
    files = [path for path in job.paths if path not in without]
    return [*job.input_hashes, *(str(identity_of(path)) for path in files)]


def with_inputs(settings: dict[str, str], hashes) -> dict[str, str]:
    """The settings of a job whose inputs have these hashes, in whatever order."""
    return settings | {"inputs": _short(sorted(hashes))} if hashes else settings


def digest_of(settings: dict[str, str]) -> str:
    """The sha256 of settings, in whatever order: the same for jobs that have the same result."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def _recorded(text) -> dict | None:
    """The settings {name: text} of an attribute `request`; None where it holds none."""
    try:
        settings = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None
    return settings if isinstance(settings, dict) else None


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
    return f"{name} = {old or 'its default'}, not {new or 'its default'}"
