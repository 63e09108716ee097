"""Which commands a study runs, and what a task of each reads. A new command is one line of KINDS."""

from collections.abc import Callable
from dataclasses import dataclass

NOTHING = "nothing"
PACKING = "a packing"
START = "a packing, or nothing where its table gives n"
SWEEP = "a sweep"
SEEDS = "the files of all seeds"


@dataclass(frozen=True)
class Kind:
    """What a task of a command reads: one task per packing, per sweep, or for the files of all seeds."""

    on: str
    of: tuple[str, ...] = ("sweep",)  # commands whose files it reads
    suits: Callable = lambda job: True  # whether it can use the file of this job
    needs: str = ""  # the files it can use, for messages
    alone: bool = False  # whether it runs on one rank only, however large it is


KINDS = {
    "pack": Kind(NOTHING, alone=True),
    "sweep": Kind(PACKING),
    "quasistatic": Kind(PACKING),
    "modes": Kind(PACKING),
    "oscillate": Kind(PACKING),
    "flow": Kind(START),
    "shear": Kind(START, alone=True),
    "jam": Kind(NOTHING),
    "spectrum": Kind(
        SWEEP, suits=lambda sweep: sweep.method == "rational", needs="sweeps with method rational"
    ),
    "correlate": Kind(
        SEEDS,
        of=("sweep", "flow"),
        suits=lambda job: any(
            getattr(job, name, None) is not None for name in ("fields", "snapshots", "snapshot_every")
        ),
        needs="sweeps with fields, or flows with snapshots",
    ),
}
