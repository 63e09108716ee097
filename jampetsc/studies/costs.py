"""What tasks cost, estimated from those that are done: the same command, N and pressure if there are any."""

import statistics

_KEYS = (("command", "n", "pressure"), ("command", "n"))


class Costs:
    """Seconds of finished tasks, by what they were."""

    def __init__(self, records=()):
        self._seconds = {}
        for record in records:
            if record["state"] == "done":
                self.learn(record["row"], record["seconds"])

    def learn(self, row: dict, seconds: float) -> None:
        """A task with this row took so long."""
        for keys in _KEYS:
            self._seconds.setdefault(tuple(row.get(key) for key in keys), []).append(seconds)
        if row.get("n"):
            self._seconds.setdefault((row["command"],), []).append(seconds / row["n"])

    def of(self, task) -> float | None:
        """Seconds that a task will take; None if nothing like it has been done. Cost ∝ N from another N."""
        row = task.columns | {"command": task.command}
        for keys in _KEYS:
            if found := self._seconds.get(tuple(row.get(key) for key in keys)):
                return statistics.median(found)
        if row.get("n") and (found := self._seconds.get((task.command,))):
            return statistics.median(found) * row["n"]
        return None

    def total(self, tasks) -> float | None:
        """Seconds of all of them one after another; what is unknown counts as the mean of what is known."""
        known = [seconds for task in tasks if (seconds := self.of(task)) is not None]
        return statistics.fmean(known) * len(tasks) if known else None


def in_words(seconds: float | None) -> str:
    """42 s, 3.2 min, 5.1 h."""
    if seconds is None:
        return "unknown"
    for limit, unit, name in ((90, 1, "s"), (5400, 60, "min")):
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}"
    return f"{seconds / 3600:.2g} h"
