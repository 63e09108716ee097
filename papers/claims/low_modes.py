"""The lowest modes: whether they are floppy-like, from modes in one band of λ/p, beyond the waves of shear."""

import numpy as np

from jampetsc.analysis.statistics import mean_with_error
from papers.claims.shared import (
    LARGE,
    Row,
    by_decades,
    check,
    claim,
    exponent_of_seeds,
    medians_in_pressure,
    near_jamming,
    paired,
    size_of,
)
from papers.claims.verdicts import number

QUANTITIES = {"normal": ("|Δu∥|", 0.25), "transverse": ("|Δu⊥|", -0.25), "nonaffine": ("|u_na|", -0.25)}
BAND = 0.45  # λ/p from which the band of modes reaches up


@claim("bt-modes", on="low-modes")
def lowest(table):
    """Needs of each modes file: attributes, eigenvalues and shear_force; the rest is in the table."""
    rows = table.where(command="modes")
    rows = rows.where(n=int(rows["n"].max()))
    counts = [count for count in (10, 50, 200) if f"floppiness_{count}" in rows]
    if counts:
        points = medians_in_pressure(rows, f"floppiness_{counts[0]}")
        if (found := near_jamming(*points)) is not None:
            what = f"rms Δu⊥ over rms Δu∥ of the lowest {counts[0]} modes ~ p^x, p ≤ 0.001 alone"
            note = f"waves of shear of the cell, whose λ does not go as p; {by_decades(*points[:2])}"
            yield check(what, found.value, found.inflated, note, size_of(rows), "-1/2")
    yield from _band_of_modes(rows)
    for name, symbol in (("nonaffine", "|u_na|²"), ("transverse", "Δu⊥²"), ("normal", "Δu∥²")):
        for count in counts:
            p, share = paired(rows, f"share_{name}_{count}")
            if len(share):
                told = "from low to high p: " + ", ".join(f"{one:.3f}" for one in share.mean(axis=0))
                size = f"N = {rows['n'].max()}, {len(share)} packings"
                what = f"share of {symbol} that the lowest {count} modes carry, p = {p[0]:.0e}"
                yield check(what, *mean_with_error(share[:, 0]), told, size)
    for name, (symbol, _) in QUANTITIES.items() if counts else ():
        p, alone = paired(rows, f"{name}_median_{counts[-1]}")
        _, whole = paired(rows, f"{name}_median")
        if len(alone):
            ratio = alone / whole
            told = "from low to high p: " + ", ".join(f"{one:.2f}" for one in ratio.mean(axis=0))
            what = f"median {symbol} by the lowest {counts[-1]} modes alone over that of the whole, p = {p[0]:.0e}"
            size = f"N = {rows['n'].max()}, {len(alone)} packings"
            yield check(what, *mean_with_error(ratio[:, 0]), told, size)
    yield from _floppy_band(rows)


def _methods(rows):
    return "found by " + ", ".join(sorted(set(rows["method"].tolist())))


def _of_files(rows, values):
    """(p (P,), (S, P, …)) of values(file, λ/p of its modes) of seeds with a file at each p where pN² is large."""
    files = [
        (int(seed), one)
        for seed, one in zip(rows["seed"][rows["state"] == "done"], rows.results(), strict=True)
        if one.attributes["pressure"] * one.attributes["particle_count"] ** 2.0 >= LARGE
    ]
    p = np.array(sorted({float(f"{one.attributes['pressure']:.3g}") for _, one in files}))
    found = {}
    for seed, one in files:
        place = int(np.abs(np.log(p / one.attributes["pressure"])).argmin())
        found.setdefault(seed, {})[place] = values(one, one["eigenvalues"] / one.attributes["pressure"])
    whole = [[found[seed][n] for n in range(len(p))] for seed in sorted(found) if len(found[seed]) == len(p)]
    return p, np.array(whole)


def _reach(rows) -> float:
    """The largest λ/p that all files reach."""
    return float(min(_of_files(rows, lambda _, level: level[-1])[1].ravel(), default=0.0))


def _band_of_modes(rows):
    """Δu⊥ over Δu∥ of modes with λ/p in a band, where λ = k Σ(Δu∥)² of modes goes as p."""
    low, high = BAND, _reach(rows)

    def ratio(one, level):
        inside = (level > low) & (level <= high)
        squares = [np.sum(one[name][inside]) for name in ("transverse", "normal")]
        return np.sqrt(squares[0] / squares[1]) if squares[1] > 0 else np.nan

    p, ratios = _of_files(rows, ratio)
    ratios = ratios[np.isfinite(ratios).all(axis=1)] if len(ratios) else ratios
    found = exponent_of_seeds(p, ratios)
    if found is not None:
        what = f"rms Δu⊥ over rms Δu∥ of modes with λ = {low:g} … {high:.2g} p ~ p^x"
        note = by_decades(p, np.log(ratios).mean(axis=0))
        yield Row(what, "floppy-like: -1/2", found, number(-0.5), note, size_of(rows))


def _floppy_band(rows):
    """What the modes with λ < X p alone do, X the largest that all files reach: their number is ~ N p^½."""
    reach = _reach(rows)

    def lengths(one, level):
        force, low = one["shear_force"], level < reach
        values = one["eigenvalues"][low]
        return np.sqrt([np.sum(force[low] ** 2 / values), np.sum((force[low] / values) ** 2)])

    p, values = _of_files(rows, lengths)
    if len(p) < 2 or not len(values) or not (values > 0).all():
        return
    size = f"N = {rows['n'].max()}, {len(values)} packings at each p = {p[0]:.0e} … {p[-1]:.0e}"
    for column, (symbol, claimed) in enumerate((("Δu∥", 0.25), ("u_na", -0.25))):
        slopes = np.polyfit(np.log(p), np.log(values[:, :, column]).T, 1)[0]
        note = (
            f"as for the whole; {by_decades(p, np.log(values[:, :, column]).mean(axis=0))}; {_methods(rows)}"
        )
        what = f"rms {symbol} by the modes with λ < {reach:.2g} p alone ~ p^x"
        yield check(what, *mean_with_error(slopes), note, size, f"{claimed:+g}", predicted=True)
