"""The rule by which claims of the papers are judged, on planted data: every kind of verdict once."""

import csv
import re

import launch
import numpy as np
import pytest
from claims.verdicts import AGREES, DIFFERS, UNDECIDED, Estimate, between, exact, number, verdict

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


def quoted(figures):
    """Names of figures as the page has them."""
    return ", ".join(f"`{figure}`" for figure in figures.split())


def test_the_page_of_claims_has_the_verdicts_of_the_table():
    docs = launch.ROOT / "docs"
    with open(docs / "kept" / "claims.csv", encoding="utf-8") as file:
        entries = [entry for entry in csv.DictReader(file) if entry["verdict"]]
    kept = sorted(
        (entry["claim"], entry["theirs"], entry["verdict"], quoted(entry["figure"])) for entry in entries
    )
    lines = (docs / "reproduction.md").read_text().partition("## Verdicts")[2].splitlines()
    rows = [
        [cell.strip().replace(r"\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines
    ]
    page = sorted(
        (row[0], row[1], row[3], row[4])
        for row in rows
        if len(row) == 6 and row[3] in (AGREES, DIFFERS, UNDECIDED)
    )
    assert page == kept and len(page) > 40
