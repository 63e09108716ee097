"""The rule by which claims of the papers are judged, on planted data: every kind of verdict once."""

import csv
import re
from dataclasses import replace

import launch
import numpy as np
import pytest

from jampetsc.io.ensemble import Ensemble
from papers.claims.page import PAGE, TEXTS
from papers.claims.selection import combined, page_rows
from papers.claims.shared import Row, bearing, beside
from papers.claims.spheres import exponent_of_flow
from papers.claims.verdicts import (
    AGREES,
    DIFFERS,
    IDENTITY,
    UNDECIDED,
    Estimate,
    between,
    exact,
    mean_estimate,
    number,
    verdict,
)

X = np.log(np.geomspace(1e-5, 1e-2, 7))


def fit(exponent, error, bend=0.0, seed=1):
    """Estimate of the exponent of planted data y = x^exponent · e^(bend ln² x), from a straight line."""
    noise = np.random.default_rng(seed).normal(0, error, len(X))
    y = exponent * X + bend * (X - X.mean()) ** 2 + noise
    coefficients, covariance = np.polyfit(X, y, 1, w=np.full(len(X), 1 / error), cov="unscaled")
    chi2 = np.sum(((y - np.polyval(coefficients, X)) / error) ** 2)
    return Estimate(coefficients[0], covariance[0, 0] ** 0.5, 0.0, chi2, len(X) - 2)


CASES = {
    "agrees": (fit(0.5, 0.01), number(0.5), AGREES, ""),
    "differs": (fit(0.4, 0.01), number(0.5), DIFFERS, ""),
    "too wide": (fit(0.5, 0.3), number(0.5), UNDECIDED, "wider than the margin"),
    "poor form": (fit(0.5, 0.01, bend=0.01), number(0.5), UNDECIDED, "does not fit: χ² = "),
    "near": (fit(0.47, 0.01), number(0.5), UNDECIDED, "misses the claim by less than the margin"),
    "exact": (fit(0.47, 0.01), exact(0.5), DIFFERS, ""),
    "inside": (fit(0.5, 0.01), between(high=0.6), AGREES, ""),
    "outside": (fit(0.5, 0.01), between(low=0.6), DIFFERS, ""),
    "at the end": (fit(0.5, 0.01), between(low=0.5), UNDECIDED, "crosses the end"),
    "no error": (Estimate(0.5, np.nan), number(0.5), UNDECIDED, "no error is known"),
}


@pytest.mark.parametrize("name", CASES)
def test_verdict(name):
    estimate, target, expected, reason = CASES[name]
    found, why = verdict(estimate, target)
    assert found == expected and (reason in why if reason else not why)


def test_both_errors_and_a_fair_chi2_widen_the_interval():
    assert Estimate(1.0, 0.03, 0.04).half_width == pytest.approx(0.1)
    assert Estimate(1.0, 0.03, 0.04, chi2=2.0, dof=4).half_width == pytest.approx(0.1)
    assert Estimate(1.0, 0.03, 0.0, chi2=8.0, dof=2).half_width == pytest.approx(0.12)
    assert verdict(Estimate(1.0, 0.03, 0.0, chi2=8.0, dof=2), number(1.0))[0] == UNDECIDED
    assert verdict(Estimate(1.0, 0.03, 0.0, chi2=2.0, dof=2), number(1.0))[0] == AGREES


def test_the_worst_of_several_numbers_decides_a_claim():
    rows = [
        Row(f"law {n}: x", "0.5", fit(x, error), number(0.5), part=f"law {n}")
        for n, x, error in ((1, 0.5, 0.01), (2, 0.5, 0.3))
    ]
    row = combined("BT28", rows)
    assert verdict(row.ours, row.target)[0] == UNDECIDED and row.reason == "worst of 2: law 2"
    differs = [*rows, Row("law 3: x", "0.5", fit(0.3, 0.01), number(0.5), part="law 3")]
    row = combined("BT28", differs)
    assert row.reason == "worst of 3: law 3" and row.claim == TEXTS["BT28"]


def test_a_number_decides_the_claim_that_it_names():
    """Not one without a claimed number, nor one that is beside it; a default does not replace the name of a claim."""
    judged = Row("x", "0.5", fit(0.5, 0.01), number(0.5))
    rows = [judged, replace(judged, target=None), *beside([judged]), replace(judged, bears="BT29")]
    rows = [((), row) for row in bearing("BT28", rows)]
    (first, second) = page_rows(rows)
    assert first[1] == "BT28" and first[4] == [rows[0][1]] and first[3].claim == "x"
    assert second[1] == "BT29" and second[4] == [rows[3][1]]


def test_the_mean_of_one_number_has_the_chi2_of_its_parts():
    parts = [Estimate(0.4, 0.1, 0.02), Estimate(0.8, 0.1, 0.04)]
    mean = mean_estimate(parts)
    assert mean.value == pytest.approx(0.6) and mean.statistical == pytest.approx(0.1 / 2**0.5)
    assert mean.systematic == pytest.approx(0.03) and (mean.chi2, mean.dof) == (pytest.approx(8.0), 1)
    assert verdict(mean, number(0.6))[0] == UNDECIDED  # two numbers that exclude each other have no mean


def table_of_claims():
    """Rows of papers/kept/claims.csv."""
    with open(launch.ROOT / "papers" / "kept" / "claims.csv", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_claim_has_one_row_and_every_number_bears_on_one():
    entries = table_of_claims()
    claims = [text for group in PAGE.values() for text in group.values()]
    assert len(set(claims)) == len(claims) == len(TEXTS) > 50
    assert {entry["row"] for entry in entries} == {*claims, "Predictions"}
    shown = [entry for entry in entries if entry["on_page"] == "yes"]
    assert sorted(entry["row"] for entry in shown) == sorted(claims)
    parts = {entry["row"] for entry in entries if entry["on_page"] == "part"}
    assert parts == {entry["row"] for entry in shown if entry["claim"] == entry["row"]}
    assert all(entry["verdict"] for entry in entries if entry["on_page"])


def test_the_page_of_claims_has_the_verdicts_of_the_table():
    kept = sorted(
        (entry["row"], entry["theirs"].rpartition(": ")[2], entry["verdict"], entry["reason"])
        for entry in table_of_claims()
        if entry["on_page"] == "yes"
    )
    lines = (
        (launch.ROOT / "docs" / "papers" / "claims.md").read_text().partition("## Verdicts")[2].splitlines()
    )
    rows = [
        [cell.strip().replace(r"\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines
    ]
    page = sorted(
        (row[0], row[1], row[3], row[4])
        for row in rows
        if len(row) == 5 and row[3] in (AGREES, DIFFERS, UNDECIDED, IDENTITY)
    )
    assert page == kept


def test_the_exponent_of_flow_at_a_packing_fraction_lies_between_those_of_its_neighbours():
    """Below γ̇ = 2e-3; half of the change without the largest rate, and the slope in φ, are its systematic error."""
    phi, rate = (grid.ravel() for grid in np.meshgrid([0.64, 0.65], [1e-4, 3e-4, 1e-3, 1e-2], indexing="ij"))
    q = np.where(phi < 0.645, 0.30, 0.35)
    columns = {"phi": phi, "rate": rate, "pressure_mean": np.where(rate < 5e-3, rate**q, 1.0)}
    columns |= {"state": np.full(len(phi), "done"), "n": np.full(len(phi), 64.0), "strain": np.ones(len(phi))}
    columns["pressure_error"] = 0.01 * columns["pressure_mean"]
    flows = Ensemble("study", columns, None)
    found, told = exponent_of_flow(flows, 0.644, "pressure")
    by_density = 0.05 / 0.01 * 2e-3 * 0.644
    assert found.value == pytest.approx(0.32) and found.systematic == pytest.approx(by_density)
    assert told.startswith("0.300 at φ = 0.64, 0.350 at φ = 0.65") and told.endswith("0.300, 0.300")
    columns["pressure_mean"] = np.where(rate > 5e-4, 2.0 ** (rate < 5e-3), 1.0) * columns["pressure_mean"]
    columns["pressure_error"] = 0.01 * columns["pressure_mean"]
    bent, _ = exponent_of_flow(flows, 0.644, "pressure")
    slow = np.log([1e-4, 3e-4, 1e-3])
    change = np.polyfit(slow, np.log([1, 1, 2]), 1)[0]
    assert bent.value == pytest.approx(0.32 + change)
    assert bent.systematic == pytest.approx(np.hypot(by_density, 0.5 * change)) and not bent.fits
    assert exponent_of_flow(flows, 0.66, "pressure") is None
