"""Estimates of what tasks cost, from finished ones of the same command, N and pressure if there are any.

Until there are, from N, p and the settings: ROUGH was measured on one core with 64 to 1024 disks, and is right within a
factor of three or so.
"""

import statistics

from jampetsc.minimise.protocols import start_phi

ROUGH = {  # command -> seconds independent of N, seconds per unit (`_units`) at N = 1024, power of N of the latter
    "pack": (0.02, 0.12, 1.5),
    "sweep": (0.05, 0.07, 1.4),
    "quasistatic": (0.04, 0.05, 1.3),
    "modes": (0.04, 0.003, 1.2),
    "oscillate": (0.05, 0.5, 1.0),
    "flow": (0.07, 2.5e-5, 1.0),
    "shear": (0.05, 3e-3, 0.6),
    "jam": (0.03, 0.04, 0.5),
    "spectrum": (0.03, 0.0, 0.0),
    "correlate": (0.05, 0.04, 0.0),
}
DIRECT = 0.33  # of one frequency of --method direct, in units of a rational sweep
NONLINEAR, MOVING = 8, 16  # oscillations with a power law, or contacts that open, in units of linear ones
SOLVED = 10  # time steps that solve for velocities, in units of those that do not
_KEYS = (("command", "n", "pressure"), ("command", "n"))


class Costs:
    """Seconds of finished tasks by command, N and pressure."""

    def __init__(self, records=()):
        self._seconds = {}
        for record in records:
            if record["state"] == "done":
                self.learn(record["row"], record["seconds"])

    def learn(self, row: dict, seconds: float) -> None:
        """Add the seconds that the task with this row of the table took."""
        for keys in _KEYS:
            self._seconds.setdefault(tuple(row.get(key) for key in keys), []).append(seconds)
        if row.get("n"):
            self._seconds.setdefault((row["command"],), []).append(seconds / row["n"])

    def of(self, task) -> float | None:
        """Seconds that a task will take, ∝ N from tasks of another N; None if no such task is done and N is unknown."""
        row = task.columns | {"command": task.command}
        for keys in _KEYS:
            if found := self._seconds.get(tuple(row.get(key) for key in keys)):
                return statistics.median(found)
        if row.get("n") and (found := self._seconds.get((task.command,))):
            return statistics.median(found) * row["n"]
        return rough(task)

    def total(self, tasks) -> float | None:
        """Seconds of all tasks one after another; one of unknown cost counts as the mean of the others."""
        if not tasks:
            return 0.0
        known = [seconds for task in tasks if (seconds := self.of(task)) is not None]
        return statistics.fmean(known) * len(tasks) if known else None


def rough(task) -> float | None:
    """Seconds of one core for a task, from its settings; None where N is in a file."""
    fixed, each, power = ROUGH[task.command]
    count = task.columns.get("n")
    return count and fixed + each * (count / 1024) ** power * _units(task)


def _units(task):
    """Number of the units of which ROUGH has the cost: steps, samples, modes, frequencies, files."""
    job = task.choice.job
    match task.command:
        case "pack":
            phi, pressure = task.columns.get("phi"), task.columns.get("pressure")
            pressure = pressure or max(1e-6, (phi - start_phi(0.0)) / 3.5)
            return (1e-3 / pressure) ** 0.2
        case "sweep":
            return DIRECT * len(job.omega) if job.method == "direct" else 1
        case "modes":
            return task.columns["n"] if job.all else job.count or 1
        case "oscillate":
            kind = MOVING if job.contacts == "moving" else NONLINEAR if job.alpha != 1.0 else 1
            amplitudes = len(job.strain if job.stress is None else job.stress)
            return amplitudes * len(job.omega) * kind
        case "flow":
            step = job.step or min(0.2, 5e-3 / job.rate)
            return (
                job.strain
                / (job.rate * step)
                * (SOLVED if job.model.law.damps_contacts and not job.model.mass else 1)
            )
        case "shear":
            return job.strain / job.step
        case "jam":
            protocol = job.made_protocol
            steps = protocol.strain / protocol.step / 30 if protocol.name == "shear" else 0
            return job.count * (1 + steps + 40 * (protocol.name == "compress"))
        case "correlate":
            return len(task.inputs)
    return 1


def in_words(seconds: float | None) -> str:
    """42 s, 3.2 min, 5.1 h."""
    if seconds is None:
        return "unknown"
    for limit, unit, name in ((90, 1, "s"), (5400, 60, "min")):
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}"
    return f"{seconds / 3600:.2g} h"
