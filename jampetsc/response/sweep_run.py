"""A run of a sweep: its settings, what is known of its packing, and whether its bounds are certified."""

import time
from dataclasses import dataclass, field, replace

import numpy as np

from jampetsc.errors import InputError, about, named
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_identified, source_name
from jampetsc.laws.damping import Physics
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.network.contact_network import build_network
from jampetsc.packing.contacts import BALANCED
from jampetsc.packing.minimum_proof import proved_minimum
from jampetsc.packing.packing import Packing
from jampetsc.petsc.session import current
from jampetsc.progress import warn
from jampetsc.response.limits import MAX_OMEGA, MIN_OMEGA
from jampetsc.response.minimum_check import examine_balance, negative_modes

SAME = 1e-9  # a frequency of the grid this close to one of the fields, relatively, counts as the same


@dataclass(frozen=True, eq=False)
class Run:
    """A run of a sweep: G*(ω) of one packing under one law. Frequencies are in 1/time, in the unit of the law's τ₁.

    Under power-law damping `omega` and `field_omega` are the equivalent frequencies at which the linear law
    is solved; `asked` turns them into those of the experiment.
    """

    packing: str  # its name in messages
    disks: Packing
    identity: tuple  # name and sha256 of the packing
    physics: Physics
    omega: np.ndarray  # (M,) increasing
    field_omega: np.ndarray  # (F,) increasing, where displacement fields are wanted
    experiment: np.ndarray  # (M,) frequency of the experiment for each of omega
    method: str  # rational | direct
    accuracy: float  # asked for, relative, in G' and in G'' each
    to: Outlet
    damping: EquivalentDamping | None = None  # None: linear
    parallel: str = "auto"  # what ranks share in the rational method: shifts | matrix | auto
    negative_modes: int | None = None  # of K; None: not known
    counted_by: str = ""  # how that number was found, if this run has counted
    imbalance: float = np.nan  # max |F| / (p d)
    started: float = field(default_factory=time.perf_counter)

    @classmethod
    def of(cls, job, to, comm=None) -> "Run":
        """The run of a `commands.sweep.Sweep`; fields are stored at frequencies of the sweep, so those are added to it.

        Collective over `comm`, as `read_identified`. Raises InputError as that does, and where power-law damping
        would need frequencies beyond what can be solved.
        """
        field_omega = np.zeros(0) if job.fields is None else job.fields
        apart = ~np.isclose(job.omega[:, None], field_omega, rtol=SAME, atol=0.0).any(axis=1)
        experiment = np.union1d(job.omega[apart], field_omega)
        damping, tau1 = job.damping, job.law.tau1
        solved = experiment if damping is None else damping.frequency(experiment * tau1) / tau1
        beyond = (solved < MIN_OMEGA) | (solved > MAX_OMEGA)
        if beyond.any():
            raise InputError(
                f"{named('alpha')} {damping.alpha:g} {named('stress')} {damping.stress:g}: omega = "
                f"{experiment[beyond][0]:g} is equivalent to {solved[beyond][0]:g} under linear damping, outside "
                f"{MIN_OMEGA:g} to {MAX_OMEGA:g}: narrow {named('omega')}"
            )
        disks, identity = read_identified(job.packing, comm)
        to.made_from(disks)
        return cls(
            packing=source_name(job.packing),
            disks=disks,
            identity=identity,
            physics=Physics(job.law, job.prestress),
            omega=solved,
            field_omega=solved[np.searchsorted(experiment, field_omega)],
            experiment=experiment,
            method=job.method,
            accuracy=job.accuracy,
            to=to,
            damping=damping,
            parallel=job.parallel or "auto",
            negative_modes=0 if not job.prestress or proved_minimum(disks) else None,
        )

    def network(self, comm):
        """The contact network of the packing. Collective. Raises InputError, naming the file, where it is not rigid."""
        with about(self.packing):
            return build_network(self.disks, comm, self.physics.prestress)

    def examined(self) -> "Run":
        """The run with force balance and negative modes of its packing known; direct if there are any. Collective.

        The rational method and the error bounds of fields need K + ωB to be positive definite. If K has negative modes,
        G* is still defined, and is solved for frequency by frequency. If forces are not balanced, it is the G* of the
        contacts as they are, though the packing would not stay in that state. Modes are not counted for a run that is
        direct anyway. Warnings report unbalanced forces and negative modes.
        """
        session = current()
        run = replace(self, imbalance=examine_balance(self.packing, self.disks, session.comm))
        if run.method != "direct" and run.negative_modes is None:
            negative, how = negative_modes(run.network(session.comm))
            run = replace(run, negative_modes=negative, counted_by=how)
        if run.method != "direct" and run.negative_modes:
            if session.rank == 0:
                warn(
                    f"{run.packing}: K has {run.negative_modes} negative modes, so the packing is not a minimum of its "
                    "energy: solving every frequency by method direct"
                )
            run = replace(run, method="direct")
        return run

    def asked(self, omega):
        """Frequencies of the experiment for some of `self.omega`, in their shape."""
        return self.experiment[np.searchsorted(self.omega, omega)]

    @property
    def parameters(self) -> dict:
        """Parameters of the law as a file records them, with exponent and stress of power-law damping."""
        if self.damping is None:
            return self.physics.parameters
        return {**self.physics.parameters, "alpha": self.damping.alpha, "stress": self.damping.stress}

    @property
    def positive_semidefinite(self) -> str:
        """Whether K has no negative modes, and how that is known, as text for the file."""
        if not self.physics.prestress:
            status = "by construction (no pre-stress)"
        elif self.negative_modes is None:
            status = "not shown: that of fields is a bound only if K has no negative modes"
        elif self.negative_modes:
            status = f"no: {self.negative_modes} negative modes; error_bound is an estimate for fields, a bound for G*"
        else:
            status = f"proved {f'by {self.counted_by}' if self.counted_by else 'when the packing was made'}"
        if self.imbalance <= BALANCED:
            return status
        return f"{status}; but forces are not balanced: max|F|/(p d) = {self.imbalance:.1e}"

    @property
    def certified(self) -> bool:
        """Whether K is known to have no negative modes and forces are balanced, so that error bounds are certified."""
        return self.negative_modes == 0 and self.imbalance <= BALANCED

    def key(self, ranks: int) -> dict:
        """What identifies the job to a checkpoint; rows of fields belong to ranks, numbers do not."""
        return {
            "packing": self.identity[1],
            "law": self.parameters,
            "omega": self.omega,
            "method": self.method,
            "accuracy": self.accuracy,
            "fields": self.field_omega,
            "ranks": ranks if len(self.field_omega) or self.method == "rational" else None,
        }
