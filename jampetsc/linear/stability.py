"""What is known of a packing as a minimum of its energy before a sweep, and what becomes of the sweep when it is none.

The rational method needs K + ωB to be positive definite, and so do the error bounds of fields. Where K has negative
modes G* is still defined, and is solved for frequency by frequency. Where forces are not balanced it is that of the
contacts as they are, which is no state that a packing stays in.
"""

from dataclasses import replace

from jampetsc.collective import on_root
from jampetsc.core.state import BALANCED, imbalance, measure
from jampetsc.linear.run import Run
from jampetsc.mechanics.minimum import negative_modes
from jampetsc.petsc.session import current
from jampetsc.progress import Progress


def settle(run: Run) -> Run:
    """The job with balance and negative modes of its packing known, direct where there are some. Collective.

    Modes are not counted for a job that is direct anyway. Says on stderr what is not as it should be.
    """
    session = current()
    run = replace(run, imbalance=on_root(session.comm, lambda: imbalance(run.disks, measure(run.disks))))
    notes = []
    if not run.imbalance <= BALANCED:
        notes.append(
            f"forces are not balanced, max|F|/(p d) = {run.imbalance:.1e}, so the packing is not a minimum of its "
            "energy: quench it (pack from it); G* is that of its contacts as they are"
        )
    if run.method != "direct" and run.negative_modes is None:
        negative, how = negative_modes(run.network(session.comm))
        run = replace(run, negative_modes=negative, counted_by=how)
    if run.method != "direct" and run.negative_modes:
        notes.append(
            f"K has {run.negative_modes} negative modes, so the packing is not a minimum of its energy: solving "
            "every frequency by method direct"
        )
        run = replace(run, method="direct")
    with Progress(None, "sweep", session.rank) as progress:
        for note in notes:
            progress.note(f"{run.packing}: {note}")
    return run
