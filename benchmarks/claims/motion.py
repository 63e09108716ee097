"""How disks move in slow shear: BT figures 5 and 7."""

import numpy as np

from claims.shared import CRITICAL, Row, claim, exponent
from jampetsc.analysis.correlations import length_spread
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.plots.correlation import correlation_curve


@claim("bt-fig5")
def floppy(table):
    slow = table.where(command="quasistatic", pressure=CRITICAL)
    for prefix, where in (("no_prestress_", "without pre-stress"), ("", "with pre-stress")):
        for column, name, theirs in (
            ("normal", "|Δu∥|", 0.25), ("transverse", "|Δu⊥|", -0.25), ("nonaffine", "|u_na|", -0.25)
        ):  # fmt: skip
            found = exponent(slow, f"{prefix}{column}_median")
            yield Row(f"median {name} ~ p^x, {where}, p = 1e-5 … 1e-3", theirs, *found, "")
    lowest = table.where(command="quasistatic", pressure=[1e-4, 1e-5, 1e-6])
    yield Row(
        "mean |Δu∥| ~ p^x at p ≤ 1e-4 (a plateau is reported)",
        0.0,
        *exponent(lowest, "no_prestress_normal_mean"),
        "k Σ (Δu∥)² = G₀Vγ² exactly, so rms |Δu∥| follows √G₀ ~ p^¼ and no plateau is possible",
    )
    for column, name, theirs in (("G0", "G₀", 0.5), ("eta0", "η₀", -0.5), ("omega_star", "ω*", 1.0)):
        yield Row(
            f"β = 1 without pre-stress: {name} ~ p^x, p = 1e-5 … 1e-3",
            theirs,
            *exponent(slow, f"no_prestress_{column}"),
            "",
        )


@claim("bt-fig7")
def lengths(table):
    def curves(law):
        rows = table.where(command="correlate", law=law)
        return [correlation_curve(result) for result in rows.results()]

    slowest = [c.G.real[0] / c.size for c in curves("stokes")]
    yield Row(
        "Stokes: l/L as ω → 0 (Re u_y)",
        0.25,
        *mean_with_error(slowest),
        "mean over three pressures of four packings each; Im u_y gives more, see the picture",
    )
    contact = [c.G.real[c.omega < 1e-1] / c.size for c in curves("contact")]
    spread = np.std(np.concatenate(contact)) / np.mean(np.concatenate(contact))
    yield Row("contact: l/L does not depend on ω: spread of l over ω < 0.1 and p", 0.0, spread, None, "")
    collapsed = [(c.omega, c.G, c.pressure, c.size) for c in curves("stokes")]
    for sign, note in ((0.65, "as printed"), (-0.65, "the other sign collapses better"), (0.0, "no factor")):
        yield Row(
            f"Stokes: l (−ln p)^{sign:g} against ω/p^½: spread",
            0.0,
            length_spread(collapsed, sign),
            None,
            note,
        )
