"""V 5.5 and 2.4: the pressure above φ_J, where every state is jammed, under quasistatic shear and of random starts.

Primary estimator. y and φ_J of ⟨p⟩ = A (φ − φ_J)^y at the largest N, all three free. Systematic: half of the largest
change without the lowest φ, without the highest, and at the other N.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from jampetsc.analysis.correlated_series import Average
from papers.claims.shared import Row, check, claim
from papers.claims.verdicts import Estimate, between, difference, number
from papers.tables.pressures import NAMES

FEWEST = 4  # packing fractions for three parameters


@dataclass(frozen=True, eq=False)
class Rise:
    """⟨p⟩ (F,) with its errors at increasing φ, and the fit A (φ − φ_J)^y."""

    phi: np.ndarray
    pressure: np.ndarray
    error: np.ndarray
    A: float
    y: Estimate
    phi_J: Estimate

    @classmethod
    def of(cls, phi, pressure, error) -> "Rise":
        """The fit by least squares in ln p; raises ValueError where none converges."""

        def line(parameters):
            return parameters[0] + parameters[1] * np.log(phi - parameters[2])

        def distance(parameters):
            return (np.log(pressure) - line(parameters)) * pressure / error

        slope = np.ptp(pressure) / np.ptp(phi)
        low = phi[0] - pressure[0] / slope
        bounds = ([-np.inf, 0.2, 0.0], [np.inf, 5.0, phi[0] - 1e-9])
        found = least_squares(distance, (np.log(slope), 1.0, low), bounds=bounds, x_scale=(1.0, 0.1, 1e-3))
        if not found.success:
            raise ValueError(found.message)
        own = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)))
        chi2, dof = float(np.sum(found.fun**2)), len(phi) - 3
        y, phi_J = (Estimate(float(found.x[i]), float(own[i]), 0.0, chi2, dof) for i in (1, 2))
        return cls(phi, pressure, error, float(np.exp(found.x[0])), y, phi_J)

    def less(self, rows) -> "Rise":
        """The fit to these rows alone."""
        return Rise.of(self.phi[rows], self.pressure[rows], self.error[rows])


def rises(table) -> dict:
    """{(RAND or QS, N): Rise} of the ensembles in which every state is jammed at FEWEST φ at least."""
    found = {}
    for result in table.where(command="jam").results():
        key = NAMES[str(result.attributes["protocol"])], int(result.attributes["particle_count"])
        for phi in np.unique(result["phi"]):
            here = (result["phi"] == phi) & np.isfinite(result["pressure"])  # a run may have lost its minimum
            if here.sum() > 1 and (result["jammed"][here] == 1).all():
                mean = Average.of(result["pressure"][here])
                found.setdefault(key, []).append((phi, mean.mean, mean.error))
    return {key: Rise.of(*np.transpose(sorted(rows))) for key, rows in found.items() if len(rows) >= FEWEST}


def with_changes(rise, others) -> tuple[Estimate, Estimate]:
    """(y, φ_J) with half of the largest change without an end of the φ, and of the same at other N, as systematic."""
    ends = [rise.less(part) for part in (slice(1, None), slice(None, -1))] if len(rise.phi) > FEWEST else []
    changed = [*ends, *others]

    def half(name):
        own = getattr(rise, name)
        changes = [abs(getattr(one, name).value - own.value) for one in changed]
        return replace(own, systematic=0.5 * max(changes, default=0.0))

    return half("y"), half("phi_J")


@claim("above-jamming", on="above")
def pressures_above(table):
    found, decided = rises(table), {}
    for name in ("RAND", "QS"):
        sizes = sorted(n for one, n in found if one == name)
        for n in sizes:
            rise = found[name, n]
            largest = n == sizes[-1]
            y, phi_J = with_changes(
                rise, [found[name, other] for other in sizes if other != n] if largest else []
            )
            size = f"N = {n}, φ = {rise.phi[0]:g} to {rise.phi[-1]:g}"
            what = f"{name}, N = {n}: ⟨p⟩ = A (φ − φ_J)^y above φ_J"
            note = f"χ² = {y.chi2:.1f} for {y.dof}"
            yield check(f"{what}: φ_J", phi_J.value, 0.5 * phi_J.half_width, note, size, bears="phi_J")
            if largest:
                decided[name] = y, size
            if name == "QS" and largest:
                words = f"φ_J = {phi_J}; A = {rise.A:.2f}"
                yield Row(f"{what}: y", "1.1", y, number(1.1), words, size)
            else:
                yield check(f"{what}: y", y.value, 0.5 * y.half_width, note, size)
    if len(decided) == 2:
        (one, size), (other, _) = decided["QS"], decided["RAND"]
        what, words = "y of QS less y of RAND, of ⟨p⟩ above φ_J", "exponents differ: > 0"
        note = f"QS {one}, RAND {other}"
        yield Row(what, words, difference(one, other), between(low=0.0), note, size, bears="ensembles")
