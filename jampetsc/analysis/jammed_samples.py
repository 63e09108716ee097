"""Fraction of samples that jam, with its error, and distributions of pressure and φ_J over jammed samples.

For independent samples the fraction is binomial, with Wilson's interval (J. Am. Stat. Assoc. 22, 209 (1927)), which
keeps its meaning where all or none are jammed. The states of one sheared run are correlated: their fraction is a mean
over a series, with an error from its autocorrelation and from the scatter of runs.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.correlated_series import Average, mean_of_runs
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError

MIN_SAMPLES = 10  # samples for a distribution
OPTIONAL_COLUMNS = ("phi_J", "segregation")  # columns that samples may also have
BIN_COUNT_RANGE = (5, 30)  # least and largest number of bins; √samples between them


@dataclass(frozen=True)
class Share:
    """A fraction of samples, and the interval of one standard error about it."""

    value: float
    low: float
    high: float
    samples: int
    independent: float  # number of independent samples with the same error

    @property
    def error(self) -> float:
        """Half of the interval."""
        return 0.5 * (self.high - self.low)


def binomial_share(value: float, count: float) -> Share:
    """A share with Wilson's interval, of `count` independent samples, maybe not a whole number."""
    middle = (value + 0.5 / count) / (1.0 + 1.0 / count)
    half = np.sqrt(value * (1.0 - value) / count + 0.25 / count**2) / (1.0 + 1.0 / count)
    return Share(value, float(min(middle - half, value)), float(max(middle + half, value)), int(count), count)


def independent_share(jammed) -> Share:
    """Share of ones among independent samples (S,), S ≥ 1."""
    return binomial_share(float(np.mean(jammed)), len(jammed))


def correlated_share(runs) -> Share:
    """Share of ones in several series [(T,), …] of runs: see `share_of_runs`."""
    averages = [Average.of(run) for run in runs]
    parts = zip(*((average.mean, average.error, average.samples) for average in averages), strict=True)
    return replace(share_of_runs(*parts), samples=int(sum(len(run) for run in runs)))


def share_of_runs(means, errors, samples) -> Share:
    """Mean share of runs (R,), each with error and effective number of samples as in `Average`.

    The error is the larger of the scatter of runs and their own errors; not less than the error of as many independent
    samples as the effective sample size of the runs.
    """
    value, error = mean_of_runs(means, errors, samples)
    count = float(np.sum(samples))  # a series of ones alone is one: it may be one long memory
    whole_count = math.ceil(count)
    wilson = binomial_share(round(value * whole_count) / whole_count, whole_count)
    low, high = max(0.0, min(value - error, wilson.low)), min(1.0, max(value + error, wilson.high))
    return Share(value, low, high, len(means), count)


def pooled_share(values, samples) -> Share:
    """Share of ones in all of several sets of independent samples: their shares (R,), and numbers of samples (R,)."""
    samples = np.asarray(samples, float)
    return binomial_share(float(np.dot(values, samples) / samples.sum()), float(samples.sum()))


def effective_samples(share: Share) -> float:
    """The number of independent samples of which Wilson's interval is as long as that of this share."""
    if share.samples == share.independent:
        return float(share.samples)
    square, spread = share.error**2, share.value * (1.0 - share.value)
    half = square - 0.5 * spread
    return max(1.0, (-half + math.sqrt(half**2 - square * (square - 0.25))) / square)


def share_of(runs) -> Share:
    """Share of ones in runs [(T,), …]: independent samples where each has one, series that remember otherwise."""
    if all(len(run) == 1 for run in runs):
        return independent_share(np.concatenate(runs))
    return correlated_share(runs)


def runs_of(result) -> list:
    """[(φ, seed, rows)] of the runs of samples in a jam or shear file; shear is one, after what is discarded.

    Raises InputError where `jammed` has other numbers than 0, 1 and nan.
    """
    jammed = result.get("jammed", np.empty(0))
    if not np.isin(jammed[~np.isnan(jammed)], (0.0, 1.0)).all():
        raise InputError(f"{result.path}: dataset jammed: numbers other than 0 and 1. Make the file again.")
    if "seed" not in result:
        a = result.attributes
        rows = np.flatnonzero(np.abs(result["strain"]) > float(a["discard"]) * (1 + 1e-12))
        return [(float(a["phi"]), a.get("seed", a.get("packing_sha256")), rows)]
    rows_by_run = {}
    for row, run in enumerate(zip(result["phi"].tolist(), result["seed"].tolist(), strict=True)):
        rows_by_run.setdefault(run, []).append(row)
    return [(*run, np.array(rows)) for run, rows in rows_by_run.items()]


@dataclass(frozen=True)
class AtDensity:
    """Results of the samples at one φ."""

    phi: float
    jammed: Share | None  # None where no minimum was found
    pressure: float  # mean over jammed samples; nan where none jams
    means: dict  # name in OPTIONAL_COLUMNS -> (mean, its error)


def at_densities(columns: dict) -> list[AtDensity]:
    """Results at every φ of samples: columns (S,) phi, seed, jammed, pressure, nan without minimum, and others."""
    phi, seed, jammed, pressure = (columns[name] for name in ("phi", "seed", "jammed", "pressure"))
    rows = []
    for value in np.unique(phi):
        here = (phi == value) & np.isfinite(jammed)
        runs = [jammed[here & (seed == run_seed)] for run_seed in np.unique(seed[here])]
        hard = pressure[here & (jammed == 1)]
        means = {}
        for name in OPTIONAL_COLUMNS:
            values = columns.get(name, np.zeros(len(phi)) * np.nan)[phi == value]
            values = values[np.isfinite(values)]
            if len(values) > 1:
                means[name] = mean_with_error(values)
        rows.append(
            AtDensity(
                float(value),
                share_of(runs) if runs else None,
                float(hard.mean()) if len(hard) else np.nan,
                means,
            )
        )
    return rows


def memory(runs) -> float:
    """Statistical inefficiency 2τ, the number of samples per independent one, averaged over series [(T,), …]; 1 for
    single samples.
    """
    lengths = [len(run) for run in runs]
    return max(1.0, float(np.average([2.0 * Average.of(run).time for run in runs], weights=lengths)))


def density(values, low=None, memory=1.0):
    """(edges (B + 1,), density (B,), error (B,)) of samples (S,): Σ density · width = 1, errors of counting.

    low: where the first bin begins, by default the least value; memory: statistical inefficiency of the samples.
    Errors are √(count · memory), with a count of 1 for an empty bin.
    """
    values = np.asarray(values, float)
    count = len(values)
    bins = int(np.clip(np.sqrt(count), *BIN_COUNT_RANGE))
    edges = np.linspace(values.min() if low is None else low, values.max() * (1 + 1e-12), bins + 1)
    counts = np.histogram(values, edges)[0]
    unit = count * np.diff(edges)
    return edges, counts / unit, np.sqrt(memory * np.maximum(counts, 1)) / unit


def assortativity(kind, i, j) -> float:
    """Assortativity, (s − s₀)/(1 − s₀) of the share s of like pairs, s₀ of random pairs, Newman, PRE 67, 026126
    (2003).

    kind (N,) of each disk; pairs (i, j). 1 where unlike disks never meet, 0 where they mix at random; nan for one kind.
    """
    kind = np.asarray(kind)
    same = float(np.mean(kind[i] == kind[j])) if len(i) else np.nan
    _, counts = np.unique(np.concatenate((kind[i], kind[j])), return_counts=True)
    mixed = float(np.sum((counts / max(counts.sum(), 1)) ** 2))
    return (same - mixed) / (1.0 - mixed) if mixed < 1.0 else np.nan
