"""What the claims share: how one is entered, and estimates over the rows of a study."""

from dataclasses import dataclass

import numpy as np

import jampetsc
from jampetsc.analysis.scaling import fit_power_law
from jampetsc.analysis.statistics import bootstrap

RESAMPLES = 500
WITHIN = 2.0  # standard errors
CRITICAL = [1e-3, 1e-4, 1e-5]  # pressures near jamming at which N = 4096 is large: N²p > 100
CLAIMS = []  # (figure, function)


@dataclass
class Row:
    """One line of docs/reproduction.md."""

    claim: str
    theirs: float | None  # only what is printed; None where the works have a picture or words
    ours: float
    error: float | None  # one standard error
    note: str = ""
    size: str = ""  # N, packings or strain behind the number
    decided: str = ""  # "yes", "no" or "open", with the reason in the note; by default from the error


def claim(figure):
    """Decorator: the function yields a `Row` for each claim, from the table of a study."""

    def enter(function):
        CLAIMS.append((figure, function))
        return function

    return enter


def exponent(rows, column, by="pressure"):
    """(exponent of the mean of a column in `by`, its standard error from resampling the packings)."""
    groups = [(key[by], part[column]) for key, part in rows.groups([by])]
    x = np.array([key for key, _ in groups])
    draw = np.random.default_rng(0)
    means = [[np.mean(draw.choice(y, len(y))) for _, y in groups] for _ in range(RESAMPLES)]
    found = [fit_power_law(x, mean).exponent for mean in means if min(mean) > 0]
    return fit_power_law(x, np.array([np.mean(y) for _, y in groups])).exponent, np.std(found)


def rates_of(rows, name):
    """(rates, means, errors) of σ or p of flows, over seeds."""
    groups = rows.groups(["rate"])
    rates = np.array([key["rate"] for key, _ in groups])
    values = np.array([part[f"{name}_mean"].mean() for _, part in groups])
    own = [np.sqrt(np.mean(part[f"{name}_error"] ** 2) / part.rows) for _, part in groups]
    scatter = [bootstrap(part[f"{name}_mean"])[1] if part.rows > 1 else 0.0 for _, part in groups]
    return rates, values, np.maximum(own, scatter)


def slope_with_error(rates, values, errors):
    """Exponent through all points, weighted, and its error from theirs."""
    (slope, _), covariance = np.polyfit(np.log(rates), np.log(values), 1, w=values / errors, cov="unscaled")
    return slope, np.sqrt(covariance[0, 0])


def fitted(table, name, wanted, of):
    """Claims about the parameters that `jampetsc collapse` has put into a file of the study's folder."""
    path = table.path / f"{name}.h5"
    if not path.exists():  # a fit that did not converge, or that is under way
        return
    result = jampetsc.load(path).attributes
    for parameter, theirs, note in wanted:
        symbol = {"phi_J": "φ_J", "znu": "zν", "nu": "ν"}.get(parameter, parameter)
        what = f"{of}: {symbol} (χ²/dof {result['chi2'] / result['dof']:.2f})"
        error = result[f"{parameter}_error"]
        if np.isfinite(error):
            yield Row(what, theirs, result[parameter], error, note)
        else:
            yield Row(what, theirs, result[parameter], None, "the data do not tell it", decided="open")
