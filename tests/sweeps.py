"""Rational sweeps without files, and how they compare with a reference."""

import numpy as np
from samples import network_of

from jampetsc.response.assembly import assemble
from jampetsc.response.rational import RationalSweep


class Sweep:
    """The sweep of `disks` for `physics`. Collective.

    Of a finished one G (M,), bounds (M, 3) on |ΔG*|, |ΔG'|, |ΔG''|; galerkin, basis and sweep as the package made them
    """

    def __init__(self, disks, physics, omega, accuracy, comm, parallel="auto"):
        self.omega = np.atleast_1d(np.asarray(omega, float))
        self.physics, self.network = physics, network_of(disks, physics, comm)
        self.pencil = assemble(self.network, physics.law)
        self.sweep = RationalSweep(self.pencil, self.omega, accuracy, parallel)
        self.compatibility = self.pencil.compatibility

    def solved(self):
        """The same, finished."""
        while shifts := self.sweep.next_shifts():
            self.sweep.add_shifts(shifts)
        found = self.sweep.certificate
        self.galerkin, self.G, self.bounds = self.sweep.galerkin, found.G, found.bounds
        self.basis = self.sweep.basis
        return self


def errors(G, exact):
    """|ΔG*|, |ΔG'|, |ΔG''| and what they compare with, (M, 3) each; what a double cannot hold is no error."""
    exact = np.asarray(exact)
    size = np.column_stack((np.abs(exact), np.abs(exact.real), np.abs(exact.imag)))
    d = G - exact
    error = np.column_stack((np.abs(d), np.abs(d.real), np.abs(d.imag)))
    return np.where(error <= 2 * np.finfo(float).eps * size, 0.0, error), size


def judge(G, bounds, exact, accuracy, what):
    """G' and G'' each within `accuracy`, and everything within its bound."""
    error, size = errors(G, exact)
    assert np.all(error <= bounds), what
    assert np.all(error[:, 1:] <= accuracy * size[:, 1:]), what
    assert np.all(bounds[:, 1:] <= 2 * accuracy * size[:, 1:]), what
