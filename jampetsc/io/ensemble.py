"""The table of a study as numpy arrays, from its file, and its averages over packings. Needs neither PETSc nor MPI."""

import copy
import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jampetsc.analysis.jammed_samples import pooled_share, share_of_runs
from jampetsc.analysis.statistics import STATISTICS, complex_statistic
from jampetsc.columns import unquoted
from jampetsc.errors import InputError, MissingPackage
from jampetsc.io.atomic import open_regular
from jampetsc.io.provenance import LAW_PARAMETERS
from jampetsc.io.results import Named, Result

TABLE = "table.csv"
SETTINGS = "settings"  # column with the names of the columns that the study has set in a row
SYSTEM_COLUMNS = (
    "lattice",
    "keep",
    "potential",
    "exponent",
    "stabilise",
    "stiffness",
    "sizes",
)  # set ones of tables without it
# how a task ran, or what it stored; a packing of a ladder differs from others in its pressure
EXECUTION_SETTINGS = frozenset(
    "seed seeds threads last ladder parallel omega fields betas count below all discard every window "
    "snapshots snapshot_every snapshot_spacing series".split()
)
MEASURED_COLUMNS = ("pressure", "phi")  # which hold what the packing has where the study did not set them
RELATIVE_TOLERANCE = 1e-9  # numbers that differ by less, relatively, are the same
DISTINGUISHING_COLUMNS = ("command", "law", *LAW_PARAMETERS)
DISTINGUISHING_COLUMNS += ("model", "method", "phase", "omega", "rate", "strain", "accuracy")
NOT_AVERAGED = ("seed", "seconds")
# columns that are shares of samples: those with the error of a run and its effective number of samples; runs of jam are
# independent samples, or as many as they are worth
SHARE_COLUMNS = {
    "jammed_fraction": ("jammed_fraction_samples",),
    "jammed_mean": ("jammed_error", "jammed_samples"),
    "plastic_mean": ("plastic_error", "plastic_samples"),
}


@dataclass(frozen=True, eq=False)
class AverageCurve:
    """A mean or median over packings, point by point; errors are halves of 68 % intervals, nan for one packing."""

    key: dict  # column -> value that its rows agree in
    omega: np.ndarray  # (M,) the frequencies, or what else it is a function of
    value: np.ndarray  # (M, …), complex for G*
    error: np.ndarray  # (M, …), of G* the errors of G' and G'' as a complex number
    count: int  # packings


class Ensemble(Named):
    """Rows of the table of a study: column -> (rows,) array, nan or "" where a task has no such number.

    path   the folder; the columns `command`, `state` and `file` are always there
    load   function that opens one of its files
    """

    def __init__(self, path, columns: dict, load):
        super().__init__(columns)
        self.path, self._load = Path(path), load

    def __getitem__(self, name):
        return self.named(name, "column", self.table)

    def __repr__(self):
        return f"<{self.rows} rows of {self.table}>"

    @property
    def table(self) -> Path:
        """The file of the table, for messages."""
        return self.path / TABLE

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self["state"])

    @property
    def failed(self) -> "Ensemble":
        """The tasks that failed; `state` says why."""
        return self.taken(self["state"] != "done")

    def where(self, **values) -> "Ensemble":
        """The rows with these values, where(command="sweep", pressure=[1e-2, 1e-3]): any one of a list will do."""
        chosen = np.ones(self.rows, bool)
        for name, choice in values.items():
            column = self[name]
            group = choice if isinstance(choice, list | tuple | set | np.ndarray) else [choice]
            chosen &= np.any([is_equal(column, value) for value in group], axis=0)
        return self.taken(chosen)

    def taken(self, rows) -> "Ensemble":
        """Some of the rows, by number or as a mask."""
        return Ensemble(self.path, {name: column[rows] for name, column in self.items()}, self._load)

    def results(self) -> list:
        """What `jampetsc.load` gives for the files of the rows that are done, results with their `settings`."""
        done, results = self.taken(self["state"] == "done"), []
        for name, settings in zip(done["file"], done.settings(), strict=True):
            result = self._load(self.path / name)
            if isinstance(result, Result):
                result.settings = settings
            results.append(result)
        return results

    def settings(self) -> list[dict]:
        """{column: value} of each row: what the study has set in any of them but EXECUTION_SETTINGS.

        None where a row leaves a parameter at its default and has no number of this name.
        """
        words = [str(word).split() for word in self.get(SETTINGS, [""] * self.rows)]
        names = [row if row and row != ["nan"] else SYSTEM_COLUMNS for row in words]
        columns = [
            column
            for column in dict.fromkeys(name for row in names for name in row)
            if column in self and column not in EXECUTION_SETTINGS
        ]
        values = {column: self[column].tolist() for column in columns}
        return [
            {
                column: _setting(values[column][row])
                if column in names[row] or column not in MEASURED_COLUMNS
                else None
                for column in columns
            }
            for row in range(self.rows)
        ]

    def mean(self, by=()) -> "Averages":
        """Means over the rows that agree in the columns `by`, a name or several, with errors."""
        return Averages(self, by, "mean")

    def median(self, by=()) -> "Averages":
        """Medians, as `mean`."""
        return Averages(self, by, "median")

    def mean_curve(self, name="G", by=(), over="omega") -> list[AverageCurve]:
        """Means of a dataset of the files, one curve for the rows that agree in the columns `by`.

        over   the dataset that it is a function of, the same in all files of a curve

        Rows of commands whose files have no such datasets are left out. Raises InputError where no file has them, where
        `over` is not the same, where two rows of a curve are of one packing, and where they differ in what the study
        has set, except for seeds.
        """
        return self._curves(name, by, over, "mean")

    def median_curve(self, name="G", by=(), over="omega") -> list[AverageCurve]:
        """Medians, as `mean_curve`."""
        return self._curves(name, by, over, "median")

    def _holding(self, *names):
        """The done rows of commands whose files hold these datasets, judged by the first file of each command."""
        done = self.taken(self["state"] == "done")
        commands = []
        for command in set(done["command"].tolist()):
            first = self._load(self.path / done["file"][done["command"] == command][0])
            if isinstance(first, Mapping) and all(name in first for name in names):
                commands.append(command)
        if not commands:
            raise InputError(
                f"{self.table}: no dataset {' and '.join(names)} in the files of these rows. Choose another name."
            )
        return done.where(command=commands)

    def _curves(self, name, by, over, statistic):
        curves, holding = [], self._holding(name, over)
        for key, rows in holding.groups((by,) if isinstance(by, str) else tuple(by)):
            require_independent(key, rows, name)
            require_alike(key, rows, name)
            results = rows.results()
            x = results[0][over]
            for result in results:
                has_shape = result[over].shape == x.shape
                if not (has_shape and np.allclose(result[over], x, rtol=RELATIVE_TOLERANCE, atol=0.0)):
                    raise InputError(
                        f"{result.path}: other {over} than {results[0].path}. Average results of equal {over}."
                    )
            value, error = complex_statistic([result[name] for result in results], statistic)
            curves.append(AverageCurve(key, x, value, error, len(results)))
        return curves

    def to_pandas(self):
        """The table as a pandas.DataFrame. Raises InputError where pandas is not installed."""
        return to_frame(self)

    def groups(self, by) -> list:
        """[({column: value}, rows as an Ensemble)] for the values that occur in the columns `by`, sorted; done rows."""
        done = self.taken(self["state"] == "done")
        keys = list(zip(*(done[name].tolist() for name in by), strict=True)) if by else [()] * done.rows
        keys = [tuple(None if value != value else value for value in key) for key in keys]
        groups = []
        for group in sorted(set(keys), key=lambda key: [(value is None, value) for value in key]):
            rows = np.array([key == group for key in keys])
            groups.append((dict(zip(by, group, strict=True)), done.taken(rows)))
        return groups


class Averages(Mapping):
    """Averages over groups of rows: column -> (groups,) array, for the columns `by` the value of each group.

    error        column -> (groups,) halves of 68 % intervals, see `analysis.statistics`; nan for a single row, but for
                 shares, which are taken over all samples of the rows
    count        column -> (groups,) numbers of rows averaged
    below_zero   column -> (groups,) how many of these are negative, such as G₀ of packings unstable to shear: they
                 count like all others

    Raises InputError on reading a column where a group has two rows of one packing, which are not independent, or rows
    that differ in what the study has set, except for seeds.
    """

    _row = 0  # of what `_average` gives: value, error, count, below zero

    def __init__(self, ensemble, by, statistic):
        self.by = (by,) if isinstance(by, str) else tuple(by)
        self.statistic = statistic
        self._groups = ensemble.groups(self.by)
        self._names = [
            name for name in ensemble if name not in NOT_AVERAGED and ensemble[name].dtype.kind in "if"
        ]
        self._results = {}
        self.error, self.count, self.below_zero = (self._other(row) for row in (1, 2, 3))

    def _other(self, row):
        """The same mapping of another row."""
        other = copy.copy(self)
        other._row = row
        return other

    def __getitem__(self, name):
        if name in self.by:
            return np.array([key[name] for key, _ in self._groups])
        if name not in self._results:
            results = [self._average(key, rows, name) for key, rows in self._groups]
            self._results[name] = [np.array(column) for column in zip(*results, strict=True)]
        return self._results[name][self._row]

    def _average(self, key, rows, name):
        column = rows[name]
        if column.dtype.kind not in "if":
            raise InputError(
                f"{rows.table}: column {name} holds text, which has no {self.statistic}. Choose a column of numbers."
            )
        finite = np.isfinite(column)
        require_independent(key, rows.taken(finite), name)
        require_alike(key, rows.taken(finite), name)
        values = column[finite]
        if not len(values):
            return np.nan, np.nan, 0, 0
        value, error = self._share(rows.taken(finite), name) or STATISTICS[self.statistic](values)
        return float(value), float(error), len(values), int(np.count_nonzero(values < 0))

    def _share(self, rows, name):
        """(value, error) of a share, which is binomial: of all samples of the rows together; None for anything else."""
        parts = [rows[part] for part in SHARE_COLUMNS.get(name, ()) if part in rows]
        if not parts or not np.isfinite(parts).all():
            return None
        share = (pooled_share if len(parts) == 1 else share_of_runs)(rows[name], *parts)
        return share.value, share.error

    def __iter__(self):
        return iter([*self.by, *(name for name in self._names if name not in self.by)])

    def __len__(self):
        return len(list(iter(self)))

    def to_pandas(self):
        """A pandas.DataFrame of the averages, errors in columns `…_error`. Raises InputError without pandas."""
        errors = {f"{name}_error": self.error[name] for name in self._names if name not in self.by}
        return to_frame({**self, **errors})


def load_ensemble(folder, load) -> Ensemble:
    """The table of the study in a folder, whose files `load` opens. Raises InputError for any other folder."""
    path = Path(folder) / TABLE
    if not path.exists():
        raise InputError(
            f"{folder}: a folder without {TABLE}. Give the file in it; run a study that was stopped again."
        )
    try:
        with open_regular(path) as file:
            text = file.read().decode()
        header, *rows = ([unquoted(cell) for cell in row] for row in csv.reader(io.StringIO(text)))
        if not {"command", "state", "file"} <= set(header) or any(len(row) != len(header) for row in rows):
            raise ValueError
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}). Check its permissions.") from None
    except (UnicodeDecodeError, csv.Error, ValueError):
        raise InputError(f"{path}: not the table of a study. Run `jampetsc study` again.") from None
    columns = {name: _column([row[n] for row in rows]) for n, name in enumerate(header)}
    return Ensemble(folder, columns, load)


def _column(cells):
    """Integers if all cells are, else floats with nan for an empty one, else words."""
    for kind, empty in ((int, None), (float, np.nan)):
        try:
            return np.array([kind(cell) if cell or empty is None else empty for cell in cells], kind)
        except (ValueError, OverflowError):
            continue
    return np.array(cells, str)


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
    first = seen[packing]
    differ = [
        c for c in DISTINGUISHING_COLUMNS if c in rows and not is_equal(rows[c][[first]], rows[c][other])[0]
    ]
    raise InputError(
        f"{rows.table}: {name} of {_group_text(key)}: {rows['file'][first]} and {rows['file'][other]} are of one "
        f"packing. Choose rows with where(…), or name in by= what differs ({', '.join(differ) or 'see the table'})."
    )


def require_alike(key, rows, name) -> None:
    """Raise InputError where rows, whose mean is to be taken, differ in what the study has set."""
    settings = rows.settings()
    varied = varied_settings(settings)
    if not varied:
        return
    column = varied[0]
    values = list(dict.fromkeys(str(row[column]) for row in settings if row[column] is not None))
    raise InputError(
        f"{rows.table}: {name} of {_group_text(key)}: rows differ in {' and '.join(varied)} "
        f"({column} {' or '.join(values[:3])}). Choose rows with where(…), or name in by= what differs."
    )


def varied_settings(settings) -> list[str]:
    """The columns in which rows of `Ensemble.settings` differ; None where a row lacks one."""
    columns = dict.fromkeys(column for row in settings for column in row)
    return [column for column in columns if len({str(row.get(column)) for row in settings}) > 1]


def _setting(value):
    return None if value != value or value == "" else value


def _group_text(key) -> str:
    return ", ".join(f"{column} {value}" for column, value in key.items()) or "all rows"


def is_equal(column, value):
    """Which entries are this value: numbers to RELATIVE_TOLERANCE, nan is nan, True is 1."""
    if column.dtype.kind in "if":
        try:
            value = float(value)
        except (TypeError, ValueError):
            return np.zeros(len(column), bool)
        return np.isclose(column, value, rtol=RELATIVE_TOLERANCE, atol=0.0, equal_nan=True)
    return column == str(value)


def to_frame(columns):
    """Columns as a pandas.DataFrame. Raises MissingPackage where pandas is not installed."""
    try:
        import pandas
    except ImportError:
        raise MissingPackage("to_pandas", "pandas") from None
    return pandas.DataFrame(dict(columns))
