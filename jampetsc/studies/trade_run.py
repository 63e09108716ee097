"""The trade of one packing: runs every choice, writes table and picture, gives recommendations."""

import datetime
import os
import platform
import shlex
import tempfile
from pathlib import Path

from jampetsc.io.packing_file import read_identified
from jampetsc.io.provenance import git_commit
from jampetsc.progress import Progress
from jampetsc.studies import trade_ensembles, trade_settings, trade_table
from jampetsc.studies.trade_advice import advise
from jampetsc.version import VERSION


def measure(job, out) -> str:
    """Run all choices of a `studies.trade_job.Trade`, write `out` (.csv) and a picture (.png); returns the text.

    Choices that fail have a row that says why. Raises JampetscError without a reference.
    """
    picture = Path(out).with_suffix(".png")
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="jampetsc-trade-") as folder, Progress(None, "trade") as progress:
        bench = trade_settings.TradeRuns(job, folder, progress)
        rows = bench.find_reference()
        todo, remarks = trade_settings.plan_settings(bench)
        packs, more = trade_ensembles.plan_ensembles(bench) if job.ensemble else ([], [])
        count = sum(len(pack.seeds) for pack in packs)
        progress.note(f"{len(todo)} runs{f' and {count} packings with one each' if packs else ''} to do")
        rows += [bench.measure(choice) for choice in todo]
        rows += [trade_ensembles.measure(bench, pack) for pack in packs]
    facts = [*_facts(job, out, bench.reference, load), *remarks, *more]
    trade_table.write(out, rows, facts)
    from jampetsc.plots.trade_plots import plot_trade  # only now: matplotlib's memory is the runs' until then

    plot_trade(rows, bench.reference.certified, picture)
    lines = [trade_table.as_text(rows), "", *facts, "", *advise(rows), "", f"{out}, {picture}"]
    return "\n".join(lines)


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
        f"runs: {how}; {platform.machine()}, {os.cpu_count()} cores, load average {load:.1f} at the start",
        f"program: {versions}; {date}",
        f"reference: certified to {reference.certified:.1e}; errors below that are not resolved",
    ]
    if reference.window is not None:
        facts.append(f"critical window: omega = {reference.window[0]:.3g} to {reference.window[1]:.3g}")
    return facts
