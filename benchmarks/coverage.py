"""How often errors hold what they say: shares of estimates within one error and within two of the true value.

    coverage.py [means shares runs studies collapse laws overshoots]

One error is to hold 68 % of cases and two 95 %. Every table draws its series and samples from a fixed seed
(docs/theory/statistics.md).
"""

import argparse

import numpy as np
from planted import collapse
from planted_flows import laws, overshoots

from jampetsc.analysis.correlated_series import Average, mean_of_averages
from jampetsc.analysis.jammed_samples import share_of
from jampetsc.analysis.statistics import mean_with_error, median_interval, median_with_error

SERIES = 1500  # of each kind
SEED = 20


def autoregressive(rng, tau, count, series=SERIES):
    """(series, T) of mean 0, variance 1 and ρ(t) = a^t, with τ = ½ (1 + a)/(1 − a)."""
    a = (np.asarray(tau, float) - 0.5) / (np.asarray(tau, float) + 0.5)
    x = rng.standard_normal((series, count))
    for t in range(1, count):
        x[:, t] = a * x[:, t - 1] + np.sqrt(1.0 - a * a) * x[:, t]
    return x


def kinds(rng):
    """(words, T, τ, series, true mean): one memory, two, shares, skewed values, an oscillation."""
    single = [(1000, 10), (1000, 50), (100, 10), (50, 10), (2000, 10), (600, 10), (400, 10), (1000, 25)]
    for count, tau in [*single, (200, 3), (100, 3), (100, 1)]:
        yield "one memory", count, tau, autoregressive(rng, tau, count), 0.0
    for count in (25, 50, 100, 1000):
        yield "none", count, 0.5, autoregressive(rng, 0.5, count), 0.0
    for fast, slow, part in ((2, 20, 0.5), (2, 40, 0.5), (0.5, 10, 0.3), (0.5, 40, 0.1)):
        x = np.sqrt(1 - part) * autoregressive(rng, fast, 1000) + np.sqrt(part) * autoregressive(
            rng, slow, 1000
        )
        yield f"two, {part:g} of it slow: {slow}", 1000, (1 - part) * fast + part * slow, x, 0.0
    x = autoregressive(rng, 10, 1000)
    yield "zeros and ones, half", 1000, np.nan, (x > 0) * 1.0, 0.5
    yield "zeros and ones, a tenth", 1000, np.nan, (x > 1.2815515655446004) * 1.0, 0.1
    yield "log-normal", 1000, np.nan, np.exp(x), np.exp(0.5)
    tau = np.exp(rng.uniform(0.0, np.log(200.0), SERIES))
    yield "one memory, 1 to 200", 1000, np.nan, autoregressive(rng, tau, 1000), 0.0


def sokal(x):
    """Error from the window of five τ(W), of the covariance as it is: what emcee takes."""
    d = x - x.mean()
    gamma = np.fft.irfft(np.abs(np.fft.rfft(d, 2 * len(x))) ** 2)[: len(x)]
    times = np.cumsum(gamma / gamma[0]) - 0.5
    time = times[np.argmax(np.arange(len(x)) >= 5.0 * times)]
    return np.sqrt(2.0 * max(0.5, time) * np.var(x) / len(x))


def held(off, chosen=...):
    """Shares within one and within two errors of distances in errors, as words."""
    off = np.asarray(off)[chosen]
    return f"{np.mean(off < 1):.2f} / {np.mean(off < 2):.2f}" if len(off) >= 50 else f"({len(off)} series)"


def means():
    """Means of correlated series. Worth: effective number of values; a note if it is small or changes are slow."""
    print("| series | rows | τ | worth | all | no note | of these | with a note | Sokal's window alone |")
    print("|---|---|---|---|---|---|---|---|---|")
    for words, count, tau, series, mean in kinds(np.random.default_rng(SEED)):
        found = [Average.of(x) for x in series]
        off = np.array([abs(one.mean - mean) / one.error for one in found])
        plain = np.array([abs(x.mean() - mean) / sokal(x) for x in series])
        sound = np.array([one.enough and not one.drifts for one in found])
        worth = np.median([one.samples for one in found])
        known = f"{tau:g}" if np.isfinite(tau) else ""
        print(
            f"| {words} | {count} | {known} | {worth:.0f} | {held(off)} | {sound.mean():.3f} | {held(off, sound)} | "
            f"{held(off, ~sound)} | {held(plain)} |"
        )


def shares():
    """Shares of ones, drawn evenly from a range: independent samples, and runs that switch by chance."""
    rng = np.random.default_rng(SEED)
    print("| share | runs × rows | τ | within the interval / twice it | worth |")
    print("|---|---|---|---|---|")
    sizes = [
        (10, 1, 0.5),
        (40, 1, 0.5),
        (160, 1, 0.5),
        (1, 1000, 10),
        (3, 300, 10),
        (5, 200, 2),
        (1, 200, 20),
    ]
    for least, most in ((0.3, 0.7), (0.8, 0.98)):
        for runs, count, tau in sizes:
            share = rng.uniform(least, most, SERIES)
            stay = (tau - 0.5) / (tau + 0.5)  # of a chain of two states, ρ(t) = stay^t
            x = rng.random((SERIES, runs, count)) < share[:, None, None]
            for t in range(1, count):
                x[..., t] = np.where(rng.random((SERIES, runs)) < stay, x[..., t - 1], x[..., t])
            found = [share_of(list(sample.astype(float))) for sample in x]
            off = [
                (true - s.value) / (s.high - s.value if true > s.value else s.low - s.value)
                for true, s in zip(share, found, strict=True)
            ]
            worth = np.median([s.independent for s in found])
            print(f"| {least:g} to {most:g} | {runs} × {count} | {tau:g} | {held(off)} | {worth:.0f} |")


def runs():
    """Means over runs of 300 rows, τ = 5, worth 30, whose levels differ by a part of the error of one run."""
    rng = np.random.default_rng(SEED)
    print("| runs | levels differ by | larger of scatter and own errors | own errors alone |")
    print("|---|---|---|---|")
    for spread in (0.0, 1.0, 3.0):
        for count in (1, 2, 3, 5, 10):
            if count == 1 and spread:
                continue
            x = autoregressive(rng, 5.0, 300, count * 600).reshape(600, count, 300)
            x += spread * np.sqrt(2 * 5.0 / 300) * rng.standard_normal((600, count, 1))
            off, alone = [], []
            for sample in x:
                parts = [Average.of(run) for run in sample]
                mean, error = mean_of_averages(parts)
                off.append(abs(mean) / error)
                alone.append(abs(mean) / np.sqrt(np.mean([one.error**2 for one in parts]) / count))
            print(f"| {count} | {spread:g} | {held(off)} | {held(alone)} |")


def studies():
    """Means and medians over packings, of values with short and with long tails."""
    rng = np.random.default_rng(SEED)
    draws = {
        "normal": (rng.standard_normal, 0.0, 0.0),
        "exponential": (rng.standard_exponential, 1.0, np.log(2.0)),
        "log-normal": (lambda size: np.exp(rng.standard_normal(size)), np.exp(0.5), 1.0),
    }
    print("| values | packings | mean | plain standard error | median | interval of the median |")
    print("|---|---|---|---|---|---|")
    for words, (draw, mean, median) in draws.items():
        for count in (2, 3, 4, 5, 6, 10, 20, 100):
            x = draw((count, 20000))
            value, error = mean_with_error(x)
            middle, half = median_with_error(x)
            low, high = median_interval(x)
            plain = x.std(axis=0, ddof=1) / np.sqrt(count)
            inside = f"{np.mean((low < median) & (median < high)):.2f}" if count > 2 else ""
            print(
                f"| {words} | {count} | {held(abs(value - mean) / error)} | {held(abs(value - mean) / plain)} | "
                f"{held(abs(middle - median) / half)} | {inside} |"
            )


TABLES = {table.__name__: table for table in (means, shares, runs, studies, collapse, laws, overshoots)}


def main():
    """Print the tables that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"{', '.join(TABLES)}; default: all")
    chosen = parser.parse_args().tables or list(TABLES)
    if unknown := set(chosen) - set(TABLES):
        parser.error(f"no table {', '.join(sorted(unknown))}: there are {', '.join(TABLES)}")
    for name in chosen:
        print(f"\n{TABLES[name].__doc__}\n", flush=True)
        TABLES[name]()


if __name__ == "__main__":
    main()
