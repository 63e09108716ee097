"""G*(ω) of sweeps in comparable form: units of k and 1/τ₁, labels with the differences, means over an ensemble."""

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
from matplotlib.colors import LogNorm, to_rgba

from jampetsc.analysis.elasticity import dimension_of
from jampetsc.analysis.statistics import STATISTICS, median_interval
from jampetsc.errors import InputError, named
from jampetsc.io.provenance import LAW_PARAMETERS, recorded_dimension
from jampetsc.laws.damping import FAMILIES, OPTIONS
from jampetsc.laws.forms import FORMS
from jampetsc.laws.loads import DEFAULT, TENSOR
from jampetsc.plots.picture import group_by, setting_text, stress_unit, units_of
from jampetsc.plots.style import (
    DASHED,
    DOTTED,
    GREY,
    colours,
    entry,
    has_chosen_colours,
    looks,
    number,
    power_or_number,
    sequential,
)

_FREQUENCY_TOLERANCE = 1e-9  # relative, within which two frequencies are the same
_MAX_MODULUS = 1e200  # on a log axis; its inverse is the smallest
_BOUNDS = ("error_bound_storage", "error_bound_loss")  # sharper than the one on |ΔG*|, where a file has them
_LEADING = [family.leading for family in FAMILIES.values()]  # in labels whenever laws differ
_SWITCHES = {  # attribute -> words for (off, on)
    "rotations": ("no rotations", "rotations"),
    "prestress": ("no pre-stress", "pre-stress"),
}
_SYMBOLS = {  # parameter -> its symbol; a law's own parameters are shown by name
    **{name: rf"\rm {name}".replace("_", r"\_") for name in OPTIONS if name not in _SWITCHES},
    **{form.weight: form.symbol for form in FORMS},
    **{"beta": r"\beta", "tangential_stiffness": r"k_t/k", "mass": "m"},
    **{"alpha": r"\alpha", "stress": r"\sigma_0/k", "strain": r"\gamma_0", "omega": r"\omega\tau_1"},
}
_LOADS = {DEFAULT: "shear xy", TENSOR: "shear, all directions"}
_CONTACTS = {  # of an oscillation; None: a sweep
    None: "linear response",
    "fixed": "fixed contacts",
    "moving": "moving contacts",
}
OSCILLATION = "jampetsc-oscillate"
PROPERTIES = {
    "pressure": "p/k",
    "n": "N",
    "particle_count": "N",
    "dimension": "D",
}  # of columns with other names
_KEYS = {"p/k", "phi", "D", "N", "law", "load", "contacts", *_SYMBOLS, *_SWITCHES}
# settings that files record as well, and the amplitude and duration of oscillations
_DESCRIBED = {
    *PROPERTIES,
    *_SYMBOLS,
    *_SWITCHES,
    *LAW_PARAMETERS,
    "phi",
    "law",
    "load",
    "contacts",
    "cycles",
    "steps",
}
_DASHES = ("-", DASHED, DOTTED, (0, (6, 1.5, 1, 1.5)))


@dataclass(frozen=True, eq=False)
class Curve:
    """One sweep, or oscillations, frequencies increasing, in units of k and 1/τ₁."""

    name: str  # of the file
    omega: np.ndarray  # (M,) ωτ₁, or the amplitude of oscillations at one frequency
    G: np.ndarray  # (M,) G*/k
    bounds: np.ndarray  # (2, M) on |ΔG'|/k and |ΔG''|/k, or (2, 2, M) below and above
    pressure: float | None  # p/k
    attributes: dict
    settings: dict = field(default_factory=dict, kw_only=True)  # of `io.results.Result`
    by: tuple = field(default=(), kw_only=True)  # the columns by which alone curves differ; () for all

    @property
    def description(self) -> dict:
        """{property: value} by which it may differ from other sweeps, in the order of the label."""
        properties = self._properties()
        return {name: properties.get(name) for name in self.by} if self.by else properties

    @property
    def has_fixed_density(self) -> bool:
        """Whether its packing was made at a packing fraction, so that pressures of its ensemble differ."""
        return self.settings.get("phi") is not None and self.settings.get("pressure") is None

    def _properties(self):
        fixed, phi = self.has_fixed_density, self.settings.get("phi")
        whole = (
            1.0 if "bond_count" in self.attributes else None
        )  # networks that keep all bonds do not record it
        description = {
            "p/k": None if fixed or self.pressure is None else float(f"{self.pressure:.3g}"),
            "phi": phi if fixed else None,
        }
        description["D"] = recorded_dimension(self.attributes)
        description["N"] = self.attributes.get("particle_count")
        description["law"] = self.attributes.get("law")
        options = FAMILIES[description["law"]].options if description["law"] in FAMILIES else {}
        for key in (*_SYMBOLS, *_SWITCHES):
            default = options[key].default if key in options else None  # of files older than the option
            description[key] = self.attributes.get(key, default)
        description["alpha"] = self.attributes.get("alpha", 1.0)  # linear damping without the attribute
        return description | {
            "load": self.attributes.get("load", DEFAULT),
            "contacts": self.attributes.get("contacts"),
            **{name: value for name, value in self.settings.items() if name not in _DESCRIBED},
            "keep": self.settings.get("keep", self.attributes.get("keep", whole)),
        }


@dataclass(frozen=True, eq=False)
class CurveGroup:
    """Sweeps that share a label, a colour, a marker and a dash: one, or the members of an ensemble.

    parts   of the label, pressure and law, where a legend tells them apart: by colour, and by marker or dash
    value   of the only number in which the groups differ; None where they differ in other things
    """

    label: str
    curves: list
    colour: tuple
    marker: str
    dash: str | tuple = "-"
    parts: tuple = ()
    value: float | None = None


def curve_of(result) -> Curve:
    """The curve of a SweepResult, brought to units of k and 1/τ₁ with its attributes `k` and `tau1`; a Curve is one.

    Raises InputError for a file without any modulus, or with one outside the range of log axes.
    """
    if isinstance(result, Curve):
        return result
    if result.G.ndim > 1:
        raise InputError(
            f"{result.path}: {named('load')} {result.load}, several waves. Give files of one wave each."
        )
    bounds = [result[name] if name in result else result.error_bound for name in _BOUNDS]
    return _curve(result, result.omega * units_of(result).tau1, result.G, bounds)


def bulk_curve_of(result) -> Curve:
    """The curve of K*, the bulk modulus, of a sweep of the tensor. Raises InputError for a sweep of a single load."""
    require_tensor(result)
    D = dimension_of(result["C"])
    names = [name if (name := f"C_{part}") in result else "C_error_bound" for part in _BOUNDS]
    bounds = [result[name][:, :D, :D].mean(axis=(1, 2)) for name in names]
    return _curve(result, result.omega * units_of(result).tau1, result["bulk_modulus"], bounds)


def require_tensor(result) -> None:
    """Raise InputError for a sweep without elastic constants."""
    if "C" not in result:
        raise InputError(
            f"{result.path}: {named('load')} {result.load}, so no elastic constants. Run the sweep with "
            f"{named('load')} tensor."
        )


def curves_of(result, along="omega") -> list[Curve]:
    """The curve of a sweep, [`curve_of`]; of oscillations G* over the frequency for each amplitude, or the other way
    round along="amplitude". What failed altogether is left out. Raises InputError as `curve_of`.
    """
    if isinstance(result, Curve) or (result.format != OSCILLATION and result.G.ndim == 1):
        return [curve_of(result)]
    units = units_of(result)
    if result.format != OSCILLATION:  # several waves of forces
        x, columns = result.omega * units.tau1, [result[name].T for name in ("G", *_BOUNDS)]
        waves = zip(str(result.load).split("+"), *columns, strict=True)
        return [_curve(result, x, G, bounds, load=load) for load, G, *bounds in waves]
    G, error, fixed = result["G"], result["error"], result.attributes["control"]
    omega, amplitude = (
        result["omega"] * units.tau1,
        result["amplitude"] / (units.k if fixed == "stress" else 1.0),
    )
    if along == "amplitude":
        omega, amplitude, G, error, fixed = amplitude, omega, G.T, error.T, "omega"
    rows = [row for row in range(len(amplitude)) if np.isfinite(G[row]).any()] or [0]
    return [_curve(result, omega, G[n], [error[n]] * 2, **{fixed: float(amplitude[n])}) for n in rows]


def _curve(result, x, G, bounds, **more):
    """The curve of a file over x, (M,), increasing; more: further attributes."""
    units = units_of(result)
    order = np.argsort(x)
    order = order[np.isfinite(G[order])]
    repeated = np.diff(np.log(x[order]), prepend=-np.inf) < _FREQUENCY_TOLERANCE
    order = order[~repeated]
    if not len(order):
        raise InputError(f"{result.path}: no modulus at any frequency. Run the sweep again.")
    for part in (G.real[order], G.imag[order]):
        size = np.abs(part[part != 0])
        if not ((size > 1 / _MAX_MODULUS) & (size < _MAX_MODULUS)).all():
            raise InputError(f"{result.path}: moduli beyond the range of a picture. Run the sweep again.")
    return Curve(
        name=result.path.name,
        omega=x[order],
        G=G[order] / units.k,
        bounds=np.array(bounds)[:, order] / units.k,
        pressure=units.pressure,
        attributes={"mass": 0.0} | _in_units_of_k(result.attributes, units.k) | more,
        settings=getattr(result, "settings", {}),
    )


def _in_units_of_k(attributes, k):
    """Attributes with the stress of power-law damping over k."""
    return attributes | ({"stress": attributes["stress"] / k} if "stress" in attributes else {})


def group_curves(curves, crossed=True, labels=()) -> tuple[str, list[CurveGroup]]:
    """(legend title, groups) of curves that differ in pressure, law or parameters, low pressure first.

    labels   words of the user for each curve, which then is a group of its own, in the order of the curves

    Colours run from dark at low pressure (or at the first label) to light; the title is p over its unit if that is all,
    after the load of all where that is not shear.
    Where one number differs, its logarithm sets the colour, and grey is 0. If they may be `crossed`, several laws at
    several pressures have the colours of these, and each law a marker and a dash.
    """
    descriptions, over = [c.description for c in curves], stress_unit(curves).over
    names = dict.fromkeys(key for description in descriptions for key in description)
    descriptions = [{key: description.get(key) for key in names} for description in descriptions]
    varying = [key for key in names if _varies(key, [d[key] for d in descriptions])]
    only_pressure = varying in (["p/k"], []) and all(c.pressure and c.pressure > 0 for c in curves)
    only_pressure = only_pressure and all(d.get("p/k") is not None for d in descriptions)
    density = "phi" if descriptions[0].get("phi") is not None else "p/k"
    keys = varying or [density if density in names else next(iter(names))]
    members = group_by(
        sorted(zip(curves, descriptions, strict=True), key=lambda pair: _rank(pair[1])),
        lambda pair: tuple(_part(key, pair[1], only_pressure, over) for key in keys),
    )
    numbers = [own[0][0].pressure if only_pressure else own[0][1][keys[0]] for own in members.values()]
    scaled = keys in ([name] for name in ("p/k", *_SYMBOLS)) and all(
        isinstance(value, int | float) and value >= 0 for value in numbers
    )
    shades = colours(len(members))
    if scaled and any(numbers) and not has_chosen_colours():
        shades = log_colours(numbers)
    elif has_chosen_colours() and len(members) == len(curves):  # in the order of the files
        shades = [shades[curves.index(own[0][0])] for own in members.values()]
    groups = []
    for ((parts, own), look), shade, value in zip(looks(members.items()), shades, numbers, strict=True):
        own_curves = [curve for curve, _ in own]
        groups.append(
            CurveGroup(_label(parts), own_curves, shade, look["marker"], value=value if scaled else None)
        )
    pairs = [(level, _label(law)) for level, *law in members]
    levels, laws = (dict(looks(dict.fromkeys(parts))) for parts in zip(*pairs, strict=True))
    if crossed and keys[0] == "p/k" and len(pairs) > max(len(levels), len(laws)):
        dashes = dict(zip(laws, itertools.cycle(_DASHES), strict=False))
        for n, (level, law) in enumerate(pairs):
            look = {"colour": levels[level]["color"], "marker": laws[law]["marker"], "dash": dashes[law]}
            groups[n] = replace(groups[n], **look, parts=pairs[n])
    load = descriptions[0].get("load", DEFAULT)
    words = [] if "load" in varying or load in _LOADS else [f"load {load}"]
    if labels:
        return ",  ".join(words), _labelled_groups(curves, groups, labels)
    return ",  ".join(words + [f"$p{over}$"] * only_pressure), groups


def _labelled_groups(curves, groups, labels):
    """A group for each curve, in their order, with its label; curves of a shared group get colours of their own."""
    owners = [
        next(group for group in groups if any(own is curve for own in group.curves)) for curve in curves
    ]
    if len(groups) == len(curves) and not has_chosen_colours():
        return [replace(group, label=label, parts=()) for group, label in zip(owners, labels, strict=True)]
    return [
        CurveGroup(label, [curve], look["color"], look["marker"])
        for (curve, look), label in zip(looks(curves), labels, strict=True)
    ]


def log_colours(values) -> list[tuple]:
    """Colours of values (G,) by their logarithm, dark to light; grey is 0."""
    values = np.array(values, float)
    positive = values[values > 0]
    shades = sequential()(LogNorm(positive.min(), positive.max())(np.maximum(values, positive.min())))
    return [tuple(shade) if value > 0 else to_rgba(GREY) for value, shade in zip(values, shades, strict=True)]


def symbol_of(groups) -> str:
    """The symbol of the number in which alone groups differ, in TeX; "" where they differ in other things."""
    if any(group.value is None for group in groups):
        return ""
    first, last = groups[0].curves[0].description, groups[-1].curves[0].description
    over = stress_unit([curve for group in groups for curve in group.curves]).over
    symbols = (_SYMBOLS.get(key, key).replace("/k", over) for key in first if first[key] != last[key])
    return next((f"${symbol}$" for symbol in symbols), "")


def entries_of(groups, look) -> list:
    """Entries of a legend: of each group, or of each pressure and each law; look(group): of its line but for colour."""
    if not groups[0].parts:
        return [entry(group.label, group.colour, **look(group)) for group in groups]
    levels = {group.parts[0]: entry(group.parts[0], group.colour) for group in groups}
    laws = {group.parts[1]: entry(group.parts[1], **{"ls": "none"} | look(group)) for group in groups}
    return [*levels.values(), *laws.values()]


def _label(parts):
    return ", ".join(filter(None, parts)) or "other"  # what only some files record


def _varies(key, values):
    """Whether a property differs among sweeps; one that a law does not have counts as different only if _LEADING."""
    counts = key not in (*OPTIONS, *_SWITCHES) or key in _LEADING
    return len({str(value) for value in values if counts or value is not None}) > 1


def _rank(description):
    return tuple(
        (value is None, value if isinstance(value, (int, float)) else 0.0, str(value))
        for value in description.values()
    )


def _part(key, description, bare, over):
    """The words for one property in a label; over: the unit of stress, as `StressUnit.over`."""
    value = description[key]
    if key == "p/k" and value is None and description.get("phi") is not None:
        return ""
    if key not in _KEYS:
        return setting_text(key, value)
    if key == "contacts":
        return _CONTACTS[value]
    if key == "load":
        return _LOADS.get(value, f"load {value}")
    if value is None:
        return "" if key != "p/k" else "$p$ unknown"
    if key == "p/k":
        return f"${power_or_number(value)}$" if bare else f"$p{over}={power_or_number(value)}$"
    if key == "phi":
        return rf"$\phi={value:.6g}$"
    if key in ("D", "N"):
        return f"${key}={value}$"
    if key == "alpha" and value == 1.0:
        return "linear damping"
    if key in _SYMBOLS:
        return f"${_SYMBOLS[key].replace('/k', over)}={number(value)}$"
    if key in _SWITCHES:
        return _SWITCHES[key][bool(value)]
    return FAMILIES[value].label.split()[0] if value in FAMILIES else str(value)


def average_curves(curves, statistic="mean") -> list[Curve]:
    """One curve for all that differ only in the packing; `bounds`: its error, nan for one packing.

    statistic   "mean", the arithmetic one, or "median", of G' and of G''

    G' < 0 of a packing unstable to shear counts like any other value. A packing that is nearly unstable can dominate a
    mean of G'' at low ω, but not a median. Raises InputError if sweeps to average are of one packing or have
    different frequencies.
    """
    groups = group_by(curves, lambda curve: str(curve.description))
    return [_average(group, statistic) for group in groups.values()]


def require_same_frequencies(curves) -> None:
    """Raise InputError if a curve to average has other frequencies than the first."""
    first = curves[0]
    for curve in curves:
        same = len(curve.omega) == len(first.omega)
        if not (same and np.allclose(curve.omega, first.omega, rtol=_FREQUENCY_TOLERANCE, atol=0)):
            raise InputError(
                f"{curve.name}: not the frequencies of {first.name}. For a mean give sweeps of equal frequencies."
            )


def _average(curves, statistic):
    first, seen = curves[0], {}
    require_same_frequencies(curves)
    for curve in curves:
        packing = curve.attributes.get("packing_sha256", curve)  # an unknown packing equals no other
        if packing in seen:
            raise InputError(
                f"{curve.name}: the packing of {seen[packing]}. Give each packing once for a mean."
            )
        seen[packing] = curve.name
    G = np.array([curve.G for curve in curves])
    samples = np.stack((G.real, G.imag), axis=1)
    middle, error = STATISTICS[statistic](samples)
    if statistic == "median" and len(curves) > 2:  # whose errors are not alike on both sides
        error = np.abs(np.array(median_interval(samples)) - middle).swapaxes(0, 1)
    name = first.name if len(curves) == 1 else f"{len(curves)} sweeps"
    pressures = [curve.pressure for curve in curves if curve.pressure is not None]
    pressure = (
        float(np.mean(pressures)) if pressures else None
    )  # which seeds of one packing fraction do not share
    return replace(first, name=name, G=middle[0] + 1j * middle[1], bounds=error, pressure=pressure)
