"""Response of a packing to slow shear."""

from dataclasses import dataclass
from typing import ClassVar

from jampetsc.errors import InputError, named
from jampetsc.io.results import note_lines
from jampetsc.laws.damping import MAX_WEIGHT, having
from jampetsc.options.law_options import PackingJob
from jampetsc.options.parameters import optional_parameter
from jampetsc.options.task_inputs import ONE_PACKING, TaskInputs
from jampetsc.options.values import Numbers, number_list


@dataclass(frozen=True, eq=False)
class Quasistatic(PackingJob):
    """Fields, moduli and viscosities of the limit of slow shear.

    The motion of touching disks relative to each other, Δu∥ and Δu⊥, and the non-affine displacement of every disk, per
    unit strain, with medians, means, rms and histograms; G₀, bulk modulus, η₀ = lim G''/ω and η_∞ (BT eqs. 18–24).
    Numbers whose names have no_prestress are those without the pre-stress of K.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING)
    EPILOG: ClassVar = """examples:
  jampetsc quasistatic p.h5 --out slow.h5
  jampetsc quasistatic p.h5 --betas 1e-4,1e-2,1 --out betas.h5

PETSc options: -shift_… for the factorisations."""

    SOLVERS: ClassVar = ("shift_", "inertia_")

    betas: Numbers | None = optional_parameter(
        "also η₀ and η_∞ at these β, from the same fields (contact law)",
        value_type=number_list(0.0, MAX_WEIGHT, "b1,b2,…"),
    )

    def check(self):
        """Refuse a law without dissipation, and values of β for a law without β."""
        self.law.require_dissipation()
        owners = having("beta")
        if self.betas is not None and self.law.family not in owners:
            raise InputError(
                f"{named('betas')}: belongs to {named('law')} {' or '.join(owners)}, not to "
                f"{self.law.family or self.law}; leave it out"
            )
        for beta in [] if self.betas is None else self.betas:
            self.law.altered(beta=beta)  # where nothing dissipates

    def work(self, to):
        from jampetsc.response import slow_response as quasistatic

        betas = () if self.betas is None else self.betas.tolist()
        return _summary(to, self.physics, quasistatic.run(self.packing, to, self.physics, betas))


def _summary(to, physics, outcome) -> str:
    """The summary."""
    lines = [f"{to}: {physics}, eta_inf = {outcome.eta_inf:.6g}"]
    for name, response in outcome.responses.items():
        found = outcome.distributions[name]
        stress = "pre-stress" if response.network.prestress else "no pre-stress"
        parts = ", ".join(f"{part} {value:.4g}" for part, value in response.flow.parts.items())
        lines += [
            f"  {stress}: G0 = {response.G0:.6g}, bulk modulus {response.bulk_modulus:.6g}, eta0 = "
            f"{response.flow.eta0:.6g} "
            f"({parts}), omega* = {response.omega_star:.4g}",
            "    medians per unit strain: "
            + ", ".join(
                f"{symbol} {found[key].median:.4g}"
                for symbol, key in (("|Δu∥|", "normal"), ("|Δu⊥|", "transverse"), ("|u_na|", "nonaffine"))
            )
            + f"; identity kept to {response.identity_difference:.0e}",
        ]
    return "\n".join(lines + note_lines(outcome.notes))
