"""The response in time on grids that the spectrum and the frequencies behind it support: H(τ), G(t), J(t)."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.creep import RetardationSpectrum, retardation
from jampetsc.analysis.relaxation import MAX_WINDOW, RelaxationSpectrum

TIMES_PER_DECADE = 20
MIN_WINDOW = 0.25  # decades; the window of H is never narrower unless asked for
_WINDOW_GAPS = 2.0  # its width in gaps between modes: with two, single modes show by a per cent or less
# times are shown so far beyond the fastest and the slowest mode; there nothing happens any more
_TIME_MARGIN = 100.0
_MAX_GROWTH = 5.0  # creep that grows is followed for this multiple of its time constant


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
    creep_time = time[time * late.growth_rate <= _MAX_GROWTH]
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
