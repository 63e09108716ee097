"""G*(ω) of a packing."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from jampetsc.analysis.statistics import relative_bound
from jampetsc.errors import InputError, named
from jampetsc.io.results import note_lines
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.options.law_options import PackingJob
from jampetsc.options.parameters import optional_parameter, parameter
from jampetsc.options.task_inputs import ONE_PACKING, TaskInputs
from jampetsc.options.values import FREQUENCIES, Numbers
from jampetsc.petsc import builds, session

OMEGA = "1e-10:1e4:141"
POWER_LAW = (
    "power-law damping: viscous force of a contact ∝ |Δu̇|^A, by an equivalent linear damping (approximate)"
)
of_power_law = partial(optional_parameter, group=POWER_LAW)


@dataclass(frozen=True, eq=False)
class Sweep(PackingJob):
    """Complex modulus G*(ω) of a packing under oscillatory shear.

    Each value comes with a bound on its error (BT eqs. 10–15; docs/theory/linear_response.md). Method `rational` gets
    the whole spectrum from a few real factorisations, `direct` solves K + iωB at every frequency.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING)
    EPILOG: ClassVar = """examples:
  jampetsc sweep p.h5 --beta 0.1 --omega 1e-6:1e2:81 --fields 1e-3,1 --out sweep.h5
  jampetsc sweep p.h5 --method direct --omega 1e-3,1 --out direct.h5 -options_file jampetsc:iterative

PETSc options: -shift_… and -inertia_… for the factorisations of the rational method, -freq_… for the solver of
--method direct. `jampetsc examples` copies the options files that come with the program."""

    SOLVERS: ClassVar = ("shift_", "freq_", "inertia_")

    omega: Numbers = parameter(OMEGA, "frequencies ω", value_type=FREQUENCIES, unit="1/τ₁ (with τ₁ = 1)")
    method: str = parameter(
        "rational",
        "rational: the whole spectrum from a few real factorisations; direct: one complex solve per frequency",
        choices=("rational", "direct"),
    )
    accuracy: float = parameter(1e-6, "relative error allowed in G' and in G'' each", low=1e-12, high=0.1)
    parallel: str | None = optional_parameter(
        "rational method on several ranks: each factorises a shift of its own, or all share each factorisation "
        "(default auto: by the number of ranks and unknowns)",
        choices=("auto", "shifts", "matrix"),
    )
    fields: Numbers | None = optional_parameter(
        "also displacement fields at these frequencies", value_type=FREQUENCIES
    )
    alpha: float | None = of_power_law(
        "exponent of the damping force (1 is linear)", low=0.05, high=5.0, metavar="A"
    )
    stress: float | None = of_power_law(
        "amplitude of the shear stress, with alpha", low=1e-30, high=1.0, unit="k", metavar="S"
    )

    def check(self):
        self.law.require_dissipation()
        if self.parallel and self.method == "direct":
            raise InputError(
                f"{named('parallel')} {self.parallel}: belongs to {named('method')} rational; with direct all ranks "
                "share each solve"
            )
        if self.alpha is None and self.stress is not None:
            raise InputError(
                f"{named('stress')} {self.stress:g}: belongs to power-law damping: give {named('alpha')} too"
            )
        if self.alpha is not None and self.stress is None:
            raise InputError(
                f"{named('alpha')} {self.alpha:g}: power-law damping depends on the amplitude: give "
                f"{named('stress')}, in units of k"
            )
        if self.alpha is not None and not self.law.is_of_contacts:
            raise InputError(
                f"{named('alpha')}: power-law damping is of contacts alone, and {self.law} has a fluid. Leave it out, "
                f"or take another {named('law')}"
            )

    @property
    def damping(self):
        """The EquivalentDamping, None where damping is linear."""
        return None if self.alpha is None else EquivalentDamping(self.alpha, self.stress)

    @property
    def scalar(self):
        """The direct method prefers complex scalars; real ones need twice the memory."""
        if self.method == "rational":
            return "real"
        return "complex" if builds.to_choose("complex") else "any"

    def work(self, to):
        from jampetsc.response.sweep_method import notes_of, solve
        from jampetsc.response.sweep_run import Run

        run = Run.of(self, to, session.current().comm).examined()
        omega, G, bounds = solve(run)
        notes = notes_of(run, run.asked(omega), G, bounds)
        return "\n".join([_summary(run, run.asked(omega), G, bounds), *note_lines(notes)])


def _summary(run, omega, G, bounds) -> str:
    """The summary of a sweep."""
    storage, loss = (
        relative_bound(bound, part).max() for bound, part in ((bounds[:, 1], G.real), (bounds[:, 2], G.imag))
    )
    lines = [
        f"{run.to}: {run.physics}, {len(omega)} frequencies, "
        f"{'certified' if run.certified else 'estimated'} to {storage:.1e} in G' and {loss:.1e} in G''"
    ]
    lines += [
        f"  omega {omega[end]:.3g}: G' = {G[end].real:.6g}, G'' = {G[end].imag:.6g}"
        for end in ((0, -1) if len(omega) > 1 else (0,))
    ]
    return "\n".join(lines + (_damping_lines(run, G) if run.damping else []))


def _damping_lines(run, G):
    """Lines about power-law damping: the equivalent frequencies, and where G* is formal."""
    damping = run.damping
    lines = [
        f"  alpha {damping.alpha:g}, stress {damping.stress:g} k: equivalent linear frequencies "
        f"{run.omega[0]:.3g} to {run.omega[-1]:.3g}; the stored spectrum is that of the linear law"
    ]
    if G.real.min() < 0.0:
        lines.append(
            "  G' < 0: no stress can be imposed on a packing that is unstable to shear; G* is formal"
        )
    return lines
