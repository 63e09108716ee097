"""What the claims share: how one is entered, and estimates over the rows of a study."""

import math
from dataclasses import dataclass, replace

import numpy as np

import jampetsc
from jampetsc.analysis.collapse_fit import correlations, find_minima
from jampetsc.analysis.correlated_series import mean_of_runs
from jampetsc.analysis.scaling_collapse import Points, form_named
from jampetsc.analysis.statistics import log_median, mean_with_error
from papers.claims.verdicts import Estimate, Target

NEAR, LARGE = 1e-3, 1e3  # p up to which, pN² from which, a packing counts as near jamming and large
POINT = ("n", "pressure", "law", "beta", "eta_f", "prestress")  # what packings of one point have in common
CLAIMS = []  # (figures, function)


@dataclass(frozen=True)
class Row:
    """One claim of the works with our estimate, or a measured number beside them, of which only claims.csv tells.

    theirs      what the work says, in words or digits
    target      the same as numbers; None for a number without a verdict
    reason      one line; every number in it is computed
    size        N, packings or strain behind the number
    predicted   whether `theirs` is a prediction of our own theory, for docs/theory/linear_response.md
    identity    why it is exact for any packing: no evidence for a power or a form; "" where it is not
    bears       key of the claim in claims/page.py on which the number bears
    part        what part of the claim it decides, in words, "" for all of it; None for a number that does not decide
    """

    claim: str
    theirs: str
    ours: Estimate
    target: Target | None = None
    reason: str = ""
    size: str = ""
    predicted: bool = False
    bears: str = ""
    part: str | None = ""
    identity: str = ""

    @property
    def decides(self) -> bool:
        """Whether the row of the page is made of this number."""
        return self.target is not None and self.part is not None


def check(claim, value, error=None, note="", size="", theirs="", predicted=False, bears="") -> Row:
    """A measured number without a verdict: of another estimator, or one of which the works say nothing."""
    return Row(
        claim,
        theirs,
        Estimate(float(value), math.nan if error is None else float(error)),
        None,
        note,
        size,
        predicted,
        bears,
    )


def unjudged(row: Row) -> Row:
    """The same number without a verdict."""
    return replace(row, target=None)


def beside(rows, bears=None):
    """The numbers with their verdicts, none of which decides a claim; bears: the claim on which they do bear."""
    for row in rows:
        yield replace(row, bears=bears or row.bears, part=None)


def bearing(key, rows):
    """The numbers with the claim on which they bear, where they do not name one."""
    for row in rows:
        yield row if row.bears or row.predicted else replace(row, bears=key)


def identities(rows, reasons):
    """The numbers, those that bear on one of the claims {key: why it is exact} marked as identities."""
    for row in rows:
        yield replace(row, identity=reasons[row.bears]) if row.bears in reasons else row


def claim(*figures, on="", exact=None):
    """Decorator: the function yields a `Row` for each number, from the tables of the studies of these figures.

    on     key of the claim on which those bear that do not name one
    exact  {key of a claim: why it is exact for any packing}
    """

    def enter(function):
        def rows(*tables):
            return identities(bearing(on, function(*tables)), exact or {})

        CLAIMS.append((figures, rows))
        return function

    return enter


def size_of(rows):
    """N with seeds and strain behind flows, or with the number of packings a point, in words."""
    n = ", ".join(f"{one:.0f}" for one in np.unique(rows["n"]))
    if "rate" in rows:
        strains, seeds = np.unique(rows["strain"]), len(np.unique(rows["seed"])) if "seed" in rows else 1
        strain = f"{strains[0]:g}" + (f" to {strains[-1]:g}" if len(strains) > 1 else "")
        return f"N = {n}, {seeds} seed{'s' if seeds > 1 else ''}, strain {strain}"
    parts = [part for _, part in rows.groups([name for name in POINT if name in rows])]
    counts = sorted({part.rows for part in parts})
    starts = max(len(np.unique(part["seed"])) for part in parts) if "seed" in rows else counts[-1]
    few = f"{counts[0]}" if counts[0] == counts[-1] else f"{counts[0]} to {counts[-1]}"
    return f"N = {n}; {few} packings" + (f" of {starts} starts" if starts < counts[-1] else "")


def starts_of(rows, column) -> dict:
    """{seed: mean of a column over the rows of it}; rows without a number are left out.

    Packings of one seed, by several versions of the program, begin at the same places and are not independent.
    """
    values = {}
    for seed, value in zip(rows["seed"].tolist(), rows[column].tolist(), strict=True):
        if np.isfinite(value):
            values.setdefault(seed, []).append(value)
    return {seed: float(np.mean(some)) for seed, some in values.items()}


def independent(rows, column):
    """Values of a column (S,), one for each seed."""
    return np.array(list(starts_of(rows, column).values()))


def widening(rows) -> float:
    """√(packings/starts): the factor of errors of medians over packings of one p and N, some of one seed.

    The larger of what full dependence of such packings asks for, and 1.
    """
    return float(
        np.sqrt(max(part.rows / len(np.unique(part["seed"])) for _, part in rows.groups(["n", "pressure"])))
    )


def widened(estimate: Estimate | None, rows) -> Estimate | None:
    """The estimate with its statistical error times `widening`."""
    return estimate and replace(estimate, statistical=estimate.statistical * widening(rows))


def medians_in_pressure(rows, column):
    """(p, ln of the median, its error), each (P,), of a column at the pressures where pN² > LARGE, p increasing.

    Rows without a number in the column are left out.
    """
    groups = [(key, part[column][np.isfinite(part[column])]) for key, part in rows.groups(["n", "pressure"])]
    found = [
        (key["pressure"], *log_median(values))
        for key, values in groups
        if key["pressure"] * key["n"] ** 2 > LARGE and len(values) > 2
    ]
    if not found:
        return np.empty((3, 0))
    p, medians, errors = np.transpose(sorted(found))
    return p, medians, errors * widening(rows)


def line_fit(terms, y, error) -> tuple[float, float, float, int]:
    """(coefficient of terms[1], its error, χ², degrees of freedom) of a weighted linear fit; terms (T, m)."""
    weighted = (np.asarray(terms) / error).T
    coefficients = np.linalg.lstsq(weighted, y / error, rcond=None)[0]
    chi2 = float(np.sum((y / error - weighted @ coefficients) ** 2))
    variance = np.linalg.inv(weighted.T @ weighted)[1, 1]
    return float(coefficients[1]), float(np.sqrt(variance)), chi2, len(y) - len(coefficients)


def exponent(p, y, error) -> Estimate | None:
    """Exponent of y ~ p^x (1 + b p^½) from ln y (P,) and its errors; None below four pressures.

    Systematic: half of the difference to a power law alone at p ≤ NEAR.
    """
    if len(p) < 4 or not np.isfinite(y).all():
        return None
    full = line_fit((np.ones_like(p), np.log(p), np.sqrt(p)), y, error)
    near = p <= NEAR * (1 + 1e-9)
    alone = line_fit((np.ones(near.sum()), np.log(p[near])), y[near], error[near])
    return Estimate(full[0], full[1], 0.5 * abs(full[0] - alone[0]), full[2], full[3])


def paired(rows, column):
    """(p (P,), values (S, P)) of the seeds that have a packing at every pressure where pN² is large, p increasing.

    Where it is at fewer than two, as in runs of tiny packings, at every pressure: nothing is decided then.
    """
    p = np.unique(rows["pressure"][rows["pressure"] * rows["n"] ** 2.0 >= LARGE])
    p = p if len(p) > 1 else np.unique(rows["pressure"])
    found = [starts_of(rows.where(pressure=level, state="done"), column) for level in p]
    seeds = sorted(set.intersection(*map(set, found))) if found else []
    values = [[level[seed] for level in found] for seed in seeds]
    return p, np.array(values).reshape(len(seeds), len(p))


def paired_exponent(rows, column) -> Estimate | None:
    """`exponent_of_seeds` of a column."""
    return exponent_of_seeds(*paired(rows, column))


def exponent_of_seeds(p, values) -> Estimate | None:
    """Exponent of y ~ p^x at p ≤ NEAR: a fit for each seed, then mean and error over seeds; values (S, P) positive.

    Systematic: half of the difference to fits of p^x (1 + b p^½) to all p. None below three seeds or four pressures.
    """
    near = p <= NEAR * (1 + 1e-9)
    if len(values) < 3 or len(p) < 4 or near.sum() < 2 or not (values > 0).all():
        return None
    y = np.log(values).T
    alone = np.polyfit(np.log(p[near]), y[near], 1)[0]
    corrected = np.linalg.lstsq(np.transpose((np.ones_like(p), np.log(p), np.sqrt(p))), y, rcond=None)[0][1]
    value, error = mean_with_error(alone)
    return Estimate(float(value), float(error), 0.5 * abs(float(np.mean(corrected) - value)))


def near_jamming(p, y, error) -> Estimate | None:
    """Exponent of a power law alone at p ≤ NEAR from ln y (P,) and its errors; None below two such pressures.

    Systematic: half of the difference between the lowest two pressures and the others, if there are three.
    """
    near = p <= NEAR * (1 + 1e-9)
    p, y, error = p[near], y[near], error[near]
    if len(p) < 2 or not np.isfinite(y).all():
        return None
    slopes = np.diff(y) / np.diff(np.log(p))
    slope, own, chi2, dof = line_fit((np.ones_like(p), np.log(p)), y, error)
    return Estimate(slope, own, 0.5 * abs(slopes[-1] - slopes[0]), chi2, dof)


def by_decades(p, y):
    """Exponents between neighbouring pressures from the highest, in words; p, ln y (P,)."""
    slopes = ", ".join(f"{slope:.2f}" for slope in (np.diff(y) / np.diff(np.log(p)))[::-1])
    return f"between neighbouring p, from {p[-1]:g} down: {slopes}"


def rates_of(rows, name):
    """(rates, means, errors) of σ or p of flows, over seeds."""
    groups = rows.groups(["rate"])
    rates = np.array([key["rate"] for key, _ in groups])
    return rates, *np.array([mean_over_seeds(part, name) for _, part in groups]).T


def mean_over_seeds(rows, name):
    """(mean, error) of σ or p of flows of one kind."""
    samples = rows[f"{name}_samples"] if f"{name}_samples" in rows else np.full(rows.rows, np.inf)
    return mean_of_runs(rows[f"{name}_mean"], rows[f"{name}_error"], samples)


def power_law(x, values, errors) -> Estimate:
    """Exponent of a power law through all points, with the χ² of that form."""
    x, values = np.asarray(x, float), np.asarray(values, float)
    slope, own, chi2, dof = line_fit((np.ones_like(x), np.log(x)), np.log(values), errors / values)
    return Estimate(slope, own, 0.0, chi2, dof)


SYMBOLS = {"phi_J": "φ_J", "y": "y", "znu": "zν", "nu": "ν", "omega": "ω"}


def fitted(table, name) -> dict[str, Estimate]:
    """{parameter: estimate} of a fit that `jampetsc collapse` has left in the study's folder; {} where there is none.

    Systematic: half of the largest change where a fit leaves out the largest rates, or the smallest N, and still has
    an error within three of the whole fit's.
    """
    path = table.path / f"{name}.h5"
    if not path.exists():  # a fit that did not converge, or that is under way
        return {}
    result = jampetsc.load(path)
    facts, found = result.attributes, {}
    for column, parameter in enumerate(str(facts["fitted"]).split(",")):
        value, own = facts[parameter], facts[f"{parameter}_error"]
        change = 0.0
        if "drift/parameters" in result:
            others, errors = result["drift/parameters"][:, column], result["drift/errors"][:, column]
            known = np.isfinite(errors) & (errors < 3 * own)
            change = 0.5 * float(np.max(np.abs(others[known] - value), initial=0.0))
        found[parameter] = Estimate(value, own, change, facts["chi2"], int(facts["dof"]))
    return found


def beta_of(result, znu: Estimate, y: Estimate, largest=np.inf) -> tuple[Estimate, str]:
    """(β = zν − y, note): of estimates by a collapse of rates, whose errors are correlated.

    The correlation is that of the points of the collapse with γ̇ ≤ largest, fitted again.
    """
    names = str(result.attributes["fitted"]).split(",")
    degree = int(str(result.attributes["functions"]).rpartition(" ")[2])
    columns = (result[name] for name in ("phi", "rate", "value", "error"))
    points = Points(*columns, common=float(result.attributes["common_share"]))
    points = points[points.scale <= largest * (1 + 1e-3)]  # kept rates are rounded
    fit = find_minima(points, form_named(",".join(names), degree=degree))[0]
    correlation = correlations(points, fit)[names.index("y"), names.index("znu")]
    one, other = znu.statistical, y.statistical
    error = float(np.sqrt(one**2 + other**2 - 2 * correlation * one * other))
    note = f"the errors of y and zν have the correlation {correlation:.2f}"
    return Estimate(znu.value - y.value, error), note
