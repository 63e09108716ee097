"""Relaxation spectrum, stress relaxation and creep of a sweep."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.analysis.transient import transient
from jampetsc.commands.sources import write_derived
from jampetsc.errors import InputError, named
from jampetsc.io.outputs import PICTURE
from jampetsc.io.reader import SweepResult
from jampetsc.io.results import note_lines, notes_of_sources, unstable_to_shear
from jampetsc.options.job import ONE_RESULT, Job, TaskInputs
from jampetsc.options.parameters import FILES, optional_parameter, parameter
from jampetsc.options.values import RESULT, load_source, refuse_repeated

OSCILLATING = (
    "with masses, G(t) and J(t) follow from reduced matrices, which are certified at the frequencies swept"
)
HDF5 = (".h5", ".hdf5")  # endings of a file; of a picture: `plots.style.FORMATS`


@dataclass(frozen=True, eq=False)
class Spectrum(Job):
    """Relaxation spectrum, G(t) and J(t) of a sweep.

    The response in time from a sweep by the rational method: relaxation times and weights, the spectrum
    H(τ), stress relaxation G(t), creep compliance J(t) and its retardation spectrum. One sweep gives a result; any
    number of sweeps give a picture, where the name of the file ends in .png, .pdf or .svg.

    A packing has thousands of modes, the spectrum of a sweep a few tens: nodes of a quadrature that gives G* to the
    accuracy of the sweep. H(τ) is therefore its mean between neighbouring nodes, averaged over a window. With masses
    G(t) and J(t) oscillate, and the result has these two alone, without a spectrum.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(
        ONE_RESULT,
        commands=("sweep",),
        is_suitable=lambda sweep: sweep.method == "rational" and not sweep.load.probe,
        needs="sweeps of strains with method rational",
    )
    scalar: ClassVar = None
    OUT_HELP: ClassVar = "result (HDF5), or picture"
    EPILOG: ClassVar = """examples:
  jampetsc spectrum sweep.h5 --out spectrum.h5
  jampetsc spectrum s1e-2.h5 s1e-3.h5 s1e-4.h5 --out spectra.png"""

    sweeps: Sequence = parameter(
        help="sweeps by the rational method", value_type=RESULT, place=FILES, metavar="SWEEP"
    )
    window: float | None = optional_parameter(
        "width of the average of H(τ) (default: twice the widest gap between nodes)",
        low=0.01,
        high=1.5,
        unit="decades",
        metavar="DECADES",
    )

    def check(self):
        """Refuse a sweep given twice."""
        refuse_repeated(self.sweeps)

    def check_outputs(self, to):
        """Refuse an output that is neither a file of one spectrum nor a picture."""
        from jampetsc.plots.style import FORMATS

        suffix = "" if to.path is None else to.path.suffix.lower()
        if suffix in FORMATS:
            to.check(PICTURE, self.paths)
            return
        if to.path is not None and suffix not in HDF5:
            raise InputError(
                f"{named('out')} {to}: unknown ending. Give it {HDF5[0]} for a result, {', '.join(FORMATS)} for a "
                "picture."
            )
        if len(self.sweeps) > 1:
            raise InputError(
                f"{named('out')} {to}: {len(self.sweeps)} spectra for one result. Give one sweep, or the name of a "
                "picture."
            )
        super().check_outputs(to)

    def work(self, to):
        """Find the spectrum, or draw the spectra."""
        from jampetsc.plots.style import FORMATS

        sweeps = [load_source(source) for source in self.sweeps]
        for source, sweep in zip(self.sweeps, sweeps, strict=True):
            if not isinstance(sweep, SweepResult):
                raise InputError(f"{source}: not a sweep. Give sweeps by the rational method.")
        if to.path is not None and to.path.suffix.lower() in FORMATS:
            from jampetsc.plots.spectrum_plots import plot_relaxation, spectrum_curve

            drawn = plot_relaxation.draw([spectrum_curve(sweep, self.window) for sweep in sweeps])
            drawn.save(to.path)
            return f"{to}: {drawn.text}"
        return _write(sweeps[0], to, self.window)


def _write(sweep, to, window):
    """Write the result and return the summary."""
    start_time = time.perf_counter()
    slowest, fastest = sweep.frequency_range
    if sweep.has_inertia and "C" not in sweep:
        if window is not None:
            raise InputError(
                f"{named('window')} {window:g}: of H(τ), which a sweep with masses does not have. Leave it out."
            )
        response = sweep.reduced_inertia.transient(slowest, fastest)
        notes, summary = [*notes_of_sources([sweep]), OSCILLATING], _summary_with_inertia(to, response)
    else:
        response = transient(sweep.spectrum, slowest, fastest, window)
        notes, summary = _notes(sweep, response), _summary(to, response)
    ends = {"slowest_omega": slowest, "fastest_omega": fastest}
    write_derived(to, Spectrum.FORMAT, [sweep], start_time, response.arrays, notes, **response.numbers | ends)
    return "\n".join([summary, *note_lines(notes)])


def _notes(sweep, response) -> list[str]:
    """Notes on a spectrum and the sweep behind it, see `io.results`."""
    spectrum, notes = response.spectrum, notes_of_sources([sweep])
    slowest, fastest = sweep.frequency_range
    if response.retardation.growth_rate and not any(note.startswith("unstable to shear:") for note in notes):
        notes += unstable_to_shear(spectrum.G0, "G0")
    if len(spectrum.rates) and not (
        slowest < 0.1 * spectrum.rates[-1] and fastest > 10.0 * spectrum.rates[0]
    ):
        notes.append(
            f"not certified at all times: the sweep covers times {1 / fastest:.3g} to {1 / slowest:.3g}, and what is "
            "faster or slower is an estimate. Sweep more frequencies"
        )
    if sweep.damping is not None:
        notes.append(
            "linear damping: alpha is not in this spectrum, as J(t) and G(t) need linearity. Use a linear law"
        )
    return notes


def _summary_with_inertia(to, response) -> str:
    """The summary of an `OscillatingTransient`."""
    G, J = response.G, response.J
    lines = [
        f"{to}: G(t) and J(t) with masses, t = {response.time[0]:.3g} to {response.time[-1]:.3g}",
        f"  G(t) between {G.min():.6g} and {G.max():.6g}, in the end {G[-1]:.6g}",
        f"  J(t) up to {J.max():.6g}, in the end {J[-1]:.6g}",
    ]
    if response.growth_rate:
        lines.append(_divergence(response.growth_rate))
    return "\n".join(lines)


def _divergence(rate) -> str:
    return f"  G0 < 0: creep diverges as exp({rate:.3g} t)"


def _summary(to, response) -> str:
    """The summary."""
    spectrum, late = response.spectrum, response.retardation
    lines = [f"{to}: {len(spectrum.rates)} relaxation times"]
    if len(spectrum.rates):
        times = 1.0 / spectrum.rates
        lines[0] += f" from {times[0]:.3g} to {times[-1]:.3g}, H averaged over {response.window:.2g} decades"
    lines.append(
        f"  G(0+) = {spectrum.G_inf:.6g} and {spectrum.eta_inf:.6g} delta(t), "
        f"G(t -> inf) = {spectrum.G0:.6g}, eta0 = {spectrum.eta0:.6g}"
    )
    if late.growth_rate:
        lines.append(_divergence(late.growth_rate))
    elif late.fluidity:
        lines.append(f"  G0 = 0: it flows in the end, J(t) -> {late.fluidity:.6g} t")
    else:
        lines.append(
            f"  J(t -> inf) = 1/G0 = {1.0 / spectrum.G0:.6g}, slowest retardation {1 / late.rates[0]:.3g}"
        )
    return "\n".join(lines)
