"""A run of quasistatic shear from its start, or from where it was stopped, to its file."""

import time

import numpy as np

from jampetsc import session
from jampetsc.analysis.averages import Average
from jampetsc.contacts.disks import PLACES
from jampetsc.contacts.threads import Team, cores
from jampetsc.flows.means import facts_of, short, worth
from jampetsc.flows.record import Record, remove_checkpoint, resumed, write_checkpoint, write_record
from jampetsc.flows.run import INTERVAL, LINES
from jampetsc.flows.slowly import ENERGY_CUT, SHARE, SlowShear
from jampetsc.progress import Progress
from jampetsc.storage.packing_file import write_packing
from jampetsc.storage.provenance import provenance

FORMAT = "jampetsc-shear"
# per step: strain, then what `slowly.Look` and `slowly.Step` have
COLUMNS = {
    "strain": 0, "energy": 0, "shear_stress": 0, "pressure": 0, "jammed": 0, "coordination": 0, "nonaffine": 0,
    "dissipated": 0, "plastic": 0, "evaluations": 0,
}  # fmt: skip


def run(args, disks, origin, solver) -> str:
    """Shear by the words of the command line, write the file; returns what a user wants to read."""
    began = time.perf_counter()
    steps = max(1, int(np.ceil(args.strain / args.step - 1e-9)))
    discard = min(1.0, 0.5 * args.strain) if args.discard is None else args.discard
    settings = {"start": disks.fingerprint, "step": args.step, "steps": steps, "tolerance": args.tolerance}
    settings |= {"discard": discard}
    slow = SlowShear(disks, args.step, solver, args.tolerance, Team(args.threads or cores()))
    record = Record(COLUMNS)
    kept = resumed(args.out, settings, COLUMNS)
    if kept is not None:
        record, state = kept
        slow.restore(state)
    saved = time.monotonic()
    said = len(record) * LINES // steps
    with Progress(LINES, "shear", done=said) as progress:
        if kept is not None:
            progress.note(f"{args.out}: goes on from strain {slow.strain:.6g}")
        while len(record) < steps:
            step = slow.advance()
            record.add(strain=slow.strain, **vars(slow.found), **vars(step))
            if time.monotonic() - saved > INTERVAL or len(record) == steps:
                write_checkpoint(args.out, record, slow.state(), settings)
                saved = time.monotonic()
            if len(record) * LINES // steps > said:
                said += 1
                progress.step(f"strain {slow.strain:.4g}, p {slow.found.pressure:.4g}")
    averages = _averages(record, discard)
    facts = _facts(args, disks, origin, averages, discard, slow, time.perf_counter() - began)
    minimum = {name: getattr(slow.disks, name) for name in (*PLACES, "radii")}
    if args.last is not None:
        write_packing(
            args.last, slow.disks.with_record(protocol=f"quasistatic shear, steps of {args.step:g}")
        )
    write_record(args.out, record, minimum, settings, facts, FORMAT)
    remove_checkpoint(args.out)
    return _summary(args, disks, averages, record, discard)


def _averages(record, discard):
    """Average of every quantity over strain > discard, jammed or not."""
    after = record.series("strain") > discard * (1 + 1e-12)
    names = ("shear_stress", "pressure", "energy", "coordination", "jammed", "plastic", "dissipated")
    return {name: Average.of(record.series(name)[after]) for name in names}


def _facts(args, disks, origin, averages, discard, slow, seconds):
    running, potential = session.current(), disks.potential
    return {
        **provenance(
            versions=session.versions(), scalar_type=running.scalar_type, petsc_options=running.options_told(),
            ranks=1, packing=(None, None), law={}, wall_seconds=seconds,
        ),
        **origin,
        "step": args.step,
        "phi": disks.phi,
        "particle_count": disks.n,
        "potential": potential.kind,
        "stiffness": potential.stiffness,
        "k": float(potential.k),
        "tolerance": args.tolerance,
        "discard": discard,
        "energy_cut": ENERGY_CUT,
        "plastic_share": SHARE,
        "newton_steps": slow.effort.newton_steps,
        **facts_of(**averages),
    }  # fmt: skip


def _summary(args, disks, averages, record, discard):
    stress, pressure = averages["shear_stress"], averages["pressure"]
    notes = short(args.strain - discard, args.step, stress, pressure)
    cost, events = record.series("evaluations").mean(), int(record.series("plastic").sum())
    return (
        f"{args.out}: phi = {disks.phi:.6g}, {len(record)} steps of {args.step:g}, {cost:.0f} force evaluations each, "
        f"{events} plastic event{'s' * (events != 1)}\n"
        f"  sigma = {stress}, p = {pressure}, jammed {averages['jammed']}, "
        f"Z = {averages['coordination']}; {worth(stress, pressure)}"
        + "".join(f"\n  note: {line}" for line in notes)
    )
