"""Which files a task of a study reads; the class of a job declares it as `STUDY_INPUTS`."""

from collections.abc import Callable
from dataclasses import dataclass

NO_FILE = "no file"
ONE_PACKING = "one packing"
PACKING_OR_N = "one packing, or no file where the table gives n"
NETWORKS = ("pack", "springs")  # commands that make a packing or a network
ONE_RESULT = "one result"
ALL_SEEDS = "the results of all seeds"


@dataclass(frozen=True)
class TaskInputs:
    """What one task of a command reads in a study.

    reads        NO_FILE, ONE_PACKING, PACKING_OR_N, ONE_RESULT or ALL_SEEDS
    commands     commands whose results it reads; of packings: pack alone if none are named
    is_suitable  whether it can use the result of this job
    needs        the results that it can use, for messages
    one_rank     whether it runs on one rank only, however large the packing is
    """

    reads: str
    commands: tuple[str, ...] = ()
    is_suitable: Callable = lambda job: True
    needs: str = ""
    one_rank: bool = False
