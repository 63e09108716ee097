"""The response in time on grids that the spectrum and the frequencies behind it support: H(τ), G(t), J(t).

Creep J(t), the strain after a step of stress, follows from the zeros of G* that lie between its poles. With G* a sum of
Maxwell elements (`relaxation`), the compliance J* = 1/G* is one of Kelvin–Voigt elements,

    1/G*(ω) = J_∞ + 1/(iωη) + Σ_k J_k μ_k/(μ_k + iω) ,     J(t) = J_∞ + t/η + Σ_k J_k [1 − exp(−μ_k t)] .

Its rates μ_k are the zeros of G* at s = −μ, that is the eigenvalues of an arrow-shaped matrix, and there
G* = μ h(μ) with the function of the secular equation

    h(μ) = G₀/μ − η_∞ − Σ_m g_m/(λ_m − μ) = 0 .

h falls from +∞ to −∞ between neighbouring poles, so each interval holds one zero, found by bisection of its
distance to the nearer pole: every μ_k and J_k is accurate in itself, whatever range the rates span. Since

    1/J_k = μ_k dG*/ds = μ_k [η_∞ + Σ_m g_m λ_m/(λ_m − μ_k)²] ,

all J_k are positive where all μ_k are. J_∞ = 1/G_∞ if η_∞ = 0, else 0; the flow term 1/η = 1/η₀ is present only
if G₀ = 0. If G₀ < 0 one zero is at s = −μ > 0: any stress makes the packing yield, creep grows as exp(|μ|t).
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.relaxation import MAX_WINDOW, RelaxationSpectrum
from jampetsc.errors import InputError

_HALVINGS = 80  # halvings of a range of some 500 in the logarithm: far below rounding
_MIN_POLE_DISTANCE = 1e-200  # closest to a pole, relative to the gap, that a zero is looked for
TIMES_PER_DECADE = 20
MIN_WINDOW = 0.25  # decades; the window of H is never narrower unless requested
_WINDOW_GAPS = 2.0  # its width in gaps between modes: with two, single modes show by a per cent or less
# times are shown so far beyond the fastest and the slowest mode; there nothing happens any more
_TIME_MARGIN = 100.0
MAX_GROWTH = 5.0  # creep that grows is followed for this multiple of its time constant


@dataclass(frozen=True, eq=False)
class RetardationSpectrum:
    """Rates μ (m,) in 1/τ₁, increasing, compliances J (m,) and J_∞ in 1/k, fluidity 1/η in 1/(kτ₁)."""

    J_inf: float  # instantaneous compliance
    fluidity: float  # rate of final flow per stress; 0 for a solid
    rates: np.ndarray
    compliances: np.ndarray

    @property
    def growth_rate(self) -> float:
        """Rate of the exponential growth of creep, 0 where G₀ ≥ 0."""
        return float(np.max(-self.rates, initial=0.0))

    def creep(self, time):
        """J(t) for t > 0 in the shape of time; infinite where it exceeds all numbers (G₀ < 0)."""
        time = np.asarray(time, float)
        with np.errstate(over="ignore"):
            relaxed = np.expm1(-time[..., None] * self.rates)
            return self.J_inf + self.fluidity * time - np.sum(self.compliances * relaxed, axis=-1)


def retardation(spectrum: RelaxationSpectrum) -> RetardationSpectrum:
    """The retardation spectrum of 1/G*.

    Raises InputError where G* has no zero that could limit creep: η_∞ = 0 and G_∞ ≤ 0.
    """
    spectrum = spectrum.sorted()
    G0, eta_inf = spectrum.G0, spectrum.eta_inf
    if eta_inf <= 0 and spectrum.G_inf <= 0:
        raise InputError(
            f"G_inf = {spectrum.G_inf:g} without viscosity: no creep compliance. Give a packing with contacts."
        )
    poles, weights = spectrum.rates[::-1], spectrum.weights[::-1]
    if G0 > 0:
        poles, weights = np.r_[0.0, poles], np.r_[G0, weights]
    rates, gaps = _between_poles(G0, eta_inf, poles, weights)
    if G0 < 0:
        unstable = _growth_rate(spectrum)
        rates, gaps = np.r_[-unstable, rates], np.vstack((poles + unstable, gaps))
    slopes = eta_inf + np.sum(weights * poles / gaps**2, axis=1)
    return RetardationSpectrum(
        J_inf=0.0 if eta_inf > 0 else 1.0 / spectrum.G_inf,
        fluidity=1.0 / spectrum.eta0 if G0 == 0 else 0.0,
        rates=rates,
        compliances=1.0 / (rates * slopes),
    )


def _between_poles(G0, eta_inf, poles, weights):
    """Zeros (n,) of h above the lowest pole, and their distances λ_j − μ_k (n, m) from all poles."""
    if not len(poles):
        return np.empty(0), np.empty((0, 0))
    gap = np.diff(poles)
    origin, side, reach = poles[:-1], np.ones(len(gap)), 0.5 * gap

    def h(distance):
        """h at origin + distance, G₀'s pole included; distances (n,) from the origins."""
        distances = poles - origin[:, None] - distance[:, None]
        value = -eta_inf - np.sum(weights / distances, axis=1)
        return value if G0 >= 0 else value + G0 / (origin + distance)

    upper = h(reach) > 0  # the zero is nearer to the upper pole
    origin, side = np.where(upper, poles[1:], origin), np.where(upper, -1.0, side)
    if eta_inf > 0:
        origin, side = np.r_[origin, poles[-1]], np.r_[side, 1.0]
        reach = np.r_[reach, 2.0 * np.sum(weights) / eta_inf]
    low, high = np.log(reach) + np.log(_MIN_POLE_DISTANCE), np.log(reach)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        farther = h(side * np.exp(middle)) * side > 0
        low, high = np.where(farther, middle, low), np.where(farther, high, middle)
    distance = side * np.exp(0.5 * (low + high))
    return origin + distance, poles - origin[:, None] - distance[:, None]


def _growth_rate(spectrum):
    """The positive zero of G*(s), which increases with s > 0 from G₀ < 0."""
    from scipy.optimize import bisect  # takes a while to import

    def value(log_s):
        s = np.exp(log_s)
        return spectrum.G0 + s * spectrum.eta_inf + np.sum(spectrum.weights * s / (spectrum.rates + s))

    return float(np.exp(bisect(value, np.log(1e-200), np.log(1e200), xtol=1e-15)))


@dataclass(frozen=True, eq=False)
class Transient:
    """Response in time; units as in the spectrum. G lacks the Dirac part η_∞ δ(t)."""

    spectrum: RelaxationSpectrum  # modes in the order of their times
    tau: np.ndarray  # (m,): to half a window beyond all modes; further out H is the flank of the window
    H: np.ndarray  # (m,) averaged over `window` decades
    window: float
    time: np.ndarray  # (n,)
    G: np.ndarray  # (n,) stress relaxation
    creep_time: np.ndarray  # (n' ≤ n,): ends early where creep diverges
    J: np.ndarray  # (n',) creep compliance
    retardation: RetardationSpectrum

    @property
    def arrays(self) -> dict:
        """{name: array} as files hold them."""
        times, between = self.spectrum.between()
        return {
            "relaxation/times": times,
            "relaxation/rates": self.spectrum.rates,
            "relaxation/weights": self.spectrum.weights,
            "H/between": between,
            "H/tau": self.tau,
            "H/smoothed": self.H,
            "stress/time": self.time,
            "stress/G": self.G,
            "creep/time": self.creep_time,
            "creep/J": self.J,
            "retardation/rates": self.retardation.rates,
            "retardation/compliances": self.retardation.compliances,
        }

    @property
    def numbers(self) -> dict:
        """{name: value} as files hold them."""
        return {
            "G0": self.spectrum.G0,
            "G_inf": self.spectrum.G_inf,
            "eta0": self.spectrum.eta0,
            "eta_inf": self.spectrum.eta_inf,
            "J_inf": self.retardation.J_inf,
            "fluidity": self.retardation.fluidity,
            "growth_rate": self.retardation.growth_rate,
            "window_decades": self.window,
            "resolution_decades": self.spectrum.resolution,
        }


def transient(spectrum: RelaxationSpectrum, slowest: float, fastest: float, window=None) -> Transient:
    """H(τ), G(t) and J(t) of a spectrum known for frequencies from `slowest` to `fastest`.

    Times lie between 1/fastest and 1/slowest, and no more than two decades beyond all modes. `window` in
    decades is the width of the average for H, by default twice the widest gap between modes that matter,
    so that single modes do not show. Raises InputError for a window out of range.
    """
    spectrum = spectrum.sorted()
    late = retardation(spectrum)
    if window is None:
        window = float(np.clip(_WINDOW_GAPS * spectrum.resolution, MIN_WINDOW, MAX_WINDOW))
    rates = np.abs(np.r_[spectrum.rates, late.rates])
    rates = rates[rates > 0]
    first, last = 1.0 / fastest, 1.0 / slowest
    if len(rates):
        first = min(max(first, 1.0 / (_TIME_MARGIN * rates.max())), last)
        last = max(min(last, _TIME_MARGIN / rates.min()), first)
    time, tau = _grid(first, last), _grid(*_mode_times(first, last, spectrum.rates, window))
    creep_time = time[time * late.growth_rate <= MAX_GROWTH]
    return Transient(
        spectrum=spectrum,
        tau=tau,
        H=spectrum.smoothed(tau, window),
        window=window,
        time=time,
        G=spectrum.stress_relaxation(time),
        creep_time=creep_time,
        J=late.creep(creep_time),
        retardation=late,
    )


def _grid(first, last):
    """Times from first to last, TIMES_PER_DECADE of them to a decade."""
    return np.geomspace(first, last, max(2, int(np.ceil(TIMES_PER_DECADE * np.log10(last / first))) + 1))


def _mode_times(first, last, rates, window):
    """The part of first … last within half a window of the times of the modes; all of it without modes."""
    if not len(rates):
        return first, last
    reach = 10.0 ** (0.5 * window)
    low, high = np.clip((1.0 / (rates.max() * reach), reach / rates.min()), first, last)
    return (low, high) if low < high else (first, last)
