"""How far a curve G*(ω) is from the reference: errors of G' and G'', slopes of the critical branch."""

import numpy as np

from jampetsc.analysis.bounds import relative_bound
from jampetsc.analysis.scaling import CRITICAL_END, fit_power_law

CRITICAL_START = 10.0  # ωτ₁ over p/k: well above the lower crossover, which is near 2 to 4 (BT eq. 16)
FEWEST = 5  # frequencies in the critical window for a slope
_FINE = 40  # frequencies per decade at which interpolation is judged


def critical(result):
    """Which frequencies (M,) of a sweep lie between both crossovers: 10 p/k < ωτ₁ < 0.1."""
    attributes = result.attributes
    x = result.omega * float(attributes.get("tau1", 1.0))
    return (x >= CRITICAL_START * attributes["pressure"] / attributes["k"]) & (x <= CRITICAL_END)


class Reference:
    """The exact curve, to its own bound. result: a rational sweep (`io.reader.SweepResult`)."""

    def __init__(self, result):
        self.result = result
        self.omega, self.G = result.omega, result.G
        self.certified = certified(result)
        inside = critical(result)
        self.inside = inside if np.count_nonzero(inside) >= FEWEST else None  # None: too few

    @property
    def window(self):
        """(first, last) frequency of the critical window in the sweep, or None if it has too few there."""
        return None if self.inside is None else (self.omega[self.inside][0], self.omega[self.inside][-1])

    def deviation(self, G) -> dict:
        """Largest relative errors of G (M,) at `omega`, anywhere and in the critical window, and slopes: of a Row."""
        found = dict(zip(("error_storage", "error_loss"), _largest(self.G, G), strict=True))
        if self.inside is not None:
            inside = _largest(self.G[self.inside], G[self.inside])
            found |= dict(zip(("window_storage", "window_loss"), inside, strict=True))
        return found | self.exponents(G)

    def exponents(self, G) -> dict:
        """Slopes of G (M,) at `omega` over the critical window with standard errors, as fields of a Row.

        None without a window, or where G' or G'' ≤ 0.
        """
        if self.inside is None or (G[self.inside].real <= 0).any() or (G[self.inside].imag <= 0).any():
            return {}
        found = {}
        for name, part in (("storage", G.real), ("loss", G.imag)):
            fit = fit_power_law(self.omega[self.inside], part[self.inside])
            found |= {f"exponent_{name}": fit.exponent, f"exponent_{name}_error": fit.exponent_error}
        return found

    def violation(self, result):
        """Frequency where an error of `result` exceeds its bound plus the reference's; None if nowhere."""
        change = result.G - self.G
        for part, name in ((change.real, "storage"), (change.imag, "loss")):
            beyond = np.abs(part) > sum(r[f"error_bound_{name}"] for r in (result, self.result))
            if beyond.any():
                return float(self.omega[beyond][0])
        return None

    def interpolation_errors(self, omega, G):
        """Largest relative errors of (G', G'') between frequencies, by straight lines in log-log.

        omega (m,), G (m,): what another run has. nan where values that are not positive forbid logarithms.
        """
        decades = np.log10(self.omega[-1] / self.omega[0])
        fine = np.geomspace(self.omega[0], self.omega[-1], max(2, int(_FINE * decades)))
        return _largest(self.result.modulus(fine), log_interpolate(fine, omega, G))


def log_interpolate(x, omega, G):
    """G* between frequencies, G' and G'' each a straight line in log-log; nan where one is not positive."""
    parts = []
    for values in (G.real, G.imag):
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.where(values > 0, np.log(values), np.nan)
        parts.append(np.exp(np.interp(np.log(x), np.log(omega), logs)))
    return parts[0] + 1j * parts[1]


def certified(result) -> float:
    """The larger of a sweep's relative bounds on G' and on G''."""
    parts = (("error_bound_storage", result.G.real), ("error_bound_loss", result.G.imag))
    return float(max(relative_bound(result[name], part).max() for name, part in parts))


def _largest(exact, G):
    return tuple(
        float(relative_bound(np.abs(part - true), true).max())
        for part, true in ((G.real, exact.real), (G.imag, exact.imag))
    )
