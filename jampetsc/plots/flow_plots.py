"""Pictures of steady shear: flow curves, regimes, series and order over strain, profiles between walls, g_y(x).

Quantities are in the units of the files (`picture.flow_units`): Vågberg's if `jampetsc flow` made the disks.

Local exponents d ln σ/d ln γ̇ show the regime (Vågberg, thesis sec. 6.4): 1 is Newtonian, where disks stay together in
large clusters, 2 Bagnoldian, where they part after a collision.
"""

from itertools import pairwise

import numpy as np

from jampetsc.analysis.correlated_series import layer_heights, mean_of_facts, mean_profile
from jampetsc.analysis.power_laws import local_exponents, power_law_window, quotient
from jampetsc.analysis.velocity_correlation import DEFAULT_BIN_WIDTH, DEFAULT_LANE_WIDTH
from jampetsc.errors import InputError
from jampetsc.io.disk_motion import correlate_lanes, six_fold_order, velocity_profiles
from jampetsc.plots.flow_kinds import kind_of, labels_of, shared_words
from jampetsc.plots.page import draw_band, draw_guide, draw_points
from jampetsc.plots.picture import count_text, flow_units, group_by, picture
from jampetsc.plots.style import DASHED, GREY, OPEN, PAGE, colours, entry, hidden, looks, number

CURVE_HEIGHT = 2.3  # inches of one row of panels
_MIN_POINTS = 2  # rates or packing fractions of a curve
MIN_GUIDE_RATES = 4  # of a curve that shows a slope
QUANTITIES = ("shear_stress", "pressure", "contact_number")


def flow_curves(results, over="rate") -> dict:
    """{kind: {quantity: (rates or φ (R,), values (R,), errors (R,))}}, runs of one kind and rate averaged.

    QUANTITIES in the units of `picture.flow_units`; errors are the larger of the scatter of runs and their own. over:
    "rate", with kinds as `kind_of` has them, or "phi", with kinds (kind, γ̇) whose φ is nan. Raises InputError
    where a run is there twice, or units differ.
    """
    units, curves, seen = flow_units(results), {}, {}
    for result in results:
        attributes, kind = result.attributes, kind_of(result)
        rate = float(attributes["rate"])
        origin = str(attributes.get("seed", attributes.get("packing_sha256")))
        if (kind, rate, origin) in seen:
            raise InputError(
                f"{result.path}: model, phi, N, rate and start of {seen[kind, rate, origin]}. "
                "Give each run once."
            )
        seen[kind, rate, origin] = result.path.name
        group, x = (kind, rate) if over == "rate" else (((kind[0], 0.0, *kind[2:]), rate), kind[1])
        curves.setdefault(group, {}).setdefault(x, []).append(attributes)
    averages = {}
    for kind, runs in sorted(curves.items()):
        x, averages[kind] = np.array(sorted(runs)), {}
        for name in QUANTITIES:
            values, errors = np.array([mean_of_facts(runs[position], name) for position in x]).T
            unit = 1.0 if name == "contact_number" else units.k
            averages[kind][name] = x * (units.tau1 if over == "rate" else 1.0), values / unit, errors / unit
    return averages


@picture("flow", "flow")
def plot_flow(results, page):
    """Flow curves of runs at several rates, as `draw_flow_curves`; σ and p over the strain of runs at one rate."""
    rates = {float(result.attributes["rate"]) for result in results}
    return draw_flow_curves(results, page) if len(rates) > 1 else draw_series(results, page)


def draw_flow_curves(results, page) -> str:
    """σ, p, σ/p, σ/γ̇ (filled) and p/γ̇ (hollow), local exponents of both, and Z against the rate.

    Grey lines have slopes 1 and 2 where a curve of σ or p follows them; the legend's title is what all have in common.
    Rates at which the mean stress or pressure is not positive are left out of all but Z. Raises InputError where no
    kind has two rates.
    """
    curves, units = flow_curves(results), flow_units(results)
    if not any(len(curve["pressure"][0]) >= _MIN_POINTS for curve in curves.values()):
        raise InputError(
            f"{results[0].path}: one rate of each model, phi and N. For flow curves give several."
        )
    names = [units.label(r"\sigma", "stress"), units.label("p", "stress"), r"$\sigma/p$"]
    names += [units.label(r"\sigma/\dot\gamma,\ p/\dot\gamma", "viscosity")]
    names += [r"$d\ln\sigma/d\ln\dot\gamma,\ d\ln p/d\ln\dot\gamma$", "$2N_c/N$"]
    rate = units.label(r"\dot\gamma", "rate")
    axes = page.panels(2, 3, PAGE, 2 * CURVE_HEIGHT, x=rate, y=names, log=["xy"] * 4 + ["x"] * 2)
    every = np.concatenate([curve["pressure"][0] for curve in curves.values()])
    for ax in axes:
        ax.set_xlim(every.min() / 1.3, 1.3 * every.max())
    exponents = []
    for (name, curve), look in looks(zip(labels_of(list(curves)), curves.values(), strict=True)):
        draw_points(axes[5], *curve["contact_number"], label=hidden(name), **look)
        rates = curve["pressure"][0]
        shown = (curve["shear_stress"][1] > 0) & (curve["pressure"][1] > 0)
        stress, pressure = ([part[shown] for part in curve[quantity][1:]] for quantity in QUANTITIES[:2])
        rates = rates[shown]
        for ax, both in zip(axes, (stress, pressure, quotient(stress, pressure)), strict=False):
            draw_points(ax, rates, *both, label=name, **look)
        for symbol, both, face in ((r"$\sigma$", stress, {}), ("$p$", pressure, OPEN)):
            named = look | {"label": hidden(f"{name}, {symbol}")}
            draw_points(axes[3], rates, *(part / rates for part in both), **named | face)
            hollow = {"markerfacecolor": "white"} if face else {}
            exponents.append((named | hollow, *local_exponents(rates, *both)))
    draw_local_exponents(axes[4], exponents)
    for ax in axes[:2]:
        for exponent, above in ((1.0, False), (2.0, True)):
            lines = [line.get_data() for line in ax.get_lines() if len(line.get_xdata()) >= MIN_GUIDE_RATES]
            followed = (line for line in lines if power_law_window(*line, exponent) is not None)
            if line := next(followed, None):
                draw_guide(ax, *line, exponent, r"\dot\gamma", above)
    page.legend(axes[0], title=shared_words(list(curves)), fontsize=7.5, handlelength=1.2, labelspacing=0.2)
    both = [entry(r"$\sigma$", marker="o"), entry("$p$", marker="o", mew=0.7, **OPEN)]
    page.legend(axes[3], both, groups=0, fontsize=7.5)
    return f"flow curves of {count_text(results, 'run', 'runs')} at {len(set(every))} rates"


def draw_local_exponents(ax, curves) -> None:
    """Curves [(look, x (M,), exponents (M,), errors (M,)), …], and lines at named limits within their range."""
    values = np.concatenate([y for _, _, y, _ in curves])
    low, high = np.array([values.min(), values.max()]) + np.array([-0.06, 0.12]) * max(np.ptp(values), 0.1)
    for look, x, y, error in curves:
        draw_points(ax, x, y, error, **look)
    ax.set_ylim(low, high)
    for value, regime in ((1, "Newtonian"), (2, "Bagnoldian")):
        if low < value < high:
            ax.axhline(value, color=GREY, lw=0.6, ls=":")
            place = {"textcoords": "offset points", "ha": "right", "color": GREY}
            ax.annotate(regime, (1, value), (-2, 1), ("axes fraction", "data"), **place)


@picture("stress", "flow")
def plot_stress(results, page):
    """σ alone against the rate, where it is positive, a line for each kind; runs of one kind and rate averaged.

    Raises InputError where no kind has two rates, or no stress is positive.
    """
    curves, units = flow_curves(results), flow_units(results)
    if not any(len(curve["shear_stress"][0]) >= _MIN_POINTS for curve in curves.values()):
        raise InputError(
            f"{results[0].path}: one rate of each model, phi and N. For a flow curve give several."
        )
    if not any((curve["shear_stress"][1] > 0).any() for curve in curves.values()):
        raise InputError(
            f"{results[0].path}: no shear stress is positive. Shear longer, or draw other files."
        )
    axes = units.label(r"\dot\gamma", "rate"), units.label(r"\sigma", "stress")
    ax = page.panels(x=axes[0], y=axes[1], log="xy")
    for (name, curve), look in looks(zip(labels_of(list(curves)), curves.values(), strict=True)):
        draw_points(ax, *curve["shear_stress"], label=name, **look)
    page.legend(ax)
    return f"shear stress of {count_text(results, 'run', 'runs')} against the rate"


@picture("phi", "flow")
def plot_against_phi(results, page):
    """σ, p and Z against φ, a line for every rate of a kind. Raises InputError where none has two φ."""
    curves = flow_curves(results, "phi")
    if not any(len(curve["pressure"][0]) >= _MIN_POINTS for curve in curves.values()):
        raise InputError(
            f"{results[0].path}: one phi of each model, rate and N. For curves against phi give several."
        )
    units = flow_units(results)
    kinds = [kind for kind, _ in curves]
    words = labels_of(kinds) if len(set(kinds)) > 1 else [""] * len(kinds)
    names = [units.label(r"\sigma", "stress"), units.label("p", "stress"), "$2N_c/N$"]
    axes = page.panels(1, 3, PAGE, CURVE_HEIGHT * 1.2, x=r"$\phi$", y=names, log=["y", "y", ""])
    for ax, name in zip(axes, QUANTITIES, strict=True):
        for (((_, rate), curve), word), look in looks(zip(curves.items(), words, strict=True)):
            label = (f"{word}, " if word else "") + f"${number(rate * units.tau1)}$"
            draw_points(ax, *curve[name], label=label, **look)
    page.legend(axes[2], title=units.label(r"\dot\gamma", "rate"))
    return f"stress, pressure and contacts of {count_text(results, 'run', 'runs')} against phi"


def flow_regimes(results) -> dict:
    """{model: {φ: (Q (M,), exponent (M,), error (M,), cluster (M,), low, high)}} of massive flows at two rates or more.

    exponent   d ln σ/d ln γ̇ between the two lowest rates, low and high, in 1/τ₁; nan where σ is not positive
    cluster    share of the disks in the largest cluster, at the lowest rate

    Raises InputError without a massive flow at two rates.
    """
    table, clusters = {}, {}
    for result in results:
        attributes = result.attributes
        clusters.setdefault((kind_of(result), float(attributes["rate"])), []).append(
            float(attributes["largest_cluster_mean"])
        )
    quality = {kind_of(result): result.attributes.get("quality") for result in results}
    for kind, curve in flow_curves(results).items():
        rates, stress, error = curve["shear_stress"]
        if quality[kind] is None or len(rates) < 2:
            continue
        exponent, spread = np.nan, np.nan
        if (stress[:2] > 0).all():
            _, (exponent,), (spread,) = local_exponents(rates[:2], stress[:2], error[:2])
        slowest = min(rate for other, rate in clusters if other == kind)
        share = np.mean(clusters[kind, slowest]) / kind[2]
        row = (float(quality[kind]), exponent, spread, share, rates[0], rates[1])
        table.setdefault(kind[0], {}).setdefault(kind[1], []).append(row)
    if not table:
        raise InputError(
            f"{results[0].path}: no massive disks at two rates of one φ and Q. For regimes give such flows."
        )
    return {
        model: {phi: np.array(sorted(rows)).T for phi, rows in sorted(group.items())}
        for model, group in table.items()
    }


@picture("regimes", "flow")
def plot_regimes(results, page):
    """Exponents of σ at the lowest rates, and the share of the largest cluster, against Q; a line for each φ.

    Raises InputError as `regimes`.
    """
    maps = flow_regimes(results)
    phis = sorted({phi for group in maps.values() for phi in group})
    styles = dict(looks(phis))
    axes = page.panels(2, len(maps), PAGE, 4.2, x="$Q$", log="x", sharex=True, sharey="row").reshape(2, -1)
    axes[0, 0].set_ylabel(r"$d\ln\sigma/d\ln\dot\gamma$")
    axes[1, 0].set_ylabel("largest cluster$/N$")
    for (slope, share), (model, group) in zip(axes.T, sorted(maps.items()), strict=True):
        for value in (1, 2):
            slope.axhline(value, color=GREY, lw=0.6, ls=":")
        for phi, (quality, exponent, error, cluster, *_) in group.items():
            look = styles[phi] | {"label": hidden(rf"${phi:g}$")}
            draw_points(slope, quality, exponent, error, **look)
            share.plot(quality, cluster, **look)
        slope.set_title(model, loc="right", pad=3)
        share.set_ylim(0, 1.05)
    handles = [entry(rf"${phi:g}$", **look) for phi, look in styles.items()]
    page.legend(axes[1, 0], handles, r"$\phi$", "lower left")
    return f"exponents and clusters of {count_text(results, 'run', 'runs')} against Q"


HEIGHT = 2.7  # inches of one row of panels
_STRESSES = (("shear_stress", r"\sigma"), ("pressure", "p"))
MAX_NAMED = 12  # runs in a legend
ORDERS = (r"$\langle|\psi_6|\rangle$", r"$|\langle\psi_6\rangle|$")
WINDOWS = (0.0, 0.1, 0.3, 1.0)  # strains between which the start is shown; the last window is the steady part
MAX_PROFILES = 3  # kinds of flow between walls in one picture


def draw_mean(ax, result, name, unit, colour, width) -> None:
    """The mean of NAME over the steady part of a run, dashed along its strain."""
    attributes = result.attributes
    mean, end = float(attributes[f"{name}_mean"]) / unit, result["strain"][-1]
    span = [np.copysign(float(attributes["discard"]), end), end]
    ax.plot(span, [mean, mean], color=colour, lw=width, ls=DASHED, label=hidden(f"{result.path.stem}, mean"))


def draw_series(results, page) -> str:
    """σ and p over the strain, of one file or several, with the means of the steady part."""
    units = flow_units(results)
    names = [units.label(symbol, "stress") for _, symbol in _STRESSES]
    axes = page.panels(1, 2, PAGE, HEIGHT, x=r"$\gamma$", y=names)
    for ax, (name, _) in zip(axes, _STRESSES, strict=True):
        for result, colour in zip(results, colours(len(results)), strict=True):
            values = result[name].sum(1) / units.k
            ax.plot(result["strain"], values, color=colour, lw=0.6, label=result.path.stem)
            draw_mean(ax, result, name, units.k, colour, 1.6)
        ax.set(ylim=(0, None), xmargin=0)
    handles = [entry("means", GREY, lw=1.6, ls=DASHED)]
    if 1 < len(results) <= MAX_NAMED:
        handles = axes[0].get_legend_handles_labels()[0] + handles
    page.legend(axes[1], handles)
    return f"stress and pressure of {count_text(results, 'run', 'runs')} over the strain"


@picture("order", "flow")
def plot_order(results, page):
    """⟨|ψ₆|⟩ and |⟨ψ₆⟩| over the strain: disks of one size order into layers, disks of two do not (Vågberg, Fig. 4.6).

    Kind by kind: thin lines runs, thick ones their mean. Raises InputError for files without snapshots, and for runs of
    one kind with snapshots at other strains.
    """
    kinds = group_by([(result, six_fold_order(result)) for result in results], lambda pair: kind_of(pair[0]))
    for (first, _), *repeats in kinds.values():
        for result, _ in repeats:
            if not np.array_equal(result["snapshots/strain"], first["snapshots/strain"]):
                raise InputError(
                    f"{result.path}: snapshots at other strains than {first.path.name}. For a mean give equal strains."
                )
    axes = page.panels(1, 2, PAGE, HEIGHT, x=r"$\gamma$", y=ORDERS)
    for part, ax in enumerate(axes):
        for (runs, label), look in looks(zip(kinds.values(), labels_of(list(kinds)), strict=True)):
            strain, thin = runs[0][0]["snapshots/strain"], {"color": look["color"], "lw": 0.3, "alpha": 0.6}
            for run, order in runs if len(runs) > 1 else ():
                ax.plot(strain, order[part], label=hidden(run.path.name), **thin)
            mean = np.mean([order[part] for _, order in runs], axis=0)
            ax.plot(strain, mean, markevery=max(1, len(strain) // 10), label=label, **look)
        ax.set(ylim=(0, 1), xmargin=0.01)
    page.legend(axes[1], title=f"thin: {len(results)} runs" if len(results) > len(kinds) else None)
    return f"six-fold order of {count_text(results, 'run', 'runs')} over the strain"


@picture("profile", "flow")
def plot_profiles(results, page):
    """y/H − ½ against v_x/(γ̇H) between walls in windows of strain: where the shear is at the start, and when steady.

    A panel for each kind and rate, runs averaged; dotted: linear, bars: standard errors. Raises InputError for files
    without profiles, and for more kinds than MAX_PROFILES.
    """
    kinds = group_by(results, lambda result: (kind_of(result), float(result.attributes["rate"])))
    if len(kinds) > MAX_PROFILES:
        raise InputError(
            f"{len(kinds)} kinds of flow: one picture of profiles shows {MAX_PROFILES}. Choose some."
        )
    rates = {rate for _, rate in kinds}
    named = {"x": r"$v_x/(\dot\gamma H)$", "y": r"$y/H-\frac{1}{2}$"}
    axes = np.ravel(page.panels(1, len(kinds), PAGE, 3.0, **named, sharey=True))
    names = labels_of([kind for kind, _ in kinds])
    for ax, ((_, rate), runs), name in zip(axes, kinds.items(), names, strict=True):
        steady = min(float(run.attributes["discard"]) for run in runs)
        end = min(float(run["strain"][-1]) for run in runs)
        windows = [*pairwise([edge for edge in WINDOWS if edge < steady]), (steady, end)]
        ax.plot([-0.5, 0.5], [-0.5, 0.5], color=GREY, lw=0.8, ls=":", zorder=1)
        for (low, high), look in looks(windows):
            v, error = mean_profile(velocity_profiles(runs, low, high))
            bars = {"xerr": np.nan_to_num(error), "elinewidth": 0.6, "label": f"${low:g}$ to ${high:.3g}$"}
            ax.errorbar(v, layer_heights(len(v)), ms=3, lw=0.8, **bars, **look)
        ax.set(xlim=(-0.52, 0.52), ylim=(-0.5, 0.5))
        title = rf"{name}, $\dot\gamma={number(rate)}$" if len(rates) > 1 else name
        ax.set_title(title, loc="right", pad=3)
    page.legend(axes[0], title=r"$\gamma$", first="upper left")
    return f"velocity between walls of {count_text(results, 'run', 'runs')} in windows of strain"


def lanes_of(results) -> list:
    """[(label, x (D,), g_y (D,), error (D,))] of files of g_y, or of flow files with snapshots, kind by kind.

    Flow files are correlated with the defaults of `jampetsc correlate`. Raises InputError without snapshots.
    """
    curves = []
    if results[0].format == "jampetsc-velocity-correlation":
        for result in results:
            attributes = result.attributes
            model, phi, rate = attributes["model"], float(attributes["phi"]), float(attributes["rate"])
            label = rf"{model}, $\phi={phi:.5g}$, $\dot\gamma={number(rate)}$"
            curves.append((label, result["x"], result["g_y"], result["g_y_error"]))
        return curves
    groups = group_by(results, lambda result: (kind_of(result), float(result.attributes["rate"])))
    names = labels_of([kind for kind, _ in sorted(groups)])
    for ((_, rate), runs), name in zip(sorted(groups.items()), names, strict=True):
        g = correlate_lanes(runs, DEFAULT_LANE_WIDTH, DEFAULT_BIN_WIDTH)
        curves.append((rf"{name}, $\dot\gamma={number(rate)}$", g.centres, g.values, g.errors))
    return curves


@picture("lanes", "velocity-correlation", "flow")
def plot_lanes(results, page):
    """g_y against x of one or several files, with bands of one standard error."""
    curves = lanes_of(results)
    ax = page.panels(1, 1, PAGE, HEIGHT, x=flow_units(results).label("x", "length"), y="$g_y(x)$")
    ax.axhline(0.0, color=GREY, lw=0.6)
    for (label, x, g, error), look in looks(curves):
        draw_band(ax, x, g - error, g + error, label, color=look["color"])
        ax.plot(x, g, label=label, **look)
    ax.set_xmargin(0.02)
    page.legend(ax, title="bands: one standard error")
    return f"g_y of {count_text(results, 'file', 'files')}"
