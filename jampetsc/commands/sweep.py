"""G*(ω) of a packing or a network."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from jampetsc.commands.probe_files import ProbeResponse
from jampetsc.commands.sweep_files import minimum_notes, notes_of, summary_of, write_moduli
from jampetsc.errors import InputError, about, named
from jampetsc.io.results import note_lines
from jampetsc.laws.damping import MAX_OMEGA, MIN_OMEGA
from jampetsc.laws.equivalent_damping import STRESS_RATIOS, EquivalentDamping
from jampetsc.laws.loads import DEFAULT, STRESS_MEASURE, TENSOR, LoadChoice
from jampetsc.laws.masses import BY_NUMBER, BY_VOLUME, Masses
from jampetsc.options.job import NETWORKS, ONE_PACKING, TaskInputs
from jampetsc.options.parameters import optional_parameter, parameter
from jampetsc.options.physics_options import NetworkJob, load_parameter
from jampetsc.options.values import FREQUENCIES, POSITIVE, STRESS_UNIT, TIME_UNIT, Numbers, check_frequencies
from jampetsc.packing.units import is_within
from jampetsc.petsc import builds, session
from jampetsc.progress import note, warn

SAME_FREQUENCY = 1e-9  # a frequency this close to one of the fields, relatively, counts as the same
OMEGA = "1e-10:1e4:141"
POWER_LAW = (
    "power-law damping: viscous force of a contact ∝ |Δu̇|^A, by an equivalent linear damping (approximate)"
)
INERTIA = "inertia"
of_power_law = partial(optional_parameter, group=POWER_LAW)


@dataclass(frozen=True, eq=False)
class Sweep(NetworkJob):
    """Complex modulus G*(ω) of a packing or a network under shear or another load.

    A modulus is the second derivative of the energy per volume along F = 1 + εE, E the displacement gradient of the
    load. With load tensor all elastic constants C*(ω) of the symmetric loads xx, yy, (zz, yz, xz,) xy, whose shears are
    E = ½(x̂ŷ + ŷx̂), from the same factorisations, and the bulk modulus −V dp/dV and the shear modulus averaged over all
    directions.

    Each value comes with a bound on its error (BT eqs. 10–15; docs/theory/linear_response.md). Method `rational` gets
    the whole spectrum from a few real factorisations, `direct` solves K + iωB at every frequency.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING, NETWORKS)
    EPILOG: ClassVar = """examples:
  jampetsc sweep p.h5 --beta 0.1 --omega 1e-6:1e2:81 --fields 1e-3,1 --out sweep.h5
  jampetsc sweep p.h5 --load tensor --out C-sweep.h5      # all elastic constants
  jampetsc sweep net.h5 --law stokes --eta-f 0 --omega 1e-4:1e2:31 --out net-sweep.h5     # a network of springs
  jampetsc sweep p.h5 --mass 1 --omega 1e-4:1e2:61 --out massive.h5       # with inertia
  jampetsc sweep p.h5 --method direct --omega 1e-3,1 --out direct.h5 -options_file jampetsc:iterative

PETSc options: -shift_… and -inertia_… for the factorisations of the rational method, -freq_… for the solver of
--method direct. `jampetsc examples` copies the options files that come with the program."""

    SOLVERS: ClassVar = ("shift_", "freq_", "inertia_")

    omega: Numbers = parameter(OMEGA, "frequencies ω", value_type=FREQUENCIES, unit=TIME_UNIT)
    method: str = parameter(
        "rational",
        "rational: the whole spectrum from a few real factorisations; direct: one complex solve per frequency",
        choices=("rational", "direct"),
    )
    load: LoadChoice = load_parameter("all elastic constants C*(ω)", takes_forces=True)
    accuracy: float = parameter(
        1e-6, "relative error allowed in G' and in G'' each, of forces in χ' and in χ''", low=1e-12, high=0.1
    )
    parallel: str | None = optional_parameter(
        "rational method on several ranks: each factorises a shift of its own, or all share each factorisation "
        "(default auto: by the number of ranks and unknowns)",
        choices=("auto", "shifts", "matrix"),
        in_identity=False,
    )
    fields: Numbers | None = optional_parameter(
        "also displacement fields at these frequencies", value_type=FREQUENCIES
    )
    alpha: float | None = of_power_law(
        "exponent of the damping force (1 is linear)", low=0.05, high=5.0, metavar="A"
    )
    stress: float | None = of_power_law(
        "amplitude of the shear stress, with alpha",
        above=0.0,
        high=POSITIVE[1],
        unit=STRESS_UNIT,
        metavar="S",
    )

    mass: float | None = optional_parameter(
        "mass of every particle, in the unit of k τ₁²; with it inertia adds −ω²M to K + iωB (default: none)",
        above=0.0,
        high=POSITIVE[1],
        group=INERTIA,
        metavar="M",
    )
    mass_by: str | None = optional_parameter(
        "masses: equal (number), or by the volume of a particle, mass then being that of one of the mean diameter "
        "(default number)",
        choices=(BY_NUMBER, BY_VOLUME),
        group=INERTIA,
    )

    def check(self):
        self.law.require_dissipation()
        check_frequencies(self.omega, self.law.tau1)
        if self.fields is not None:
            check_frequencies(self.fields, self.law.tau1)
        if self.mass_by is not None and self.mass is None:
            raise InputError(f"{named('mass_by')} {self.mass_by}: masses of no size. Give {named('mass')}.")
        if self.mass is not None and self.alpha is not None:
            raise InputError(
                f"{named('mass')} {self.mass:g}: not with power-law damping. Leave {named('mass')} or "
                f"{named('alpha')} out."
            )
        if self.mass is not None and self.parallel == "shifts":
            raise InputError(
                f"{named('parallel')} shifts: not with {named('mass')}, where ranks share factorisations. Leave it out."
            )
        if self.parallel and self.method == "direct":
            raise InputError(
                f"{named('parallel')} {self.parallel}: an option of {named('method')} rational; with direct all ranks "
                "share each solve. Leave it out."
            )
        if self.fields is not None and self.load.is_tensor:
            raise InputError(
                f"{named('fields')}: not stored with {named('load')} {TENSOR}. Give a single {named('load')}, or leave "
                f"{named('fields')} out."
            )
        if self.fields is not None and self.load.probe:
            raise InputError(
                f"{named('fields')}: not stored with {named('load')} {self.load}, which is forces. Leave "
                f"{named('fields')} out."
            )
        if self.alpha is not None and self.load != DEFAULT:
            raise InputError(
                f"{named('load')} {self.load}: power-law damping is for simple shear xy. Leave {named('alpha')} out."
            )
        if self.alpha is None and self.stress is not None:
            raise InputError(
                f"{named('stress')} {self.stress:g}: an option of power-law damping. Give {named('alpha')}."
            )
        if self.alpha is not None and self.stress is None:
            raise InputError(
                f"{named('alpha')} {self.alpha:g}: power-law damping depends on the amplitude. Give "
                f"{named('stress')}."
            )
        if self.alpha is not None and not self.law.is_of_contacts:
            raise InputError(
                f"{named('alpha')}: power-law damping is of contacts alone, and {self.law} has a fluid. Leave it out, "
                f"or give another {named('law')}."
            )

    def damping(self, unit: float) -> EquivalentDamping | None:
        """Power-law damping of a packing whose stress of order one is `unit`, None where damping is linear."""
        if self.alpha is None:
            return None
        low, high = (end * unit for end in STRESS_RATIOS)
        if not is_within(self.stress, low, high):
            raise InputError(f"{named('stress')} {self.stress:g}: must lie between {low:g} and {high:g}")
        return EquivalentDamping(self.alpha, min(max(self.stress / unit, STRESS_RATIOS[0]), STRESS_RATIOS[1]))

    @property
    def masses(self) -> Masses | None:
        """Masses of the particles, None where they have none."""
        return None if self.mass is None else Masses(self.mass, self.mass_by or BY_NUMBER)

    @property
    def elastic(self) -> dict:
        """What K has beside the stiffness of contacts, and masses, for `build_network`."""
        return super().elastic | ({} if self.mass is None else {"masses": self.masses})

    @property
    def scalar(self):
        """The direct method prefers complex scalars; real ones need twice the memory."""
        if self.method == "rational":
            return "real"
        return "complex" if builds.can_choose("complex") else "any"

    def frequencies(self, damping: EquivalentDamping | None = None) -> "SweepFrequencies":
        """The frequencies to solve at, with the ones of fields. Raises InputError where they cannot be solved."""
        fields = np.zeros(0) if self.fields is None else self.fields
        is_new = ~np.isclose(self.omega[:, None], fields, rtol=SAME_FREQUENCY, atol=0.0).any(axis=1)
        experiment = np.union1d(self.omega[is_new], fields)
        tau1 = self.law.tau1
        solved = experiment if damping is None else damping.frequency(experiment * tau1) / tau1
        beyond = (solved * tau1 < MIN_OMEGA) | (solved * tau1 > MAX_OMEGA)
        beyond &= damping is not None  # `check` refuses others, at the ends to rounding
        if beyond.any():
            raise InputError(
                f"{named('alpha')} {damping.alpha:g} {named('stress')} {self.stress:g}: omega = "
                f"{experiment[beyond][0]:g} is equivalent to {solved[beyond][0]:g} under linear damping, outside "
                f"{MIN_OMEGA / tau1:g} to {MAX_OMEGA / tau1:g}. Narrow {named('omega')}."
            )
        return SweepFrequencies(experiment, solved, solved[np.searchsorted(experiment, fields)])

    @property
    def parameters(self) -> dict:
        """Parameters of the law as a file records them, with masses, exponent and stress of power-law damping."""
        parameters = self.physics.parameters
        if self.masses is not None:
            parameters |= {"mass": self.masses.mass, "mass_by": self.masses.by}
        return (
            parameters if self.alpha is None else {**parameters, "alpha": self.alpha, "stress": self.stress}
        )

    def work(self, to):
        from jampetsc.commands.packing_network import read_network
        from jampetsc.response.minimum_check import check_minimum
        from jampetsc.response.probe_loads import probe_loads

        source = read_network(self.packing, self.elastic, to)
        damping = self.damping(source.stress_scale)
        frequencies = self.frequencies(damping)
        with about(source.name):
            minimum = check_minimum(source.network, source.proved, count=self.method != "direct")
        method = "direct" if minimum.negative_modes else self.method
        notes = minimum_notes(minimum)
        for line in notes if method != self.method and session.current().rank == 0 else ():
            warn(f"{source.name}: {line}")
        # other PETSc options may decide otherwise about the method: direct steps, not ordered, are no rational ones
        checkpoint = to.checkpoint(session.current().comm, ordered=method == "rational")
        with about(source.name):
            loads, probe = self.load.of(source.source.dimension), self.load.probe
            if probe:
                of_probe = probe_loads(probe, source.source, source.network)
            sweep = self._solve(
                source, of_probe.loads if probe else loads, frequencies, method, minimum, checkpoint
            )
        response = ProbeResponse.of(probe, of_probe, sweep, source.network.volume) if probe else None
        if response is None:
            notes += notes_of(self, source, frequencies.of_experiment(sweep.omega), sweep, damping)
        with to.writer(self.FORMAT, session.current().comm) as writer:
            writer.dataset("omega", frequencies.of_experiment(sweep.omega))
            if response is None:
                write_moduli(writer, frequencies, sweep, source, damping is not None)
            else:
                response.write(writer)
            writer.attributes(
                **source.record(self.parameters, notes),
                stress_ratio=None if damping is None else damping.stress,
                load=self.load,
                stress_measure=None if response else STRESS_MEASURE,
                method=method,
                accuracy=self.accuracy,
                positive_semidefinite=minimum.description,
                unknowns=source.network.n * source.network.dofs(self.law),
                factorisations=sweep.factorisations,
                vectors=sweep.vectors,
                direct_frequencies=sweep.direct if method == "rational" and self.mass is not None else None,
                failed_omega=frequencies.of_experiment(sorted(sweep.failures)) if sweep.failures else None,
            )
        to.raise_failures(sweep.failures, len(frequencies.solved), "frequencies")
        checkpoint.remove()
        summary = summary_of(self, to, source.network, frequencies, sweep, minimum.certified, response)
        units = source.units_line(self.law.tau1)
        return "\n".join([summary, units, *note_lines([*source.notes, *notes])])

    def _solve(self, source, loads, frequencies, method, minimum, checkpoint):
        """The `ModulusSweep`, continued from the finished steps of a checkpoint. Collective."""
        from jampetsc.response.assembly import assemble
        from jampetsc.response.direct_sweep import sweep_directly
        from jampetsc.response.massive_sweep import sweep_with_inertia
        from jampetsc.response.modulus_sweep import sweep_rationally

        with session.current().stage("assembly"):
            pencil = assemble(source.network, self.law)
        settings = {
            "omega": frequencies.solved,
            "accuracy": self.accuracy,
            "field_omega": frequencies.of_fields,
            "loads": loads,
        }
        if checkpoint.done and session.current().rank == 0:
            what = "shifts" if method == "rational" else "frequencies"
            note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} {what} are finished")
        settings["resume"] = {
            step: (record, checkpoint.fields(step)) for step, record in checkpoint.done.items()
        }
        settings["save"] = checkpoint.save
        if method == "direct":
            is_positive = minimum.negative_modes == 0 and self.mass is None
            return sweep_directly(pencil, **settings, positive_semidefinite=is_positive)
        if self.mass is not None:
            return sweep_with_inertia(pencil, **settings)
        return sweep_rationally(pencil, **settings, parallel=self.parallel or "auto")


@dataclass(frozen=True, eq=False)
class SweepFrequencies:
    """Frequencies of a sweep in 1/time. Under power-law damping the linear law is solved at other frequencies."""

    experiment: np.ndarray  # (M,) increasing, of the experiment
    solved: np.ndarray  # (M,) the equivalent ones of the linear law
    of_fields: np.ndarray  # (F,) of `solved`, at which fields are stored

    def of_experiment(self, omega):
        """Frequencies of the experiment for some of `solved`, in their shape."""
        return self.experiment[np.searchsorted(self.solved, omega)]
