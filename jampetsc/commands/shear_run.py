"""The run that a `shear.Shear` asks for: quasistatic shear from its start, or from a checkpoint, to its result."""

import time

import numpy as np

from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.jammed_samples import correlated_share
from jampetsc.flows.means import discarded_strain, facts_of, independent_samples, short_run_warnings
from jampetsc.flows.quasistatic_shear import ENERGY_CUT, PLASTIC_RATIO, SlowShear
from jampetsc.flows.record import (
    Record,
    facts_of_disks,
    resumed,
    run_provenance,
    write_checkpoint,
    write_record,
)
from jampetsc.flows.run import INTERVAL, LINES
from jampetsc.io.results import note_lines, noted
from jampetsc.minimise.minimise import proved
from jampetsc.packing.packing import PLACES
from jampetsc.petsc import session
from jampetsc.progress import Progress

# of a step: strain, then the fields of `quasistatic_shear.MinimumState` and `Step`
COLUMNS = {
    "strain": 0, "energy": 0, "shear_stress": 0, "pressure": 0, "jammed": 0, "coordination": 0, "nonaffine": 0,
    "dissipated": 0, "plastic": 0, "proved": 0, "evaluations": 0,
}  # fmt: skip
AVERAGED = ("shear_stress", "pressure", "energy", "coordination", "jammed", "plastic", "dissipated")


def execute(job, solver, to) -> str:
    """Do the run of a Shear, and return a summary. The result goes into the outlet `to`.

    solver: `petsc.hessian_solver.HessianSolver` for the quenches.

    Raises ConvergenceError where no minimum is found.
    """
    disks, origin = job.disks()
    began = time.perf_counter()
    steps = max(1, int(np.ceil(job.strain / job.step - 1e-9)))
    discard = discarded_strain(job.strain, job.discard)
    settings = {  # everything that determines the result
        "start": disks.fingerprint,
        "step": job.step,
        "steps": steps,
        "tolerance": job.tolerance,
        "discard": discard,
    }
    slow, record = SlowShear(disks, job.step, solver, job.tolerance, job.team), Record(COLUMNS)
    checkpoint = to.checkpoint(settings)
    kept = resumed(checkpoint, COLUMNS)
    if kept is not None:
        record, state = kept
        slow.restore(state)
    saved = time.monotonic()
    lines_done = len(record) * LINES // steps
    with Progress(LINES, "shear", done=lines_done) as progress:
        if kept is not None:
            progress.note(f"{to}: continues from strain {slow.strain:.6g}")
        while len(record) < steps:
            step = slow.advance()
            record.add(strain=slow.strain, **vars(slow.found), **vars(step))
            if time.monotonic() - saved > INTERVAL or len(record) == steps:
                write_checkpoint(checkpoint, record, slow.state())
                saved = time.monotonic()
            if len(record) * LINES // steps > lines_done:
                lines_done += 1
                progress.step(f"strain {slow.strain:.4g}, p {slow.found.pressure:.4g}")
    after = record.series("strain") > discard * (1 + 1e-12)
    averages = {name: Average.of(record.series(name)[after]) for name in AVERAGED}  # jammed or not
    facts = {
        **run_provenance(time.perf_counter() - began, session.current()),
        **origin,
        "step": job.step,
        "phi": disks.phi,
        "particle_count": disks.n,
        **facts_of_disks(disks),
        "tolerance": job.tolerance,
        "discard": discard,
        "energy_cut": ENERGY_CUT,
        "plastic_share": PLASTIC_RATIO,
        "newton_steps": slow.effort.newton_steps,
        "saddles": slow.effort.saddles,
        **facts_of(**averages),
    }
    stress, pressure = averages["shear_stress"], averages["pressure"]
    share = correlated_share([record.series("jammed")[after]])
    notes = short_run_warnings(job.strain - discard, job.step, stress, pressure)
    facts["notes"] = noted(notes)
    minimum = {name: getattr(slow.disks, name) for name in (*PLACES, "radii")}
    if job.last is not None:
        job.write_last(proved(slow.disks.replace(record={}), solver), facts, to)
    write_record(to.writer(job.FORMAT), record, minimum, settings, facts)
    checkpoint.remove()
    cost, events = record.series("evaluations").mean(), int(record.series("plastic").sum())
    lines = (
        f"{to}: phi = {disks.phi:.6g}, {len(record)} steps of {job.step:g}, {cost:.0f} force evaluations each, "
        f"{events} plastic event{'s' * (events != 1)}\n"
        f"  sigma = {stress}, p = {pressure}, jammed {share.value:.3g} "
        f"(68 % interval {share.low:.2g} to {share.high:.2g}), "
        f"Z = {averages['coordination']}; {independent_samples(stress, pressure)}"
    )
    return "\n".join([lines, *note_lines(notes)])
