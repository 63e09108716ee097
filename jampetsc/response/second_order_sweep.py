"""G*(ω) with inertia from a handful of real factorisations, with a bound at every frequency.

Galerkin's method in the space of `second_order_basis`, whose chains grow where the bound of `second_order_bound` is
furthest above what is allowed. Frequencies at which it stays above, as where resonances are too many for the space, are
solved one by one (`direct`).
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.collective import on_root
from jampetsc.petsc.session import current
from jampetsc.response.assembly import Pencil
from jampetsc.response.certificate import Functional, field_bound, tensor_at
from jampetsc.response.rational import LARGEST_SHIFT, SMALLEST_SHIFT, largest_rate
from jampetsc.response.second_order_basis import Chain, SecondOrderBasis
from jampetsc.response.second_order_bound import MARGIN, Definiteness, DefinitenessTest, MassiveShift
from jampetsc.response.shift_factors import Factors

FIRST_LENGTH, MORE_LENGTH = 14, 8  # steps of a chain, at first and where it is continued
NEARBY = 5.0  # ratio of a frequency and a shift within which the chain of the shift is continued
MAX_CHAIN = 60
MAX_VECTORS = 240  # for each load
MAX_STALLED = 4  # steps that do not halve the worst ratio
SPACED = 1  # frequencies of a decade that steer, about
LOW_SHIFT = 1e-7  # first shift, relative to the scale of rates, if lower frequencies follow
GUESSES = 200  # frequencies at which ω_c of the space is looked for
TRIAL_RATIOS = 0.4, 0.15, 0.05  # of the ω_c of the space, which are tested


@dataclass(frozen=True, eq=False)
class Solution:
    """What is certified at one frequency."""

    certificates: list  # a `Certified` for each load
    C: np.ndarray | None = None  # (L, L) of several loads
    C_bounds: np.ndarray | None = None  # (L, L, 3)
    x: np.ndarray | None = None  # (n_local,) the field of a single load at a field frequency
    field_bound: float | None = None  # on its relative error in the energy norm


class SecondOrderSweep:
    """Grows a space for the loads of one pencil with masses. All methods are collective; needs the real build.

    pencils    one for each load, that differ in the load alone
    omega      (M,) increasing
    accuracy   relative, allowed in G' and in G'' of each load
    fields     frequencies at which fields are kept, of a single load
    first      a sweep of the same K, B and M under other loads, whose factors are used
    solutions  {ω: Solution} of the frequencies that are certified
    """

    def __init__(
        self,
        pencils: list[Pencil],
        omega,
        accuracy: float,
        fields=(),
        first: "SecondOrderSweep | None" = None,
    ):
        self.pencils, self.pencil = pencils, pencils[0]
        self.network = self.pencil.network
        self.omega = self.network.comm.bcast(np.asarray(omega, float))
        self.accuracy, self.field_omega = accuracy, np.asarray(fields, float)
        self.solutions: dict[float, Solution] = {}
        self.functionals = [Functional(pencil) for pencil in pencils]
        self.basis = SecondOrderBasis(pencils)
        self.ratios = []  # largest bound over what is allowed, before each step but the first ones
        if first is not None:
            self.factors, self.shifts, self.rate = first.factors, first.shifts, first.rate
            self.definiteness, self.is_tested = first.definiteness, first.is_tested
            return
        self.factors = Factors(self.pencil, "matrix")
        self.shifts: dict[float, MassiveShift] = {}
        self.rate = max(of_K / of_B for of_K, of_B in self.pencil.largest_of_kinds if of_B)
        self.definiteness, self.is_tested = Definiteness(largest_rate(self.pencil)), False

    @property
    def factorisations(self) -> int:
        """Factorisations made."""
        return len(self.shifts)

    def steps(self):
        """The next (shift, number of vectors), until all is certified or nothing helps any more."""
        steering = self._steering()
        grown = {s for _, s in self.basis.chains}
        for s in self._first_shifts():
            if s not in grown:
                yield s, FIRST_LENGTH
        while True:
            missing = self._missing(steering)
            step = self._next_step(missing, self.evaluate(missing))
            if step is None and len(steering) < len(self.omega) and not len(self._missing(steering)):
                missing = self._missing(self.omega)
                ratio = self.evaluate(missing)
                steering = self._missing(self.omega)
                step = self._next_step(missing, ratio)
            if step is None:
                return
            yield step

    def _missing(self, omega):
        """The frequencies that are not certified yet."""
        return np.array([at for at in omega if float(at) not in self.solutions])

    def _steering(self):
        """Frequencies whose bounds steer: `SPACED` of a decade, the ends among them."""
        decades = np.log10(self.omega[-1] / self.omega[0])
        count = min(len(self.omega), int(np.ceil(SPACED * decades)) + 2)
        return self.omega[np.unique(np.linspace(0, len(self.omega) - 1, count).round().astype(int))]

    def _first_shifts(self):
        low, high = self._clipped(self.omega[0]), self._clipped(self.omega[-1])
        middle = float(np.clip(self.rate, low, high))
        return dict.fromkeys((float(np.clip(LOW_SHIFT * self.rate, low, high)), middle))

    def _clipped(self, omega):
        return float(np.clip(omega, SMALLEST_SHIFT * self.rate, LARGEST_SHIFT * self.rate))

    def extend(self, s: float, count: int) -> None:
        """Factorise at shift s unless it is done, and extend the chains of all loads by `count` vectors."""
        self.add_shift(s)
        for load in range(len(self.pencils)):
            self.basis.extend(self.shifts[s].solve, load, s, count)

    def add_shift(self, s: float) -> None:
        """Factorise at shift s unless it is done."""
        if s not in self.shifts:
            self.factors.factorise([s])
            self.shifts[s] = MassiveShift(self.pencil, self.factors, s)

    def resume(self, ratios, omega_c) -> None:
        """Take the `ratios` of an earlier run, and its ω_c if it was looked for."""
        self.ratios = list(ratios)
        if omega_c is not None:
            self.definiteness, self.is_tested = replace(self.definiteness, omega_c=omega_c), True

    @property
    def worst(self) -> float:
        """Largest bound over what is allowed, before the last step."""
        return self.ratios[-1] if self.ratios else np.inf

    def _next_step(self, omega, ratio):
        """(shift, count) where the `ratio` of the bound to what is allowed, (M,), is largest.

        None where all are below 1, or where nothing helps.
        """
        reachable = np.any([self.definiteness.transfer(omega, s) > 0.0 for s in self.shifts], axis=0)
        ratio = np.where(reachable, ratio, 0.0)
        worst = float(ratio.max(initial=0.0))
        self.ratios.append(worst)
        before = self.ratios[-1 - MAX_STALLED] if len(self.ratios) > MAX_STALLED else np.inf
        if not worst > 1.0 or not worst < 0.5 * before or self.basis.size >= MAX_VECTORS * len(self.pencils):
            return None
        for index in np.argsort(-ratio):
            if not ratio[index] > 1.0:
                return None
            shift = self._clipped(omega[index])
            near = min(self.shifts, key=lambda s: abs(np.log(s / shift)))
            if not 1.0 / NEARBY < near / shift < NEARBY:
                return shift, FIRST_LENGTH
            chains = [self.basis.chains.get((load, near), Chain()) for load in range(len(self.pencils))]
            if not (chains[0].length or chains[0].refused):
                return near, FIRST_LENGTH
            if not all(chain.is_complete or chain.length >= MAX_CHAIN for chain in chains):
                return near, MORE_LENGTH
        return None

    def _find_definiteness(self):
        """Find ω_c, from what the space has as a first guess."""
        self.is_tested = True
        if not self.basis.size:
            return
        guess = on_root(self.network.comm, self._definite_below)
        test = DefinitenessTest(self.pencil) if guess else None
        for ratio in TRIAL_RATIOS if guess else ():
            if test.holds(ratio * guess):
                self.definiteness = replace(self.definiteness, omega_c=ratio * guess)
                return

    def _definite_below(self):
        """The frequency up to which K + ωB − νω²M̂ > 0 in the space, about; 0 if there is none. On rank 0."""
        guess, identity = 0.0, np.eye(self.basis.size)
        for at in np.geomspace(*map(self._clipped, (1e-3 * self.omega[0], self.omega[-1])), GUESSES):
            if np.linalg.eigvalsh(self.basis.K + at * self.basis.B - MARGIN * at**2 * identity)[0] <= 0.0:
                break
            guess = float(at)
        return guess

    def evaluate(self, omega):
        """Bound over what is allowed, (M,), at frequencies by the space as it is; `solutions` take those below 1."""
        if not self.is_tested:
            with current().stage("definiteness"):
                self._find_definiteness()
        ratio, serving = np.empty(len(omega)), self._serving(omega)
        with current().stage("projection"):
            for s in np.unique(serving):
                own = np.flatnonzero(serving == s)
                transfer = self.definiteness.transfer(omega[own], s)
                results = self._evaluate_at(omega[own], self.shifts[s], transfer)
                for index, certificates in zip(own, results, strict=True):
                    ratio[index] = np.max([self._ratio(result) for result in certificates])
                    if ratio[index] <= 1.0:  # not where it is nan
                        self.solutions[float(omega[index])] = self._solution(certificates)
        return ratio

    def _solution(self, certificates):
        omega = float(certificates[0].omega)
        if len(certificates) > 1:
            tensor = tensor_at(self.functionals, self.trials(omega), certificates)
            return Solution(certificates, *tensor)
        if omega not in self.field_omega:
            return Solution(certificates)
        x = self.trials(omega)[0].x
        ratio = self.definiteness.energy_ratio(omega, self._serving(np.array([omega]))[0])
        energy = certificates[0].error * self.network.volume
        bound = field_bound(self.pencil, omega, x, energy / ratio if ratio else np.inf)
        return Solution(certificates, x=x, field_bound=bound)

    def _serving(self, omega):
        """Shifts (M,) whose factors bound the errors at ω (M,)."""
        shifts = np.array(sorted(self.shifts))
        # Z(s) far below Z(ω) has large energies
        transfer = self.definiteness.transfer(omega[:, None], shifts) * np.minimum(
            1.0, shifts / omega[:, None]
        )
        return shifts[np.argmax(transfer, axis=1)]

    def _ratio(self, result):
        """Bound over what is allowed."""
        if np.all(result.within(self.accuracy)):
            return 0.0
        allowed = result.allowed_error(self.accuracy)
        return float(result.error / allowed) if allowed > 0.0 else np.inf

    def _evaluate_at(self, omega, shift, transfer):
        """Lists of `Certified` for each frequency, by the factor of one shift."""
        results, residuals, rounding, weights = [], [], [], []
        volume = self.network.volume
        fields = self.basis.fields(self.basis.coefficients(omega))
        for at, c, of_loads in zip(omega, transfer, fields, strict=True):
            for x, functional in zip(of_loads, self.functionals, strict=True):
                trial = functional.trial(at, x)
                result = functional.evaluate(trial)
                results.append(result)
                residuals.append(trial.left)
                rounding.append(functional.rounding(trial, shift.shift, shift.diagonal))
                floor = np.finfo(float).tiny ** 0.5
                weights.append(1.0 / max(c * volume * result.allowed_error(self.accuracy), floor))
        energies = shift.energies(np.array(residuals), np.array(rounding), np.array(weights))
        loads = len(self.pencils)
        with np.errstate(divide="ignore", invalid="ignore"):
            errors = np.where(energies == 0.0, 0.0, energies / (np.repeat(transfer, loads) * volume))
        results = [replace(result, error=float(error)) for result, error in zip(results, errors, strict=True)]
        return [results[start : start + loads] for start in range(0, len(results), loads)]

    def trials(self, omega: float):
        """The trial field of each load at ω."""
        fields = self.basis.fields(self.basis.coefficients([omega]))[0]
        return [functional.trial(omega, x) for functional, x in zip(self.functionals, fields, strict=True)]
