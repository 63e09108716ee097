"""Stress relaxation after step strains of any size: contacts open and close, disks without inertia."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jampetsc.errors import InputError, about, named
from jampetsc.io.results import note_lines
from jampetsc.laws.loads import DEFAULT, STRESS_MEASURE, LoadChoice
from jampetsc.options.job import ONE_PACKING, TaskInputs
from jampetsc.options.parameters import optional_parameter, parameter
from jampetsc.options.physics_options import PackingJob, check_finite_strain, load_parameter
from jampetsc.options.values import POSITIVE, Numbers, number_list

MIN_STRAIN, MAX_STRAIN = 1e-9, 1.0  # smaller strains give forces of few correct digits
MIN_TIME, MAX_TIME = 1e-6, 1e12  # over τ₁
FIRST_TIME, LAST_TIME = 1e-3, 1e9  # over τ₁, of the default, which ends where all are at rest
TIMES_PER_DECADE = 10


@dataclass(frozen=True, eq=False)
class Relax(PackingJob):
    """G(t) after step strains of any size.

    The cell of a packing at rest is strained at t = 0 and held. The disks relax without inertia, contacts open and
    close, until forces balance again: G(t) = (σ(t) − σ(0⁻))/γ with an estimate of its error, the energy stored and
    dissipated, and the contacts that changed. For γ → 0 it is the G(t) of spectrum. The step is the limit of a fast
    one: dashpots and fluid alone decide where it leaves the disks, along with the strain where only a fluid damps
    them. Masses are not supported.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING)
    EPILOG: ClassVar = """examples:
  jampetsc relax p1e-3.h5 --strain 1e-6,1e-3,1e-2 --out relax.h5
  jampetsc relax p1e-3.h5 --strain 1e-4 --law stokes --times 1e-2:1e4:31 --out drag.h5
  jampetsc relax p1e-3.h5 --strain 1e-3 --load compression --beta 0 --out compressed.h5
  mpirun -n 2 jampetsc relax p1e-3.h5 --strain 1e-5:1e-2:4 --accuracy 1e-4 --out accurate.h5

PETSc options: -osc_factor_… for the factorisations of time steps, -shift_… for the proof that the packing and the
states at the end are minima, -inertia_… for the count of their negative modes.
A killed run continues when the same command is given again."""

    SOLVERS: ClassVar = ("osc_factor_", "shift_", "inertia_")

    strain: Numbers = parameter(
        help="step strains γ, the cell becomes 1 + γE with the load E",
        value_type=number_list(MIN_STRAIN, MAX_STRAIN),
    )
    times: Numbers | None = optional_parameter(
        "times t at which G is stored; the step takes a hundredth of the first. Default: "
        f"{TIMES_PER_DECADE} per decade from {FIRST_TIME:g} τ₁ until forces balance",
        value_type=number_list(*POSITIVE, "LOW:HIGH:COUNT|LIST"),
        unit="the time that tau1 is in",
    )
    accuracy: float = parameter(
        1e-3, "relative error of the energy balance of a time step, about that of G(t)", low=1e-8, high=0.1
    )
    load: LoadChoice = load_parameter()

    def check(self):
        if not self.prestress or self.tangential_stiffness:
            option = "tangential_stiffness" if self.prestress else "prestress"
            raise InputError(
                f"{named(option)}: not supported by relax, whose contacts move. Leave it out, or use sweep and "
                "spectrum."
            )
        if self.law.exponent != 1.0:
            raise InputError(
                f"exponent {self.law.exponent:g} of {self.law}: not supported by relax. Give a linear law."
            )
        check_finite_strain(self.load, self.strain[-1], "relax")
        if self.times is not None:
            for end in self.times[[0, -1]]:
                if not MIN_TIME * self.law.tau1 <= end <= MAX_TIME * self.law.tau1:
                    raise InputError(
                        f"{named('times')} {end:g}: must lie between {MIN_TIME * self.law.tau1:g} and "
                        f"{MAX_TIME * self.law.tau1:g}, {MIN_TIME:g} and {MAX_TIME:g} {named('tau1')}"
                    )

    @property
    def measured_times(self):
        """Times at which G is stored, (T,)."""
        if self.times is not None:
            return self.times
        count = round(TIMES_PER_DECADE * np.log10(LAST_TIME / FIRST_TIME))
        return FIRST_TIME * self.law.tau1 * 10.0 ** (np.arange(count + 1) / TIMES_PER_DECADE)

    def work(self, to):
        from jampetsc.commands.packing_network import read_network
        from jampetsc.io.packing_file import read_packing
        from jampetsc.oscillation.amplitude_sweep import require_stability
        from jampetsc.oscillation.strain_sweep import sweep_strains
        from jampetsc.petsc.session import current

        session = current()
        source = read_network(self.packing, self.elastic, to, read_packing)
        with session.stage("assembly"), about(source.name):
            (load,) = self.load.of(source.network.dimension)
            require_stability(source.network, "strain", load)
        checkpoint, times = to.checkpoint(session.comm), self.measured_times
        sweep = sweep_strains(
            source.source,
            source.network,
            self.law,
            load,
            strains=self.strain,
            times=times,
            accuracy=self.accuracy,
            resume=checkpoint.done,
            save=checkpoint.save,
        )
        arrays = dict(sweep.arrays)
        if self.times is None:
            times = times[: _count_until_rest(times, arrays)]
            arrays = {name: a[:, : len(times)] if a.ndim > 1 else a for name, a in arrays.items()}
        notes = _notes(self.strain, times, arrays)
        rest_stress = float(np.nanmax(arrays.pop("rest_stress")))
        with session.stage("output"), to.writer(self.FORMAT, session.comm) as writer:
            writer.dataset("time", times)
            writer.dataset("strain", self.strain)
            for name, values in arrays.items():
                writer.dataset(name, values)
            writer.attributes(
                **source.record(self.physics.parameters, notes),
                load=self.load,
                stress_measure=STRESS_MEASURE,
                accuracy=self.accuracy,
                rest_stress=rest_stress,
            )
        to.raise_failures(sweep.failures, len(self.strain), "strains")
        checkpoint.remove()
        return "\n".join(
            [
                _summary(self, to, times, arrays),
                source.units_line(self.law.tau1),
                *note_lines([*source.notes, *notes]),
            ]
        )


def _count_until_rest(times, arrays) -> int:
    """Number of times until all relaxations are at rest; of all times, where one is not."""
    relaxed = arrays["relaxed_time"][np.isfinite(arrays["initial_G"])]
    return len(times) if np.isnan(relaxed).any() else int(np.searchsorted(times, relaxed.max())) + 1


def _notes(strains, times, arrays) -> list[str]:
    """Notes on relaxations without an end, and on ends that are no minima."""
    solved, notes = np.isfinite(arrays["initial_G"]), []
    moving = strains[solved & np.isnan(arrays["relaxed_time"])]
    if len(moving):
        notes.append(
            f"not at rest: at t = {times[-1]:.3g} forces are not balanced for {_range(moving)}. Give later times"
        )
    saddles = strains[solved & (arrays["negative_modes"] > 0)]
    if len(saddles):
        notes.append(f"saddles: negative modes at the end for {_range(saddles)}. Lower the accuracy")
    return notes


def _range(strains) -> str:
    """Strains (S,), increasing, in words."""
    first, last = strains[[0, -1]]
    return (
        f"strain {first:.3g}"
        if len(strains) == 1
        else f"{len(strains)} strains from {first:.3g} to {last:.3g}"
    )


def _summary(job, to, times, arrays) -> str:
    """The summary."""
    G, error = arrays["G"], arrays["error"]
    of_load = "" if job.load == DEFAULT else f", load {job.load}"
    solved = np.isfinite(arrays["initial_G"])
    count = int(solved.sum())
    lost = arrays["initial_energy"][:, None] - arrays["energy"] - arrays["dissipated"]
    stored = 0.5 * np.abs(arrays["initial_G"]) * job.strain**2
    balance = np.nanmax(np.abs(lost) / stored[:, None])
    lines = [
        f"{to}: {job.physics}{of_load}, {count} step strain{'s' * (count > 1)}, t = {times[0]:.3g} to {times[-1]:.3g}, "
        f"G(t) estimated to {np.nanmax(error / np.abs(arrays['initial_G'])[:, None]):.1e} of G(0+), energy balanced to "
        f"{balance:.0e}"
    ]
    for s in np.flatnonzero(solved)[[0, -1]] if solved.sum() > 1 else np.flatnonzero(solved):
        rest = arrays["relaxed_time"][s]
        end = f"at rest from t = {rest:.3g}" if np.isfinite(rest) else "still moving"
        lines.append(
            f"  strain {job.strain[s]:.3g}: G(0+) = {arrays['initial_G'][s]:.6g}, G = {G[s, -1]:.6g} {end}, "
            f"contacts opened {arrays['contacts_opened'][s, -1]}, closed {arrays['contacts_closed'][s, -1]}"
        )
    return "\n".join(lines)
