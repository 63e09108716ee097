"""Compatibility matrix C: the relative motions of the contacts for given displacements; K and B as sums of squares.

A row of C turns unknowns into one of the relative motions a∥, a⊥, a⊥ᶜ of one contact, the transverse ones along D − 1
axes, g holds what a load of unit
amplitude adds (`laws.loads`), the part of E r along the motion's axis:

    a = C x + ε g ,      K = Cᵀ W_K C ,      B = Cᵀ W_B C   (+ kτ₁ drag 1 on displacements, not on angles).

Sums over contacts of W a² keep digits that products with the assembled matrices lose: at low pressure the relative
motions are far smaller than the displacements, and here their difference is taken once per contact.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from jampetsc.errors import InputError, named
from jampetsc.laws.damping import Law
from jampetsc.laws.loads import Load, fluid_dissipation
from jampetsc.laws.relative_motion import linear_forms, transverse_axes
from jampetsc.petsc.sparse_matrices import distributed_matrix
from jampetsc.response.contact_network import DistributedNetwork


@dataclass(frozen=True, eq=False)
class Compatibility:
    """C, g and the weights. Rows are distributed with the contacts, each contact once, with its lower-numbered disk."""

    network: DistributedNetwork
    C: object  # PETSc.Mat, one row per form and contact
    forms: int  # rows per contact: a∥, D − 1 of a⊥ and, where disks roll, as many of a⊥ᶜ
    g: np.ndarray  # (rows,) local, of a unit amplitude of the load
    g_size: np.ndarray  # (rows,) local, ≥ |g|: sum of the sizes of its terms, which under a rotation cancel
    w_K: np.ndarray  # (rows,) local weights of a² in K
    w_B: np.ndarray  # (rows,) local weights of a² in B
    size_K: np.ndarray  # (rows,) |w_K| and what rounding may do to it, in ε: an overlap is off by ε σ
    reach_K: np.ndarray  # (n_local,) Σ |w_K| C² over the contacts of each unknown,
    reach_B: np.ndarray  # and Σ w_B C² + drag; see `reach`
    drag: np.ndarray  # (n_local,) kτ₁ times the drag, 0 for angles: the part of B not from contacts
    drag_gg: float  # the part of b_γγ that does not come from contacts, kτ₁ η_F V 2 s′:s″
    viscosity: float  # kτ₁ η_F

    def under(self, load: Load) -> "Compatibility":
        """The same under another load; C is shared."""
        contacts = self.network.contacts
        once = contacts[contacts.i < contacts.j]
        axes, imposed = (once.normal, *transverse_axes(once.normal)), load.imposed(once.r)
        size = np.abs(once.r) @ np.abs(load.gradient).T
        g, g_size = (
            self._by_form([np.sum(of(axis) * vectors, axis=1) for axis in axes])
            for of, vectors in ((np.asarray, imposed), (np.abs, size))
        )
        return replace(self, g=g, g_size=g_size, drag_gg=self.fluid_gg(load, load))

    def _by_form(self, parts):
        """(rows,) of parts (M,) along each axis of the contacts: those across it twice, where disks roll."""
        along, *across = parts
        return np.stack([along, *across, *across][: self.forms], axis=1).ravel()

    @cached_property
    def affine_sizes(self):
        """Sizes of the terms of k_γγ and of b_γγ that contacts add, (2,), which may cancel. Collective."""
        return self.network.sum(np.array([self.size_K @ self.g_size**2, self.w_B @ self.g_size**2]))

    def fluid_gg(self, load: Load, other: Load) -> float:
        """The part of b_EE′ of two loads that the fluid adds."""
        return self.viscosity * self.network.volume * fluid_dissipation(load, other)

    def dissipation(self, motions, field) -> float:
        """aᵀ W_B a + xᵀ drag x of real motions a (rows,) and their field x (n_local,): this rank's part of the sum."""
        return self.w_B @ motions**2 + self.drag @ field**2

    def reach(self, s: float):
        """D (n_local,) with Σ (|w_K| + s w_B)(|C||x|)² + s Σ drag x² ≤ ROW xᵀDx, in any unit of length.

        It bounds the effect of rounding in the terms of the motions C x; ROW unknowns at most enter one motion.
        """
        return self.reach_K + s * self.reach_B

    @cached_property
    def _vectors(self):
        return self.C.createVecs()

    def motions(self, x):
        """C x, (rows,) local, for local unknowns x (n_local,), real or complex in either build. Collective."""
        return self._through(self.C.mult, x, *self._vectors)

    def forces(self, a):
        """Cᵀ a, (n_local,), for a (rows,), real or complex in either build. Collective."""
        return self._through(self.C.multTranspose, a, *reversed(self._vectors))

    def _through(self, multiply, values, source, target):
        def once(part):
            source.setArray(part)
            multiply(source, target)
            return target.getArray().copy()

        if np.iscomplexobj(values) and not np.iscomplexobj(source.getArray()):
            return once(values.real) + 1j * once(values.imag)
        return once(values) if np.iscomplexobj(values) else once(values).real


def along_and_across(motions):
    """(a∥, a⊥) (M,) each of motions (M, D), a⊥ with its sign in 2D, its length in 3D."""
    along, *across = motions.T
    return along, across[0] if len(across) == 1 else np.hypot(*across)


def forms_of(network: DistributedNetwork, law: Law):
    """`linear_forms` of the network's contacts, with spins where disks roll."""
    c = network.contacts
    if law.couples_rotations and network.radii is None:
        raise InputError(
            "network without radii: its nodes roll under this damping law. Give radii, or take a law without rotations "
            f"({named('rotations')})."
        )
    rims = (network.radii[c.i], network.radii[c.j]) if law.couples_rotations else None
    return linear_forms(c.normal, c.r[:, 1], rims)


def weights(network: DistributedNetwork, law: Law):
    """Weights of the squares of `forms_of`, per contact, complex (M, forms): real part for K, imaginary for B."""
    c = network.contacts
    damping = network.damping(law) * np.array(law.on_forms(network.dimension))
    w = np.zeros((len(c), len(damping)), complex)
    w[:, 0] = c.stiffness
    if network.prestress:
        w[:, 1 : network.dimension] = -c.force_per_length[:, None]
    return w + 1j * damping


def stacked(forms):
    """`linear_forms` of M bonds as coefficients of both disks' unknowns, (M, forms, 2 dofs), and of γ, (M, forms)."""
    rows = np.stack([np.hstack((on_i, on_j)) for on_i, on_j, _ in forms], axis=1)
    return rows, np.stack([on_gamma for *_, on_gamma in forms], axis=1)


def build_compatibility(network: DistributedNetwork, law: Law, pins) -> Compatibility:
    """C of a network under a law, with zero columns for pinned unknowns. Collective."""
    once = network.contacts.i < network.contacts.j
    i, j = network.contacts.i[once], network.contacts.j[once]
    forms, w, dimension = forms_of(network, law), weights(network, law), network.dimension
    m, f, d = len(i), len(forms), law.dofs(dimension)
    size_K = np.abs(w[once].real)
    rounding = network.contacts[once].weight_rounding
    rounding[:, 1] *= network.prestress
    size_K[:, :dimension] += np.repeat(rounding, (1, dimension - 1), axis=1)
    rows, g = stacked(forms)
    # contacts are seen from both ends, in the order of their disks
    at = (np.abs(w.real) + 1j * w.imag)[:, None, :] @ rows[..., :d] ** 2
    starts = np.searchsorted(network.contacts.i, np.arange(network.first, network.last))
    reach = np.add.reduceat(at[:, 0], starts).ravel()
    reach[np.isin(np.arange(network.first * d, network.last * d), pins)] = 0.0
    damping = network.damping(law)
    drag = np.zeros((network.last - network.first, d))
    drag[:, :dimension] = damping * law.drag
    reach += 1j * drag.ravel()
    w, values, g = w[once], rows[once], g[once]
    columns = np.concatenate((i[:, None] * d + np.arange(d), j[:, None] * d + np.arange(d)), axis=1)
    columns = np.broadcast_to(columns[:, None, :], values.shape)
    values[np.isin(columns, pins)] = 0.0
    local = csr_array(
        (values.ravel(), columns.ravel(), np.arange(m * f + 1) * 2 * d), shape=(m * f, network.n * d)
    )
    local.sort_indices()
    C = distributed_matrix(network.comm, local, local.data, (network.last - network.first) * d)
    return Compatibility(
        network, C, f, g.ravel(), np.abs(g).ravel(), w.real.ravel(), w.imag.ravel(), size_K.ravel(), reach.real,
        reach.imag, drag.ravel(), damping * law.eta_f * network.volume, damping * law.eta_f,
    )  # fmt: skip
