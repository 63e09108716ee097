"""table.csv: one row per task, with its settings, its state and the numbers of its result."""

import numpy as np

from jampetsc.analysis.jammed_samples import OPTIONAL_COLUMNS, effective_samples, runs_of, share_of
from jampetsc.analysis.power_laws import MIN_FREQUENCIES, critical_slopes, is_critical, low_frequency_limit
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.columns import comma_separated
from jampetsc.errors import InputError
from jampetsc.io.ensemble import SETTINGS
from jampetsc.io.reader import load
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network

# columns that come first, if they exist, and last
FIRST_COLUMNS = ("command", "state", "file", "packing", "n", "pressure", "phi", "seed", "law")
LAST_COLUMNS = ("seconds",)
TEXT_ATTRIBUTES = ("law", "model", "method", "packing", "phase", "notes")  # text attributes that are columns
# numbers that are no columns
EXCLUDED_ATTRIBUTES = (
    "ranks",
    "wall_seconds",
    "negative_modes",
    "requested_n",
    "requested_pressure",
    "requested_phi",
)


def rows_of(tasks, records: dict) -> list[dict]:
    """The rows of the tasks in STUDY.toml, in its order, then of finished tasks of an earlier STUDY.toml.

    Unfinished tasks have no row.
    """
    names = {task.name: None for task in tasks if task.name in records}  # a set in order
    previous = [name for name, record in records.items() if name not in names and record["state"] == "done"]
    return [_row(records[name]) for name in [*names, *sorted(previous)]]


def _row(record):
    state = "done" if record["state"] == "done" else f"failed: {record['why']}"
    row = record["row"]
    return row | {"state": state, "seconds": round(record["seconds"], 3)}


def table_text(rows) -> str:
    """The table as CSV; numbers to their last digit, nothing where a task has none."""
    names = {name: None for row in rows for name in row}
    columns = [name for name in FIRST_COLUMNS if name in names]
    columns += [name for name in names if name not in (*FIRST_COLUMNS, SETTINGS, *LAST_COLUMNS)]
    columns += [SETTINGS] * (SETTINGS in names) + list(LAST_COLUMNS)
    return comma_separated(columns, ({name: _cell(value) for name, value in row.items()} for row in rows))


def _cell(value):
    if isinstance(value, bool):
        return int(value)
    return value if value == value else None  # for which csv writes nothing


def numbers_of(path) -> dict:
    """{column: value} of a packing, a network or a result. Raises InputError where it cannot be read."""
    loaded = load(path)
    if isinstance(loaded, Packing):
        return {**_scalars(loaded.record), "phi": loaded.phi, "n": loaded.n}
    if isinstance(loaded, Network):
        return {**_scalars(loaded.record), "n": loaded.n, "bond_count": len(loaded.bonds)}
    numbers = _scalars(loaded.attributes)
    numbers |= NUMBERS_OF_ARRAYS.get(loaded.format, lambda result: {})(loaded)
    if "particle_count" in numbers:
        numbers["n"] = numbers.pop("particle_count")
    return numbers


def _scalars(attributes):
    numbers = {}
    for name, value in attributes.items():
        if name in EXCLUDED_ATTRIBUTES or name.endswith("_version"):
            continue
        if isinstance(value, bool | np.bool_):
            numbers[name] = int(value)
        elif isinstance(value, int | float | np.number):
            numbers[name] = value.item() if isinstance(value, np.number) else value
        elif isinstance(value, str) and name in TEXT_ATTRIBUTES:
            numbers[name] = value
    return numbers


def _sweep(result):
    """G₀, η₀ and ω* of a sweep, and the slopes of its critical branch, as far as its frequencies reach them.

    Of forces the mean susceptibility at the lowest frequency, of one wave moduli as well.
    """
    numbers = {}
    if "susceptibility" in result:
        lowest = result["susceptibility"][np.argmin(result.omega)]
        numbers |= {"susceptibility_mean": float(np.mean(lowest.real))}
    if "G" not in result or result.G.ndim > 1:
        return numbers
    try:
        limit = low_frequency_limit(result.omega, result.G)
        numbers |= {"G0": limit.modulus, "eta0": limit.viscosity, "omega_star": limit.crossover}
    except InputError:
        pass
    attributes = result.attributes
    inside = is_critical(
        result.omega, float(attributes.get("tau1", 1.0)), attributes["pressure"], attributes["k"]
    )
    if np.count_nonzero(inside) >= MIN_FREQUENCIES:
        slopes = critical_slopes(result.omega[inside], result.G[inside])
        numbers |= {name: value for name, value in slopes.items() if not name.endswith("_error")}
    return numbers


def _modes(result):
    """Numbers of the first mode; floppiness and shares of the response of the lowest 10, 50 and 200 modes together.

    None of numbers of states.
    """
    if "eigenvalues" not in result:
        return {}
    numbers = {
        "lowest_eigenvalue": float(result["eigenvalues"][0]),
        "lowest_participation": float(result["participation_ratio"][0]),
        "lowest_floppiness": float(result["floppiness"][0]),
    }
    for place, count in enumerate(result["lowest/count"] if "lowest/count" in result else ()):
        slides, stretches = (result[name][:count].sum() for name in ("transverse", "normal"))
        numbers[f"floppiness_{count}"] = float(np.sqrt(slides / stretches))
        for name in ("nonaffine", "normal", "transverse"):
            numbers[f"share_{name}_{count}"] = float(result[f"cumulative/{name}"][count - 1])
            numbers[f"{name}_median_{count}"] = float(result[f"lowest/{name}_median"][place])
    return numbers


def _correlation(result):
    """Lengths at the lowest frequency, of the first lane width."""
    lowest = int(np.argmin(result["omega"]))
    length, error = (result[name][0, lowest] for name in ("length", "length_error"))
    return {
        "omega": float(result["omega"][lowest]),
        **{f"length_{part}": float(length[n]) for n, part in enumerate(("storage", "loss"))},
        **{f"length_{part}_error": float(error[n]) for n, part in enumerate(("storage", "loss"))},
    }


def _jam(result):
    """The fraction of samples that jam, and the means of φ_J and segregation if the protocol gives them."""
    numbers = {"samples": len(result["jammed"])}
    jammed = [result["jammed"][rows] for _, _, rows in runs_of(result)]
    jammed = [run[np.isfinite(run)] for run in jammed if np.isfinite(run).any()]
    if jammed:
        share = share_of(jammed)
        numbers |= {"jammed_fraction": share.value, "jammed_fraction_error": share.error}
        numbers["jammed_fraction_samples"] = effective_samples(share)
    for name in OPTIONAL_COLUMNS:
        values = result[name] if name in result else np.empty(0)
        values = values[np.isfinite(values)]
        if len(values):
            numbers[name] = float(values.mean())
            if len(values) > 1:
                numbers[f"{name}_error"] = float(mean_with_error(values)[1])
    return numbers


NUMBERS_OF_ARRAYS = {  # format -> function (result) -> {column: number} from its arrays
    "jampetsc-sweep": _sweep,
    "jampetsc-modes": _modes,
    "jampetsc-correlation": _correlation,
    "jampetsc-jam": _jam,
}
