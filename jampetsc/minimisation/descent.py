"""State of a minimisation: the pair list, the moves since it was made, and the memory of L-BFGS, kept between lists."""

from dataclasses import dataclass, field

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.minimisation.hessian import Bonds
from jampetsc.minimisation.lbfgs import CONVERGED, STALE, STRETCH, LbfgsProblem, descend
from jampetsc.minimisation.lbfgs_kernels import LbfgsArrays
from jampetsc.packing.elementary import exp
from jampetsc.packing.neighbour_list import ListedPacking, NeighbourList, borders, padded
from jampetsc.packing.packing import Packing
from jampetsc.packing.strain import Strain, cell_strain
from jampetsc.packing.threads import Team
from jampetsc.packing.units import stress_unit_of

MEMORY = 5  # pairs (s, y) that are kept
STEPS = 2000  # evaluations between two adjustments of the skin
MAX_MOVE = 0.1  # no disk moves farther in one step, in units of d
FIRST_STEP = 0.1  # first step, in units of force / contact stiffness
MAX_LIST_STRETCH = 0.05  # d/σ_max: strain of the cell in one step, for which a list of the widest skin serves


@dataclass(frozen=True)
class Goal:
    """What is held fixed while the energy is minimised."""

    pressure: float | None = None  # target p; None keeps the cell as it is
    shear: bool = (
        False  # also relax the tilts of the cell: no shear stress, of σ_xy or of σ_xy, σ_xz and σ_yz
    )

    def moving(self, dimension: int) -> tuple[bool, ...]:
        """Which of the strains of `strain.cell_strain` move: ε, and the D(D − 1)/2 shears."""
        return self.pressure is not None, *[self.shear] * (dimension * (dimension - 1) // 2)


@dataclass
class Effort:
    """Cost of a minimisation so far; `report` is called with it after every slice."""

    evaluations: int = 0
    newton_steps: int = 0  # factorisations
    saddles: int = 0
    shakes: int = 0
    stage: str = ""
    residual: float = np.nan  # max |F| / (p d^(D−1))
    report: object = field(default=lambda effort: None, repr=False)


def stress_unit(disks: Packing) -> float:
    """Pressure of order one for these disks, see `stress_unit_of`."""
    return stress_unit_of(disks.radii, disks.potential, disks.dimension)


class Descent(ListedPacking):
    """Disks as they were when their pairs were listed, and their moves since.

    `evaluations` counts evaluations of forces, `effort` also the ones of earlier descents.
    """

    def __init__(self, disks: Packing, goal: Goal, team: Team | None = None, effort: Effort | None = None):
        self.goal, self.effort = goal, effort or Effort()
        self.evaluations = 0
        self.dimension, self.moving = disks.dimension, goal.moving(disks.dimension)
        rows, size, domains = 2 * MEMORY, padded(disks.n), len(borders(disks.n)) - 1
        shape, strains = (size, self.dimension), len(self.moving)
        self.space = LbfgsArrays(
            offsets=np.zeros(shape),
            box=np.zeros(strains),
            forces=np.zeros((2, *shape)),
            pairs=np.zeros(self.dimension * size * rows, np.float32),
            box_pairs=np.zeros((rows, strains)),
            products=np.zeros((2, MEMORY, MEMORY)),
            sums=np.zeros((domains, rows + 4 + strains)),
            reaches=np.zeros((domains, 3)),
        )
        self._remembered = (0, 0)  # how many pairs, and where the next one goes
        super().__init__(disks, team=team)

    def list(self, disks):
        """See `ListedPacking`; the moves are those in `space`."""
        super().list(disks)
        self.domains = NeighbourList.build(disks, self.skin, borders(disks.n), self.team)
        self.space.offsets[:] = 0.0
        self.space.box[:] = 0.0
        self.offsets = self.space.offsets[: disks.n]

    @property
    def n(self) -> int:
        """Number of disks."""
        return self.reference.n

    @property
    def potential(self):
        """That of the disks."""
        return self.reference.potential

    @property
    def box(self):
        """Strains of the cell since the list was made, see `strain.cell_strain`."""
        return self.space.box

    @property
    def cell_strain(self) -> Strain:
        """See `ListedPacking`."""
        return cell_strain(self.box.tolist())

    @property
    def volume(self) -> float:
        """V of the cell now."""
        return self.reference.volume * exp(self.dimension * self.box[0])

    def bonds(self) -> Bonds:
        """The bonds of the listed pairs in the present state."""
        return Bonds.of(self.pairs, self.potential, self.offsets, self.cell_strain)

    def move(self, moves, strain):
        """Move the disks by (N, D), then deform the cell with them by strains as of `cell_strain`."""
        growth, moved = exp(-self.box[0]), moves
        if self.dimension == 3:
            *_, along_xz, along_yz = self.box
            x, y, z = moves.T
            moved = np.stack((x - along_xz * z, y - along_yz * z, z), axis=1)
            self.offsets[:, 2] += growth * z
            self.box[2] += strain[1] * along_yz  # tilts after tilts: the matrices are multiplied
        self.offsets[:, 0] += growth * (moved[:, 0] - self.box[1] * moved[:, 1])
        self.offsets[:, 1] += growth * moved[:, 1]
        self.box[:] += strain
        if self.stale():
            self.fold()
        self._remembered = (0, 0)

    def force_at(self, pressure: float) -> float:
        """p d^(D−1), the unit of forces at a pressure p."""
        return pressure * self.diameter ** (self.dimension - 1)

    def usual_overlap(self, pressure: float | None = None) -> float:
        """Overlap of a contact of the force 2 p d^(D−1), p the given pressure, the target's, or else 1e-3 k."""
        potential, d = self.potential, self.diameter
        pressure = pressure or self.goal.pressure or potential.force_limit(1e-3) * stress_unit(self.reference)
        return potential.overlap_at(2.0 * self.force_at(pressure), d)

    def usual_stiffness(self, pressure: float | None = None) -> float:
        """Stiffness of a contact of `usual_overlap`."""
        return float(self.potential.contact_stiffness(self.usual_overlap(pressure), self.diameter))

    def stiffest(self):
        """Largest contact stiffness: of the present contacts, or of one of `usual_overlap`."""
        pairs = self.domains.trimmed()
        depth = np.full_like(pairs.sigma, self.usual_overlap())
        if self.potential.kind != "harmonic":  # whose stiffness is the same at every overlap
            depth = np.maximum(depth, Bonds.of(pairs, self.potential, self.offsets, self.cell_strain).overlap)
        return np.max(self.potential.contact_stiffness(depth, pairs.sigma), initial=1e-300)

    def descend(self, force: float, box_force: float, evaluations: int) -> bool:
        """L-BFGS until max |F| ≤ force and |∂H| of every strain ≤ box_force; False if `evaluations` did not suffice."""
        budget = self.evaluations + evaluations
        while True:
            task = self.task(force, box_force, min(STEPS, budget - self.evaluations))
            status, done, *self._remembered = self.team.run(
                descend, self.domains.number, self.domains, self.space, task, *self._remembered
            )
            self.served(done, status == STALE)
            if status == CONVERGED or self.evaluations >= budget:
                return status == CONVERGED

    def served(self, steps: int, stale: bool):
        """Count the evaluations made with a list; make a new list if it is stale or its skin is badly chosen.

        Raises ConvergenceError where coordinates are no longer numbers.
        """
        self.evaluations += steps
        self.effort.evaluations += steps
        if not (np.isfinite(self.offsets).all() and np.isfinite(self.box).all()):
            raise ConvergenceError("forces are not finite: do two particles lie on the same spot?")
        skin = self.skin
        if stale or steps >= STEPS:
            self.tune(steps)
        if stale or self.skin != skin:
            self.fold()

    def task(self, force: float, box_force: float, steps: int) -> LbfgsProblem:
        """The arguments of the next compiled steps."""
        return LbfgsProblem(
            potential=self.potential.constants,
            moving=self.moving,
            push=(self.goal.pressure or 0.0) * self.reference.volume,
            scale=float(np.sqrt(self.n)) * self.diameter,
            reach=MAX_MOVE * self.diameter,
            stretch=min(STRETCH, MAX_LIST_STRETCH * self.diameter / self.largest),
            widest=self.largest,
            skin=self.skin,
            softness=FIRST_STEP / self.stiffest(),
            force=float(force),
            box_force=float(box_force),
            steps=steps,
        )
