"""Newton's method (PETSc SNES, prefix `osc_`) on the equations of a cycle.

A step solves the linear equations of all times together by FGMRES, preconditioned for each harmonic separately
(`HarmonicPreconditioner`); damping forces are eliminated exactly.
"""

import numpy as np

from jampetsc import interrupts
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.oscillation.cycle_equations import Equations
from jampetsc.oscillation.harmonic_preconditioner import HarmonicPreconditioner
from jampetsc.petsc.session import current

NEWTON_PREFIX = "osc_"
NEWTON_TYPES = ("newtonls", "ksponly")  # methods of SNES that solve with the derivative
NEWTON_DEFAULTS = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "bt",
    "snes_max_it": "50",
    "snes_rtol": "1e-14",  # `tolerance` decides
    "snes_stol": "0",
    "snes_ksp_ew": None,
    "snes_ksp_ew_version": "2",
    "snes_ksp_ew_rtol0": "0.1",
    "snes_ksp_ew_rtolmax": "0.1",
    "ksp_type": "fgmres",
    "ksp_gmres_restart": "60",
    "ksp_max_it": "600",
}


def solve_cycle(equations: Equations, values, tolerance: float):
    """The solution (size,) from the start `values` (size,), with a residual of at most `tolerance`. Collective.

    Also the numbers of Newton's steps and of linear iterations. Raises InputError for options that choose a method
    which does not solve with the derivative, ConvergenceError if SNES does not reach the tolerance.
    """
    session, comm = current(), equations.contacts.network.comm
    PETSc = session.PETSc
    session.free_dropped(comm)
    linearised = _Linearised(equations)
    jacobian = PETSc.Mat().createPython(((equations.size, None),) * 2, linearised, comm=comm)
    x, left = jacobian.createVecs()
    session.set_defaults({NEWTON_PREFIX + name: value for name, value in NEWTON_DEFAULTS.items()})
    snes = PETSc.SNES().create(comm)
    snes.setOptionsPrefix(NEWTON_PREFIX)
    snes.setFunction(linearised.function, left)
    snes.setJacobian(linearised.linearise, jacobian)
    ksp = snes.getKSP()
    ksp.setPCSide(PETSc.PC.Side.RIGHT)
    ksp.getPC().setType("python")
    ksp.getPC().setPythonContext(linearised)
    snes.setFromOptions()
    if snes.getType() not in NEWTON_TYPES:
        raise InputError(
            f"-{NEWTON_PREFIX}snes_type {snes.getType()}: not supported. Use one of {', '.join(NEWTON_TYPES)}."
        )
    x.setArray(values)
    snes.setTolerances(atol=tolerance)
    snes.solve(None, x)
    # Options may make SNES call anything converged: only the residual of the equations counts.
    linearised.function(snes, x, left)
    size = left.norm()
    if not size <= tolerance:
        raise ConvergenceError(
            f"Newton's method stopped (SNES reason {snes.getConvergedReason()}) after {snes.getIterationNumber()} "
            f"steps, its residual {size / tolerance:.1e} times the tolerance. Look with -osc_snes_monitor "
            "-osc_ksp_converged_reason."
        )
    return x.getArray().copy(), snes.getIterationNumber(), snes.getLinearSolveIterations()


class _Linearised:
    """The equations, their derivative and its preconditioner as PETSc calls them.

    It knows nothing of the solver: python's garbage collection does not see that PETSc holds it.
    """

    def __init__(self, equations: Equations):
        self.equations = equations
        self.preconditioner = HarmonicPreconditioner(
            equations.contacts, equations.cycle, equations.drive.stress_controlled
        )

    def function(self, snes, x, f):
        """f ← the residual at x."""
        self.equations.residual(
            self.equations.split(x.getArray(readonly=True)), self.equations.split(f.getArray())
        )

    def linearise(self, snes, x, J, P):
        """Take the derivative at x."""
        equations = self.equations
        state = equations.split(x.getArray(readonly=True))
        self.tangent = equations.law.tangent(equations.motions(state), state.f)
        self.preconditioner.update(self.tangent.mean_stiffness())

    def mult(self, matrix, x, y):
        """y ← the derivative times x."""
        split = self.equations.split
        self.equations.derivative(self.tangent, split(x.getArray(readonly=True)), split(y.getArray()))

    def apply(self, pc, x, y):
        """Eliminate the damping forces exactly and precondition the rest for each harmonic."""
        interrupts.check()
        equations, tangent = self.equations, self.tangent
        contacts = equations.contacts
        right, out = equations.split(x.getArray(readonly=True)), equations.split(y.getArray())
        eliminated = tangent.eliminated(right.f, equations.unit)
        tensions = np.zeros((len(eliminated), contacts.rows))
        contacts.add_damping(tensions, eliminated)
        forces, row = contacts.forces(tensions)
        row = row + equations.rate(right) if equations.drive.stress_controlled else np.zeros_like(row)
        out.v[:], rate = self.preconditioner.apply(right.v + forces, row)
        if equations.holds_rate:
            out.rate[:] = rate
        z = contacts.damping_motions(contacts.motions(out.v, rate))
        out.f[:] = tangent.forces(z) - eliminated
