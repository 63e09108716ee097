"""Quasistatic shear: an affine step of the cell, the minimum of the energy there, and again (Vågberg, thesis sec. 4.7).

Between rearrangements the disks follow the cell by a displacement that is nearly the same from step to step: each
step starts from the affine positions displaced further as in the previous step, and descends by `warm_start`,
with a factor of the Hessian that serves for many steps. Only if that takes too long, `minimise` quenches.
The path of minima has its rows, averages and the packing at its end.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.strain_series import SAVE_INTERVAL, StrainSeries
from jampetsc.jamming.event_table import EventTable
from jampetsc.jamming.instability import displacement_between
from jampetsc.minimisation import warm_start
from jampetsc.minimisation.descent import Effort, Goal
from jampetsc.minimisation.minimise import NEWTON_START_FORCE, minimise, separated_pressure
from jampetsc.minimisation.newton import force_floor
from jampetsc.minimisation.protocols import MAX_SHAKES
from jampetsc.packing.contacts import find_contacts, measure, typical_force
from jampetsc.packing.neighbour_list import SKIN_RANGE, ListedPacking
from jampetsc.packing.neighbours import lengths
from jampetsc.packing.packing import PLACES, Packing
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import bond_vector, simple_shear
from jampetsc.packing.threads import Team

# of U/(N k_e), above which disks are jammed (Vågberg et al., PRE 83, 031307 (2011)); see `energy_cut`
ENERGY_CUT = 1e-16
# mean diameters: longest move in one iteration of the descent, as longer ones leave the path of a rearrangement for
# minima where fewer disks touch; and longest displacement in a step that the next one repeats, else disks rearranged
MAX_MOVE_RATIO = 0.01
COUNTS = ("evaluations", "newton_steps", "saddles", "shakes")  # of an `Effort` that a run keeps
RESTART_STEPS = 50  # steps between two calls of `_restart_list`
MAX_OLD_FACTOR_STEPS = 12  # evaluations of a step with the present factor before a new one is made,
MAX_NEW_FACTOR_STEPS = 40  # and with that one before disks are taken to rearrange
DESCENT_TOLERANCE = 3e-2  # max |F| / (p d^(D−1)) to which they then descend without a factor
MAX_STEP_EVALUATIONS = 1500  # evaluations of a step, in all, before a quench is begun
HESSIAN_SHIFT_RATIO = 1e-5  # added to the Hessian, in units of the stiffness of a contact
# mean diameters: pairs with a smaller gap, which may touch within the step, are in the Hessian
MAX_CONTACT_GAP = 3e-3
# mean diameters: the order of elimination is found as if pairs with a smaller gap touched,
MAX_ORDER_GAP = 0.1
# and found again if a factor has this many times the entries of the first one in that order
MAX_FILL_RATIO = 1.25
# share of contacts with the overlap of another one from which states are proved, until `_restart_list`
MAX_ALIKE_RATIO = 0.125
PLASTIC_RATIO = 0.25  # of G_A V Δγ²: a step that dissipates more is a plastic event
# of a step: strain, then the fields of `stepwise_shear.MinimumState` and `StrainStep`
PATH_COLUMNS = {
    "strain": 0, "energy": 0, "shear_stress": 0, "pressure": 0, "jammed": 0, "contact_number": 0, "nonaffine": 0,
    "dissipated": 0, "plastic": 0, "proved": 0, "evaluations": 0,
}  # fmt: skip
AVERAGED = ("shear_stress", "pressure", "energy", "contact_number", "jammed", "plastic", "dissipated")


@dataclass(frozen=True)
class MinimumState:
    """Energy, stress and contacts of a minimum."""

    energy: float  # U
    shear_stress: float  # σ_xy
    pressure: float
    jammed: bool
    contact_number: float  # 2N_c/N of all disks, rattlers included


@dataclass(frozen=True)
class StrainStep:
    """Displacement, dissipation and cost of a step.

    The work of the stress, by the trapezium rule, is stored or dissipated: V ½(σ + σ') Δγ = U' − U + E. On an elastic
    branch |E| is the error of the rule, at most Δγ²/8 times the change of V dσ/dγ in the step, which lies below V G_A,
    the modulus of affine motion. A plastic event is a step from a jammed state with E > ¼ G_A V Δγ²: disks rearranged.
    """

    nonaffine: float  # rms non-affine displacement, in mean diameters
    dissipated: float  # E
    plastic: bool
    proved: bool  # whether the Hessian there was factorised, without a negative eigenvalue
    evaluations: int  # of forces


def energy_cut(potential: Potential) -> float:
    """U/(N k) above which disks are jammed."""
    return potential.energy_limit(ENERGY_CUT)


def measure_minimum(disks: Packing) -> MinimumState:
    """Energy, stress and contacts of disks at a minimum."""
    contacts = find_contacts(disks)
    state = measure(disks, contacts)
    return MinimumState(
        state.energy,
        float(state.stress[0, 1]),
        state.pressure,
        bool(state.energy / disks.n > energy_cut(disks.potential) * disks.potential.k),
        2.0 * len(contacts) / disks.n,
    )


def quench(disks: Packing, solver, tolerance: float) -> tuple[Packing, MinimumState]:
    """(minimum of the energy reached from `disks`, its state); raises ConvergenceError as `minimise`."""
    minimum = minimise(disks, Goal(), solver, tolerance=tolerance).disks
    return minimum, measure_minimum(minimum)


class StepwiseShear(ListedPacking):
    """Disks sheared step by step; `disks`: the last minimum, `minimum`: its state, `effort`: cost so far.

    team: the threads of quenches; their number does not change the result.
    Where a step leads to no minimum, as a contact is too weak for a proof, disks are shaken as by `make_packing`.
    Raises ConvergenceError where no minimum is found, as `minimise`.
    """

    events: EventTable | None = None
    came_apart: float | None = None  # strain where `shear_events.EventShear` ends, as no contact is left

    def __init__(self, disks: Packing, step: float, solver, tolerance: float, team: Team | None = None):
        self.step, self.solver, self.tolerance, self.team = step, solver, tolerance, team
        self.effort = Effort()
        self.steps = 0
        self.last_displacement = np.zeros(disks.base.shape)  # non-affine displacement in the last step,
        self.displacement = np.zeros(disks.base.shape)  # and in this one
        self._separated_pressure, self._potential = separated_pressure(disks), disks.potential.constants
        self._memory = warm_start.nothing_remembered(disks.base.shape)
        super().__init__(self._quench(disks), SKIN_RANGE[1], team)

    @property
    def strain(self) -> float:
        """Total strain γ."""
        return self.steps * self.step

    @property
    def disks(self) -> Packing:
        """The packing as it is now, folded."""
        return super().disks.folded()

    @property
    def cell_strain(self):
        """See `ListedPacking`."""
        return simple_shear(self.shear)

    @property
    def _quench_tolerance(self) -> float:
        """A saddle that was just left is at rest to a larger one."""
        return min(self.tolerance, NEWTON_START_FORCE)

    def _quench(self, disks, shakes=0) -> Packing:
        effort, tolerance = Effort(), self._quench_tolerance
        minimum = minimise(
            disks, Goal(), self.solver, tolerance=tolerance, shakes=shakes, team=self.team, effort=effort
        )
        for name in COUNTS:
            setattr(self.effort, name, getattr(self.effort, name) + getattr(effort, name))
        return minimum.disks.folded()

    def list(self, disks):
        """See `ListedPacking`; `shear` is zero then."""
        super().list(disks)
        self.shear, self.volume = 0.0, disks.volume

    def _restart_list(self):
        """Fold the disks and make new list, order and factor: from here `restore` repeats a run to the last bit."""
        self.fold()
        self._anchor = self.reference, self.last_displacement.copy(), self.steps, replace(self.effort)
        self.needs_proof = self.tolerance > NEWTON_START_FORCE  # forces as large also rest on slopes
        self._find_order()
        self._measure_scales()
        self._factorise()
        self.minimum = self._minimum_state(self._forces())

    def _measure_scales(self):
        """Stiffness of a usual contact, and the largest force that rounding leaves, of the disks as they are listed."""
        potential, state = self.reference.potential, measure(self.reference)
        pressure = max(state.pressure, self._separated_pressure)
        usual = potential.overlap_at(2.0 * typical_force(self.reference, pressure), self.diameter)
        self._stiffness = float(potential.contact_stiffness(usual, self.diameter))
        changes = state.contacts.stiffness * state.contacts.distance
        ends = state.contacts.i, state.contacts.j
        self._floor = force_floor(self._stiffness * self.diameter, self.reference.n, *ends, changes)

    def _find_order(self):
        """Find an order of elimination for the present positions."""
        pairs, o = self.pairs, self.offsets
        r = bond_vector(self.cell_strain, pairs.r0, (o[pairs.j] - o[pairs.i]).T)
        near = lengths(np.stack(r, axis=1)) < pairs.sigma + MAX_ORDER_GAP * self.diameter
        self._order = self.solver.order(self.reference.n, pairs.i[near], pairs.j[near])
        self._entries = 0

    def _factorise(self):
        """Factorise the present Hessian, and clear the memory of L-BFGS."""
        while True:
            self._factor = warm_start.factor_of(
                self._order, self.pairs, self.offsets, self.shear, self._potential,
                MAX_CONTACT_GAP * self.diameter, HESSIAN_SHIFT_RATIO * self._stiffness, self._stiffness,
            )  # fmt: skip
            entries = len(self._factor[2])
            self._entries = self._entries or entries
            if entries <= MAX_FILL_RATIO * self._entries:
                break
            self._find_order()
        self._memory[2][0] = 0
        self.effort.newton_steps += 1

    def _descend(self, forces, tolerance, budget):
        unit = typical_force(self.reference, 1.0)
        scalars = (
            self.largest, self.skin, self.volume, self.shear, tolerance, self._floor,
            self._separated_pressure, unit, MAX_MOVE_RATIO * self.diameter, 0.2 / self._stiffness, budget,
        )  # fmt: skip
        state = self._factor, self._memory, self.offsets, self.displacement, forces
        return warm_start.follow(self.pairs, self._potential, scalars, *state)

    def _follow(self):
        """Descend to the minimum; the sums of `bond_forces` there, None if MAX_STEP_EVALUATIONS do not reach it."""
        forces, spent = np.empty_like(self.offsets), 0
        tolerance, budget = self.tolerance, MAX_OLD_FACTOR_STEPS
        while spent < MAX_STEP_EVALUATIONS:
            status, evaluations, sums = self._descend(forces, tolerance, budget)
            spent += evaluations
            self.effort.evaluations += evaluations
            if status == warm_start.SEPARATED or (
                status == warm_start.CONVERGED and tolerance == self.tolerance
            ):
                return sums
            if status == warm_start.LOST:
                return None
            if status == warm_start.STALE:
                self.fold()
            elif tolerance == self.tolerance and budget == MAX_NEW_FACTOR_STEPS:
                # disks rearrange: until they come to rest a factor of the Hessian does not pay
                self._factor = warm_start.NO_FACTOR[self.reference.dimension]
                self._memory[2][0] = 0
                tolerance, budget = max(2.0 * self.tolerance, DESCENT_TOLERANCE), MAX_STEP_EVALUATIONS
            else:
                self._factorise()
                tolerance, budget = self.tolerance, MAX_NEW_FACTOR_STEPS
        return None

    def advance(self) -> StrainStep:
        """One step of shear, to the minimum that `minimum` describes."""
        if self.steps % RESTART_STEPS == 0:
            self._restart_list()
        last_minimum, spent = self.minimum, self.effort.evaluations
        self.shear += self.step
        self.displacement = np.empty_like(self.offsets)
        if self.stale(
            warm_start.moved_on(
                self.offsets, self.cell_strain, self.last_displacement, self.displacement, self.pairs.r0
            )
        ):
            self.fold()
        sums, proved = self._follow(), False
        self.steps += 1
        if sums is not None:
            minimum = self._minimum_state(sums)
            if self.needs_proof or self.steps % RESTART_STEPS == 0:
                left = self.tolerance * typical_force(self.reference, minimum.pressure)
                proved = warm_start.is_minimum(
                    self._order, self.pairs, self.offsets, self.shear, self._potential, self._stiffness,
                    max(left, self._floor),
                )  # fmt: skip
                sums = sums if proved else None
        if sums is None:  # rearrangements without end, or a saddle: a quench, which leaves saddles
            start = self.disks
            self.list(self._quench(start, MAX_SHAKES))
            self.displacement += displacement_between(start, self.reference)
            self._factorise()
            minimum, proved = self._minimum_state(self._forces()), True
        size, longest = warm_start.without_drift(self.displacement, self.pairs.r0)
        repeats = longest < MAX_MOVE_RATIO * self.diameter
        self.last_displacement = self.displacement if repeats else np.zeros_like(self.displacement)
        self.minimum = minimum
        work = 0.5 * (last_minimum.shear_stress + minimum.shear_stress) * self.volume * self.step
        dissipated = work - (minimum.energy - last_minimum.energy)
        return StrainStep(
            size / self.diameter,
            dissipated,
            last_minimum.jammed
            and bool(dissipated > PLASTIC_RATIO * self.affine_modulus * self.volume * self.step**2),
            proved,
            self.effort.evaluations - spent,
        )

    def _forces(self):
        """Sums of `bond_forces` at the present positions."""
        return self._descend(np.empty_like(self.offsets), self.tolerance, 0)[2]

    def _minimum_state(self, sums):
        disks, n = self.reference, self.reference.n
        contacts, stiffness, alike = warm_start.contacts_at(
            self.pairs, self.offsets, self.shear, self._potential
        )
        self.affine_modulus = stiffness / self.volume
        self.needs_proof |= bool(alike > MAX_ALIKE_RATIO)
        energy = sums.energy / disks.potential.exponent
        return MinimumState(
            energy,
            -sums.elastic_xy / self.volume,
            (sums.elastic_xx + sums.elastic_yy + sums.elastic_zz) / disks.dimension / self.volume,
            energy / n > energy_cut(disks.potential) * disks.potential.k,
            2.0 * contacts / n,
        )

    def state(self) -> dict:
        """Arrays and numbers for `restore`: the state at the last `_restart_list`, and the number of steps in all."""
        disks, last, steps, effort = self._anchor
        arrays = {name: getattr(disks, name) for name in PLACES} | {"last": last}
        counts = {name: getattr(effort, name) for name in COUNTS}
        return arrays | counts | {"anchor": steps, "steps": self.steps}

    def restore(self, state: dict) -> None:
        """Return to the state that `state` gave, to the last bit, by repeating the steps since its `_restart_list`."""
        self.list(self.reference.replace(**{name: np.asarray(state[name], float) for name in PLACES}))
        self.last_displacement, self.steps = np.asarray(state["last"], float), int(state["anchor"])
        self.effort = Effort(**{name: int(state[name]) for name in COUNTS})
        while self.steps < int(state["steps"]):
            self.advance()


@dataclass(frozen=True, eq=False)
class ShearPath:
    """Result of quasistatic shear."""

    disks: Packing  # the last minimum
    series: StrainSeries  # PATH_COLUMNS, a row for each step
    discard: float  # strain before the averages
    averages: dict  # {name of AVERAGED: Average} over strain > discard, over all states, jammed or not
    effort: Effort  # cost of all steps
    events: EventTable | None  # of `shear_events.EventShear`,
    came_apart: float | None  # and the strain where it ended before its goal, as no contact was left

    @property
    def averaged_rows(self) -> np.ndarray:
        """(T,) whether a row is averaged."""
        return _is_averaged(self.series, self.discard)


def shear_stepwise(
    disks: Packing,
    step: float,
    steps: int,
    solver,
    tolerance: float,
    *,
    discard: float = 0.0,
    team: Team | None = None,
    start: Callable[..., StepwiseShear] = StepwiseShear,
    resume: tuple[StrainSeries, dict] | None = None,
    save: Callable[[StrainSeries, dict], None] | None = None,
    report: Callable[[StrainSeries], None] | None = None,
) -> ShearPath:
    """Shear disks in `steps` strain steps of size `step`, each followed to the minimum of the energy.

    solver      `petsc.hessian_solver.HessianSolver` for the quenches
    tolerance   max |F| / (p d) of a minimum
    discard     strain before the averages
    team        threads of the quenches
    start       makes the `StepwiseShear` of (disks, step, solver, tolerance, team)
    resume      series and state as given to `save`, from which an interrupted run continues
    save        called with series and state after a step, every SAVE_INTERVAL seconds, and after the last one
    report      called with the series after every step

    Raises ConvergenceError where no minimum is found.
    """
    shear, series = start(disks, step, solver, tolerance, team), StrainSeries(PATH_COLUMNS)
    if resume is not None:
        series.restore(resume[0].arrays())
        shear.restore(resume[1])
    saved = time.monotonic()
    while len(series) < steps and shear.came_apart is None:
        done = shear.advance()
        series.add(strain=shear.strain, **vars(shear.minimum), **vars(done))
        if save is not None and (time.monotonic() - saved > SAVE_INTERVAL or len(series) == steps):
            save(series, shear.state())
            saved = time.monotonic()
        if report is not None:
            report(series)
    if not _is_averaged(series, discard).any():  # of a path that ended before
        discard = 0.0
    rows = _is_averaged(series, discard)
    averages = {name: Average.of(series.column(name)[rows]) for name in AVERAGED}
    return ShearPath(
        shear.disks,
        series,
        discard,
        averages,
        shear.effort,
        shear.events,
        shear.came_apart,
    )


def _is_averaged(series, discard):
    return np.abs(series.column("strain")) > discard * (1 + 1e-12)
