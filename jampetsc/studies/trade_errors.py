"""Deviations of a curve G*(ω) from the reference: errors of G' and G'', slopes of the critical branch."""

import numpy as np

from jampetsc.analysis.error_bounds import relative_bound, relative_part_bounds
from jampetsc.analysis.power_laws import MIN_FREQUENCIES, critical_slopes, is_critical, moduli

FREQUENCIES_PER_DECADE = 40  # frequencies per decade at which errors of interpolation are computed


class ReferenceCurve:
    """The exact curve, to its own bound. result: a rational sweep (`io.reader.SweepResult`)."""

    def __init__(self, result):
        self.result = result
        self.omega, self.G = result.omega, result.G
        self.certified = certified(result)
        attributes = result.attributes
        inside = is_critical(
            result.omega, float(attributes.get("tau1", 1.0)), attributes["pressure"], attributes["k"]
        )
        self.inside = inside if np.count_nonzero(inside) >= MIN_FREQUENCIES else None  # None: too few

    @property
    def window(self):
        """(first, last) frequency of the critical window in the sweep, or None if it has too few there."""
        return None if self.inside is None else (self.omega[self.inside][0], self.omega[self.inside][-1])

    def deviation(self, G) -> dict:
        """Largest relative errors of G (M,) at `omega`, anywhere and in the critical window, and slopes."""
        errors = _largest("error", self.G, G)
        if self.inside is not None:
            errors |= _largest("window", self.G[self.inside], G[self.inside])
        return errors | self.exponents(G)

    def exponents(self, G) -> dict:
        """Slopes of G (M,) at `omega` over the critical window with standard errors, as fields of a TradeRow.

        None without a window, or where G' or G'' ≤ 0.
        """
        errors = {} if self.inside is None else critical_slopes(self.omega[self.inside], G[self.inside])
        return errors if len(errors) == 4 else {}

    def violation(self, result):
        """Frequency where an error of `result` exceeds its bound plus the reference's; None if nowhere."""
        for name, change in moduli(result.G - self.G).items():
            beyond = np.abs(change) > sum(r[f"error_bound_{name}"] for r in (result, self.result))
            if beyond.any():
                return float(self.omega[beyond][0])
        return None

    def interpolation_errors(self, omega, G) -> dict:
        """Largest relative errors of G' and G'' between frequencies, by straight lines in log-log.

        omega (m,), G (m,): what another run has. nan where values that are not positive forbid logarithms.
        """
        decades = np.log10(self.omega[-1] / self.omega[0])
        fine = np.geomspace(self.omega[0], self.omega[-1], max(2, int(FREQUENCIES_PER_DECADE * decades)))
        return _largest("error", self.result.modulus(fine), log_interpolate(fine, omega, G))


def log_interpolate(x, omega, G):
    """G* between frequencies, G' and G'' each a straight line in log-log; nan where one is not positive."""

    def line(values):
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.where(values > 0, np.log(values), np.nan)
        return np.exp(np.interp(np.log(x), np.log(omega), logs))

    return line(G.real) + 1j * line(G.imag)


def certified(result) -> float:
    """The larger of a sweep's relative bounds on G' and on G''."""
    bounds = np.stack([result[f"error_bound_{name}"] for name in moduli(result.G)], axis=-1)
    return float(relative_part_bounds(result.G, bounds).max())


def _largest(what, exact, G) -> dict:
    """Largest relative errors of G' and G'', fields of a TradeRow that begin with `what`."""
    errors = {name: np.abs(part - moduli(exact)[name]) for name, part in moduli(G).items()}
    return {
        f"{what}_{name}": float(relative_bound(errors[name], part).max())
        for name, part in moduli(exact).items()
    }
