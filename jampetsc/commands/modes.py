"""Vibrational modes of a packing."""

from dataclasses import dataclass
from typing import ClassVar

from jampetsc.errors import InputError, named
from jampetsc.options.job import Job
from jampetsc.options.law_options import PRESTRESS
from jampetsc.options.parameters import FILE, optional_parameter, parameter
from jampetsc.options.task_inputs import ONE_PACKING, TaskInputs
from jampetsc.options.values import PACKING
from jampetsc.packing.packing import Packing

COUNT = 50


@dataclass(frozen=True, eq=False)
class Modes(Job):
    """Lowest vibrational modes of a packing, how floppy they are, and their share of the response to shear.

    Eigenvectors of the Hessian K without its translations. Disks have mass one: frequencies are the square roots of
    the eigenvalues. Each mode has its floppiness, participation ratio and share of the response to shear. That none
    was missed is proved by the inertia of K.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING)
    EPILOG: ClassVar = """examples:
  jampetsc modes p.h5 --count 20 --out modes.h5
  jampetsc modes p.h5 --below 0.01 --out below.h5 -options_file jampetsc:modes_many       # hundreds of modes

PETSc options: -modes_… for SLEPc's eigensolver, -inertia_… for the proof that no mode was missed. All modes, or most
of them, are found by LAPACK, which takes no options."""

    SOLVERS: ClassVar = ("modes_", "shift_", "inertia_")

    packing: Packing = parameter(help="packing", value_type=PACKING, place=FILE)
    count: int | None = optional_parameter(
        f"number of modes (default {COUNT}); more where the last eigenvalues are equal", low=1, metavar="M"
    )
    below: float | None = optional_parameter(
        "all modes with eigenvalues below this", above=0.0, unit="k", metavar="LAMBDA"
    )
    all: bool = parameter(
        False, "all modes, by LAPACK on one rank: up to 4096 disks, 8 (2N)² bytes in the file"
    )
    prestress: bool = PRESTRESS

    def check(self):
        """Refuse two ways to choose modes, and a limit too low to tell modes from translations."""
        given = [name for name in ("count", "below", "all") if getattr(self, name) not in (None, False)]
        if len(given) > 1:
            raise InputError(f"{named(given[0])} and {named(given[1])}: give one of them")
        if self.below is not None:
            from jampetsc.petsc.inertia import SHIFT

            if not SHIFT < self.below < float("inf"):
                raise InputError(
                    f"{named('below')} {self.below:g}: must be above {SHIFT:g} and finite; softer modes cannot be "
                    "told from translations"
                )

    def work(self, to):
        from jampetsc.response import vibrations as modes

        count = COUNT if self.count is None and self.below is None and not self.all else self.count
        return _summary(to, modes.run(self.packing, to, self.prestress, count, self.below))


def _summary(to, modes) -> str:
    """The summary."""
    m = len(modes.eigenvalues)
    proof = (
        "all there are"
        if modes.complete
        else f"inertia counts {modes.inertia_count} below {modes.inertia_shift:.4g}"
    )
    lines = [
        f"{to}: {m} modes, {'pre-stress' if modes.network.prestress else 'no pre-stress'}; {proof}",
        f"  eigenvalues {modes.eigenvalues[0]:.6g} to {modes.eigenvalues[-1]:.6g}, residuals ≤ "
        f"{modes.residuals.max():.1e}",
        f"  floppiness (rms Δu⊥ / Δu∥) {modes.floppiness[0]:.3g} to {modes.floppiness[-1]:.3g}",
    ]
    if modes.contributions is None:
        lines.append(
            "  the response to shear is affine, or not unique because of zero modes: no shares of it"
        )
    else:
        names = {"nonaffine": "|u_na|²", "transverse": "Δu⊥²", "normal": "Δu∥²", "modulus": "G_affine − G0"}
        parts = [
            f"{100 * modes.contributions.share[key].sum():.3g} % of {name}" for key, name in names.items()
        ]
        lines.append(f"  together {', '.join(parts)}")
    return "\n".join(lines)
