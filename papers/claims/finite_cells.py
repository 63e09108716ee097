"""V 5.3: finite size separates z from zν, by the pressure of flows at φ_J in cells of several N.

Primary estimator. z of p = N^(−y/2ν) F(γ̇ N^(z/2)), ln F a polynomial, over all N and γ̇ ≤ SLOWEST_FIT, and ν = zν/z with
zν of the collapse of V Fig. 5.1. Systematic: half of the largest change of z without the smallest N, for lower γ̇ alone,
and at the other φ.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

import jampetsc
from papers.claims.exponents import SLOWEST_FIT, at_cut
from papers.claims.finite_size import OHERN
from papers.claims.flow import PHI_J, slower
from papers.claims.shared import Row, check, claim, rates_of, size_of
from papers.claims.verdicts import Estimate, between, difference

DEGREE = 4  # of ln F
LOWER = 1e-4  # γ̇ of the fit of lower rates
START = (0.55, 1.75)  # y/2ν, z/2


@dataclass(frozen=True, eq=False)
class Cells:
    """p of flows at one φ, and the fit p N^(y/2ν) = F(γ̇ N^(z/2)); arrays (M,)."""

    n: np.ndarray
    rate: np.ndarray
    pressure: np.ndarray
    error: np.ndarray
    shrink: Estimate  # y/2ν
    stretch: Estimate  # z/2
    ratio: Estimate  # y/zν
    coefficients: np.ndarray  # of ln F, powers of `argument` from 0

    @classmethod
    def of(cls, n, rate, pressure, error) -> "Cells":
        """The fit by least squares in ln p."""

        def line(parameters):
            power, stretch, *coefficients = parameters
            return np.polynomial.polynomial.polyval(
                argument(n, rate, stretch), coefficients
            ) - power * np.log(n)

        def distance(parameters):
            return (np.log(pressure) - line(parameters)) * pressure / error

        level = np.log(pressure) + START[0] * np.log(n)
        first = np.polynomial.polynomial.polyfit(argument(n, rate, START[1]), level, DEGREE)
        found = least_squares(distance, (*START, *first), x_scale="jac")
        covariance = np.linalg.pinv(found.jac.T @ found.jac)
        quality = float(np.sum(found.fun**2)), max(len(n) - len(found.x), 0)

        def estimate(value, slopes):
            return Estimate(float(value), float(np.sqrt(slopes @ covariance[:2, :2] @ slopes)), 0.0, *quality)

        shrink, stretch = found.x[:2]
        return cls(
            n,
            rate,
            pressure,
            error,
            estimate(shrink, np.array([1.0, 0.0])),
            estimate(stretch, np.array([0.0, 1.0])),
            estimate(shrink / stretch, np.array([1.0, -shrink / stretch]) / stretch),
            found.x[2:],
        )

    def less(self, rows) -> "Cells":
        """The fit to these rows (M,) alone."""
        return Cells.of(self.n[rows], self.rate[rows], self.pressure[rows], self.error[rows])

    @property
    def collapsed(self):
        """(γ̇ N^(z/2), p N^(y/2ν), its error)."""
        unit = self.n**self.shrink.value
        return self.rate * self.n**self.stretch.value, self.pressure * unit, self.error * unit

    def curve(self, x):
        """F at x = γ̇ N^(z/2)."""
        return np.exp(np.polynomial.polynomial.polyval(argument(1.0, x, 0.0), self.coefficients))


def argument(n, rate, stretch):
    """ln(γ̇ N^(z/2)) over its range, some 10."""
    return (np.log(rate) + stretch * np.log(n)) / 10


def cells(*tables) -> dict:
    """{φ: Cells} of flows at each φ where there are at least three N and enough points with γ̇ ≤ SLOWEST_FIT."""
    points = {}
    for table in tables:
        flows = slower(table, SLOWEST_FIT * 1.1)
        for key, part in flows.groups(["phi", "n"]):
            for rate, pressure, error in zip(*rates_of(part, "pressure"), strict=True):
                points.setdefault(key["phi"], []).append((key["n"], rate, pressure, error))
    found = {}
    for phi, rows in points.items():
        columns = np.transpose(rows)
        if len(np.unique(columns[0])) > 2 and len(rows) > DEGREE + 4:
            found[phi] = Cells.of(*columns)
    return found


def larger_cells(flows, curves, drag):
    """Flows of RD0 in larger cells at the φ of `flows`: of N = 1024 from the flow curves, of N = 4096 near φ_J."""
    phi = list(np.unique(flows["phi"]))
    for table, n in ((curves, 1024), (drag, 4096)):
        yield table.where(command="flow", model="RD0", n=n, phi=phi)


@claim("finite-size-flow", "vagberg-flow-curves", "vagberg-fig5.1-slow", on="cells")
def cells_at_phi_J(table, curves, drag):
    flows = table.where(command="flow")
    found = cells(flows, *larger_cells(flows, curves, drag))
    path = drag.path / "pressure.h5"
    if len(found) < 2 or not path.exists():
        return
    best = found[PHI_J]
    other, second = next((phi, one) for phi, one in found.items() if phi != PHI_J)
    changes = {
        f"without N = {best.n.min():.0f}": best.less(best.n > best.n.min()).stretch.value
        - best.stretch.value,
        f"for γ̇ ≤ {LOWER:g}": best.less(best.rate <= 1.1 * LOWER).stretch.value - best.stretch.value,
        f"at φ = {other:g}": second.stretch.value - best.stretch.value,
    }
    own = best.stretch
    z = Estimate(2 * own.value, 2 * own.inflated, max(abs(change) for change in changes.values()))
    ends = f"N = {best.n.min():.0f} to {best.n.max():.0f}, γ̇ = {best.rate.min():g} to {best.rate.max():g}"
    size = f"{ends}; {size_of(flows)}"
    told = ", ".join(f"{2 * change:+.2f} {words}" for words, change in changes.items())
    note = f"χ² = {own.chi2:.0f} for {own.dof}; {told}"
    what = f"RD0 at φ = {PHI_J}, p N^(y/2ν) against γ̇ N^(z/2)"
    yield check(f"{what}: z", z.value, 0.5 * z.half_width, note, size)
    shrink = best.shrink
    yield check(f"{what}: y/ν", 2 * shrink.value, 2 * shrink.inflated, "", size)
    yield check(f"{what}: y/zν", best.ratio.value, best.ratio.inflated, "", size, "0.314")
    znu = at_cut(jampetsc.load(path), SLOWEST_FIT)["znu"]
    nu = quotient(znu, z)
    earlier = f"{OHERN[0]:g}({100 * OHERN[1]:.0f}) of O'Hern et al."
    words = f"z = {z}, zν = {znu}, ν = {nu}; z changes by {told}"
    yield Row(
        f"RD0 at φ = {PHI_J}: ν = zν/z, less the earlier {earlier}",
        "well above: > 0",
        difference(nu, Estimate(*OHERN)),
        between(low=0.0),
        words,
        size,
    )


def quotient(one: Estimate, other: Estimate) -> Estimate:
    """The quotient of two independent estimates."""
    value = one.value / other.value
    errors = [
        abs(value) * float(np.hypot(getattr(one, name) / one.value, getattr(other, name) / other.value))
        for name in ("inflated", "systematic")
    ]
    return Estimate(value, *errors)
