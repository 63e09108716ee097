"""Quasistatic shear: an affine step of the cell, the minimum of the energy there, and again (Vågberg, thesis sec. 4.7).

Between rearrangements the disks follow the cell by a displacement that is nearly the same from step to step: each
minimisation starts from the affine positions moved once more as in the step before, by Newton's method; only where
contacts change too much for that does it go down by `packing.minimise`.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.pairs import deformed
from jampetsc.contacts.state import find_contacts, measure
from jampetsc.contacts.threads import Team
from jampetsc.packing.descent import Descent, Goal
from jampetsc.packing.minimise import Effort, minimise
from jampetsc.packing.newton import Limits, Newton

ENERGY_CUT = 1e-16  # U/(N k_e) above which disks are jammed (Vågberg et al., PRE 83, 031307 (2011))
LONGEST = 0.1  # mean diameters: a longer displacement was a rearrangement, which does not go on as it went


@dataclass(frozen=True)
class Look:
    """What is kept of a minimum."""

    energy: float  # U
    shear_stress: float  # σ_xy
    pressure: float
    jammed: bool
    coordination: float  # Z = 2 N_c / N, rattlers included


def look_at(disks: Disks) -> Look:
    """Energy, stress and contacts of disks at a minimum."""
    state = measure(disks)
    return Look(
        state.energy,
        float(state.stress[0, 1]),
        state.pressure,
        bool(state.energy / disks.n > ENERGY_CUT * disks.potential.k),
        2.0 * len(find_contacts(disks)) / disks.n,
    )


class SlowShear:
    """Disks sheared step by step; `disks` is the last minimum, `effort` what it has cost.

    Raises ConvergenceError where no minimum is found, as `packing.minimise.minimise`.
    """

    def __init__(self, disks: Disks, step: float, solver, tolerance: float):
        self.step, self.solver, self.tolerance = step, solver, tolerance
        self.effort = Effort()
        self.steps = 0
        self.last = np.zeros((disks.n, 2))  # displacement beside the affine one in the last step
        self.disks, self.jammed = self._minimum(disks, False)

    @property
    def strain(self) -> float:
        """Total strain γ."""
        return self.steps * self.step

    def _minimum(self, disks, near):
        """The minimum downhill from disks; near: Newton's method is tried at once, and a proof is not asked for."""
        if near:
            descent = Descent(disks, Goal(), Team())
            newton = Newton(descent, self.solver, self.effort)
            there = newton.converge(Limits(descent, self.tolerance))
            self.effort.evaluations += descent.evaluations
            if there:
                return descent.disks.folded(), True
        found = minimise(disks, Goal(), self.solver, tolerance=self.tolerance, effort=self.effort)
        return found.disks.folded(), found.jammed

    def advance(self) -> float:
        """One step; returns the rms displacement beside the affine one, in mean diameters."""
        still = np.zeros_like(self.last)
        affine = deformed(self.disks, still, 0.0, self.step).folded()
        # The minimum of the step before may be shifted as a whole: nothing holds it.
        self.disks, self.jammed = self._minimum(deformed(affine, self.last, 0.0, 0.0), self.jammed)
        moved = (self.disks.base - affine.base) + (self.disks.offset - affine.offset)
        turns = np.round(moved @ np.linalg.inv(affine.cell))
        moved -= turns @ affine.cell
        moved -= moved.mean(axis=0)
        self.steps += 1
        diameter = 2.0 * float(np.mean(self.disks.radii))
        size = float(np.sqrt(np.mean(np.sum(moved**2, axis=1)))) / diameter
        self.last = moved if np.abs(moved).max() < LONGEST * diameter else still
        return size

    def state(self) -> dict:
        """Everything that goes on from here; `restore` takes it back to the last bit."""
        d = self.disks
        arrays = {"base": d.base, "offset": d.offset, "cell_base": d.cell_base, "cell_offset": d.cell_offset}
        counts = {"steps": self.steps, "evaluations": self.effort.evaluations, "jammed": self.jammed}
        return arrays | counts | {"last": self.last, "newton_steps": self.effort.newton_steps}

    def restore(self, state: dict) -> None:
        """Go on from what `state` gave."""
        old = self.disks
        arrays = [np.asarray(state[name], float) for name in ("base", "offset", "cell_base", "cell_offset")]
        self.disks = Disks(*arrays[:2], old.radii, *arrays[2:], old.potential)
        self.jammed = bool(state["jammed"])
        self.last, self.steps = np.asarray(state["last"], float), int(state["steps"])
        self.effort = Effort(int(state["evaluations"]), int(state["newton_steps"]))
