"""The choices a user has for one packing, and the runs that measure them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from jampetsc.core.laws import FAMILIES, Physics, damping_law
from jampetsc.errors import ConvergenceError, InputError, JampetscError
from jampetsc.io.reader import load
from jampetsc.jobs.sweep import Sweep
from jampetsc.shipped_files import located
from jampetsc.speed_accuracy import processes
from jampetsc.speed_accuracy.compare import Reference, certified, log_interpolate
from jampetsc.speed_accuracy.table import Row

GROUPS = ("accuracy", "method", "physics", "frequencies")
ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
TIGHTEST = (1e-12, 1e-11, *reversed(ACCURACIES))  # what the reference tries, until one can be certified
PHYSICS_ACCURACY = 1e-3  # well below what simpler physics changes, and certified at all frequencies
PER_DECADE = (0.5, 1, 2, 4)  # frequencies, solved one by one
OPTIONS_FILES = tuple(
    Path(located(f"jampetsc:{name}")) for name in ("iterative", "superlu_dist", "low_memory")
)


def words_of(physics, **options) -> list[str]:
    """The options of a command line for a sweep under this physics."""
    return Sweep("packing", physics.law, prestress=physics.prestress, **options).words()


@dataclass(frozen=True)
class Choice:
    """One run of `jampetsc sweep`, and how to make a row of its result."""

    group: str
    name: str
    words: list  # options of the sweep, the law's included
    judge: Callable  # (reference, result) -> the fields of a Row
    omega: str | None = None  # None: the frequencies of the reference


class Bench:
    """Runs sweeps of one packing under one physics, in a folder of its own, and tells a Progress about them."""

    def __init__(self, packing, physics: Physics, omega: str, ranks: int | None, folder, progress):
        self.packing, self.physics, self.omega, self.ranks = Path(packing), physics, omega, ranks
        self.folder, self.progress = Path(folder), progress
        self.reference = None
        self.reference_accuracy = None
        self._runs = {}  # (packing, words) -> what came out: two choices may need the same run

    def sweep(self, packing, words, omega=None):
        """(Outcome, result or None) of one sweep. A run that cannot be read counts as failed."""
        words = ["--omega", omega or self.omega, *map(str, words)]
        key = (packing, *words)
        if key not in self._runs:
            out = self.folder / f"run{len(self._runs)}.h5"
            outcome, result = processes.run(["sweep", packing, "--out", out, *words], self.ranks), None
            try:
                result = None if outcome.status else load(out)
            except JampetscError as error:
                outcome = replace(outcome, status=1, error=str(error))
            self._runs[key] = outcome, result
        return self._runs[key]

    def find_reference(self) -> list[Row]:
        """Find the tightest rational sweep that is certified; its row first, then the failed `ACCURACIES`.

        Raises JampetscError with the run's own line where there is none.
        """
        rows = []
        for accuracy in TIGHTEST:
            words = words_of(self.physics, accuracy=accuracy)
            outcome, result = self.sweep(self.packing, words)
            name = f"accuracy {accuracy:g}"
            if result is None:
                if outcome.status == InputError.exit_code:
                    raise InputError(outcome.error)
                if outcome.status != ConvergenceError.exit_code:
                    raise JampetscError(f"no reference: {outcome.error}")
                failed = self.failed("accuracy", name, outcome)
                rows += [failed] if accuracy in ACCURACIES else []
                continue
            self.reference, self.reference_accuracy = Reference(result), accuracy
            spent = {**_spent(outcome, result), **_slopes(self.reference, result.G)}
            row = Row("reference", name, **spent, note="the others are compared with it")
            self._tell(row)
            return [row, *rows]
        raise ConvergenceError(f"no reference, the rational sweep failed at every accuracy: {outcome.error}")

    def measure(self, choice: Choice) -> Row:
        """The row of a choice; a failed run gives a row that says why."""
        outcome, result = self.sweep(self.packing, choice.words, choice.omega)
        if result is None:
            return self.failed(choice.group, choice.name, outcome)
        row = Row(
            choice.group, choice.name, **_spent(outcome, result), **choice.judge(self.reference, result)
        )
        self._tell(row)
        return row

    def failed(self, group, name, outcome) -> Row:
        """The row of a run that failed."""
        row = Row(group, name, process_seconds=outcome.seconds, note=f"failed: {outcome.error}", failed=True)
        self._tell(row)
        return row

    def _tell(self, row):
        if row.failed:
            what = row.note
        elif row.group == "reference":
            what = f"{row.seconds:.2f} s  certified to {row.certified:.1e}"
        else:
            what = f"{row.seconds:.2f} s  error {row.error:.1e}"
        self.progress.step(f"{row.group} {row.choice}: {what}")


def plan(bench: Bench, groups, options_files) -> tuple[list[Choice], list[str]]:
    """(choices, lines on what is left out and why) for the groups asked for."""
    physics, choices, left_out = bench.physics, [], []
    if "accuracy" in groups:
        choices += [_accuracy(physics, a) for a in ACCURACIES if a > bench.reference_accuracy]
    if "method" in groups:
        missing = [path for path in options_files if not Path(path).is_file()]
        left_out += [f"{path} is not there: left out; options_files names others" for path in missing]
        choices.append(_method(physics, "direct, MUMPS", []))
        choices += [
            _method(physics, f"direct, {Path(path).name}", ["-options_file", path])
            for path in options_files
            if path not in missing
        ]
    if "physics" in groups:
        choices += [_physics(name, other) for name, other in simpler(physics)]
    if "frequencies" in groups:
        low, colon, _ = bench.omega.partition(":")
        if colon:
            high = bench.omega.split(":")[1]
            decades = np.log10(float(high) / float(low))
            counts = sorted({max(2, 1 + round(decades * n)) for n in PER_DECADE})
            grids = {f"{low}:{high}:{count}": count for count in counts if count < len(bench.reference.omega)}
            grids[bench.omega] = len(bench.reference.omega)
            choices += [_frequencies(physics, grid, count) for grid, count in grids.items()]
        else:
            left_out.append("number of frequencies: left out, it needs a logarithmic grid of omega")
    if bench.reference.window is None:
        left_out.append("critical window, 10 p/k < omega tau1 < 0.1: too few frequencies in it, no slopes")
    return choices, left_out


def simpler(physics: Physics) -> list[tuple[str, Physics]]:
    """Other physics for the same packing: rotations and pre-stress the other way, the other damping laws.

    Stokes drag is without BT's η_F, which adds iωη_F to G* and changes nothing else. Its exponents are those of contact
    damping at β = 1 (BT) but for a logarithm (docs/physics.md), which slopes over a window do not tell from another.
    """
    law, prestress = physics.law, physics.prestress
    others = []
    if "rotations" in dict(law.options) and (law.sliding or law.transverse):
        name = "without rotations" if law.couples_rotations else "with rotations"
        others.append((name, Physics(law.altered(rotations=not law.couples_rotations), prestress)))
    name = "without pre-stress" if prestress else "with pre-stress"
    others.append((name, Physics(law, not prestress)))
    for name, family in FAMILIES.items():
        if name != law.family:
            other = damping_law(name, tau1=law.tau1, **family.simplest)
            others.append((str(other), Physics(other, prestress)))
    return others


def deviation(reference, G) -> dict:
    """Errors and slopes of a curve G (M,) at the reference's frequencies, as fields of a Row."""
    storage, loss = reference.errors(G)
    inside = reference.window_errors(G)
    fields = {"error_storage": storage, "error_loss": loss}
    fields |= {"window_storage": inside[0], "window_loss": inside[1]}
    return fields | _slopes(reference, G)


def _accuracy(physics, accuracy):
    name = f"accuracy {accuracy:g}"
    return Choice("accuracy", name, words_of(physics, accuracy=accuracy), _judge_certified)


def _method(physics, name, words):
    return Choice("method", name, [*words_of(physics, method="direct"), *words], _judge_certified)


def _physics(name, physics):
    words = words_of(physics, accuracy=PHYSICS_ACCURACY)
    return Choice("physics", name, words, lambda reference, result: deviation(reference, result.G))


def _frequencies(physics, grid, count):
    def judge(reference, result):
        storage, loss = reference.interpolation_errors(result.omega, result.G)
        seen = log_interpolate(reference.omega, result.omega, result.G)
        fields = deviation(reference, seen)
        note = "direct, log-log interpolation between them"
        return fields | {"error_storage": storage, "error_loss": loss, "note": note}

    words = words_of(physics, method="direct")
    return Choice("frequencies", f"{count} frequencies", words, judge, grid)


def _judge_certified(reference, result):
    """Errors of a run that claims to be exact to its bound, and whether it is."""
    beyond = reference.violation(result)
    note = "" if beyond is None else f"EXCEEDS ITS BOUND at omega = {beyond:g}"
    return deviation(reference, result.G) | {"note": note}


def _spent(outcome, result) -> dict:
    attributes = result.attributes
    return {
        "seconds": float(attributes["wall_seconds"]),
        "process_seconds": outcome.seconds,
        "memory_mb": outcome.memory,
        "factorisations": int(attributes["factorisations"]),
        "certified": certified(result),
    }


def _slopes(reference, G) -> dict:
    found = reference.exponents(G)
    if found is None:
        return {}
    return {
        "exponent_storage": found.storage,
        "exponent_storage_error": found.storage_error,
        "exponent_loss": found.loss,
        "exponent_loss_error": found.loss_error,
    }
