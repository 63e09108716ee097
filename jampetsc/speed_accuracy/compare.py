"""How far a curve G*(ω) is from the reference: errors of G' and G'', slopes of the critical branch."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.bounds import relative_bound
from jampetsc.analysis.scaling import CRITICAL_END, fit_power_law

CRITICAL_START = 10.0  # ωτ₁ over p/k: well above the lower crossover, which is near 2 to 4 (BT eq. 16)
_FEWEST = 5  # frequencies of the reference in the critical window
_FINE = 40  # frequencies per decade at which interpolation is judged


@dataclass(frozen=True)
class Exponents:
    """Slopes d ln G'/d ln ω and d ln G''/d ln ω over the critical window, and standard errors."""

    storage: float
    loss: float
    storage_error: float
    loss_error: float


class Reference:
    """The exact curve, to its own bound. result: a rational sweep (`io.reader.SweepResult`)."""

    def __init__(self, result):
        self.result = result
        self.omega, self.G = result.omega, result.G
        self.certified = certified(result)
        self.inside = self._critical()

    @property
    def window(self):
        """(first, last) frequency of the critical window in the sweep, or None if it has too few there."""
        return None if self.inside is None else (self.omega[self.inside][0], self.omega[self.inside][-1])

    def _critical(self):
        """Which frequencies lie between both crossovers: 10 p/k < ωτ₁ < 0.1; None if too few do."""
        attributes = self.result.attributes
        x = self.omega * float(attributes["tau1"])
        inside = (x >= CRITICAL_START * attributes["pressure"] / attributes["k"]) & (x <= CRITICAL_END)
        return inside if np.count_nonzero(inside) >= _FEWEST else None

    def errors(self, G):
        """Largest relative error of (G', G'') over all frequencies; G (M,) at `omega`."""
        return _largest(self.G, G)

    def window_errors(self, G):
        """The same over the critical window; nan without one."""
        if self.inside is None:
            return np.nan, np.nan
        return _largest(self.G[self.inside], G[self.inside])

    def exponents(self, G) -> Exponents | None:
        """Slopes of G (M,) at `omega` over the critical window; None without one, or where G' or G'' ≤ 0."""
        if self.inside is None:
            return None
        omega, G = self.omega[self.inside], G[self.inside]
        if (G.real <= 0).any() or (G.imag <= 0).any():
            return None
        storage, loss = (fit_power_law(omega, part) for part in (G.real, G.imag))
        return Exponents(storage.exponent, loss.exponent, storage.exponent_error, loss.exponent_error)

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
