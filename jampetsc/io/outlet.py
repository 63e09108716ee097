"""Where a job's result goes: a file, or the memory of the process."""

from pathlib import Path

from jampetsc.collective import on_root
from jampetsc.errors import ConvergenceError, InputError, named


class Outlet:
    """Takes the result of one run of a job, or its packing.

    path        file of the result; None: it stays in memory
    checkpoint  file beside which a long run keeps its finished steps, to resume from; None: in memory
    request     the `request.Request` of the run, which its files and its checkpoint are identified by
    status      exit status of a command that has written what it could
    finished    whether the result of the request is in its file already and stays
    summary     text for the user, after the run

    Raises InputError for a name without a character.
    """

    status, finished, summary = 0, False, ""

    def __init__(self, path=None, checkpoint=None, request=None):
        for name, value in (("out", path), ("checkpoint", checkpoint)):
            if isinstance(value, str) and not value:
                raise InputError(f"{named(name)}: empty. Give the name of a file.")
        self.path = None if path is None else Path(path)
        self.checkpoint_path, self.request = checkpoint, request
        self._result = self._packing = self._checkpoint = None
        self._ranks = 1  # that have written the file

    def __str__(self):
        return "in memory" if self.path is None else str(self.path)

    @property
    def parts_note(self) -> str:
        """A line about the parts of a result that several ranks have written; empty for one file."""
        if not self._ranks > 1:
            return ""
        folder = self.path.with_name(f"{self.path.stem}.parts")
        return (
            f"\n  rows of the {self._ranks} ranks in {folder}: keep both together, or `jampetsc merge {self}`"
        )

    def raise_failures(self, failures: dict, count: int, what: str) -> None:
        """Raise ConvergenceError where some of `count` parts of the result failed.

        failures   {part, in their order: its ConvergenceError}
        what       the parts, in words
        """
        if failures:
            first = failures[min(failures)].message(named)
            rest = (
                f"give {named('out')} to keep the others"
                if self.path is None
                else f"the others are in {self}"
            )
            raise ConvergenceError(f"{len(failures)} of {count} {what} failed, {rest}; the first: {first}")

    def require_file(self) -> None:
        """Raise InputError where a result that is for other programs has no file to go to."""
        if self.path is None:
            raise InputError(f"{named('out')}: missing. Give the file to write.")

    def check(self, kind, inputs=(), path=None, beside=()) -> bool:
        """Refuse what may not be replaced; whether the file is finished, see `outputs.check_output`.

        path    of another file than the result's
        """
        from jampetsc.io.outputs import check_output

        if not (path or self.path):
            return False
        request = self.request if kind.startswith("jampetsc-") else None
        is_finished = check_output(path or self.path, kind, inputs, beside, request)
        self.finished = self.finished if path else is_finished
        return is_finished

    def writer(self, format, comm=None):
        """A `ResultWriter`. Collective over comm."""
        from jampetsc.io.result_file import ResultWriter

        writer = ResultWriter(self.path, format, comm, self.request)
        if self.path is None:  # what is in a file is read from there
            self._result = writer
        elif comm is not None:
            self._ranks = comm.size
        return writer

    def put_packing(self, disks) -> None:
        """Take a packing that was made. Not collective."""
        from jampetsc.io.packing_file import write_packing

        self._result = disks
        if self.path is not None:
            write_packing(self.path, disks, self.request)

    def put_network(self, network) -> None:
        """Take a network that was made. Not collective."""
        from jampetsc.io.packing_file import write_network

        self._result = network
        if self.path is not None:
            write_network(self.path, network, self.request)

    def set_source(self, disks) -> None:
        """Take the packing that the result was made from, to be its `Result.packing`."""
        self._packing = disks

    def checkpoint(self, comm=None, ordered=False):
        """The `io.checkpoint.Checkpoint` of the job, after its inputs were read. Collective over comm.

        Raises InputError where an input was replaced while it was read.
        """
        from jampetsc.io.checkpoint import Checkpoint

        path = self.checkpoint_path
        digest = None if path is None else on_root(comm, self.request.confirmed_digest)
        self._checkpoint = Checkpoint(path, digest, comm, ordered=ordered)
        return self._checkpoint

    @property
    def has_checkpoint(self) -> bool:
        """Whether finished steps of an unfinished run are on disk."""
        if self.checkpoint_path is None:
            return False
        from jampetsc.io.checkpoint import has_steps

        return has_steps(self.checkpoint_path) if self._checkpoint is None else bool(self._checkpoint.done)

    def share(self, comm) -> None:
        """Give every rank what rank 0 has in memory. Collective."""
        from jampetsc.io.result_file import ResultWriter

        self._result = comm.bcast(self._result)
        if isinstance(self._result, ResultWriter):
            self._result.comm = comm  # so that all ranks save it together

    @property
    def result(self):
        """The result, as `load` gives it. Collective."""
        from jampetsc.io.reader import collected, load
        from jampetsc.io.results import Result
        from jampetsc.packing.packing import Packing
        from jampetsc.packing.spring_network import Network

        if self.path is None and isinstance(self._result, Packing | Network):
            return self._result
        result = collected(self._result) if self.path is None else load(self.path)
        if isinstance(result, Result):
            result.packing = self._packing
        return result
