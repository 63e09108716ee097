"""The trade of one packing: every choice run, table and picture written, advice given."""

import datetime
import os
import platform
import shlex
import signal
import sys
import tempfile
from pathlib import Path

from jampetsc.errors import InputError, named
from jampetsc.io.outputs import PICTURE, TABLE, check_output
from jampetsc.io.packing_file import read_identified, read_packing
from jampetsc.io.provenance import git_commit
from jampetsc.petsc import launcher
from jampetsc.progress import Progress
from jampetsc.speed_accuracy import choices, ensembles, processes
from jampetsc.speed_accuracy.advice import advise
from jampetsc.speed_accuracy.table import Table
from jampetsc.version import VERSION


def measure(job, out) -> str:
    """Run all choices of a `speed_accuracy.job.Trade`, write `out` (.csv) and a picture (.png); gives them as text.

    Choices that fail have a row that says why. Raises JampetscError if there is no reference.
    """
    picture = Path(out).with_suffix(".png")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # as by the system, but stops the run in hand
    load = _load()
    with (
        tempfile.TemporaryDirectory(prefix="jampetsc-trade-") as folder,
        Progress(None, "trade") as progress,
    ):
        bench = choices.Bench(job.packing, job.physics, job.frequencies, job.ranks, folder, progress)
        rows = bench.find_reference()
        todo, remarks = choices.plan(bench, job.choices, job.options_files or choices.OPTIONS_FILES)
        shares, more = ensembles.plan(job.packing) if job.ensemble else ([], [])
        progress.note(
            f"{len(todo)} runs{f' and {sum(shares)} packings with one each' if shares else ''} to do"
        )
        rows += [bench.measure(choice) for choice in todo]
        rows += [ensembles.measure(bench, share) for share in shares]
    table = Table(rows, _facts(job, out, bench.reference, load) + remarks + more)
    table.write(out)
    from jampetsc.plots.trade import plot_trade  # only now: matplotlib's memory is the runs' until then

    plot_trade(rows, bench.reference.certified, picture)
    lines = [str(table), "", *table.facts, "", *advise(rows), "", f"{out}, {picture}"]
    return "\n".join(lines)


def check(job, out) -> None:
    """Raise InputError for what can be known to be wrong before anything runs."""
    if launcher.several():
        raise InputError(f"trade starts its own processes: run it without mpirun and give {named('ranks')}")
    processes.launcher(job.ranks)
    inputs = [job.packing, *(job.options_files or ())]
    check_output(out, TABLE, inputs)
    check_output(Path(out).with_suffix(".png"), PICTURE, inputs)
    read_packing(job.packing)


def _facts(job, out, reference, load):
    disks, (name, digest) = read_identified(job.packing)
    attributes = reference.result.attributes
    how = f"mpirun -n {job.ranks}" if job.ranks else "one process each"
    versions = f"jampetsc {VERSION}, commit {git_commit() or 'unknown'}, PETSc {attributes['petsc_version']}"
    date = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    facts = [
        f"command: {shlex.join(job.line(out))}",
        f"packing: {name}, N = {disks.n}, p = {attributes['pressure']:.6g}, sha256 {digest}",
        f"law: {job.physics}, tau1 = {job.physics.law.tau1:g}; frequencies {job.frequencies}",
        f"runs: {how}; {platform.machine()}, {os.cpu_count()} cores, load average {load} at the start",
        f"program: {versions}; {date}",
        f"reference: certified to {reference.certified:.1e}; errors below that are not resolved",
    ]
    if reference.window is not None:
        facts.append(f"critical window: omega = {reference.window[0]:.3g} to {reference.window[1]:.3g}")
    return facts


def _load():
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
