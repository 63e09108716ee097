"""Averages over rows of the table of a study that agree in some columns, each packing counted once."""

import copy
from collections.abc import Mapping

import numpy as np

from jampetsc.analysis.statistics import mean_with_error, median_with_error
from jampetsc.errors import InputError, MissingPackage
from jampetsc.io.provenance import LAW_PARAMETERS

SAME = 1e-9  # numbers that differ by less, relatively, are the same
CHOICES = ("command", "law", *LAW_PARAMETERS)
CHOICES += ("model", "method", "phase", "omega", "rate", "mass", "strain", "accuracy")
NO_AVERAGE = ("seed", "seconds")
# columns that are shares of samples: those with the error of a run and its effective number of samples; runs of jam are
# independent samples, or as many as they are worth
SHARES = {
    "jammed_fraction": ("jammed_fraction_samples",),
    "jammed_mean": ("jammed_error", "jammed_samples"),
    "plastic_mean": ("plastic_error", "plastic_samples"),
}
STATISTICS = {"mean": mean_with_error, "median": median_with_error}


class Averages(Mapping):
    """Averages over groups of rows: column -> (groups,) array, for the columns `by` the value of each group.

    error        column -> (groups,) halves of 68 % intervals, see `analysis.statistics`; nan for a single row, but for
                 shares, which are those of all samples of the rows
    count        column -> (groups,) numbers of rows averaged
    below_zero   column -> (groups,) how many of these are negative, such as G₀ of packings unstable to shear: they
                 count like all others

    Raises InputError on reading a column where a group has two rows of one packing: they are not independent.
    """

    _row = 0  # of what `_average` gives: value, error, count, below zero

    def __init__(self, ensemble, by, statistic):
        self.by = (by,) if isinstance(by, str) else tuple(by)
        self.statistic = statistic
        self._groups = ensemble.groups(self.by)
        self._names = [
            name for name in ensemble if name not in NO_AVERAGE and ensemble[name].dtype.kind in "if"
        ]
        self._found = {}
        self.error, self.count, self.below_zero = (self._other(row) for row in (1, 2, 3))

    def _other(self, row):
        """The same mapping of another row."""
        other = copy.copy(self)
        other._row = row
        return other

    def __getitem__(self, name):
        if name in self.by:
            return np.array([key[name] for key, _ in self._groups])
        if name not in self._found:
            found = [self._average(key, rows, name) for key, rows in self._groups]
            self._found[name] = [np.array(column) for column in zip(*found, strict=True)]
        return self._found[name][self._row]

    def _average(self, key, rows, name):
        column = rows[name]
        if column.dtype.kind not in "if":
            raise InputError(f"{rows.table}: column {name} holds words, which have no {self.statistic}")
        known = np.isfinite(column)
        require_independent(key, rows.taken(known), name)
        values = column[known]
        if not len(values):
            return np.nan, np.nan, 0, 0
        value, error = self._share(rows.taken(known), name) or STATISTICS[self.statistic](values)
        return float(value), float(error), len(values), int(np.count_nonzero(values < 0))

    def _share(self, rows, name):
        """(value, error) of a share, which is binomial: of all samples of the rows together; None for anything else."""
        own = [rows[part] for part in SHARES.get(name, ()) if part in rows]
        if not own or not np.isfinite(own).all():
            return None
        from jampetsc.analysis.jammed_samples import pooled_share, share_of_runs

        share = (pooled_share if len(own) == 1 else share_of_runs)(rows[name], *own)
        return share.value, share.error

    def __iter__(self):
        return iter([*self.by, *(name for name in self._names if name not in self.by)])

    def __len__(self):
        return len(list(iter(self)))

    def to_pandas(self):
        """A pandas.DataFrame of the averages, errors in columns `…_error`. Raises InputError without pandas."""
        errors = {f"{name}_error": self.error[name] for name in self._names if name not in self.by}
        return frame({**self, **errors})


def require_independent(key, rows, name) -> None:
    """Raise InputError where two rows, whose mean is to be taken, are of one packing."""
    if "packing" not in rows:
        return
    seen = {}
    for other, packing in enumerate(rows["packing"].tolist()):
        if packing and packing in seen:
            break
        seen[packing] = other
    else:
        return
    one = seen[packing]
    differ = [c for c in CHOICES if c in rows and not same(rows[c][[one]], rows[c][other])[0]]
    where = ", ".join(f"{column} {value}" for column, value in key.items()) or "all rows"
    raise InputError(
        f"{rows.table}: {name} of {where}: {rows['file'][one]} and {rows['file'][other]} are of one packing: "
        f"choose rows with where(…) or name what differs in by= ({', '.join(differ) or 'see the table'})"
    )


def same(column, value):
    """Which entries are this value: numbers to SAME, nan is nan, True is 1."""
    if column.dtype.kind in "if":
        try:
            value = float(value)
        except (TypeError, ValueError):
            return np.zeros(len(column), bool)
        return np.isclose(column, value, rtol=SAME, atol=0.0, equal_nan=True)
    return column == str(value)


def frame(columns):
    """Columns as a pandas.DataFrame. Raises MissingPackage where pandas is not installed."""
    try:
        import pandas
    except ImportError:
        raise MissingPackage("to_pandas", "pandas") from None
    return pandas.DataFrame(dict(columns))
