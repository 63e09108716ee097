"""One run of steady shear, new or continued: its definition, execution and result."""

import time
from dataclasses import asdict, dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.flows.means import Means, discarded_strain, independent_samples
from jampetsc.flows.record import (
    FORMAT,
    check_space,
    facts_of_disks,
    record_of,
    resumed,
    run_provenance,
    write_checkpoint,
    write_record,
)
from jampetsc.flows.run import Plan, check_balance
from jampetsc.flows.run import run as shear_until
from jampetsc.flows.shearing import SteadyShear
from jampetsc.flows.walls import phi_between
from jampetsc.io.hdf5 import attributes, check_format, open_file, reading
from jampetsc.io.results import note_lines, noted
from jampetsc.laws.damping import WEIGHTS, Law
from jampetsc.laws.flow_models import Model, Scheme, scheme_for
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.packing import Packing

DEEPEST = 0.5  # largest overlap of two disks of a start, in units of σ
UNTOUCHED = 1e-6  # p/(γ̇ kτ₁) below which disks are taken not to touch: overlaps of a start fade slowly
LAW = ("label", *WEIGHTS, "tau1")  # what a run's settings have of its damping law
KEPT = ("units", "seed", "sizes", "packing", "packing_sha256", "walls")  # attributes of a continued run


@dataclass(frozen=True, eq=False)
class FlowRun:
    """One run; `settings` identify it."""

    disks: Packing  # at the start
    model: Model
    rate: float
    scheme: Scheme
    plan: Plan
    origin: dict  # attributes: origin of the disks; `walls`: how many, the first ones, make up walls
    before: tuple | None = None  # (Record, state) of the flow that is continued

    @property
    def held(self) -> int:
        """Number of disks that make up walls."""
        return int(self.origin.get("walls", 0))

    @property
    def phi(self) -> float:
        """Packing fraction of the disks that move."""
        return phi_between(self.disks, self.held)

    @property
    def settings(self) -> dict:
        """Everything that determines the result, as plain values."""
        return {
            "model": asdict(self.model) | {"law": {name: getattr(self.model.law, name) for name in LAW}},
            "rate": self.rate,
            "scheme": asdict(self.scheme),
            "plan": asdict(self.plan),
            "start": self.disks.fingerprint,
            "walls": self.held,
            "done": len(self.before[0]) if self.before else 0,
        }


def begun(
    disks, origin, model, rate, strain, *, discard=None, step=None, tolerance=1e-4, **snapshots
) -> FlowRun:
    """A new run; `snapshots`, `every` and `spacing` as for `Plan.of`.

    Raises InputError for overlaps beyond DEEPEST, and as `Plan.of`.
    """
    contacts = find_contacts(disks)
    deepest = float(np.max(contacts.overlap / contacts.sigma, initial=0.0))
    if deepest > DEEPEST:
        raise InputError(
            f"overlap of {100 * deepest:.0f} % of the distance of two disks at contact: no state of soft disks; "
            f"quench it first: pack with {named('from_')}"
        )
    scheme = scheme_for(model, disks, rate, step, tolerance)
    plan = Plan.of(rate, scheme.step, strain, discarded_strain(strain, discard), **snapshots)
    return FlowRun(disks, model, rate, scheme, plan, origin)


def continued(earlier, strain) -> FlowRun:
    """The run that continues an earlier flow, an `io.results.Result`, by `strain`. Raises InputError."""
    disks = earlier.listed
    record, state, settings, attrs = record_of(earlier)
    with reading(earlier.path):
        settings["model"]["law"] = Law(**settings["model"]["law"])
        model, scheme = Model(**settings["model"]), Scheme(**settings["scheme"])
        strain_step = settings["rate"] * scheme.step
        old = Plan.stored(settings["plan"], strain_step)
    if old.rows != len(record):
        raise InputError(
            f"{earlier.path}: {len(record)} rows, but settings of {old.rows}. Make the file again."
        )
    more = Plan.of(settings["rate"], scheme.step, strain, 0.0, steps=old.steps)
    plan = replace(old, rows=old.rows + more.rows)
    origin = {name: attrs[name] for name in KEPT if name in attrs}
    return FlowRun(disks, model, settings["rate"], scheme, plan, origin, (record, state))


def is_flow(path) -> bool:
    """Whether the file at `path` is a flow file. Raises InputError for other files than jampetsc's."""
    with open_file(path) as h5:
        return check_format(path, attributes(h5)) == FORMAT


def execute(run: FlowRun, to, write_last=None, team=None) -> Means:
    """Do the run; its result goes into the outlet `to`, after `write_last(its last state, attributes, to)`.

    team: the `packing.threads.Team` that runs the steps.
    Raises ConvergenceError as `flows.run.run`, and where disks never touch.
    """
    began = time.perf_counter()
    check_space(to, run.disks.n, run.plan.snapshots(run.plan.first_kept(run.rate * run.scheme.step)))
    shear = SteadyShear(run.disks, run.model, run.rate, run.scheme, team, run.held)
    checkpoint = to.checkpoint(run.settings)
    kept = resumed(checkpoint)
    record, state = kept or run.before or (None, None)
    if state is not None:
        shear.restore(state)
    note = f"{to.kept}: continues from strain {shear.strain:.6g}" if kept else None
    record = shear_until(shear, run.plan, checkpoint, record, note)
    means = check_balance(record, run.plan.discard, shear)
    if means is None or means.pressure.mean < UNTOUCHED * run.rate * shear.unit:
        raise ConvergenceError(
            f"phi = {run.phi:.4g}: no two disks touched within the strain of {shear.strain:.3g}: "
            f"choose a larger {named('phi')}, or a longer {named('strain')}"
        )
    facts = _facts(run, means, time.perf_counter() - began) | {"substeps": shear.substeps}
    write_checkpoint(checkpoint, record, shear.state())  # in case one of the files cannot be written
    if write_last is not None:
        write_last(shear.disks.replace(record={}), facts, to)
    state = shear.state() | {"radii": run.disks.radii}
    # a flow file that is continued in place is replaced last
    write_record(to.writer(FORMAT), record, state, run.settings, facts)
    checkpoint.remove()
    return means


def _facts(run, means, seconds):
    """Attributes of the file."""
    disks, model, k = run.disks, run.model, run.disks.potential.k
    law = model.law.parameters if model.law.family else {"tau1": model.law.tau1}
    return {
        **run_provenance(seconds, law=law),
        **run.origin,
        "model": str(model),
        "rate": run.rate,
        "phi": run.phi,
        "mass": model.mass,
        "quality": float(np.sqrt(model.mass * k)) / (k * model.law.tau1) if model.mass else None,
        "friction": model.background_drag,
        "particle_count": disks.n - run.held,
        **facts_of_disks(disks),
        "step": run.scheme.step,
        "method": run.scheme.method,
        "tolerance": run.scheme.tolerance,
        "discard": run.plan.discard,
        **means.facts(),
        "notes": noted(means.warnings()),
    }


def summary(run: FlowRun, to, means: Means) -> str:
    """Summary of a run for its user, in lines."""
    walls = f" between walls of {run.held} disks" if run.held else ""
    lines = [
        f"{to}: {run.model}{walls}, phi = {run.phi:.6g}, rate {run.rate:g}, {run.scheme.method} with steps of "
        f"{run.scheme.step:.3g}; means over strain {means.strain:.4g}",
        f"  sigma = {means.shear_stress} (elastic {means.parts[0]:.4g}, viscous {means.parts[1]:.4g}, kinetic "
        f"{means.parts[2]:.4g}), p = {means.pressure}, sigma/p = "
        f"{means.shear_stress.mean / means.pressure.mean:.4g}",
        f"  Z = {means.coordination}, energy balance {means.energy_balance:.4f}, correlation strain "
        f"{means.correlation_strain:.2g}, {independent_samples(means.shear_stress, means.pressure)}",
    ]
    if means.walls:
        stress, pressure = means.walls.values()
        lines.append(f"  on the walls: sigma = {stress}, p = {pressure}")
    return "\n".join(lines + note_lines(means.warnings()))
