"""Quasistatic files: floppy motion against pressure, viscosities against β, scaling of η₀ with N (BT Figs. 4, 5, 8).

One contact more or less than isostatic is felt where ΔZ ~ p^½ is of the order of 1/N, that is pN² ~ 1: there η₀/N^a is
constant below and falls as (pN²)^(−a/2) above, where η₀ ~ p^(−a/2) does not depend on N. Under Stokes drag it does:
random forces make an isotropic elastic medium move by ⟨|u_na|²⟩ ~ ∫d²k/k² from 2π/L to 1/d, so √p (η₀ − η_F) =
A + B ln N, which over a range of N looks like a = 1 + d ln(A + B ln N)/d ln N.
"""

import itertools

import numpy as np
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from jampetsc.analysis.power_laws import fit_logarithm
from jampetsc.analysis.statistics import mean_with_error, median_interval
from jampetsc.errors import InputError, named
from jampetsc.io.ensemble import varied_settings
from jampetsc.laws.damping import OPTIONS, WEIGHTS, having
from jampetsc.laws.loads import DEFAULT, LoadChoice
from jampetsc.laws.masses import BY_NUMBER
from jampetsc.plots.page import draw_band, draw_guide, draw_points, draw_power_law, limits_kept
from jampetsc.plots.picture import count_text, group_by, picture, setting_text, stress_unit, units_of
from jampetsc.plots.style import (
    GREY,
    OPEN,
    PAGE,
    entry,
    exponent_text,
    hidden,
    looks,
    power_or_number,
    power_text,
)

BARE = "no_prestress"
# settings by which pictures group, or of which files hold both values
_KNOWN = ("n", "pressure", "phi", "prestress", "tau1")
_DEFAULTS = {
    "dimension": 2,
    "load": DEFAULT,
    "prestress": True,
    "mass_by": BY_NUMBER,
}  # of files without the attribute
QUANTITIES = {  # attribute -> (symbol, exponent expected, BT eqs. 19-21)
    "normal": (r"|\Delta u_\parallel|", 0.25),
    "transverse": (r"|\Delta u_\perp|", -0.25),
    "nonaffine": (r"|u_{\rm na}|", -0.25),
}
PRESTRESS = (  # prefix of attributes, its meaning, further keywords of the line
    (f"{BARE}_", "no pre-stress", {}),
    ("", "pre-stress", OPEN),
)


def has_pressure(result) -> bool:
    """Whether a file has a positive pressure, unlike networks at rest."""
    return float(result.attributes.get("pressure", 0.0)) > 0


def is_strained(result) -> bool:
    """Whether a file has a positive pressure, and its load is a strain."""
    return has_pressure(result) and not probe_of(result)


def probe_of(result):
    """The forces that are the load of a file, see `laws.probes`; None of a strain."""
    return LoadChoice(str(result.attributes.get("load", DEFAULT))).probe


def pressures_of(results, zero=False):
    """p/k of each file, (F,), a mean over seeds of one packing fraction that a study has set.

    Raises InputError where it is not positive, or `zero`, as of networks at rest.
    """
    pressures = []
    for result in results:
        pressure = units_of(result).pressure
        if pressure is None or not (pressure > 0 or (zero and pressure == 0)):
            words = "is not recorded" if pressure is None else f"{pressure:g}"
            raise InputError(f"{result.path}: pressure {words}. Give files of positive pressure.")
        pressures.append(float(f"{pressure:.6g}"))
    levels = group_by(zip(results, pressures, strict=True), lambda pair: _density(pair[0]))
    means = {key: float(np.mean([p for _, p in own])) for key, own in levels.items() if key}
    return np.array([means.get(_density(result), p) for result, p in zip(results, pressures, strict=True)])


def _density(result) -> tuple:
    """(N, φ) of a packing that a study made at a packing fraction, whose seeds differ in p; else ()."""
    settings = getattr(result, "settings", {})
    if settings.get("phi") is None or settings.get("pressure") is not None:
        return ()
    return result.attributes.get("particle_count"), settings["phi"]


def require_alike(results, names, varied=()) -> None:
    """Raise InputError where files differ in an attribute of these names: a dimension, a load, a law, a parameter.

    Also where they differ in what a study has set beside pressure and N, and those that are `varied`.
    """
    first = results[0]
    for result, name in itertools.product(results, names):
        value, other = (item.attributes.get(name, _DEFAULTS.get(name)) for item in (result, first))
        if value != other:
            of_one = name if name in _DEFAULTS else "law"
            raise InputError(
                f"{result.path}: {named(name)} {value}, but {first.path.name} has {other}. Draw files of one {of_one}."
            )
    settings = [getattr(result, "settings", {}) for result in results]
    for name in varied_settings(settings):
        if name not in (*_KNOWN, *names, *varied):
            values = [str(row.get(name)) for row in settings]
            result, value = next(pair for pair in zip(results, values, strict=True) if pair[1] != values[0])
            raise InputError(
                f"{result.path}: {setting_text(name, None if value == 'None' else value)}, but {first.path.name} has "
                f"{values[0]}. Choose one (of a study by {named('where')} {name}=…)."
            )


def groups_of(results, varied=()) -> dict:
    """{N: {p/k: files}}, of files that differ in the packing alone, small N and low pressure first.

    varied: parameters of the law in which they may differ as well. Raises InputError for several dimensions, loads or
    laws, and for forces.
    """
    for result in results:
        if probe_of(result):
            raise InputError(
                f"{result.path}: {named('load')} {result.attributes['load']}, which is forces. Give files of strains."
            )
    require_alike(
        results,
        tuple(
            name for name in ("dimension", "load", "law", *OPTIONS, *WEIGHTS, "alpha") if name not in varied
        ),
        varied,
    )
    groups = {}
    for result, pressure in sorted(
        zip(results, pressures_of(results), strict=True), key=lambda pair: pair[1]
    ):
        levels = groups.setdefault(int(result.attributes.get("particle_count", 0)), {})
        levels.setdefault(pressure, []).append(result)
    return dict(sorted(groups.items()))


def values_of(levels, value, *more) -> list:
    """value(result, *more) of the files of each pressure of one N, [(files,), …]; `levels` of `groups_of`.

    Files whose value is nan are left out where others have one.
    """
    samples = [np.array([value(result, *more) for result in files]) for files in levels.values()]
    return [
        sample[np.isfinite(sample)] if sample.ndim == 1 and np.isfinite(sample).any() else sample
        for sample in samples
    ]


def prestress_samples(levels, value, *more):
    """(values as `values_of`, words, look, prefix) without pre-stress and with it, of what the files hold."""
    for prefix, words, face in PRESTRESS:
        samples = values_of(levels, value, *more, prefix)
        if np.isfinite(np.concatenate(samples)).any():
            yield samples, words, face, prefix


@picture("medians", "quasistatic", suits=is_strained)
def plot_medians(results, page):
    """Medians of |Δu∥|, |Δu⊥| and |u_na| per unit strain against p/k, with slopes ±1/4 (BT eqs. 19-21).

    Filled: without pre-stress; open: with. Small points are files, lines run through the medians of files of
    one pressure and N; where each has several, bands are 68 % intervals of these medians by resampling the files.
    """
    groups = groups_of(results)
    ax = page.panels(x=f"$p{stress_unit(results).over}$", y="median per unit strain", log="xy")
    styles = {size: {"marker": look["marker"]} for size, look in looks(groups)}
    several, handles, bands, single = len(groups) > 1, [], [], False
    for (name, (symbol, slope)), own in looks(QUANTITIES.items()):
        handles.append(entry(f"${symbol}$", **({"color": own["color"]} if several else own)))
        for size, levels in groups.items():
            p, look, lines = np.array(list(levels)), own | (styles[size] if several else {}), []
            for samples, words, face, _ in prestress_samples(levels, value_of, f"{name}_median"):
                label = f"${symbol}$, $N={size}$, {words}"
                medians, drawn = draw_medians(ax, p, samples, look | face, label)
                lines, bands = [*lines, medians], drawn or bands
                if max(map(len, samples)) > 1:
                    x, y = np.repeat(p, [len(sample) for sample in samples]), np.concatenate(samples)
                    dots = {
                        "markersize": 2,
                        "markeredgewidth": 0,
                        "label": hidden(f"{label}, single packings"),
                    }
                    ax.plot(x, y, ".", color=look["color"], **dots)
                    single = True
        draw_power_law(ax, p, lines[0], slope)  # of the largest N
    handles += handles_of({size: look | {"ls": "none"} for size, look in styles.items() if several})
    if any(len(levels) > 1 for levels in groups.values()):
        handles.append(entry(r"$p^{\pm 1/4}$", GREY, linestyle=":", linewidth=0.8))
    if single:
        handles.append(entry("single packings", marker=".", ms=2, ls="none"))
    page.legend(ax, handles + bands)
    return f"medians of floppy motion in {count_text(results, 'file', 'files')}"


def handles_of(styles) -> list:
    """Legend entries of sizes, {N: look}, and of values without pre-stress and with it."""
    sizes = [entry(f"$N={size}$", **look) for size, look in styles.items()]
    return sizes + [entry(words, marker="o", mew=0.7, **face) for _, words, face in PRESTRESS]


def draw_medians(ax, x, samples, look, name) -> tuple:
    """(medians (M,), legend entries) of M samples over x (M,): a line, and a band where the medians lie.

    The band is drawn, and has an entry, if each sample has the three values that it takes.
    """
    finite = [sample[np.isfinite(sample)] for sample in samples]
    medians = np.array([np.median(sample) if len(sample) else np.nan for sample in finite])
    ax.plot(x, medians, **{"markeredgewidth": 0.7, "label": hidden(name)} | look)
    if not all(len(sample) > 2 for sample in finite):
        return medians, []
    draw_band(ax, x, *np.transpose([median_interval(sample) for sample in finite]), name, color=look["color"])
    return medians, [Patch(facecolor="0.2", alpha=0.25, label="68 % interval")]


def value_of(result, name, prefix=f"{BARE}_"):
    """An attribute without pre-stress (this prefix) or with it (""); nan where the file has none."""
    attributes = result.attributes
    if not attributes.get("prestress", True):  # such a run has only the one, under the plain names
        return attributes[name] if prefix else np.nan
    return attributes[f"{prefix}{name}"]


def unstable(results) -> str:
    """How many of quasistatic files have G₀ < 0 under pre-stress, in words."""
    negative = sum(result.attributes["G0"] < 0 for result in results if result.attributes["prestress"])
    return f"; G0 < 0 in {negative} of them, which count like the others" if negative else ""


@picture("viscosities", "quasistatic", suits=is_strained)
def plot_viscosities(results, page):
    """η₀ (filled) and η_∞ (open) in kτ₁ against β, a colour for each pressure and N; with the scans over β of the
    files. Guides are β and β^½, where the first colour's lines follow them.

    Raises InputError for files of another law.
    """
    for result in results:
        if result.attributes.get("law") not in having("beta"):
            raise InputError(
                f"{result.path}: law {result.attributes.get('law')}, without beta. Give files of contact damping."
            )
    sizes = groups_of(results, varied=("beta",))
    groups = looks((size, level, files) for size, levels in sizes.items() for level, files in levels.items())
    ax = page.panels(x=r"$\beta$", y=rf"$\eta_0,\ \eta_\infty\ [{stress_unit(results).viscosity}]$", log="xy")
    handles, bands, first = [], [], {}
    columns = ((r"$\eta_0$", {}), (r"$\eta_\infty$", OPEN))
    for (size, level, files), look in groups:
        table = np.array([row for result in files for row in _rows(result)])
        betas = np.unique(table[:, 0])
        label = f"${power_or_number(level)}$" + (f", $N={size}$" if len(sizes) > 1 else "")
        handles.append(entry(label, **look))
        for column, (symbol, face) in enumerate(columns, 1):
            samples = [table[table[:, 0] == beta, column] for beta in betas]
            middle, drawn = draw_medians(ax, betas, samples, look | face, f"{symbol}, {label}")
            bands = drawn or bands
            first.setdefault(symbol, (betas, middle))
    for (symbol, _), exponent, above in zip(columns, (1.0, 0.5), (True, False), strict=True):
        draw_guide(ax, *first[symbol], exponent, r"\beta", above)
    handles += [entry(symbol, marker="o", mew=0.7, **face) for symbol, face in columns]
    page.legend(ax, handles + bands, f"$p{stress_unit(results).over}$")
    return f"eta0 and eta_inf against beta of {count_text(results, 'file', 'files')}"


def _rows(result):
    """(β, η₀, η_∞) in kτ₁, the file's own and its scan's, β > 0."""
    units, names = units_of(result), ("beta", "eta0", "eta_inf")
    unit = units.k * units.tau1
    rows = [tuple(result.attributes[name] for name in names)]
    if "beta_scan/beta" in result:
        rows += zip(*(result[f"beta_scan/{name}"] for name in names), strict=True)
    return sorted({(beta, eta0 / unit, eta_inf / unit) for beta, eta0, eta_inf in rows if beta > 0})


HEIGHT = 3.0  # inches
LARGE_PN2 = 30.0  # pN² above which η₀ does not depend on N, except by a logarithm
MAX_CRITICAL_PRESSURE = 2e-3  # p/k below which √p η₀ does not depend on p
MIN_SIZES = 3  # of a line in ln N
BESIDE = 1.12  # factor between points of neighbouring pressures at one N


@picture("finite-size", "quasistatic", suits=is_strained)
def plot_finite_size(results, page):
    """As `draw_finite_size` with a = 1, the exponent of contact damping (BT)."""
    return draw_finite_size(results, page, 1.0)


def draw_finite_size(results, page, size_power) -> str:
    """η₀/N^a against pN², a = size_power, with the slope −a/2 of what does not depend on N: medians, 68 % intervals.

    Filled: without pre-stress; open: with. Under a law with a fluid a second panel has η₀ − η_F; the last √p (η₀ − η_F)
    without pre-stress against N where pN² > LARGE_PN2 and p/k < MAX_CRITICAL_PRESSURE, means with their errors, and
    A + B ln N for each pressure with enough sizes.

    Raises InputError for files of several laws, and where pressures are not positive.
    """
    law = results[0].attributes.get("law")
    for result in results:
        if result.attributes.get("law") != law:
            raise InputError(
                f"{result.path}: law {result.attributes.get('law')}, {results[0].path.name} has {law}. "
                f"Choose one law (of a study by {named('where')} law=…)."
            )
    groups = groups_of(results)
    fluid = any(fluid_of(result) > 0 for result in results)
    symbols = [r"\eta_0"] + [r"(\eta_0-\eta_F)"] * fluid
    styles = dict(looks(groups))
    unit = stress_unit(results)
    y = [rf"${symbol}\,/\,{power_text('N', size_power)}$ $[{unit.viscosity}]$" for symbol in symbols]
    axes = {
        "x": [f"$N^2p{unit.over}$"] * len(symbols) + ["$N$"],
        "y": [*y, rf"$(p{unit.over})^{{1/2}}\,{symbols[-1]}$ $[{unit.viscosity}]$"],
        "log": ["xy"] * len(symbols) + ["x"],
    }
    axes = page.panels(1, 1 + len(symbols), PAGE, HEIGHT if fluid else 0.9 * HEIGHT, **axes)
    for ax, subtracted in zip(axes[:-1], (False, True), strict=False):
        _draw_collapse(ax, groups, styles, size_power, subtracted)
    _draw_sizes(page, axes[-1], groups, unit)
    guide = entry(f"slope ${exponent_text(-size_power / 2)}$", GREY, linestyle="--")
    page.legend(axes[0], [*handles_of(styles), guide], first="lower left", handlelength=1.8)
    return f"eta0/N^{size_power:g} against pN^2 of {count_text(results, 'file', 'files')}{unstable(results)}"


def fluid_of(result) -> float:
    """η_F of a quasistatic file, 0 under a law without a fluid."""
    return float(result.attributes.get("eta0_fluid", 0.0))


def viscosity_of(result, subtracted, prefix=f"{BARE}_") -> float:
    """η₀ in kτ₁, less η_F if subtracted, without pre-stress (this prefix) or with it ("")."""
    units = units_of(result)
    eta0 = value_of(result, "eta0", prefix) - (fluid_of(result) if subtracted else 0.0)
    return eta0 / (units.k * units.tau1)


def _draw_collapse(ax, groups, styles, power, subtracted):
    bare = []
    for size, levels in groups.items():
        x, look = np.array(list(levels)) * size**2, {"linewidth": 0.8} | styles[size]
        for values, words, face, prefix in prestress_samples(levels, viscosity_of, subtracted):
            samples = [value / size**power for value in values]
            y, _ = draw_medians(ax, x, samples, look | face, f"$N={size}$, {words}")
            if prefix:
                bare.append((x, y))
    x, y = np.concatenate(bare, axis=1)
    large = x > LARGE_PN2
    if large.any():
        level = np.exp(np.mean(np.log(y[large] * x[large] ** (power / 2))))
        guide = np.array([1.0, x.max()])
        with limits_kept(ax):
            ax.plot(guide, level * guide ** (-power / 2), "--", color=GREY, linewidth=0.8, zorder=1)


def _draw_sizes(page, ax, groups, unit):
    large = {}  # {p/k: {N: (mean, error) of √p (η₀ − η_F)}}
    for size, levels in groups.items():
        for level, files in levels.items():
            if level * size**2 > LARGE_PN2 and level < MAX_CRITICAL_PRESSURE:
                scaled = [
                    np.sqrt(units_of(result).pressure) * viscosity_of(result, subtracted=True)
                    for result in files
                ]
                large.setdefault(level, {})[size] = mean_with_error(scaled)
    for number, ((level, sizes), look) in enumerate(looks(sorted(large.items()))):
        n = np.array(list(sizes))
        y, error = np.transpose(list(sizes.values()))
        beside = n * BESIDE ** (number - (len(large) - 1) / 2)
        draw_points(ax, beside, y, error, linestyle="none", label=f"${power_or_number(level)}$", **look)
        certain = np.isfinite(error) & (error > 0)
        if certain.sum() >= MIN_SIZES:
            constant, slope = fit_logarithm(n[certain], y[certain], error[certain])
            ax.plot(n, constant + slope * np.log(n), color=look["color"], linewidth=0.8, zorder=1)
    ax.set_ylim(0.0, None)
    page.legend(ax, title=f"$p{unit.over}$", groups=0)
    ax.xaxis.set_major_locator(FixedLocator(sorted({size for sizes in large.values() for size in sizes})))
    ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.xaxis.set_minor_locator(NullLocator())
