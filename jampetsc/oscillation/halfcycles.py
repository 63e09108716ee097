"""The steady oscillation with fixed contacts for small exponents, by time steps over repeated half cycles.

Half a period takes displacements Q to Φ(Q). The drive changes its sign in that time, and so does the steady
oscillation: Q + Φ(Q) = 0. Two motions under the same drive approach each other in the norm of K,

    d/dt ½ |ΔQ|²_K = −Σ_c Δf·Δz ≤ 0 ,

and where they do so without oscillating around each other, the derivative of Φ lies between 0 and 1, that of Q + Φ
between 1 and 2, for every α and also where contacts stick. So Q − ⅔ (Q + Φ) reduces the error to a third; Anderson
mixing of the last few of these (Walker & Ni, SIAM J. Numer. Anal. 49, 1715 (2011)) reduces it five to ten times. Mere
repetition of cycles would never change what sticks.

Frequencies ωτ₁ ∝ X^(1/α), X the ratio of damping to elastic forces, span hundreds of powers of ten. Every oscillation
is therefore solved in its own units: time 1/ω, the amplitude of the strain, the larger of elastic and damping forces.

There are two runs, the first with half of the steps; the second starts where the first ended.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.laws.damping import Law
from jampetsc.network.contact_network import Network
from jampetsc.oscillation.dashpots import LINEAR_BELOW, Damping
from jampetsc.oscillation.fixed import FixedSprings
from jampetsc.oscillation.powerlaw import PowerLaw
from jampetsc.oscillation.response import Drive, Moduli, Response
from jampetsc.oscillation.stage import STAGE, TOLERANCE, WEIGHTS, Stages
from jampetsc.oscillation.start import Start
from jampetsc.oscillation.stepmatrix import StepMatrix

RELAXED = 2.0 / 3.0
MIXED = 5  # half cycles before the last that are mixed
LEFT = 1e-5  # of |G*|: error at which half cycles count as repeating
MOST_HALVES = 60
PILOT_STEPS, PILOTS = 8, 40
NEAR = 10.0  # largest factor between velocities and their unit
LARGEST_LOG = 690.0  # natural logarithm of numbers that double precision holds


@dataclass(frozen=True, kw_only=True)
class Stepped(Response):
    """The response, and the start of an oscillation with moving contacts."""

    start: Start


@dataclass(frozen=True)
class _Units:
    """Units of one oscillation, time being 1/ω, and its constants in them."""

    strain: float  # unit, of displacements too
    stiffness: float  # unit
    work: float  # unit, per area
    k: float  # stiffness of a contact, in that unit
    c: float  # coefficient of the power law
    amplitude: float  # of the drive

    @classmethod
    def of(cls, law: Law, rho0: float, k: float, drive: Drive, log_strain: float) -> "_Units":
        """Units in which strains are of order one, and springs, dashpots and stress at most of order one.

        log_strain: logarithm of the unit of strain. Raises ConvergenceError for units out of the range of doubles.
        """
        alpha = law.exponent
        log_c = np.log(k) + alpha * (np.log(drive.omega) + np.log(law.tau1))
        log_c += (1.0 - alpha) * (np.log(rho0) - log_strain)
        log_imposed = np.log(drive.amplitude) - log_strain
        unit = max(np.log(k), log_c)
        if drive.stress_controlled:
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
    """Half a cycle that begins where the drive grows through zero, in units of the oscillation."""

    end: np.ndarray  # (2n + 1,) displacements and strain
    u: np.ndarray  # (n, dofs) velocities at the end
    rate: float
    moduli: Moduli
    dissipation: float  # per area and cycle
    softened: float  # likewise, its change if contacts were linear only below half the velocity
    unbalanced: float  # likewise, bound on the work of the residual forces
    speed: float  # root mean square of |z|


class _Motion:
    """One oscillation in its own units, to be followed with any number of steps."""

    def __init__(self, network: Network, law: Law, rho0: float, drive: Drive, log_strain: float):
        self.units = _Units.of(law, rho0, network.k, drive, log_strain)
        self._law, self._power = law, PowerLaw(law.exponent, self.units.c)
        self.drive = replace(drive, omega=1.0, amplitude=self.units.amplitude)
        self._damping = Damping.of(law, self._power, rho0)
        self.springs = FixedSprings(network, law, self.units.k, self._damping)
        self.matrix = StepMatrix(self.springs)
        self.iterations = 0

    def moves_at(self, speed: float):
        """Set the typical |z|, far below which contacts are linear."""
        self._damping = Damping.of(self._law, self._power, speed)
        self.springs.damp(self._damping)

    def half(self, start, steps: int) -> _Half:
        """Half a cycle from displacements and strain `start` (2n + 1,), with `steps` steps per whole cycle."""
        springs, dt = self.springs, 2.0 * np.pi / steps
        stages = Stages(springs, self.matrix, STAGE * dt, 1.0)
        places, gamma = start[:-1].reshape(-1, 2), start[-1]
        last, rows = (np.zeros((springs.n, springs.dofs)), 0.0), []
        try:
            for n in range(steps // 2):
                times = [dt * (n + part) for part in (STAGE, 1.0)]
                imposed = [self.drive.at(time) for time in times]
                places, u, ends = stages.step(springs, places, gamma, imposed, last)
                gamma, last = ends[1].gamma, (u, ends[1].rate)
                rows += [
                    (time, dt * weight, *self._measured(end))
                    for time, weight, end in zip(times, WEIGHTS, ends, strict=True)
                ]
        finally:
            self.iterations += stages.iterations
        times, weights, values, *rest = np.array(rows).T
        *powers, squares = np.array(rest) @ weights
        # the other half cycle has the opposite values and contributes as much to odd harmonics
        moduli = self.drive.moduli(values, times / (2.0 * np.pi), weights / np.pi)
        speed = float(np.sqrt(squares / np.pi / springs.count))
        return _Half(
            np.append(places, gamma), *last, moduli, *(2.0 * power / springs.area for power in powers), speed
        )

    def _measured(self, end):
        """(response, power dissipated, its change if contacts were softer, power of residual forces, Σ|z|²)."""
        softer = np.sum(self._power.forces(end.z, 0.5 * self._damping.floor) * end.z) - end.power
        response = end.gamma if self.drive.stress_controlled else end.stress
        return response, end.power, softer, end.unbalanced, np.sum(end.z**2)


class _Repeated:
    """Half cycles until they repeat: `last`, which began at `start`, is the one of number `count`.

    steps: per whole cycle
    """

    def __init__(self, motion: _Motion, steps: int, start):
        self._motion = motion
        starts, lefts = np.empty((2, 0, len(start)))
        for self.count in range(1, MOST_HALVES + 1):
            self.start, self.last = start, motion.half(start, steps)
            left = start + self.last.end
            left[-1] *= motion.drive.stress_controlled  # else 0 but for rounding
            starts, lefts = (np.vstack(part)[-MIXED - 1 :] for part in ((starts, start), (lefts, left)))
            self.error = self._error(left)
            size = abs(self.last.moduli.G)
            if self.error <= LEFT * size:
                return
            start = self._mixed(starts, lefts)
        raise ConvergenceError(
            f"half cycles do not repeat: after {MOST_HALVES} of them G* is still uncertain by "
            f"{100 * self.error / size:.2g} %"
        )

    def _error(self, left):
        """Bound on the error of G* by the residual `left` = Q + Φ(Q): elastic work on the motion, and the strain."""
        springs, end, moduli = self._motion.springs, self.last.end, self.last.moduli
        sizes = (left @ springs.times_K(left)) * (end @ springs.times_K(end))
        strained = abs(moduli.G) * abs(left[-1]) / moduli.strain
        return np.sqrt(max(sizes, 0.0)) / (springs.area * moduli.strain**2) + strained

    def _mixed(self, starts, lefts):
        """The next start: the affine combination of earlier ones with the least Q + Φ(Q), less ⅔ of that."""
        changes = lefts[-1] - lefts[:-1]
        forces = np.array([self._motion.springs.times_K(change) for change in changes]).reshape(changes.shape)
        shares = np.linalg.lstsq(forces @ changes.T, forces @ lefts[-1], rcond=1e-10)[0]
        return np.append(shares, 1.0 - shares.sum()) @ (starts - RELAXED * lefts)


class SteppedOscillation:
    """All oscillations of one packing and law, on one rank alone.

    rho0: mean diameter, the length in the power law
    """

    def __init__(self, network: Network, law: Law, rho0: float, steps: int):
        self.network, self.law, self.rho0, self.steps = network, law, rho0, steps

    def solve(self, drive: Drive) -> Stepped:
        """The steady oscillation of a packing without negative modes of K, under stress also of K with the shear.

        Raises ConvergenceError if Newton's method fails, half cycles do not repeat or numbers leave the range of
        doubles.
        """
        motion = self._motion(drive)
        units = motion.units
        half = _Repeated(motion, self.steps // 2, np.zeros(2 * self.network.n + 1))
        whole = _Repeated(motion, self.steps, half.start)
        last, moduli = whole.last, whole.last.moduli
        softer, unbalanced = np.array([last.softened, last.unbalanced]) / (np.pi * moduli.strain**2)
        error = abs(moduli.G - half.last.moduli.G) + half.error + whole.error + softer + unbalanced
        G = moduli.G * units.stiffness
        return Stepped(
            G=G,
            error=error * units.stiffness,
            harmonics=moduli.harmonics,
            work=moduli.work * units.work,
            energy_balance=last.dissipation / moduli.work - 1.0,
            regularisation_effect=softer * units.stiffness,
            newton_steps=motion.iterations,
            factorisations=motion.matrix.factorisations,
            half_cycles=half.count + whole.count,
            start=self._start(drive, whole, units.strain, abs(G)),
        )

    def start(self, drive: Drive) -> Start:
        """The start of an oscillation with moving contacts. Raises as `solve`."""
        return self.solve(drive).start

    def _start(self, drive, whole, unit, modulus):
        last, places = whole.last, whole.start[:-1].reshape(-1, 2)
        scalars = (unit * one for one in (whole.start[-1], -last.rate, last.moduli.strain))
        return Start.of(
            self.network, drive, unit * places, -unit * last.u, *scalars, modulus, last.speed * unit
        )

    def _motion(self, drive) -> _Motion:
        """The motion in units in which velocities are of order one, found by half cycles of few steps.

        Under stress the strain may be smaller than that of springs by any power of ten, since it scales as σ^(1/α).
        """
        rho0 = self.rho0
        upper = log_strain = np.log(drive.amplitude)  # of the strain, too large
        lower = -np.inf  # too small to be solved
        for _ in range(PILOTS):
            motion = _Motion(self.network, self.law, rho0, drive, log_strain)
            try:
                with np.errstate(divide="ignore", invalid="ignore"):  # of a motion that underflows
                    speed = motion.half(np.zeros(2 * self.network.n + 1), PILOT_STEPS).speed
            except ConvergenceError:
                if log_strain == upper:
                    raise
                lower = log_strain
                log_strain = 0.5 * (lower + upper)
                continue
            if not drive.stress_controlled or 1.0 / NEAR <= speed / rho0 <= NEAR:
                motion.moves_at(speed)
                return motion
            slower = np.log(max(speed / rho0, TOLERANCE))  # slower motion has forces below the tolerance
            if slower < np.log(LINEAR_BELOW):  # forces are linear there; by the power law it is slower still
                upper = log_strain
                slower = np.log(LINEAR_BELOW) + (slower - np.log(LINEAR_BELOW)) / self.law.exponent
                log_strain = max(log_strain + slower, 0.5 * (lower + upper))
            else:
                log_strain += slower
        raise ConvergenceError(f"no unit of velocity was found in {PILOTS} trials")
