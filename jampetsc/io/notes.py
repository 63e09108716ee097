"""Notes: what a user should know about the numbers of a result, such as that its errors are rough.

A note is a line `KIND: what is the case. What to do`. Notes of one kind differ in what follows the colon. They are
printed below the summary of a run, kept in the attribute `notes` of its file, and counted by kind in a study.
"""

from collections import Counter

BETWEEN = "; "  # notes in an attribute; so none has one inside


def noted(notes: list[str]) -> str | None:
    """Notes as the attribute of a file; None for none."""
    return BETWEEN.join(notes) or None


def note_lines(notes: list[str]) -> list[str]:
    """Notes as lines below a summary."""
    return [f"  note: {note}" for note in notes]


def unstable_to_shear(modulus: float, name: str) -> list[str]:
    """The note, if any, that a shear modulus of this name is negative."""
    if not modulus < 0.0:
        return []
    return [
        f"unstable to shear: {name} = {modulus:.3g}. For packings with a positive one: pack --stabilise shear"
    ]


def counted(rows: list[dict]) -> list[str]:
    """A line for each command and kind of note in a study's table: in how many rows, and the first of them."""
    found, tasks = {}, Counter(row["command"] for row in rows)
    for row in rows:
        for note in filter(None, row.get("notes", "").split(BETWEEN)):
            found.setdefault((row["command"], note.partition(":")[0]), []).append((note, row["file"]))
    return [
        f"  note in {len(some)} of {tasks[command]} {command} tasks, which count like the others: "
        f"{some[0][0]} ({some[0][1]})"
        for (command, _), some in found.items()
    ]
