"""The steady oscillation of a packing with fixed contacts at one frequency and amplitude, solved for a whole cycle.

There are three solves, each the start of the next: linear damping equivalent in energy (BT 25, 26), the power law with
half of the steps, and with all. The difference of the last two estimates the error of the steps; the residual of the
equations, times the motion, that of the solver.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.laws.damping import Law
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.laws.loads import Load
from jampetsc.oscillation.cycle_equations import ContactMotions, Equations
from jampetsc.oscillation.cycle_solver import solve_cycle
from jampetsc.oscillation.drive import HARMONICS, MIN_FIXED_ALPHA, Drive, OscillationResult
from jampetsc.oscillation.half_cycle import Cycle
from jampetsc.oscillation.oscillation_start import Start
from jampetsc.oscillation.power_law import MAX_SLOPE_RATIO, ContactPowerLaw
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import DistributedNetwork

# residual of the equations over the driving force, with all steps and with half
TOLERANCE, HALF_TOLERANCE = 1e-10, 1e-7
LINEAR_RATIO = 1e-3  # of the typical |z|: below, damping forces of the start are linear
MIN_DAMPING_RATIO = 1e-3  # of k: ωc of dashpots that hardly matter beside the springs
# range of the stress for the equivalent damping, in k or, in three dimensions, k/ρ₀
MIN_EQUIVALENT_STRESS, MAX_EQUIVALENT_STRESS = 1e-30, 1.0


@dataclass(frozen=True, kw_only=True)
class SteadyResult(OscillationResult):
    """The response, the same on all ranks except `velocity`, of which each has its part."""

    speed: float  # root mean square of |z| over contacts and time, of the equivalent linear damping
    # (odd harmonics, unknowns + 1) complex amplitudes of velocities; last, of the strain rate times L
    velocity: np.ndarray


class SteadyOscillation:
    """All oscillations of one packing and law. Collective.

    rho0   mean diameter, the length in the power law
    load   whose amplitude oscillates; simple shear if not given
    """

    def __init__(
        self,
        network: DistributedNetwork,
        law: Law,
        rho0: float,
        steps: int,
        stiffest: float = MAX_SLOPE_RATIO,
        load: Load | None = None,
    ):
        self.law, self.network = law, network
        pencil = assemble(network, law)
        self.contacts = ContactMotions(pencil if load is None else pencil.under(load), rho0)
        self.steps, self.stiffest, self.rho0 = steps, stiffest, rho0
        self.power = ContactPowerLaw.of(self.law, self.network.k, rho0)

    def solve(self, drive: Drive) -> SteadyResult:
        """The steady oscillation of a packing whose K has no negative modes.

        Raises ConvergenceError if Newton's method fails.
        """
        first, stress = self.equivalent(drive)
        squares = np.array([np.sum(first.z**2), first.z.shape[0] * first.z.shape[1]])
        total, count = self.network.sum(squares)
        speed = float(np.sqrt(total / count))
        law = self.power.softened(speed, self.stiffest)
        unit = law.coefficient * speed ** (law.alpha - 1.0)
        half, whole = (
            Equations(self.contacts, Cycle(steps, drive.omega), law, drive, stress, unit)
            for steps in (self.steps // 2, self.steps)
        )
        half = self._run(half, first.waves, speed)
        whole = self._run(whole, half.waves, speed)
        softer = replace(law, softening=0.5 * law.softening)
        return SteadyResult(
            G=whole.G,
            error=abs(whole.G - half.G) + whole.relative_residual(law) * abs(whole.G),
            harmonics=whole.harmonics,
            harmonics_error=abs(whole.harmonics - half.harmonics),
            strain_waveform=whole.strain_waveform,
            stress_waveform=whole.stress_waveform,
            work=whole.work,
            energy_balance=whole.dissipation / whole.work - 1.0,
            regularisation_effect=whole.relative_residual(softer) * abs(whole.G),
            newton_steps=first.newton + half.newton + whole.newton,
            linear_iterations=first.linear + half.linear + whole.linear,
            speed=speed,
            velocity=whole.waves,
        )

    def start(self, drive: Drive) -> Start:
        """The start of an oscillation with moving contacts, on one rank alone.

        At rest for exponents below MIN_FIXED_ALPHA, and if Newton's method fails.
        """
        network, length = self.network, self.contacts.length
        try:
            solution = self.solve(drive) if self.law.exponent >= MIN_FIXED_ALPHA else None
        except ConvergenceError:
            solution = None
        if solution is None:
            still = np.zeros((network.n, self.law.dofs(network.dimension)))
            strain, speed = self._scales(drive)
            modulus = network.k / self.contacts.thickness
            return Start.of(network, drive, still, still, 0.0, 0.0, strain, modulus, speed / drive.omega)
        cycle = Cycle(self.steps, drive.omega)
        waves = solution.velocity * (-1j) ** cycle.orders[:, None]  # a quarter of a cycle before the maximum
        motions = waves / (1j * cycle.frequencies[:, None]), waves / drive.omega
        (moved, gamma), (velocity, rate) = (
            (current[:-1].reshape(network.n, -1), float(current[-1]) / length)
            for current in (motion.sum(axis=0).real for motion in motions)
        )
        strain = drive.amplitude
        if drive.stress_controlled:
            strain *= network.k / abs(solution.G)
        else:
            gamma = 0.0  # exactly
        speed = solution.speed / drive.omega
        return Start.of(network, drive, moved, velocity, gamma, rate, strain, abs(solution.G), speed)

    def _scales(self, drive) -> tuple[float, float]:
        """Estimates of the amplitudes of strain and |z|: for springs alone or, if smaller, for dashpots alone."""
        strain, k = drive.amplitude, self.network.k
        if not drive.stress_controlled:
            return strain, drive.omega * strain * self.rho0
        run = self._linear(drive, MIN_DAMPING_RATIO * k / drive.omega, strain)
        force = strain * k * self.rho0 * self.contacts.thickness
        forced = (force / self.power.coefficient) ** (1.0 / self.law.exponent)
        return run.strain, min(drive.omega * run.strain * self.rho0, forced)

    def equivalent(self, drive: Drive) -> tuple["_Run", float]:
        """(_Run, stress amplitude) with the linear damping that is equivalent in energy (BT 25, 26)."""
        law, k, scaled = self.law, self.network.k, drive.omega * self.law.tau1
        stress = drive.amplitude  # in k
        if not drive.stress_controlled:
            stress /= self.contacts.thickness  # that of a modulus k/H
        for _ in range(1 if drive.stress_controlled or law.exponent == 1.0 else 4):
            force = stress * self.contacts.thickness  # of a contact, in kρ₀
            within = min(max(force, MIN_EQUIVALENT_STRESS), MAX_EQUIVALENT_STRESS)
            ratio = float(EquivalentDamping(law.exponent, within).frequency(scaled)) / scaled
            run = self._linear(drive, self.network.damping(law) * ratio, stress)
            if not drive.stress_controlled:
                stress = abs(run.G) * drive.amplitude / k
        return run, stress * k

    def _linear(self, drive, coefficient, stress) -> "_Run":
        """The _Run with linear damping of this coefficient; stress in k."""
        cycle, law = Cycle(4, drive.omega), ContactPowerLaw(1.0, coefficient)
        return self._run(Equations(self.contacts, cycle, law, drive, stress * self.network.k, coefficient))

    def _run(self, equations, waves=None, speed=None) -> "_Run":
        """Solve, from these harmonics of the velocities, with typical |z| `speed`, or from rest."""
        cycle, values = equations.cycle, np.zeros(equations.size)
        if waves is not None:
            state = equations.split(values)
            state.v[:] = cycle.samples(waves[:, :-1])
            if equations.holds_rate:
                state.rate[:] = cycle.samples(waves[:, -1])
            state.f[:] = equations.law.forces(equations.motions(state), LINEAR_RATIO * speed)
        size = equations.force * np.sqrt(0.5 * cycle.m)
        tolerance = TOLERANCE if cycle.steps == self.steps else HALF_TOLERANCE
        return _Run(equations, *solve_cycle(equations, values, tolerance * size))


class _Run:
    """One solution: G*, harmonics, work and dissipation."""

    def __init__(self, equations: Equations, values, newton: int, linear: int):
        cycle, contacts, drive = equations.cycle, equations.contacts, equations.drive
        network, L, H = contacts.network, contacts.length, contacts.thickness
        self.equations, self.state = equations, equations.split(values)
        self.newton, self.linear = newton, linear
        rate = equations.rate(self.state)
        self.waves = cycle.harmonics(np.column_stack((self.state.v, rate)))
        _, row, self.z = equations.balance(self.state, rate)
        strain = self.waves[:, -1] / (1j * cycle.frequencies * L)
        stress = equations.stress * np.cos(cycle.phase) if drive.stress_controlled else row / (L * H)
        of_stress = cycle.harmonics(stress)
        response = strain if drive.stress_controlled else of_stress
        self.strain_waveform, self.stress_waveform = cycle.wave(strain), cycle.wave(of_stress)
        self.G = complex((equations.stress if drive.stress_controlled else response[0]) / strain[0])
        self.harmonics = np.append(response[1:] / response[0], np.zeros(HARMONICS))[:HARMONICS]
        weight = 2.0 * np.pi / cycle.omega / cycle.m  # a step and its mirror image in the other half cycle
        self.work = float(stress @ rate) / L * weight
        power = network.sum(np.sum(equations.law.dissipation(self.z)))
        self.dissipation = float(power) / network.volume * weight
        self.strain = abs(strain[0])

    def relative_residual(self, law: ContactPowerLaw) -> float:
        """Bound on the power of the residual under `law`, over the power of the oscillation: a relative error of G*."""
        equations, state = self.equations, self.state
        m, contacts = equations.cycle.m, equations.contacts
        left = equations.split(np.empty(equations.size))
        replace(equations, law=law).residual(state, left)
        parts = [left.v, left.rate, left.f / equations.unit, state.v, state.rate, state.f]
        sums = np.sqrt(contacts.network.sum(np.array([np.sum(part**2) for part in parts])))
        volume_strain = contacts.thickness * (contacts.length * self.strain) ** 2  # Vγ²
        power = 0.5 * m * abs(self.G) * volume_strain * equations.cycle.omega
        return float(sums[:3] @ sums[3:]) / power
