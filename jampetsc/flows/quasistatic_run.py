"""A run of quasistatic shear from its start, or from a checkpoint, to its result."""

import time
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.averages import Average
from jampetsc.core.disks import PLACES, Disks
from jampetsc.flows.facts import facts_of_disks, run_provenance
from jampetsc.flows.means import discarded_strain, facts_of, independent_samples, short_run_warnings
from jampetsc.flows.quasistatic_shear import ENERGY_CUT, SHARE, SlowShear
from jampetsc.flows.record import Record, remove_checkpoint, resumed, write_checkpoint, write_record
from jampetsc.flows.run import INTERVAL, LINES
from jampetsc.io.packing_file import write_packing
from jampetsc.petsc import session
from jampetsc.progress import Progress

FORMAT = "jampetsc-shear"
# of a step: strain, then the fields of `quasistatic_shear.Minimum` and `Step`
COLUMNS = {
    "strain": 0, "energy": 0, "shear_stress": 0, "pressure": 0, "jammed": 0, "coordination": 0, "nonaffine": 0,
    "dissipated": 0, "plastic": 0, "evaluations": 0,
}  # fmt: skip
AVERAGED = ("shear_stress", "pressure", "energy", "coordination", "jammed", "plastic", "dissipated")


@dataclass(frozen=True, eq=False)
class SlowRun:
    """One run: disks at the start, attributes of their origin, strain of a step and in all."""

    disks: Disks
    origin: dict
    step: float
    strain: float
    tolerance: float  # max|F|/(p d) of a minimum
    given_discard: float | None = None  # strain before the means

    @property
    def steps(self) -> int:
        """Number of steps."""
        return max(1, int(np.ceil(self.strain / self.step - 1e-9)))

    @property
    def discard(self) -> float:
        """Strain before the means."""
        return discarded_strain(self.strain, self.given_discard)

    @property
    def settings(self) -> dict:
        """Everything that determines the result, as plain values."""
        names = ("step", "steps", "tolerance", "discard")
        return {"start": self.disks.fingerprint} | {name: getattr(self, name) for name in names}


def execute(run: SlowRun, solver, to, last=None, team=None) -> str:
    """Shear, and return a summary. The result goes into the outlet `to`, the last minimum to the file `last`.

    solver: `petsc.local.NewtonSolver` for the quenches; team: the `core.threads.Team` that runs them.

    Raises ConvergenceError where no minimum is found.
    """
    began = time.perf_counter()
    slow, record = SlowShear(run.disks, run.step, solver, run.tolerance, team), Record(COLUMNS)
    kept = resumed(to.kept, run.settings, COLUMNS)
    if kept is not None:
        record, state = kept
        slow.restore(state)
    saved = time.monotonic()
    lines_done = len(record) * LINES // run.steps
    with Progress(LINES, "shear", done=lines_done) as progress:
        if kept is not None:
            progress.note(f"{to}: goes on from strain {slow.strain:.6g}")
        while len(record) < run.steps:
            step = slow.advance()
            record.add(strain=slow.strain, **vars(slow.found), **vars(step))
            if time.monotonic() - saved > INTERVAL or len(record) == run.steps:
                write_checkpoint(to.kept, record, slow.state(), run.settings)
                saved = time.monotonic()
            if len(record) * LINES // run.steps > lines_done:
                lines_done += 1
                progress.step(f"strain {slow.strain:.4g}, p {slow.found.pressure:.4g}")
    after = record.series("strain") > run.discard * (1 + 1e-12)
    averages = {name: Average.of(record.series(name)[after]) for name in AVERAGED}  # jammed or not
    facts = _facts(run, averages, slow, time.perf_counter() - began)
    minimum = {name: getattr(slow.disks, name) for name in (*PLACES, "radii")}
    if last is not None:
        protocol = f"quasistatic shear, steps of {run.step:g}"
        write_packing(last, slow.disks.with_record(protocol=protocol), to.request)
    write_record(to.writer(FORMAT), record, minimum, run.settings, facts)
    remove_checkpoint(to.kept)
    return _summary(run, to, averages, record)


def _facts(run, averages, slow, seconds):
    return {
        **run_provenance(seconds, session.current()),
        **run.origin,
        "step": run.step,
        "phi": run.disks.phi,
        "particle_count": run.disks.n,
        **facts_of_disks(run.disks),
        "tolerance": run.tolerance,
        "discard": run.discard,
        "energy_cut": ENERGY_CUT,
        "plastic_share": SHARE,
        "newton_steps": slow.effort.newton_steps,
        **facts_of(**averages),
    }


def _summary(run, to, averages, record):
    stress, pressure = averages["shear_stress"], averages["pressure"]
    notes = short_run_warnings(run.strain - run.discard, run.step, stress, pressure)
    cost, events = record.series("evaluations").mean(), int(record.series("plastic").sum())
    return (
        f"{to}: phi = {run.disks.phi:.6g}, {len(record)} steps of {run.step:g}, {cost:.0f} force evaluations each, "
        f"{events} plastic event{'s' * (events != 1)}\n"
        f"  sigma = {stress}, p = {pressure}, jammed {averages['jammed']}, "
        f"Z = {averages['coordination']}; {independent_samples(stress, pressure)}"
        + "".join(f"\n  note: {line}" for line in notes)
    )
