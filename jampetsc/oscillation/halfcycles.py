"""The steady oscillation with fixed contacts by steps in time, for small exponents: half a cycle, again and again.

Half a period takes displacements Q to Φ(Q). What is imposed changes its sign then, and so does the steady oscillation:
Q + Φ(Q) = 0. Two motions under the same drive approach each other in the norm of K,

    d/dt ½ |ΔQ|²_K = −Σ_c Δf·Δz ≤ 0 ,

and where they do so without turning around each other, the derivative of Φ lies between 0 and 1, that of Q + Φ between
1 and 2, whatever α is and however contacts stick. So Q − ⅔ (Q + Φ) is three times nearer; mixing the last few of these
(Anderson; Walker & Ni, SIAM J. Numer. Anal. 49, 1715 (2011)) makes it five to ten times. Repeating cycles as they come
would keep whatever sticks.

Every oscillation has its own units, time 1/ω, the strain there is and the larger of elastic and damping forces: with
ωτ₁ ∝ X^(1/α) numbers of any size, nothing in it is large or small.

Two runs, the second from where the first has ended: half of the steps, then all of them.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.core.laws import Law
from jampetsc.errors import ConvergenceError, named
from jampetsc.mechanics.network import Network
from jampetsc.oscillation.answer import Answer, Sine
from jampetsc.oscillation.dashpots import REST, Damping
from jampetsc.oscillation.fixed import FixedSprings, State
from jampetsc.oscillation.harmonics import harmonics_of
from jampetsc.oscillation.powerlaw import PowerLaw
from jampetsc.oscillation.preconditioner import PREFIX
from jampetsc.oscillation.stage import STAGE, TOLERANCE, WEIGHTS, Stages
from jampetsc.oscillation.steady import Point

RELAXED = 2.0 / 3.0
MIXED = 5  # half cycles before the last
LEFT = 1e-5  # of |G*|: what may be left of the change from half cycle to half cycle
MOST_HALVES = 60
PILOT_STEPS, PILOTS = 8, 40
NEAR = 10.0  # factor within which the motion is to be what its unit says
LARGEST_LOG = 690.0  # of what a double holds


@dataclass(frozen=True)
class Stepped(Answer):
    """The answer. Lengths in those of the packing, time in 1/ω."""

    regularisation: float  # estimate of |ΔG*| when the velocity is halved below which contacts are linear
    factorisations: int
    half_cycles: int  # of both runs
    strain: float  # amplitude
    speed: float  # root mean square of |z|
    start: State  # where what is imposed grows through zero
    velocity: np.ndarray  # (n, dofs) there
    rate: float  # of strain, there

    def record(self) -> dict:
        """What a file keeps, by the names of its datasets."""
        return super().record() | {
            "regularisation_effect": self.regularisation,
            "half_cycles": self.half_cycles,
            "factorisations": self.factorisations,
        }


@dataclass(frozen=True)
class _Units:
    """Of one oscillation, time being 1/ω: of strains and displacements, and of stiffness; and what has them."""

    strain: float
    stiffness: float
    work: float  # per area
    k: float
    c: float  # coefficient of the law
    amplitude: float  # of what is imposed

    @classmethod
    def of(cls, law: Law, rho0: float, k: float, point: Point, log_strain: float) -> "_Units":
        """Such that strains are of order one and neither springs nor dashpots nor the stress are stiffer.

        Raises ConvergenceError where a double does not hold them.
        """
        alpha = law.exponent
        log_c = np.log(k) + alpha * (np.log(point.omega) + np.log(law.tau1))
        log_c += (1.0 - alpha) * (np.log(rho0) - log_strain)
        log_imposed = np.log(point.amplitude) - log_strain
        unit = max(np.log(k), log_c)
        if point.stress_controlled:
            log_imposed += np.log(k)
            unit = max(unit, log_imposed)
            log_imposed -= unit
        if max(unit, abs(unit + 2.0 * log_strain)) > LARGEST_LOG:
            raise ConvergenceError(
                f"strains of 1e{log_strain / np.log(10.0):.0f} and moduli of 1e{unit / np.log(10.0):.0f} k are more "
                f"than doubles hold: choose {named('omega')} nearer to where elastic and damping forces are alike"
            )
        return cls(
            *np.exp([log_strain, unit, unit + 2.0 * log_strain, np.log(k) - unit, log_c - unit, log_imposed])
        )


@dataclass(frozen=True, eq=False)
class _Half:
    """Half a cycle from where what is imposed grows through zero, in units of the oscillation."""

    end: State
    u: np.ndarray  # (n, dofs) velocities at the end
    rate: float
    G: complex
    harmonics: np.ndarray
    strain: float  # amplitude
    work: float  # per area and cycle, as the next two
    dissipation: float
    softened: float  # what contacts would dissipate more if they were linear at half the velocity
    unbalanced: float  # work, at most, of what is left of the forces
    speed: float  # root mean square of |z|


class _Motion:
    """One oscillation in its units, whatever its steps."""

    def __init__(self, network: Network, law: Law, units: _Units, stress_controlled: bool, speed: float):
        self._roots, self._power = np.sqrt(law.on_contacts), PowerLaw(law.exponent, units.c)
        self.sine = Sine(units.amplitude, stress_controlled)
        self.springs = FixedSprings(network, law, units.k, self._damping(speed), PREFIX)
        self.iterations = 0

    def _damping(self, speed):
        self._floor = REST * speed
        return Damping(self._power, self._roots, self._floor)

    def rest_at(self, speed: float):
        """Contacts are linear at less than REST of this |z|."""
        self.springs.damp(self._damping(speed))

    def half(self, start: State, steps: int) -> _Half:
        """With so many steps of a cycle."""
        springs, dt = self.springs, 2.0 * np.pi / steps
        stages = Stages(springs, STAGE * dt, 1.0)
        places, gamma = start.places, start.gamma
        last, rows = (np.zeros((springs.n, springs.dofs)), 0.0), []
        try:
            for n in range(steps // 2):
                times = [dt * (n + part) for part in (STAGE, 1.0)]
                places, u, ends = stages.step(places, gamma, [self.sine.at(time) for time in times], last)
                gamma, last = ends[1].gamma, (u, ends[1].rate)
                rows += [
                    (time, dt * weight, *self._look(end))
                    for time, weight, end in zip(times, WEIGHTS, ends, strict=True)
                ]
        finally:
            self.iterations += stages.iterations
        times, weights, values, *rest = np.array(rows).T
        dissipation, softened, unbalanced, squares = np.array(rest) @ weights
        # the other half has the opposite values, and as much of odd harmonics
        found = harmonics_of(values, times / (2.0 * np.pi), weights / np.pi)
        G, strain, work = self.sine.moduli(found[0])
        return _Half(
            end=State(places, gamma),
            u=last[0],
            rate=last[1],
            G=G,
            harmonics=found[1:] / found[0],
            strain=strain,
            work=work,
            dissipation=2.0 * dissipation / springs.area,
            softened=2.0 * softened / springs.area,
            unbalanced=2.0 * unbalanced / springs.area,
            speed=float(np.sqrt(squares / np.pi / springs.count)),
        )

    def _look(self, end):
        """What answers, power dissipated, what more would be if contacts were softer, power left, Σ|z|²."""
        softer = np.sum(self._power.forces(end.z, 0.5 * self._floor) * end.z) - end.power
        response = end.gamma if self.sine.stress_controlled else end.stress
        return response, end.power, softer, end.unbalanced, np.sum(end.z**2)


class _Repeated:
    """Half cycles of so many steps until they repeat: `last`, which began at `start`, after `count` of them."""

    def __init__(self, motion: _Motion, steps: int, start: State):
        self._motion = motion
        tried, self.count = [], 0
        while True:
            self.start, self.last = start, motion.half(start, steps)
            self.count += 1
            left = self._sum([(1.0, self.last.end), (1.0, start)])
            tried = [*tried, (start, left)][-MIXED - 1 :]
            self.left = self._error(left)
            if self.left <= LEFT * abs(self.last.G):
                return
            if self.count == MOST_HALVES:
                raise ConvergenceError(
                    f"half cycles do not repeat: after {MOST_HALVES} of them G* is still uncertain by "
                    f"{100 * self.left / abs(self.last.G):.2g} %"
                )
            start = self._mixed(tried)

    def _sum(self, parts) -> State:
        places = sum(weight * state.places for weight, state in parts)
        free = self._motion.sine.stress_controlled
        return State(places, sum(weight * state.gamma for weight, state in parts) if free else 0.0)

    def _error(self, left):
        """Of G*, at most: elastic work of what is left on the motion there is, and the strain that is left."""
        springs, motion = self._motion.springs, self.last
        sizes = springs.product(left, left) * springs.product(motion.end, motion.end)
        strained = abs(motion.G) * abs(left.gamma) / motion.strain
        return np.sqrt(max(sizes, 0.0)) / (springs.area * motion.strain**2) + strained

    def _mixed(self, tried):
        """Where to begin next: the affine combination of what was tried that leaves least, and ⅔ of that less."""
        *before, (_, left) = tried
        changes = [self._sum([(1.0, left), (-1.0, other)]) for _, other in before]
        product = self._motion.springs.product
        matrix = np.array([[product(a, b) for b in changes] for a in changes]).reshape(2 * (len(changes),))
        right = np.array([product(a, left) for a in changes])
        shares = np.linalg.lstsq(matrix, right, rcond=1e-10)[0] if before else right
        weights = np.append(shares, 1.0 - shares.sum())
        starts = [(weight, one) for weight, (one, _) in zip(weights, tried, strict=True)]
        lefts = [(-RELAXED * weight, one) for weight, (_, one) in zip(weights, tried, strict=True)]
        return self._sum(starts + lefts)


def _require_stable(springs: FixedSprings, units: _Units):
    modulus = springs.shear_modulus() * units.stiffness
    if not modulus > 0.0:
        raise ConvergenceError(
            f"its shear modulus is {modulus:.2g}: no stress can be imposed on such a packing; impose a "
            f"{named('strain')}, or relax the shear of its cell (pack {named('stabilise')} shear)"
        )


class SteppedOscillation:
    """All points of one packing and law, on one rank alone.

    rho0: mean diameter, the length in the power law
    """

    def __init__(self, network: Network, law: Law, rho0: float, steps: int):
        self.network, self.law, self.rho0, self.steps = network, law, rho0, steps

    def solve(self, point: Point) -> Stepped:
        """The steady oscillation of a packing whose K has no negative modes.

        Raises ConvergenceError where Newton's method fails, half cycles do not repeat or doubles end.
        """
        units, motion = self._motion(point)
        try:
            start = State(np.zeros((motion.springs.n, 2)), 0.0)
            half = _Repeated(motion, self.steps // 2, start)
            whole = _Repeated(motion, self.steps, half.start)
            last = whole.last
            softer, unbalanced = np.array([last.softened, last.unbalanced]) / (np.pi * last.strain**2)
            error = abs(last.G - half.last.G) + half.left + whole.left + softer + unbalanced
            return Stepped(
                G=last.G * units.stiffness,
                error=error * units.stiffness,
                harmonics=last.harmonics,
                work=last.work * units.work,
                balance=last.dissipation / last.work - 1.0,
                regularisation=softer * units.stiffness,
                newton=motion.iterations,
                factorisations=motion.springs.factorisations,
                half_cycles=half.count + whole.count,
                strain=last.strain * units.strain,
                speed=last.speed * units.strain,
                start=State(whole.start.places * units.strain, whole.start.gamma * units.strain),
                velocity=-last.u * units.strain,
                rate=-last.rate * units.strain,
            )
        finally:
            motion.springs.destroy()

    def _motion(self, point):
        """Units in which velocities are of order one, and the motion in them, found by half a cycle of few steps.

        Under stress the strain may be less than that of springs by any power of ten, since it goes as σ^(1/α).
        """
        law, rho0, alpha = self.law, self.rho0, self.law.exponent
        upper = np.log(point.amplitude)  # of the strain, too large
        lower = -np.inf  # too small to be solved
        log_strain = upper
        for _ in range(PILOTS):
            units = _Units.of(law, rho0, self.network.k, point, log_strain)
            motion = _Motion(self.network, law, units, point.stress_controlled, rho0)
            try:
                if point.stress_controlled:
                    _require_stable(motion.springs, units)
                with np.errstate(divide="ignore", invalid="ignore"):  # of a motion too slow to be seen
                    speed = motion.half(State(np.zeros((self.network.n, 2)), 0.0), PILOT_STEPS).speed
            except ConvergenceError:
                motion.springs.destroy()
                if log_strain == upper:
                    raise
                lower = log_strain
                log_strain = 0.5 * (lower + upper)
                continue
            if not point.stress_controlled or 1.0 / NEAR <= speed / rho0 <= NEAR:
                motion.rest_at(speed)
                return units, motion
            motion.springs.destroy()
            slower = np.log(max(speed / rho0, TOLERANCE))  # slower, and forces may be taken for balanced
            if slower < np.log(REST):  # linear by then: the law is slower still
                upper = log_strain
                slower = np.log(REST) + (slower - np.log(REST)) / alpha
                log_strain = max(log_strain + slower, 0.5 * (lower + upper))
            else:
                log_strain += slower
        raise ConvergenceError(f"no unit of velocity was found in {PILOTS} trials")
