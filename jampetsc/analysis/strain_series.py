"""Numbers of a run over strain, a row at a time, and what is said of their means."""

import numpy as np

from jampetsc.analysis.correlated_series import MIN_EFFECTIVE_SAMPLES

SAVE_INTERVAL = 10.0  # seconds between two times that a run saves its series


class StrainSeries:
    """Numbers of a run over strain, a row at a time.

    columns: {name: number of parts of a value, 0 for a scalar}, the strain among them
    """

    def __init__(self, columns: dict):
        self.columns = columns
        self.rows = {name: [] for name in columns}

    def __len__(self):
        return len(self.rows["strain"])

    @property
    def strain(self) -> float:
        """Strain at the end of the last row; 0 before the first one."""
        return float(self.rows["strain"][-1]) if len(self) else 0.0

    def add(self, **row) -> None:
        """One row: a value for every column."""
        for name, column in self.rows.items():
            column.append(row[name])

    def column(self, name) -> np.ndarray:
        """(T,) array of a column, or (T, C) of one whose values have C parts."""
        parts = self.columns[name]
        return np.array(self.rows[name], float).reshape((-1, parts) if parts else -1)

    def arrays(self) -> dict:
        """All columns by name, for `restore`."""
        return {name: self.column(name) for name in self.columns}

    def restore(self, arrays) -> None:
        """Take the rows that `arrays` gave, a mapping of names to arrays."""
        self.rows = {name: list(np.asarray(arrays[name])) for name in self.columns}


def discarded_strain(strain: float, discard: float | None) -> float:
    """Strain before the means of a run: `discard`, or by default 1, but at most half of the run."""
    return min(1.0, 0.5 * strain) if discard is None else discard


def average_facts(**averages) -> dict:
    """Mean, standard error and effective sample size of each average, as NAME_mean, NAME_error, NAME_samples."""
    return {
        f"{name}_{part}": getattr(average, part)
        for name, average in averages.items()
        for part in ("mean", "error", "samples")
    }


def short_run_warnings(strain, spacing, *averages) -> list[str]:
    """Warning, if any, that one of the averages over `strain`, rows `spacing` apart, has too few effective samples."""
    least = min(averages, key=lambda average: average.samples)
    if least.enough:
        return []
    return [
        f"errors are widened and still rough: effective sample size {least.samples:.0f} (below "
        f"{MIN_EFFECTIVE_SAMPLES:.0f}), as strain {strain:.3g} after discard is short for a correlation strain of "
        f"about {spacing * least.time:.2g}. Give a longer strain"
    ]
