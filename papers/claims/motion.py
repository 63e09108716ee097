"""How disks move: BT figures 1 and 5.

Primary estimators. BT derive their exponents for second moments, so the rms over contacts or disks comes first; the
medians that they draw are claims of their own. Both: medians over packings, y = A p^x (1 + b p^½).
"""

import numpy as np

from jampetsc.analysis.statistics import mean_with_error
from papers.claims.shared import (
    Row,
    by_decades,
    check,
    claim,
    medians_in_pressure,
    near_jamming,
    paired,
    paired_exponent,
    size_of,
)
from papers.claims.verdicts import Estimate, between, number

QUANTITIES = {"normal": ("|Δu∥|", 0.25), "transverse": ("|Δu⊥|", -0.25), "nonaffine": ("|u_na|", -0.25)}


def rms_length(vectors):
    """√⟨|v|²⟩ of vectors (N, D), real or complex."""
    return float(np.sqrt(np.mean(np.sum(np.abs(vectors) ** 2, axis=1))))


@claim("bt-fig1", on="ends")
def instants(table):
    """Needs of each sweep: omega, G and the fields (of one packing at least)."""
    yield from _ends(table.where(command="sweep"))
    found = {}
    for sweep in table.where(command="sweep").results():
        if "fields/displacement" not in sweep:
            continue
        for row, omega in enumerate(sweep["fields/omega"]):
            field, G = sweep["fields/displacement"][row], sweep.modulus(omega)
            turned = field * np.conj(G) / abs(G)
            size = [rms_length(part) for part in (field, turned.imag, turned.real)]
            found.setdefault(float(omega), []).append((size[0], size[1] / size[2]))
    for omega, values in sorted(found.items()):
        sizes, ratios = np.transpose(values)
        size = f"N = {table.where(command='sweep')['n'].max()}, {len(values)} packings"
        what = f"ω = {omega:.0e}: non-affine motion per strain, in d"
        yield check(what, *mean_with_error(sizes), "rms |ũ| over all disks", size)
        yield check(f"ω = {omega:.0e}: ũ at zero over ũ at peak stress", *mean_with_error(ratios), "", size)


def _ends(sweeps):
    """d ln G″/d ln ω over the lowest and over the highest decade of ω, or between the two frequencies at the end."""
    curves = [(one.omega, one.G.imag) for one in sweeps.results()]
    for name in ("lowest", "highest"):
        slopes = []
        for omega, loss in curves:
            inner = np.argmin(
                np.abs(np.log(omega / (10 * omega[0] if name == "lowest" else 0.1 * omega[-1])))
            )
            ends = [0, max(1, inner)] if name == "lowest" else [min(inner, len(omega) - 2), -1]
            slopes.append(np.diff(np.log(loss[ends])).item() / np.diff(np.log(omega[ends])).item())
        what = f"β = 1, p = {sweeps['pressure'][0]:g}: G″ ~ ω^x at the {name} ω"
        ours = Estimate(*mean_with_error(slopes))
        part = f"at the {name} ω"
        yield Row(what, "1 ± 0.02", ours, between(0.98, 1.02), "", size_of(sweeps), part=part)


@claim("bt-fig5")
def floppy(table):
    """Needs of each quasistatic file: attributes only."""
    yield from floppy_rows(table, "median")


def floppy_rows(table, decisive):
    """Rows about Δu and u_na; decisive: rms or median, of which the claims are."""
    slow = table.where(command="quasistatic", state="done")
    size, moments = size_of(slow), {}
    for kind, source in (("rms", "BT 19–21"), ("median", "BT Fig. 5")):
        for column, (name, theirs) in QUANTITIES.items():
            points = medians_in_pressure(slow, f"no_prestress_{column}_{kind}")
            found = paired_exponent(slow, f"no_prestress_{column}_{kind}")
            if found is not None:
                what = f"{kind} {name} ~ p^x, without pre-stress ({source})"
                note = by_decades(*points[:2])
                if kind == "rms":
                    moments[name] = found
                elif name in moments:
                    note = f"the rms, for which BT derive the exponent, has {moments[name]}"
                part = None if kind != decisive else name.strip("|") if decisive == "rms" else ""
                on = f"median-{column}"
                yield Row(what, f"{theirs:g}", found, number(theirs), note, size, bears=on, part=part)
    ratios = _squares_ratio(slow)
    points = medians_in_pressure(ratios, "ratio")
    if (found := paired_exponent(ratios, "ratio")) is not None:
        what = "Σ(Δu⊥)²/Σ(Δu∥)² ~ p^x, without pre-stress (BT 20)"
        yield Row(what, "-1", found, number(-1.0), by_decades(*points[:2]), size, bears="squares")
    yield from _mean_normal(slow, size)
    for kind in ("rms", "median", "mean"):
        for prefix, where in (("no_prestress_", "without pre-stress"), ("", "with pre-stress")):
            for column, (name, theirs) in QUANTITIES.items():
                points = medians_in_pressure(slow, f"{prefix}{column}_{kind}")
                alone = near_jamming(*points)
                if alone is not None:
                    what, note = f"{kind} {name} ~ p^x, {where}, p ≤ 0.001 alone", by_decades(*points[:2])
                    on = f"median-{column}"
                    yield check(what, alone.value, alone.inflated, note, size, f"{theirs:g}", bears=on)


def _squares_ratio(slow):
    """The rows with the column "ratio", Σ(Δu⊥)²/Σ(Δu∥)² without pre-stress."""
    columns = {name: slow[name] for name in slow}
    ratio = slow["no_prestress_transverse_rms"] / slow["no_prestress_normal_rms"]
    return type(slow)(slow.path, columns | {"ratio": ratio**2}, None)


def _mean_normal(slow, size):
    """The mean of |Δu∥|, which BT see level off, beside the rms, which √G₀ gives exactly."""
    p, mean = paired(slow, "no_prestress_normal_mean")
    _, rms = paired(slow, "no_prestress_normal_rms")
    if len(p) < 2 or not len(mean):
        return
    local = np.diff(np.log(mean), axis=1) / np.diff(np.log(p))
    defect = float(np.nanmax(np.abs(slow["no_prestress_identity_difference"])))
    what = f"mean |Δu∥| ~ p^x, without pre-stress, p = {p[0]:.0e} … {p[1]:.0e}"
    note = (
        f"mean ≤ rms = (G₀V/kN_c)^½ γ, here exact to {defect:.0e}: it must fall with G₀; mean/rms is "
        f"{(mean / rms)[:, 0].mean():.2f} at p = {p[0]:g}"
    )
    yield Row(
        what,
        "levels off: 0",
        Estimate(*mean_with_error(local[:, 0])),
        number(0.0, absolute=0.1),
        note,
        size,
        bears="mean-normal",
    )
