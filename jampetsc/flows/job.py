"""A flow job: what is to be sheared and how far, made anew or read from a flow file, and the file it ends in."""

import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from jampetsc import session
from jampetsc.contacts.disks import PLACES, Disks
from jampetsc.contacts.laws import Law
from jampetsc.contacts.potentials import Potential
from jampetsc.contacts.state import find_contacts
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.flows.means import Means, worth
from jampetsc.flows.models import Model, Scheme, scheme_for
from jampetsc.flows.record import (
    FORMAT,
    Record,
    check_space,
    read_record,
    remove_checkpoint,
    write_checkpoint,
    write_record,
)
from jampetsc.flows.run import Plan, check_balance
from jampetsc.flows.run import run as shear_until
from jampetsc.flows.shearing import Shear
from jampetsc.flows.walls import phi_between
from jampetsc.storage.hdf5 import attributes, check_format, open_file, reading
from jampetsc.storage.packing_file import write_packing
from jampetsc.storage.provenance import provenance

DEEPEST = 0.5  # overlap of two disks, in units of σ, beyond which a start is none of soft disks
UNTOUCHED = 1e-6  # p/(γ̇ kτ₁) of disks that do not touch; what a start left of overlaps fades only slowly
KEPT = ("units", "seed", "sizes", "packing", "packing_sha256", "walls")  # attributes that a file hands on


@dataclass(frozen=True, eq=False)
class Job:
    """One run; `settings` identify it."""

    out: Path
    disks: Disks  # at the start
    model: Model
    rate: float
    scheme: Scheme
    plan: Plan
    origin: dict  # attributes: where the disks come from, and how many, the first ones, are those of `walls`
    before: tuple | None = None  # (Record, state) of the file it goes on from

    @property
    def held(self) -> int:
        """How many disks are those of walls."""
        return int(self.origin.get("walls", 0))

    @property
    def phi(self) -> float:
        """Packing fraction of the disks that move."""
        return phi_between(self.disks, self.held)

    @property
    def settings(self) -> dict:
        """What decides the result, as plain values."""
        return {
            "model": asdict(self.model) | {"law": _weights(self.model.law)},
            "rate": self.rate,
            "scheme": asdict(self.scheme),
            "plan": asdict(self.plan),
            "start": self.disks.fingerprint,
            "walls": self.held,
            "done": len(self.before[0]) if self.before else 0,
        }


def _weights(law):
    names = ("label", "normal", "transverse", "sliding", "drag", "eta_f", "tau1")
    return {name: getattr(law, name) for name in names}


def fresh(
    disks, origin, model, rate, strain, out, *, discard=None, snapshots=0, step=None, tolerance=1e-4
) -> Job:
    """A job from its beginning. Raises InputError for disks that lie inside one another, and as `Plan.of`."""
    contacts = find_contacts(disks)
    deepest = float(np.max(contacts.overlap / contacts.sigma, initial=0.0))
    if deepest > DEEPEST:
        raise InputError(
            f"overlap of {100 * deepest:.0f} % of the distance of two disks at contact: no state of soft disks; "
            "quench it first with `jampetsc pack --from`"
        )
    scheme = scheme_for(model, disks, rate, step, tolerance)
    discard = min(1.0, 0.5 * strain) if discard is None else discard
    plan = Plan.of(rate, scheme.step, strain, discard, snapshots)
    check_space(out, disks.n, snapshots)
    return Job(Path(out), disks, model, rate, scheme, plan, origin)


def continued(path, strain, out=None) -> Job:
    """The job of a flow file, `strain` farther. Raises InputError for a file that is none."""
    out = Path(path if out is None else out)
    record, state, settings, attrs = read_record(path)
    settings["model"]["law"] = Law(**settings["model"]["law"])
    model, scheme = Model(**settings["model"]), Scheme(**settings["scheme"])
    old = Plan(**settings["plan"])
    potential = Potential(*(attrs[name] for name in ("potential", "stiffness", "k")))
    arrays = {name: np.asarray(state[name], float) for name in (*PLACES, "radii")}
    disks = Disks(**arrays, potential=potential)
    more = Plan.of(settings["rate"], scheme.step, strain, 0.0, 0, old.steps)
    plan = Plan(old.steps, old.rows + more.rows, old.discard, old.snapshots)
    check_space(out, disks.n, 2 * old.snapshots)
    origin = {name: attrs[name] for name in KEPT if name in attrs}
    return Job(out, disks, model, settings["rate"], scheme, plan, origin, (record, state))


def is_flow(path) -> bool:
    """Whether the file at `path` is a flow file. Raises InputError if it is no jampetsc file."""
    with open_file(path) as h5, reading(path):
        return check_format(path, attributes(h5)) == FORMAT


def execute(job: Job, last=None, team=None) -> Means:
    """Run the job and write its file, and the last state as a packing where `last` names one.

    team: the `contacts.threads.Team` that does the steps.
    Raises ConvergenceError as `flows.run.run`, and where disks never touch.
    """
    began = time.perf_counter()
    shear = Shear(job.disks, job.model, job.rate, job.scheme, team, job.held)
    record = Record()
    if job.before is not None:
        record, state = job.before
        shear.restore(state)
    settings = job.settings  # of where it begins: `before` grows
    record = shear_until(shear, job.plan, job.out, settings, record)
    means = check_balance(record, job.plan.discard, shear)
    if means is None or means.pressure.mean < UNTOUCHED * job.rate * shear.unit:
        raise ConvergenceError(
            f"phi = {job.phi:.4g}: no two disks touched within the strain of {shear.strain:.3g}: "
            "choose a larger --phi, or a longer --strain"
        )
    facts = _facts(job, means, time.perf_counter() - began)
    facts |= {"substeps": shear.substeps}
    # in case one of the files cannot be written
    write_checkpoint(job.out, record, shear.state(), settings)
    _write(job, record, shear, facts, last)
    return means


def _write(job, record, shear, facts, last):
    state = shear.state() | {"radii": job.disks.radii}
    if last is not None:
        write_packing(last, shear.disks.with_record(protocol=f"steady shear, {job.model}, rate {job.rate:g}"))
    write_record(
        job.out, record, state, job.settings, facts, held=job.held
    )  # a file that goes on in place is replaced last
    remove_checkpoint(job.out)


def _facts(job, means, seconds):
    """Attributes of the file."""
    disks, model, potential = job.disks, job.model, job.disks.potential
    unit = potential.k * model.law.tau1
    law = model.law.parameters if model.law.family else {"tau1": model.law.tau1}
    common = provenance(
        versions=session.versions(),
        scalar_type=None,
        petsc_options=None,
        ranks=1,
        packing=(None, None),
        law=law,
        wall_seconds=seconds,
    )
    return {
        **common,
        **job.origin,
        "model": str(model),
        "rate": job.rate,
        "phi": job.phi,
        "mass": model.mass,
        "quality": float(np.sqrt(model.mass * potential.k)) / unit if model.mass else None,
        "friction": model.friction,
        "particle_count": disks.n - job.held,
        "potential": potential.kind,
        "stiffness": potential.stiffness,
        "k": float(potential.k),
        "step": job.scheme.step,
        "method": job.scheme.method,
        "tolerance": job.scheme.tolerance,
        "discard": job.plan.discard,
        **means.facts(),
    }


def summary(job: Job, means: Means) -> str:
    """What a user wants to read."""

    walls = f" between walls of {job.held} disks" if job.held else ""
    lines = [
        f"{job.out}: {job.model}{walls}, phi = {job.phi:.6g}, rate {job.rate:g}, {job.scheme.method} with steps of "
        f"{job.scheme.step:.3g}; means over strain {means.strain:.4g}",
        f"  sigma = {means.shear_stress} (elastic {means.parts[0]:.4g}, viscous {means.parts[1]:.4g}, kinetic "
        f"{means.parts[2]:.4g}), p = {means.pressure}, sigma/p = "
        f"{means.shear_stress.mean / means.pressure.mean:.4g}",
        f"  Z = {means.coordination}, energy balance {means.energy_balance:.4f}, correlation strain "
        f"{means.correlation_strain:.2g}, {worth(means.shear_stress, means.pressure)}",
    ]
    if means.walls:
        stress, pressure = means.walls.values()
        lines.append(f"  on the walls: sigma = {stress}, p = {pressure}")
    return "\n".join(lines + [f"  note: {line}" for line in means.warnings()])
