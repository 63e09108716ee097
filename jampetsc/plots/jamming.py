"""Which packings jam: f(φ) by N, P(p) of the jammed ones and the distribution of φ_J (Vågberg, thesis ch. 6).

Samples come from files of `jampetsc jam`, and from quasistatic shear, whose minima are samples of one run.
"""

from dataclasses import dataclass, field

import numpy as np

from jampetsc.analysis.jammed_samples import MIN_SAMPLES, Share, density, memory, runs_of, share_of
from jampetsc.errors import InputError, named
from jampetsc.plots.page import points
from jampetsc.plots.picture import count, differing, picture
from jampetsc.plots.style import COLUMN, GREY, PAGE, colours, looks, number
from jampetsc.plots.units import flow_units

HEIGHT = 2.7  # inches of one row of panels
PANELS = 6  # kinds in one picture of P(p)
RUN = "shear"  # the protocol of files of quasistatic shear


@dataclass(eq=False)
class Samples:
    """Samples of one kind (protocol, N, sizes, potential, step of shear): at each φ the runs they come in.

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
    found, seen = {}, {}
    for result in results:
        a = result.attributes
        # of disks out of a packing they are not known
        words = (str(a.get(name, "")) for name in ("sizes", "potential"))
        kind = _protocol(result), int(a["particle_count"]), *words, _step(result)
        here = found.setdefault(kind, Samples(kind))
        every = result["jammed"], result["pressure"]
        for phi, seed, rows in runs_of(result):
            phi, (jammed, pressure) = round(phi, 9), (values[rows] for values in every)
            known = np.isfinite(jammed)
            if (kind, phi, seed) in seen:
                raise InputError(
                    f"{result.path}: phi = {phi:g}, seed {seed} is in {seen[kind, phi, seed].name} too: "
                    "every sample counts once"
                )
            seen[kind, phi, seed] = result.path
            if known.any():
                here.runs.setdefault(phi, []).append((jammed[known], pressure[known]))
        if "phi_J" in result:
            phis, values = np.round(result["phi"], 9), result["phi_J"]
            for phi in np.unique(phis):
                some = values[(phis == phi) & np.isfinite(values)]
                here.jamming[phi] = np.concatenate((here.jamming.get(phi, []), some))
    kept = [found[kind] for kind in sorted(found) if found[kind].runs]
    if not kept:
        raise InputError(f"{results[0].path}: holds no sample that reached a minimum")
    return kept


def _protocol(result):
    """Protocol of the samples, with the rate of cooling where there is one."""
    a = result.attributes
    name = str(a.get("protocol", RUN if result.format == "jampetsc-shear" else "random"))
    parts = [name]
    if "cooling_rate" in a:
        parts.append(f"$R={number(float(a['cooling_rate']))}$")
        if float(a.get("strain", 0.0)) > 0:
            parts.append(rf"sheared by {float(a['strain']):g}")
    return ", ".join(parts + ["separated"] * bool(a.get("separated", False)))


def _step(result):
    """Δγ where every sample is a step of shear, or so many."""
    sheared = str(result.attributes.get("protocol", RUN)) == RUN and "step" in result.attributes
    return rf"$\Delta\gamma={number(float(result.attributes['step']))}$" if sheared else ""


def _labels(kinds):
    """A legend's words for each kind: the parts that differ, N at least."""
    protocols, sizes, *others = (len(set(part) - {""}) > 1 for part in zip(*kinds, strict=True))
    alike = not any((protocols, sizes, *others))
    parts = [(f"$N={n}$", protocol, *words) for protocol, n, *words in kinds]
    return differing(parts, (sizes or alike, protocols, *others))


@picture("fraction", "jam", "shear", mixed=True)
def plot_fraction(results, page):
    """f(φ), the share of samples that jam, a line for every N and protocol; bars are one standard error."""
    samples = samples_of(results)
    ax = page.panels(1, 1, COLUMN, HEIGHT, x=r"$\phi$", y=r"$f(\phi)$")
    ax.set_ylim(-0.04, 1.04)
    ax.axhline(0.5, color=GREY, lw=0.5, ls=":")
    labels = _labels([one.kind for one in samples])
    for (one, label), look in looks(zip(samples, labels, strict=True)):
        phis = sorted(one.runs)
        value, low, high = np.transpose([(s.value, s.low, s.high) for s in map(one.share, phis)])
        points(ax, phis, value, [value - low, high - value], label=label, **look)
    page.legend(ax, first="upper left")
    return f"f(phi), the share of samples that jam, of {count(results, 'file', 'files')}"


@picture("pressures", "jam", "shear", mixed=True)
def plot_pressures(results, page):
    """P(p) of the jammed samples, a line for every φ, a panel for every N and protocol; bars are errors of counting.

    Raises InputError where no φ has enough jammed samples, and for more kinds than fit.
    """
    samples = samples_of(results)
    curves = [
        (one, [phi for phi in sorted(one.runs) if len(one.pressures(phi)) >= MIN_SAMPLES]) for one in samples
    ]
    curves = [(one, some) for one, some in curves if some]
    if not curves:
        raise InputError(
            f"{results[0].path}: fewer than {MIN_SAMPLES} jammed samples at every phi: make more"
        )
    if len(curves) > PANELS:
        raise InputError(f"{len(curves)} kinds of samples: one picture shows P(p) of {PANELS}; choose some")
    units, columns = flow_units(results), min(len(curves), 2)
    rows, width = -(-len(curves) // columns), PAGE if columns == 2 else COLUMN
    named = {"x": units.label("p", "stress"), "y": "$P(p)$"}
    axes = np.ravel(page.panels(rows, columns, width, HEIGHT * rows, **named, count=len(curves)))
    for ax, (one, some), label in zip(axes, curves, _labels([one.kind for one, _ in curves]), strict=True):
        for phi, colour in zip(some, colours(len(some)), strict=True):
            look = {"color": colour, "marker": "o", "ms": 2.4, "label": rf"$\phi={phi:.6g}$"}
            _density(ax, *one.density(phi, units.k), **look)
        ax.set(xlim=(0, None), ylim=(0, None))
        ax.set_title(label, pad=3)
        ax.ticklabel_format(axis="x", style="sci", scilimits=(-2, 3), useMathText=True)
        page.legend(ax, first="upper right")
    return f"P(p) of the jammed samples of {count(results, 'file', 'files')}"


def _density(ax, edges, height, error, **look):
    points(ax, 0.5 * (edges[1:] + edges[:-1]), height, error, **look)


@picture("phi_J", "jam")
def plot_jamming_densities(results, page):
    """Distribution of φ_J over samples, a line for every kind and φ they were cooled at; bars are errors of counting.

    Raises InputError for samples that were not brought to their φ_J, and for fewer than make a density.
    """
    curves = [
        (one.kind, phi, values)
        for one in samples_of(results)
        for phi, values in sorted(one.jamming.items())
        if len(values) >= MIN_SAMPLES
    ]
    if not curves:
        raise InputError(
            f"{results[0].path}: holds fewer than {MIN_SAMPLES} values of phi_J: run jam with "
            f"{named('protocol')} compress"
        )
    labels = _labels([kind for kind, _, _ in curves])
    several = len({phi for _, phi, _ in curves}) > 1
    ax = page.panels(1, 1, COLUMN, HEIGHT, x=r"$\phi_J$", y=r"$P(\phi_J)$")
    for ((_, phi, values), label), look in looks(zip(curves, labels, strict=True)):
        text = label + (rf", cooled at $\phi={phi:.6g}$" if several else "")
        _density(ax, *density(values), label=text, **look)
        ax.axvline(values.mean(), color=look["color"], lw=0.6, ls=":")
    ax.set_ylim(0, None)
    page.legend(ax, title="dotted: means")
    return f"distribution of phi_J of {count(results, 'file', 'files')}"
