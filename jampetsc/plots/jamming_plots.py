"""Quasistatic shear over the strain; which packings jam: f(φ) by N, P(p) and φ_J (Vågberg, thesis ch. 6).

Samples come from files of `jampetsc jam`, and from quasistatic shear, whose minima are samples of one run.
"""

from dataclasses import dataclass, field

import numpy as np

from jampetsc.analysis.jammed_samples import MIN_SAMPLES, Share, density, memory, runs_of, share_of
from jampetsc.errors import InputError, named
from jampetsc.io.provenance import recorded_dimension
from jampetsc.plots.flow_plots import draw_mean
from jampetsc.plots.page import draw_points
from jampetsc.plots.picture import (
    count_text,
    flow_units,
    join_varied,
    other_settings,
    picture,
    potential_text,
)
from jampetsc.plots.style import COLUMN, DASHED, GREY, PAGE, colours, entry, hidden, looks, number

STRAIN_HEIGHT = 2.3  # inches of one row of panels


@picture("strain", "shear")
def plot_stepwise_shear(results, page):
    """U/N on a log scale, σ, p and Z over γ of one run or several; unjammed states are light, means dashed."""
    units = flow_units(results)
    panels = {"energy": units.label("U/N", "energy"), "shear_stress": units.label(r"\sigma", "stress")}
    panels |= {"pressure": units.label("p", "stress"), "contact_number": "$2N_c/N$"}
    named = {"x": r"$\gamma$", "y": list(panels.values()), "log": ["y", "", "", ""]}
    axes = page.panels(2, 2, PAGE, 2 * STRAIN_HEIGHT, **named, sharex=True)
    loose = any((result["jammed"] != 1).any() for result in results)
    plastic = [result["strain"][result["plastic"] == 1] if "plastic" in result else [] for result in results]
    for ax, name in zip(axes, panels, strict=True):
        for result, colour in zip(results, colours(len(results)), strict=True):
            disks = float(result.attributes["particle_count"])
            unit = {"energy": units.k * disks, "contact_number": 1.0}.get(name, units.k)
            _draw_states(
                ax, result["strain"], result[name] / unit, result["jammed"] == 1, colour, result.path.stem
            )
            if name != "energy":
                draw_mean(ax, result, name, unit, colour, 1.3)
        ax.set_xmargin(0)
    for events, colour in zip(plastic, colours(len(results)), strict=True):
        below = {"transform": axes[1].get_xaxis_transform(), "ms": 4}
        axes[1].plot(events, np.full(len(events), 0.02), "|", color=colour, **below)
    handles = [entry("jammed", lw=0.7)]
    if loose:
        axes[0].axhline(float(results[0].attributes["energy_cut"]), color=GREY, lw=0.6, ls=":")
        handles.append(entry("not jammed", alpha=0.5, marker=".", ms=1.5, ls="none"))
    if any(map(len, plastic)):
        handles.append(entry("plastic events, in (b)", marker="|", ms=4, ls="none"))
    page.legend(axes[0], [*handles, entry("means", lw=1.3, ls=DASHED)])
    return f"energy, stress, pressure and contacts of {count_text(results, 'run', 'runs')} over the strain"


def _draw_states(ax, strain, values, jammed, colour, name):
    """A line through jammed states, dots for the others."""
    ax.plot(strain, np.where(jammed, values, np.nan), color=colour, lw=0.6, label=hidden(f"{name}, jammed"))
    loose = {"ms": 1.5, "alpha": 0.5, "markeredgewidth": 0, "label": hidden(f"{name}, not jammed")}
    ax.plot(strain[~jammed], values[~jammed], ".", color=colour, **loose)
    single = jammed & ~np.r_[False, jammed[:-1]] & ~np.r_[jammed[1:], False]
    ax.plot(strain[single], values[single], "_", color=colour, ms=2)


HEIGHT = 2.7  # inches of one row of panels
MAX_PANELS = 6  # kinds in one picture of P(p)
# settings that kinds have anyway, and how long runs take
_KNOWN = ("protocol", "cooling_rate", "separated", "step", "strain")
RUN = "shear"  # the protocol of files of quasistatic shear


@dataclass(eq=False)
class Samples:
    """Samples of one kind (protocol, N, D, sizes, potential, step, other settings): at each φ the runs they come in.

    A run is a series of minima under shear, or a single sample; {φ: [(jammed (T,), pressure (T,)), …]}
    """

    kind: tuple
    runs: dict = field(default_factory=dict)
    jamming: dict = field(default_factory=dict)  # {φ: φ_J (S,)}, where samples were brought there

    def share(self, phi) -> Share:
        """The share that is jammed at φ."""
        return share_of([run[0] for run in self.runs[phi]])

    def pressures(self, phi):
        """p of the jammed samples at φ, (S,)."""
        return np.concatenate([p[jammed == 1] for jammed, p in self.runs[phi]])

    def density(self, phi, unit=1.0):
        """(edges, P(p), error) of the jammed samples at φ, p in this unit; errors know what runs remember."""
        remembered = memory([p for _, p in self.runs[phi]])
        return density(self.pressures(phi) / unit, 0.0, remembered)


def samples_of(results) -> list[Samples]:
    """The samples of jam and shear files, kind by kind. Raises InputError where one is there twice, or none is left."""
    by_kind, seen = {}, {}
    for result in results:
        attributes = result.attributes
        # of disks out of a packing they are not known
        words = str(attributes.get("sizes", "")), potential_text(attributes)
        dimension = f"$D={recorded_dimension(attributes)}$"
        more = _step(result), other_settings(result, _KNOWN)
        kind = _protocol(result), int(attributes["particle_count"]), dimension, *words, *more
        samples = by_kind.setdefault(kind, Samples(kind))
        every = result["jammed"], result["pressure"]
        for phi, seed, rows in runs_of(result):
            phi, (jammed, pressure) = round(phi, 9), (values[rows] for values in every)
            finite = np.isfinite(jammed)
            if (kind, phi, seed) in seen:
                raise InputError(
                    f"{result.path}: phi = {phi:g}, seed {seed} is in {seen[kind, phi, seed].name} as well. "
                    "Give each sample once."
                )
            seen[kind, phi, seed] = result.path
            if finite.any():
                samples.runs.setdefault(phi, []).append((jammed[finite], pressure[finite]))
        if "phi_J" in result:
            phis, values = np.round(result["phi"], 9), result["phi_J"]
            for phi in np.unique(phis):
                values_at_phi = values[(phis == phi) & np.isfinite(values)]
                samples.jamming[phi] = np.concatenate((samples.jamming.get(phi, []), values_at_phi))
    kept = [by_kind[kind] for kind in sorted(by_kind) if by_kind[kind].runs]
    if not kept:
        raise InputError(f"{results[0].path}: no sample reached a minimum. Make samples again.")
    return kept


def _protocol(result):
    """Protocol of the samples, with the rate of cooling where there is one."""
    attributes = result.attributes
    name = str(attributes.get("protocol", RUN if result.format == "jampetsc-shear" else "random"))
    parts = [name]
    if "cooling_rate" in attributes:
        parts.append(f"$R={number(float(attributes['cooling_rate']))}$")
        if float(attributes.get("strain", 0.0)) > 0:
            parts.append(rf"sheared by {float(attributes['strain']):g}")
    return ", ".join(parts + ["separated"] * bool(attributes.get("separated", False)))


def _step(result):
    """Δγ of quasistatic shear whose minima are the samples, in TeX; empty for other protocols."""
    sheared = str(result.attributes.get("protocol", RUN)) == RUN and "step" in result.attributes
    return rf"$\Delta\gamma={number(float(result.attributes['step']))}$" if sheared else ""


def labels_of(kinds) -> list[str]:
    """A legend's words for each `kind` of `samples_of`: the parts that differ, N at least."""
    protocols, sizes, *further = (len(set(part) - {""}) > 1 for part in zip(*kinds, strict=True))
    alike = not any((protocols, sizes, *further))
    parts = [(f"$N={n}$", protocol, *words) for protocol, n, *words in kinds]
    return join_varied(parts, (sizes or alike, protocols, *further))


@picture("fraction", "jam", "shear", mixed=True)
def plot_fraction(results, page):
    """f(φ), the share of samples that jam, a line for every N and protocol; bars are one standard error."""
    samples = samples_of(results)
    ax = page.panels(1, 1, COLUMN, HEIGHT, x=r"$\phi$", y=r"$f(\phi)$")
    ax.set_ylim(-0.04, 1.04)
    ax.axhline(0.5, color=GREY, lw=0.5, ls=":")
    labels = labels_of([sample.kind for sample in samples])
    for (sample, label), look in looks(zip(samples, labels, strict=True)):
        phis = sorted(sample.runs)
        value, low, high = np.transpose([(s.value, s.low, s.high) for s in map(sample.share, phis)])
        draw_points(ax, phis, value, [value - low, high - value], label=label, **look)
    page.legend(ax, first="upper left")
    return f"f(phi), the share of samples that jam, of {count_text(results, 'file', 'files')}"


@picture("pressures", "jam", "shear", mixed=True)
def plot_pressures(results, page):
    """P(p) of the jammed samples, a line for every φ, a panel for every N and protocol; bars are errors of counting.

    Raises InputError where no φ has enough jammed samples, and for more kinds than fit.
    """
    samples = samples_of(results)
    curves = [
        (sample, [phi for phi in sorted(sample.runs) if len(sample.pressures(phi)) >= MIN_SAMPLES])
        for sample in samples
    ]
    curves = [(sample, phis) for sample, phis in curves if phis]
    if not curves:
        raise InputError(
            f"{results[0].path}: fewer than {MIN_SAMPLES} jammed samples at every phi. Make more."
        )
    if len(curves) > MAX_PANELS:
        raise InputError(
            f"{len(curves)} kinds of samples: one picture shows P(p) of {MAX_PANELS}. Choose some."
        )
    units, columns = flow_units(results), min(len(curves), 2)
    rows, width = -(-len(curves) // columns), PAGE if columns == 2 else COLUMN
    named = {"x": units.label("p", "stress"), "y": "$P(p)$"}
    axes = np.ravel(page.panels(rows, columns, width, HEIGHT * rows, **named, count=len(curves)))
    for ax, (sample, phis), label in zip(
        axes, curves, labels_of([sample.kind for sample, _ in curves]), strict=True
    ):
        for phi, colour in zip(phis, colours(len(phis)), strict=True):
            look = {"color": colour, "marker": "o", "ms": 2.4, "label": rf"$\phi={phi:.6g}$"}
            _density(ax, *sample.density(phi, units.k), **look)
        ax.set(xlim=(0, None), ylim=(0, None))
        ax.set_title(label, pad=3)
        ax.ticklabel_format(axis="x", style="sci", scilimits=(-2, 3), useMathText=True)
        page.legend(ax, first="upper right")
    return f"P(p) of the jammed samples of {count_text(results, 'file', 'files')}"


def _density(ax, edges, height, error, **look):
    draw_points(ax, 0.5 * (edges[1:] + edges[:-1]), height, error, **look)


@picture("phi_J", "jam")
def plot_jamming_densities(results, page):
    """Distribution of φ_J over samples, a line for every kind and φ they were cooled at; bars are errors of counting.

    Raises InputError for samples that were not brought to their φ_J, and for fewer than make a density.
    """
    curves = [
        (samples.kind, phi, values)
        for samples in samples_of(results)
        for phi, values in sorted(samples.jamming.items())
        if len(values) >= MIN_SAMPLES
    ]
    if not curves:
        raise InputError(
            f"{results[0].path}: fewer than {MIN_SAMPLES} values of phi_J at every phi. Run jam with "
            f"{named('protocol')} compress and at least as many {named('seeds')}."
        )
    labels = labels_of([kind for kind, _, _ in curves])
    several = len({phi for _, phi, _ in curves}) > 1
    ax = page.panels(1, 1, COLUMN, HEIGHT, x=r"$\phi_J$", y=r"$P(\phi_J)$")
    for ((_, phi, values), label), look in looks(zip(curves, labels, strict=True)):
        text = label + (rf", cooled at $\phi={phi:.6g}$" if several else "")
        _density(ax, *density(values), label=text, **look)
        ax.axvline(values.mean(), color=look["color"], lw=0.6, ls=":")
    ax.set_ylim(0, None)
    page.legend(ax, title="dotted: means")
    return f"distribution of phi_J of {count_text(results, 'file', 'files')}"
