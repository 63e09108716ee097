"""The settings and ensembles that a trade compares for one packing, the runs that measure them, table and picture."""

import datetime
import os
import platform
import shlex
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from jampetsc.analysis.power_laws import moduli
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.commands.pack import Pack
from jampetsc.commands.sweep import Sweep
from jampetsc.errors import ConvergenceError, InputError, JampetscError
from jampetsc.io.packing_file import read_identified, read_packing
from jampetsc.io.provenance import git_commit
from jampetsc.io.reader import load
from jampetsc.laws.damping import FAMILIES, Physics, damping_law
from jampetsc.minimisation.size_laws import is_law
from jampetsc.progress import Progress
from jampetsc.shipped_files import located
from jampetsc.studies import trade_process
from jampetsc.studies.plan import StudyTask
from jampetsc.studies.table_keys import TaskSettings
from jampetsc.studies.task_runner import TaskRunner
from jampetsc.studies.trade_errors import ReferenceCurve, certified, log_interpolate
from jampetsc.studies.trade_process import ProcessOutcome
from jampetsc.studies.trade_report import TradeRow, advise, format_table, write_table
from jampetsc.version import VERSION

ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
REFERENCE_ACCURACIES = (
    1e-12,
    1e-11,
    *reversed(ACCURACIES),
)  # tried for the reference, until one can be certified
PHYSICS_ACCURACY = 1e-3  # well below the changes by simpler physics, and certified at all frequencies
FREQUENCY_DENSITIES = (0.5, 1, 2, 4)  # frequencies, solved one by one
OPTIONS_FILES = tuple(located(f"jampetsc:{name}") for name in ("iterative", "superlu_dist", "low_memory"))
PACKING_COUNTS = (1, 4, 16)  # numbers of packings, each of N divided by that number
FIRST_SEED = 1001  # other packings than the one of the reference
MIN_DISKS = 16  # disks


@dataclass(frozen=True)
class TradeSetting:
    """One setting: its sweep, and the function that compares the result with the reference."""

    group: str
    name: str
    sweep: Sweep
    judge: Callable  # (reference, result) -> the fields of a TradeRow
    petsc: tuple = ()  # PETSc's own options


class TradeRuns:
    """Runs the jobs of a `trade_job.Trade` in a folder of their own and reports them to a Progress."""

    def __init__(self, job, folder, progress):
        self.job, self.folder, self.progress = job, Path(folder), progress
        self.reference = self.reference_accuracy = None
        self._runs = {}  # command line -> (ProcessOutcome, result): two choices may need the same run

    def sweep_with(self, **changes) -> Sweep:
        """The sweep that the trade is about, with these changes."""
        usual = {name: getattr(self.job, name) for name in ("packing", "law", "prestress", "omega")}
        usual["tangential_stiffness"] = self.job.tangential_stiffness
        return Sweep(**usual | changes)

    def run(self, job, petsc=(), name=None):
        """(ProcessOutcome, result or None) of one job, a task as of a study but in processes of its own.

        petsc   PETSc's own options
        name    of its file in the folder, without ending

        A job that was run before is not run again. A result that cannot be read counts as failed.
        """
        key = (*job.line(), *petsc)
        if key not in self._runs:
            name = name or f"run{len(self._runs)}"
            task = StudyTask(name, job.NAME, TaskSettings({}, job), {})
            outcomes = []
            execute = partial(self._execute, petsc, outcomes)
            record = TaskRunner(self.folder, {}, cores=None, execute=execute).run(task, [])
            outcome = outcomes[0] if outcomes else ProcessOutcome(1, 0.0, 0.0, "")
            if record["state"] == "done":
                result = load(self.folder / task.file)
            else:
                outcome, result = replace(outcome, status=outcome.status or 1, error=record["why"]), None
            self._runs[key] = outcome, result
        return self._runs[key]

    def _execute(self, petsc, outcomes, job, out, argv, overwrite):
        """Make the file `out` in processes of its own and keep how they ended; JampetscError if they failed."""
        outcome = trade_process.run([*job.line(out)[1:], *petsc], self.job.ranks)
        outcomes.append(outcome)
        if outcome.status:
            raise JampetscError(outcome.error)

    def find_reference(self) -> list[TradeRow]:
        """Find the tightest rational sweep that is certified; its row first, then the failed `ACCURACIES`.

        Raises JampetscError with the message of the run if all fail.
        """
        rows = []
        for accuracy in REFERENCE_ACCURACIES:
            outcome, result = self.run(self.sweep_with(accuracy=accuracy))
            name = f"accuracy {accuracy:g}"
            if result is not None:
                self.reference, self.reference_accuracy = ReferenceCurve(result), accuracy
                measured = _spent(outcome, result) | self.reference.exponents(result.G)
                row = TradeRow("reference", name, **measured, note="the others are compared with it")
                self.progress.step(f"reference {name}: {row.seconds:.2f} s  certified to {row.certified:.1e}")
                return [row, *rows]
            if outcome.status == InputError.exit_code:
                raise InputError(outcome.error)
            if outcome.status != ConvergenceError.exit_code:
                raise JampetscError(f"no reference: {outcome.error}")
            failed = self.failed("accuracy", name, outcome)
            rows += [failed] if accuracy in ACCURACIES else []
        raise ConvergenceError(
            f"no reference, as the rational sweep failed at every accuracy: {outcome.error}"
        )

    def measure(self, choice: TradeSetting) -> TradeRow:
        """The row of a setting; of a failed run with the reason."""
        group, name = choice.group, choice.name
        outcome, result = self.run(choice.sweep, choice.petsc)
        if result is None:
            return self.failed(group, name, outcome)
        row = TradeRow(group, name, **_spent(outcome, result), **choice.judge(self.reference, result))
        self.progress.step(f"{group} {name}: {row.seconds:.2f} s  error {row.error:.1e}")
        return row

    def failed(self, group, name, outcome) -> TradeRow:
        """The row of a run that failed."""
        row = TradeRow(
            group, name, process_seconds=outcome.seconds, note=f"failed: {outcome.error}", failed=True
        )
        self.progress.step(f"{group} {name}: {row.note}")
        return row


def plan_settings(bench: TradeRuns) -> tuple[list[TradeSetting], list[str]]:
    """(settings, lines about groups that are left out) for the requested groups; needs the reference."""
    job, choices, left_out = bench.job, [], []
    if "accuracy" in job.choices:
        looser = [accuracy for accuracy in ACCURACIES if accuracy > bench.reference_accuracy]
        choices += [
            TradeSetting("accuracy", f"accuracy {a:g}", bench.sweep_with(accuracy=a), errors_with_bounds)
            for a in looser
        ]
    direct = bench.sweep_with(method="direct")
    if "method" in job.choices:
        choices.append(TradeSetting("method", "direct, MUMPS", direct, errors_with_bounds))
        for path in job.options_files or OPTIONS_FILES:
            petsc = ("-options_file", path)
            choices.append(
                TradeSetting("method", f"direct, {Path(path).name}", direct, errors_with_bounds, petsc)
            )
    if "physics" in job.choices:
        for name, other in simpler(job.physics):
            sweep = bench.sweep_with(law=other.law, prestress=other.prestress, accuracy=PHYSICS_ACCURACY)
            choices.append(
                TradeSetting("physics", name, sweep, lambda exact, measured: exact.deviation(measured.G))
            )
    if "frequencies" in job.choices and ":" in job.frequencies and not job.frequencies.startswith("lin:"):
        low, high = direct.omega[[0, -1]]
        counts = {max(2, 1 + round(np.log10(high / low) * n)) for n in FREQUENCY_DENSITIES}
        for count in [*sorted(n for n in counts if n < len(direct.omega)), len(direct.omega)]:
            sweep = replace(direct, omega=np.geomspace(low, high, count))
            choices.append(
                TradeSetting("frequencies", f"{count} frequencies", sweep, errors_at_few_frequencies)
            )
    elif "frequencies" in job.choices:
        left_out.append("number of frequencies: left out, it needs a logarithmic grid of omega")
    if bench.reference.window is None:
        left_out.append("critical window, 10 p/k < omega tau1 < 0.1: too few frequencies in it, no slopes")
    return choices, left_out


def simpler(physics: Physics) -> list[tuple[str, Physics]]:
    """Other physics for the same packing: rotations and pre-stress switched, the other damping laws.

    Stokes drag is without BT's η_F, which adds iωη_F to G* and changes nothing else. It has the exponents of contact
    damping at β = 1 (BT) except for a logarithm (docs/theory/linear_response.md), which slopes over a window do not
    resolve.
    """
    law = physics.law
    alternatives = []
    if "rotations" in dict(law.options) and (law.sliding or law.transverse):
        name = "without rotations" if law.couples_rotations else "with rotations"
        alternatives.append((name, replace(physics, law=law.altered(rotations=not law.couples_rotations))))
    name = "without pre-stress" if physics.prestress else "with pre-stress"
    alternatives.append((name, replace(physics, prestress=not physics.prestress)))
    for name, family in FAMILIES.items():
        if name != law.family and family.simplest is not None:
            other = damping_law(name, tau1=law.tau1, **family.simplest)
            alternatives.append((str(other), replace(physics, law=other)))
    return alternatives


def errors_with_bounds(reference, result) -> dict:
    """Errors of a run with bounds as fields of a TradeRow, and a note if they exceed a bound."""
    beyond = reference.violation(result)
    note = "" if beyond is None else f"EXCEEDS ITS BOUND at omega = {beyond:g}"
    return reference.deviation(result.G) | {"note": note}


def errors_at_few_frequencies(reference, result) -> dict:
    """Errors of a run at few frequencies, interpolated between them, as fields of a TradeRow."""
    fields = reference.deviation(log_interpolate(reference.omega, result.omega, result.G))
    between = reference.interpolation_errors(result.omega, result.G)
    return fields | between | {"note": "direct, log-log interpolation between them"}


def _spent(outcome, result) -> dict:
    return {
        "seconds": float(result.attributes["wall_seconds"]),
        "process_seconds": outcome.seconds,
        "memory_mb": outcome.memory,
        "factorisations": int(result.attributes["factorisations"]),
        "certified": certified(result),
    }


def plan_ensembles(bench: TradeRuns) -> tuple[list[list[Pack]], list[str]]:
    """(jobs that make the packings of each ensemble, lines on what is left out and why), once there is a reference."""
    disks, attributes = read_packing(bench.job.packing), bench.reference.result.attributes
    record, packs, left_out = disks.record, [], []
    if not is_law(record.get("sizes")):  # imported, or from a file of radii
        reason = f"the radii of {bench.job.packing} cannot be drawn by `jampetsc pack`"
        return [], [f"ensemble: left out, {reason}"]
    for share in PACKING_COUNTS:
        if disks.n // share < MIN_DISKS:
            left_out.append(f"{share} packings: left out, fewer than {MIN_DISKS} particles each")
            continue
        try:
            first = Pack(
                n=disks.n // share,
                pressure=record.get("requested_pressure", attributes["pressure"] / attributes["k"]),
                seed=FIRST_SEED,
                **{name: value for name, value in disks.potential.record.items() if name != "k"},
                sizes=record["sizes"],
                stabilise=record.get("stabilise", "volume"),
            )
        except InputError as error:  # such as a pressure that `pack` has not
            return [], [f"ensemble: left out, {error}"]
        packs.append([replace(first, seed=FIRST_SEED + number) for number in range(share)])
    return packs, left_out


def measure_ensemble(bench: TradeRuns, packs: list[Pack]) -> TradeRow:
    """The row of the packings that these jobs make, each at the pressure of the reference."""
    share, n = len(packs), packs[0].n
    name = f"{share} x N = {n}"
    packings = {pack.seed: bench.run(pack, name=f"packing-{n}-{pack.seed}") for pack in packs}
    paths = [
        bench.folder / f"packing-{n}-{seed}.h5" for seed, (_, disks) in packings.items() if disks is not None
    ]
    runs = [bench.run(bench.sweep_with(packing=path, accuracy=PHYSICS_ACCURACY)) for path in paths]
    packing_seconds = sum(outcome.seconds for outcome, _ in packings.values())
    results = [result for _, result in runs if result is not None]
    outcomes = [outcome for outcome, _ in [*packings.values(), *runs]]
    if not results:
        return bench.failed("ensemble", name, outcomes[-1])
    notes = [f"packing took {packing_seconds:.1f} s"]
    if len(results) < share:
        why = next(outcome.error for outcome in outcomes if outcome.error)
        notes.append(f"only {len(results)} of {share}: {why}")
    if negative := sum(bool((result.G.real <= 0).any()) for result in results):
        notes.append(f"G' < 0 in {negative} of them")
    row = TradeRow(
        "ensemble",
        name,
        seconds=packing_seconds + sum(float(result.attributes["wall_seconds"]) for result in results),
        process_seconds=sum(outcome.seconds for outcome in outcomes),
        memory_mb=max(outcome.memory for outcome in outcomes),
        factorisations=sum(int(result.attributes["factorisations"]) for result in results),
        **ensemble_errors(bench.reference, np.array([result.G for result in results])),
        note="; ".join(notes),
    )
    bench.progress.step(f"ensemble {name}: {row.seconds:.2f} s  deviation of the mean {row.error:.1e}")
    return row


def ensemble_errors(reference, curves) -> dict:
    """Deviation of the mean of curves (n, M) from the reference, and its standard error, as fields of a TradeRow."""
    statistics = reference.deviation(curves.mean(axis=0))
    if len(curves) < 2:
        return statistics
    # at ω → 0 the mean of G' can vanish: small packings with pre-stress need not be stable to shear
    seen = curves if reference.inside is None else curves[:, reference.inside]
    slopes = [slope for G in curves if (slope := reference.exponents(G))]
    for name, part in moduli(seen).items():
        middle, error = mean_with_error(part)
        statistics[f"stderr_{name}"] = float(np.max(error / np.abs(middle)))
        if len(slopes) > 1:
            scatter = mean_with_error([slope[f"exponent_{name}"] for slope in slopes])[1]
            statistics[f"exponent_{name}_error"] = float(scatter)
    return statistics


def measure_trade(job, out) -> str:
    """Run all choices of a `studies.trade_job.Trade`, write `out` (.csv) and a picture (.png); returns the text.

    Choices that fail have a row that says why. Raises JampetscError without a reference.
    """
    picture = Path(out).with_suffix(".png")
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="jampetsc-trade-") as folder, Progress(None, "trade") as progress:
        bench = TradeRuns(job, folder, progress)
        rows = bench.find_reference()
        todo, remarks = plan_settings(bench)
        packs, more = plan_ensembles(bench) if job.ensemble else ([], [])
        count = sum(map(len, packs))
        progress.note(f"{len(todo)} runs{f' and {count} packings with one each' if packs else ''} to do")
        rows += [bench.measure(choice) for choice in todo]
        rows += [measure_ensemble(bench, ensemble) for ensemble in packs]
    facts = [*_facts(job, out, bench.reference, load), *remarks, *more]
    write_table(out, rows, facts)
    from jampetsc.plots.trade_plots import plot_trade  # only now: matplotlib's memory is the runs' until then

    plot_trade(rows, bench.reference.certified, picture)
    lines = [format_table(rows), "", *facts, "", *advise(rows), "", f"{out}, {picture}"]
    return "\n".join(lines)


def _facts(job, out, reference, load):
    disks, (name, digest) = read_identified(job.packing)
    attributes = reference.result.attributes
    launch = f"mpirun -n {job.ranks}" if job.ranks else "one process each"
    versions = f"jampetsc {VERSION}, commit {git_commit() or 'unknown'}, PETSc {attributes['petsc_version']}"
    date = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    facts = [
        f"command: {shlex.join(job.line(out))}",
        f"packing: {name}, N = {disks.n}, p = {attributes['pressure']:.6g}, sha256 {digest}",
        f"law: {job.physics}, tau1 = {job.physics.law.tau1:g}; frequencies {job.frequencies}",
        f"runs: {launch}; {platform.machine()}, {os.cpu_count()} cores, load average {load:.1f} at the start",
        f"program: {versions}; {date}",
        f"reference: certified to {reference.certified:.1e}; errors below that are not resolved",
    ]
    if reference.window is not None:
        facts.append(f"critical window: omega = {reference.window[0]:.3g} to {reference.window[1]:.3g}")
    return facts
