"""Jamming and its exponents: papers I, II and III."""

import numpy as np

from claims.shared import Row, claim, fitted
from jampetsc.analysis.jamming import memory


@claim("paper2")
def finite_size(table):
    wanted = [("nu", 1.0, "random starts"), ("phi_J", None, "")]
    yield from fitted(table, "finite-size", wanted, "f(φ, N), RAND")
    wanted = [
        (
            "y",
            1.0,
            "N ≤ 256: drifts with the smallest N, see the picture; one packing that is compressed has 1",
        ),
        ("phi_J", None, ""),
    ]
    yield from fitted(table, "pressure", wanted, "⟨p⟩(φ, N), RAND")


@claim("paper1")
def jamming(table):
    jam = table.where(command="jam")
    random = jam.where(cooling_rate=np.nan) if "cooling_rate" in jam else jam
    for rows, column, name in (
        (random, "jammed_fraction", "RAND"), (table.where(command="shear"), "jammed_mean", "QS")
    ):  # fmt: skip
        for n in np.unique(rows["n"]):
            mine = rows.where(n=n)
            order = np.argsort(mine["phi"])
            phi, f = mine["phi"][order], mine[column][order]
            note = "depends on the protocol; f sharpens with N"
            if f[0] < 0.5 < f[-1]:
                yield Row(f"{name}, N = {n:g}: φ where f = ½", None, np.interp(0.5, f, phi), None, note)
    if "cooling_rate" in jam:
        for key, rows in jam.where(cooling_rate=[1e-1, 1e-2, 1e-3]).groups(["cooling_rate"]):
            what = f"liquid cooled at {key['cooling_rate']:g} per sweep, N = 64: φ_J"
            yield Row(what, None, rows["phi_J"][0], rows["phi_J_error"][0], "rises as cooling slows")


@claim("paper3")
def soft_states(table):
    cases = (
        ("jam", "RAND", "V: y ≤ 1, so that P does not diverge"),
        ("shear", "QS", "V: y > 1, so that P diverges"),
    )
    for command, name, theirs in cases:
        for key, rows in table.where(command=command).groups(["n"]):
            runs = []
            for result in rows.results():
                steady = np.ones(len(result["pressure"]), bool)
                if command == "shear":
                    steady = result["strain"] > result.attributes["discard"]
                runs.append(result["pressure"][steady & (result["jammed"] == 1)])
            p = np.concatenate(runs)
            edge = p.mean() / 4
            soft = p[p < edge]
            independent = len(soft) / (memory(runs) if command == "shear" else 1.0)
            y = np.mean(np.log(edge / soft))  # Hill's estimator
            what = f"{name}, N = {key['n']:g}, φ = 0.84: y of P(p) ~ p^(1/y − 1) at p < ⟨p⟩/4"
            note = f"{theirs}; {len(soft)} states below, that tell as much as {independent:.0f}"
            yield Row(what, None, y, y / np.sqrt(independent), note)
