"""Steady oscillations of a packing with power-law damping, without the equivalent linear damping."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jampetsc.errors import InputError, about, named
from jampetsc.io.results import note_lines
from jampetsc.laws.damping import MAX_OMEGA, MIN_OMEGA, Physics
from jampetsc.laws.loads import DEFAULT, STRESS_MEASURE, TENSOR, LoadChoice
from jampetsc.options.job import ONE_PACKING, TaskInputs
from jampetsc.options.parameters import ValueType, optional_parameter, parameter
from jampetsc.options.physics_options import PackingJob, load_parameter
from jampetsc.options.values import POSITIVE, STRESS_UNIT, TIME_UNIT, Numbers, number_list
from jampetsc.oscillation.drive import MIN_FIXED_ALPHA
from jampetsc.packing.units import is_within

OMEGA_RANGE = 1e-300, 1e300  # of ω and ωτ₁
MIN_AMPLITUDE, MAX_AMPLITUDE = 1e-30, 1.0  # of strains, and of stresses over `PackingNetwork.stress_scale`
MIN_MOVING_AMPLITUDE = 1e-9  # smaller strains or stresses give forces of few correct digits
MIN_CYCLES, MAX_CYCLES = 3, 100_000


def _cycles(value):
    """A number of cycles; None: until they repeat."""
    try:
        number = None if value == "auto" else int(str(value))
    except ValueError:
        number = 0
    if number is not None and not MIN_CYCLES <= number <= MAX_CYCLES:
        raise ValueError(f"must be auto or a number from {MIN_CYCLES} to {MAX_CYCLES}")
    return number


@dataclass(frozen=True, eq=False)
class Oscillate(PackingJob):
    """G*(ω), harmonics and work of a packing with power-law damping.

    Steady oscillation of a packing whose contacts are damped by a force ∝ |Δv|^alpha (BT eq. 9): G*(ω) of the first
    harmonic, third and fifth harmonic, work per cycle, with an estimate of the error. With fixed contacts the
    equations are solved for a whole cycle at once, for alpha of at least 0.45; with moving contacts, which open and
    close, cycles are integrated in time until G* repeats or, above yielding, its mean over cycles is known; each
    amplitude begins where the next smaller one ended. Moving contacts are sheared, fixed ones take any single load.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING)
    EPILOG: ClassVar = """examples:
  jampetsc oscillate p1e-3.h5 --out half.h5 --alpha 0.5 --omega 1e-9:1e-5:9 --stress 1e-6,1e-5
  jampetsc oscillate p1e-3.h5 --out strain.h5 --alpha 0.6667 --omega 1e-4 --strain 1e-6
  mpirun -n 2 jampetsc oscillate p1e-3.h5 --out fine.h5 --alpha 0.5 --omega 1e-7 --stress 1e-5 --steps 256
  jampetsc oscillate p1e-3.h5 --out soft.h5 --contacts moving --omega 1e-4 --strain 1e-6,1e-4,1e-3
  jampetsc oscillate p1e-3.h5 --out open.h5 --contacts moving --alpha 0.5 --omega 1e-6 --stress 1e-5,1e-4

PETSc options: -osc_snes_… and -osc_ksp_… for Newton's method and its linear solver, -osc_factor_… for the
factorisations of its preconditioner, -shift_… for the proof that the packing is a minimum.
A killed run continues when the same command is given again."""

    SOLVERS: ClassVar = ("osc_", "osc_factor_", "shift_", "inertia_")

    omega: Numbers = parameter(
        help="frequencies ω",
        value_type=number_list(*OMEGA_RANGE, "LOW:HIGH:COUNT|LIST"),
        unit=TIME_UNIT,
    )
    stress: Numbers | None = optional_parameter(
        "amplitudes of an imposed stress, the force per volume on the amplitude of the load",
        value_type=number_list(*POSITIVE),
        unit=STRESS_UNIT,
    )
    strain: Numbers | None = optional_parameter(
        "amplitudes of an imposed strain", value_type=number_list(MIN_AMPLITUDE, MAX_AMPLITUDE)
    )
    alpha: float = parameter(
        1.0,
        "exponent of the damping force, from 0 (dry friction) to 2; 1 is linear",
        above=0.0,
        high=2.0,
        metavar="A",
    )
    contacts: str = parameter(
        "fixed",
        "contacts: fixed, as in the packing, or moving, which open and close",
        choices=("fixed", "moving"),
    )
    cycles: int | None = optional_parameter(
        "number of cycles with moving contacts, computed with half the steps and then with all; auto (default): "
        "until G* repeats from cycle to cycle or, where cycles fluctuate, its mean is known to 5 %",
        value_type=ValueType(_cycles, metavar="auto|N", python='integer or "auto"'),
    )
    load: LoadChoice = load_parameter()
    steps: int = parameter(64, "time steps per cycle, a multiple of 8", low=16, high=4096, metavar="N")

    def check(self):
        if (self.stress is None) == (self.strain is None):
            state = "missing" if self.stress is None else "both given"
            raise InputError(f"{named('stress')}, {named('strain')}: {state}. Give one of them.")
        if self.steps % 8:
            raise InputError(f"{named('steps')} {self.steps}: must be a multiple of 8")
        if not self.law.is_of_contacts:
            reason = "the fluid dissipates as well" if self.law.damps_contacts else "no contact dissipates"
            raise InputError(
                f"{named('law')} {self.law.family or self.law}: not supported, {reason}. Give a law of contacts, or "
                "use sweep, which takes any linear law."
            )
        if self.tangential_stiffness:
            raise InputError(
                f"{named('tangential_stiffness')} {self.tangential_stiffness:g}: not supported by oscillate. Leave it "
                "out, or use sweep."
            )
        if self.load.is_tensor:
            raise InputError(
                f"{named('load')} {TENSOR}: not supported, oscillations are not linear. Give a single {named('load')}."
            )
        self._check_contacts()
        self._check_frequencies()
        if self.strain is not None:
            self._check_amplitudes(1.0)

    def _check_amplitudes(self, unit):
        """Refuse amplitudes out of range in this unit."""
        moving = self.contacts == "moving"
        low, high = (MIN_MOVING_AMPLITUDE if moving else MIN_AMPLITUDE) * unit, MAX_AMPLITUDE * unit
        for end in self.amplitude[[0, -1]]:
            if not is_within(end, low, high):
                raise InputError(
                    f"{named(self.control)} {end:g}: must lie between {low:g} and {high:g}"
                    + f" with {named('contacts')} moving" * moving
                )

    def _check_contacts(self):
        if self.contacts == "fixed":
            if self.alpha < MIN_FIXED_ALPHA:
                raise InputError(
                    f"{named('alpha')} {self.alpha:g}: must be at least {MIN_FIXED_ALPHA:g} with fixed contacts. Give "
                    f"{named('contacts')} moving, or a larger {named('alpha')}."
                )
            if self.cycles is not None:
                raise InputError(
                    f"{named('cycles')} {self.cycles}: an option of {named('contacts')} moving. Leave it out for fixed "
                    "contacts, whose steady cycle is solved directly."
                )
            return
        if self.load != DEFAULT:
            raise InputError(
                f"{named('load')} {self.load}: not supported with {named('contacts')} moving, whose cell is sheared. "
                f"Leave it out, or give {named('contacts')} fixed."
            )
        if not self.prestress:
            raise InputError(
                f"{named('prestress')}: not supported with {named('contacts')} moving. Leave out one of them."
            )

    def _check_frequencies(self):
        """Refuse frequencies out of range: a power law depends on ω^α, which has the range of ω for linear damping."""
        (low, high), widened, tau1 = OMEGA_RANGE, 1.0 / min(self.alpha, 1.0), self.law.tau1
        least = max(low, MIN_OMEGA**widened)
        most = MAX_OMEGA**widened if widened * math.log(MAX_OMEGA) < math.log(high) else high
        for end in self.omega[[0, -1]]:
            if not least <= end <= most:
                raise InputError(f"{named('omega')} {end:g}: must lie between {least:g} and {most:g}")
            if not math.log(low) <= math.log(end) + math.log(tau1) <= math.log(high):
                raise InputError(
                    f"{named('omega')} {end:g} {named('tau1')} {tau1:g}: their product must lie between {low:g} and "
                    f"{high:g}"
                )

    @property
    def physics(self) -> Physics:
        """The law with its exponent."""
        return Physics(replace(self.law, exponent=self.alpha), self.prestress)

    @property
    def control(self) -> str:
        """The imposed quantity, "stress" or "strain"."""
        return "strain" if self.stress is None else "stress"

    @property
    def amplitude(self):
        """Amplitudes of the imposed quantity, (A,) increasing."""
        return getattr(self, self.control)

    @property
    def parameters(self) -> dict:
        """Parameters of the law as a file records them, with its exponent."""
        return {**self.physics.parameters, "alpha": self.alpha}

    def work(self, to):
        from jampetsc.commands.packing_network import read_network
        from jampetsc.io.packing_file import read_packing
        from jampetsc.oscillation.amplitude_sweep import require_stability, sweep_amplitudes
        from jampetsc.petsc.session import current

        session = current()
        source = read_network(self.packing, self.elastic, to, read_packing)
        if self.stress is not None:
            self._check_amplitudes(source.stress_scale)
        with session.stage("assembly"), about(source.name):
            (load,) = self.load.of(source.network.dimension)
            require_stability(source.network, self.control, load)
        checkpoint = to.checkpoint(session.comm)
        sweep = sweep_amplitudes(
            source.source,
            source.network,
            self.physics.law,
            omega=self.omega,
            amplitudes=self.amplitude,
            control=self.control,
            contacts=self.contacts,
            steps=self.steps,
            cycles=self.cycles,
            resume=checkpoint.done,
            save=checkpoint.save,
            load=load,
        )
        notes = _notes(self, sweep.arrays)
        with session.stage("output"), to.writer(self.FORMAT, session.comm) as writer:
            writer.dataset("omega", self.omega)
            writer.dataset("amplitude", self.amplitude)
            for name, values in sweep.arrays.items():
                writer.dataset(name, values)
            writer.attributes(
                **source.record(self.parameters, notes),
                load=self.load,
                stress_measure=STRESS_MEASURE,
                control=self.control,
                contacts=self.contacts,
                steps=self.steps,
                solver=sweep.solver,
                regularisation=sweep.regularisation,
            )
        to.raise_failures(sweep.failures, sweep.arrays["G"].size, "points")
        checkpoint.remove()
        return "\n".join(
            [
                _summary(self, to, sweep.arrays),
                source.units_line(self.law.tau1),
                *note_lines([*source.notes, *notes]),
            ]
        )


def _notes(job, arrays) -> list[str]:
    """A note on points of moving contacts whose errors are large."""
    from jampetsc.oscillation.repeated_cycles import MEAN_TOLERANCE, is_accurate

    if "G_error" not in arrays:
        return []
    uncertain = np.isfinite(arrays["G"]) & ~is_accurate(arrays["G"], arrays["G_error"])
    amplitudes = ", ".join(f"{amplitude:.3g}" for amplitude in job.amplitude[uncertain.any(axis=1)])
    if not amplitudes:
        return []
    return [
        f"uncertain: errors of G' or G'' exceed {100 * MEAN_TOLERANCE:g} % at {job.control} {amplitudes}. Give more "
        "steps or cycles"
    ]


def _summary(job, to, arrays) -> str:
    """The summary."""
    G, error = arrays["G"], arrays["error"]
    of_load = "" if job.load == DEFAULT else f", load {job.load}"
    lines = [
        f"{to}: {job.physics}{of_load}, alpha = {job.alpha:g}, {G.size} oscillations, estimated to "
        f"{(error / abs(G)).max():.1e} of |G*|, energy balanced to {abs(arrays['energy_balance']).max():.0e}"
    ]
    for a, amplitude in enumerate(job.amplitude):
        for m in sorted({0, len(job.omega) - 1}):
            third = abs(arrays["harmonics"][a, m, 0])
            lines.append(
                f"  {job.control} {amplitude:.3g}, omega {job.omega[m]:.3g}: G' = {G[a, m].real:.6g}, "
                f"G'' = {G[a, m].imag:.6g}, third harmonic {100 * third:.2g} %{_cycles_text(arrays, a, m)}"
            )
    return "\n".join(lines)


def _cycles_text(arrays, a, m) -> str:
    """Mean and errors of a point of moving contacts whose cycles do not repeat, in words; else empty."""
    if "repeats" not in arrays or arrays["repeats"][a, m] or not np.isfinite(arrays["G"][a, m]):
        return ""
    G, error, count = arrays["G"][a, m], arrays["G_error"][a, m], arrays["averaged_cycles"][a, m]
    mean = f"mean of {count} cycles that fluctuate" if count > 1 else "the last cycle, still changing"
    shares = [100 * error.real / abs(G.real), 100 * error.imag / abs(G.imag)]
    return f"; {mean}, errors {shares[0]:.2g} and {shares[1]:.2g} %"
