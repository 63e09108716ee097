"""Which commands a study runs, and what a task of each begins with. A command joins by one line of KINDS."""

from collections.abc import Callable
from dataclasses import dataclass

NOTHING = "nothing"
PACKING = "a packing"
START = "a packing, or nothing where its table gives n"
SWEEP = "a sweep"
SWEEPS = "the sweeps of all seeds"


@dataclass(frozen=True)
class Kind:
    """What a task of a command begins with: one task per packing, per sweep, or for the sweeps of all seeds."""

    on: str
    suits: Callable = lambda args: True  # whether it can use a sweep with these parsed arguments
    needs: str = ""  # what such a sweep has, in words
    alone: bool = False  # whether only one rank can do it, however large


KINDS = {
    "pack": Kind(NOTHING),
    "sweep": Kind(PACKING),
    "quasistatic": Kind(PACKING),
    "modes": Kind(PACKING),
    "oscillate": Kind(PACKING),
    "flow": Kind(START),
    "shear": Kind(START, alone=True),
    "jam": Kind(NOTHING),
    "spectrum": Kind(SWEEP, lambda sweep: sweep.method == "rational", "method rational"),
    "correlate": Kind(SWEEPS, lambda sweep: sweep.fields is not None, "fields"),
}
