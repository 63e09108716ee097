"""The steady oscillation of a packing with fixed contacts at one frequency and amplitude.

Three solves, each the start of the next: linear damping equivalent in energy (BT 25, 26), half of the steps, all of
them. The difference of the last two estimates the error of the steps; what is left of the equations, times the motion,
that of the solver.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.equivalent_damping import EquivalentDamping
from jampetsc.oscillation.answer import Answer
from jampetsc.oscillation.cycle import Cycle
from jampetsc.oscillation.equations import Contacts, Drive, Equations
from jampetsc.oscillation.harmonics import HARMONICS
from jampetsc.oscillation.newton import Newton
from jampetsc.oscillation.powerlaw import STIFFEST, PowerLaw

# what may be left of the equations, over what drives them, with all steps and with half
TOLERANCE, HALF_TOLERANCE = 1e-10, 1e-7
LEAST_ALPHA = 0.45  # below, contacts stick so that FGMRES does not solve the linear equations
FLOOR = 1e-3  # of the typical velocity: where the start for the damping forces is cut
SLOW = 1e-3  # of k: ωc of dashpots that springs hardly feel
SMALLEST, LARGEST = 1e-30, 1.0  # stress in k that the equivalent damping takes


@dataclass(frozen=True)
class Point:
    """What is imposed. Stress in units of the stiffness k, as everywhere."""

    omega: float
    amplitude: float  # σ₀ or γ₀
    stress_controlled: bool


@dataclass(frozen=True)
class Steady(Answer):
    """The answer, the same on all ranks but for `velocity`, of which each has its part."""

    regularisation: float  # |ΔG*| when δ is halved, estimated in the same way as the solver's error
    speed: float  # root mean square of |z| over contacts and time, of the equivalent linear damping
    velocity: (
        np.ndarray
    )  # (odd harmonics, unknowns + 1) complex amplitudes of velocities; last, of the strain rate times √V
    linear: int  # iterations of the linear solver

    def record(self) -> dict:
        """What a file keeps, by the names of its datasets."""
        more = {"regularisation_effect": self.regularisation, "linear_iterations": self.linear}
        return super().record() | more


class SteadyOscillation:
    """All points of one packing and law. Methods are collective.

    rho0: mean diameter, the length in the power law
    """

    def __init__(self, compatibility, rho0: float, steps: int, stiffest: float = STIFFEST):
        pencil = compatibility.pencil
        self.law, self.network = pencil.law, pencil.network
        self.contacts = Contacts(compatibility)
        self.steps, self.stiffest, self.rho0 = steps, stiffest, rho0
        unit = self.network.damping(self.law)
        alpha, tau1 = self.law.exponent, self.law.tau1
        self.power = PowerLaw(alpha, unit * (rho0 / tau1) ** (1.0 - alpha))

    def solve(self, point: Point) -> Steady:
        """The steady oscillation of a packing whose K has no negative modes.

        Raises ConvergenceError where Newton's method fails.
        """
        coarse, fine = Cycle(self.steps // 2, point.omega), Cycle(self.steps, point.omega)
        first = self._equivalent(point)
        velocity = self._typical(first)
        law = self.power.softened(velocity, self.stiffest)
        drive = first.equations.drive
        half = self._nonlinear(coarse, law, drive, velocity, first.waves)
        whole = self._nonlinear(fine, law, drive, velocity, half.waves)
        softer = PowerLaw(law.alpha, law.coefficient, 0.5 * law.softening)
        runs = (first, half, whole)
        return Steady(
            G=whole.G,
            error=abs(whole.G - half.G) + whole.left_under(law) * abs(whole.G),
            harmonics=whole.harmonics,
            work=whole.work,
            balance=whole.dissipation / whole.work - 1.0,
            regularisation=whole.left_under(softer) * abs(whole.G),
            speed=velocity,
            velocity=whole.waves,
            newton=sum(run.newton for run in runs),
            linear=sum(run.linear for run in runs),
        )

    def scales(self, point: Point) -> tuple[float, float]:
        """Rough amplitudes of the strain and of |z|: from springs alone or, where that is less, from dashpots alone."""
        strain, k = point.amplitude, self.network.k
        if not point.stress_controlled:
            return strain, point.omega * strain * self.rho0
        slow = PowerLaw(1.0, SLOW * k / point.omega)
        drive = Drive(True, strain * k * self.contacts.length, 0.0)
        run = self._run(Equations(self.contacts, Cycle(4, point.omega), slow, drive, slow.coefficient), None)
        forced = (strain * k * self.rho0 / self.power.coefficient) ** (1.0 / self.law.exponent)
        return run.strain, min(point.omega * run.strain * self.rho0, forced)

    def destroy(self):
        """Free the vectors made here."""
        self.contacts.destroy()

    def _equivalent(self, point) -> "_Run":
        """Linear damping that dissipates as much at the amplitude BT assume."""
        law, network = self.law, self.network
        L = self.contacts.length
        stress = point.amplitude * network.k
        run = None
        for _ in range(1 if point.stress_controlled or law.exponent == 1.0 else 4):
            ratio = 1.0
            if law.exponent != 1.0:
                within = min(max(stress / network.k, SMALLEST), LARGEST)
                equivalent = EquivalentDamping(law.exponent, within)
                ratio = float(equivalent.frequency(point.omega * law.tau1)) / (point.omega * law.tau1)
            linear = PowerLaw(1.0, network.damping(law) * ratio)
            drive = Drive(point.stress_controlled, stress * L, point.amplitude * L)
            run = self._run(
                Equations(self.contacts, Cycle(4, point.omega), linear, drive, linear.coefficient), None
            )
            if not point.stress_controlled:
                stress = abs(run.G) * point.amplitude
        run.equations = replace(
            run.equations, drive=Drive(point.stress_controlled, stress * L, point.amplitude * L)
        )
        return run

    def _typical(self, run):
        """Root mean square of |z| over contacts and time."""
        network = self.network
        total, count = network.sum(np.array([np.sum(run.z**2), run.z.shape[0] * run.z.shape[1]]))
        return float(np.sqrt(total / count))

    def _nonlinear(self, cycle, law, drive, velocity, waves) -> "_Run":
        unit = law.coefficient * velocity ** (law.alpha - 1.0)
        equations = Equations(self.contacts, cycle, law, drive, unit)
        values = np.zeros(equations.size)
        state = equations.split(values)
        state.v[:] = cycle.samples(waves[:, :-1])
        rate = cycle.samples(waves[:, -1])
        if equations.holds_rate:
            state.rate[:] = rate
        state.f[:] = law.forces(equations.motions(state), FLOOR * velocity)
        return self._run(equations, values)

    def _run(self, equations, values) -> "_Run":
        newton = Newton(equations)
        try:
            start = np.zeros(equations.size) if values is None else values
            size = equations.drive.force * np.sqrt(0.5 * equations.cycle.m)
            tolerance = TOLERANCE if equations.cycle.steps == self.steps else HALF_TOLERANCE
            return _Run(equations, newton.solve(start, tolerance * size), newton)
        finally:
            newton.destroy()


class _Run:
    """One solution and what is read off it."""

    def __init__(self, equations: Equations, values, newton):
        cycle, contacts, drive = equations.cycle, equations.contacts, equations.drive
        network, L = contacts.network, contacts.length
        self.equations, self.state = equations, equations.split(values)
        self.newton, self.linear = newton.iterations, newton.linear_iterations
        self.rate = equations.rate(self.state)
        self.waves = cycle.harmonics(np.column_stack((self.state.v, self.rate)))
        _, row, self.z = equations.balance(self.state, self.rate)
        strain = self.waves[:, -1] / (1j * cycle.frequencies * L)
        if drive.stress_controlled:
            stress = drive.force / L * np.cos(cycle.phase)
            self.G = complex(drive.force / L / strain[0])
            response = strain
        else:
            stress = row / L
            response = cycle.harmonics(stress)
            self.G = complex(response[0] / strain[0])
        self.harmonics = np.append(response[1:] / response[0], np.zeros(HARMONICS))[:HARMONICS]
        weight = 2.0 * np.pi / cycle.omega / cycle.m  # a step and its mirror image in the other half cycle
        self.work = float(stress @ self.rate) / L * weight
        self.dissipation = (
            float(network.sum(np.sum(equations.law.dissipation(self.z)))) / network.area * weight
        )
        self.strain = abs(strain[0])

    def left_under(self, law: PowerLaw) -> float:
        """Power of what is left of the equations under `law` over that of the oscillation, at most: an error of G*."""
        equations, state = self.equations, self.state
        m, contacts = equations.cycle.m, equations.contacts
        left = equations.split(np.empty(equations.size))
        replace(equations, law=law).residual(state, left)
        parts = [left.v, left.rate, left.f / equations.unit, state.v, state.rate, state.f]
        sums = np.sqrt(contacts.network.sum(np.array([np.sum(part**2) for part in parts])))
        power = 0.5 * m * abs(self.G) * (contacts.length * self.strain) ** 2 * equations.cycle.omega
        return float(sums[:3] @ sums[3:]) / power
