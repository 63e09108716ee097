"""Compatibility matrix C: the relative motions of the contacts for given displacements; K and B as sums of squares.

A row of C turns unknowns into one of the relative motions a∥, a⊥, a⊥ᶜ of one contact, the transverse ones along D − 1
axes, g holds what a load of unit
amplitude adds (`laws.loads`), the part of E r along the motion's axis:

    a = C x + ε g ,      K = Cᵀ W_K C ,      B = Cᵀ W_B C + the drag of the fluid on the unknowns of each disk.

Sums over contacts of W a² keep digits that products with the assembled matrices lose: at low pressure the relative
motions are far smaller than the displacements, and here their difference is taken once per contact.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from jampetsc.laws.damping import Law
from jampetsc.laws.loads import ForceLoad, Load, fluid_dissipation
from jampetsc.laws.relative_motion import linear_forms, load_coefficients, load_column
from jampetsc.petsc.sparse_matrices import distributed_matrix
from jampetsc.response.contact_network import DistributedNetwork


@dataclass(frozen=True, eq=False)
class BondForms:
    """The weighted forms of the contacts of this rank's disks, seen from these disks."""

    network: DistributedNetwork
    law: Law
    rows: tuple  # of `forms.FORMS`
    forms: list  # as `linear_forms` makes them, one for each axis of a row
    weights: np.ndarray  # (contacts, forms) complex: real part for K, imaginary for B

    @classmethod
    def of(cls, network: DistributedNetwork, law: Law) -> "BondForms":
        """Of a network under a law. Raises InputError as `DistributedNetwork.contact_forms`."""
        c, rows, dimension = network.contacts, network.contact_forms(law), network.dimension
        rims = (network.radii[c.i], network.radii[c.j]) if network.rolls(law) else None
        damping = network.damping(law) * np.array(law.on_axes(rows, dimension))
        w = np.zeros((len(c), len(damping)), complex)
        w.real = _by_axis(rows, network.elastic_weights, dimension, len(c))
        return cls(network, law, rows, linear_forms(rows, c.normal, rims), w + 1j * damping)

    @property
    def weight_rounding(self):
        """What rounding of the input may do to the weights in K, in units of ε, (contacts, forms)."""
        network = self.network
        return _by_axis(self.rows, network.weight_rounding, network.dimension, len(network.contacts))

    def rotation(self, load: Load):
        """Ω of the affine flow where spins are relative to it, else None."""
        return load.rotation if self.network.spins_follow_load(self.law) else None

    def under(self, load: Load):
        """g of a unit amplitude of a load and sizes of its terms, (rows,) each: of every contact once."""
        bonds, rotation = self.network.contacts.r, self.rotation(load)
        g = load_coefficients(self.forms, load.imposed(bonds), rotation)
        sizes = [(np.abs(on_i), np.abs(on_j)) for on_i, on_j in self.forms]
        size = np.abs(bonds) @ np.abs(load.gradient).T
        g_size = load_coefficients(sizes, size, None if rotation is None else np.abs(rotation))
        return tuple(np.stack(part, axis=1)[self.once].ravel() for part in (g, g_size))

    def external_forces(self, load: Load, is_pushed):
        """External forces of a unit amplitude of a load on the unknowns and sizes of their terms, (n_local,) each."""
        if not isinstance(load, ForceLoad):
            return np.zeros((2, len(is_pushed)))
        on_unknowns = np.zeros((2, self.network.last - self.network.first, self.network.dofs(self.law)))
        on_unknowns[..., : self.network.dimension] = load.forces, load.sizes
        return on_unknowns.reshape(2, -1) * is_pushed

    @property
    def once(self):
        """Which contacts are seen from their lower-numbered disk, (contacts,)."""
        return self.network.contacts.i < self.network.contacts.j

    def load_column(self, load: Load, pins):
        """k + ib of a load, (n_local,) complex, and k_γγ + ib_γγ of the contacts. Collective.

        pins   pinned unknowns, global numbers, whose entries are zero
        """
        added = load_coefficients(self.forms, load.imposed(self.network.contacts.r), self.rotation(load))
        column, corner = load_column(self.forms, self.weights, added)
        column = self.sum_of_disks(column).ravel()
        dofs = self.network.dofs(self.law)
        own = pins - self.network.first * dofs
        column[own[(own >= 0) & (own < len(column))]] = 0.0
        return column, self.network.sum(np.sum(corner)) / 2.0  # each contact is seen from both ends

    def sum_of_disks(self, values):
        """Sums (disks, …) of values (contacts, …) over the contacts of each disk."""
        disks = np.arange(self.network.first, self.network.last)
        # contacts come ordered by i, and every disk here has some
        return np.add.reduceat(values, np.searchsorted(self.network.contacts.i, disks))


def _by_axis(rows, values, dimension, count):
    """(contacts, forms) of {name of a weight in K: (contacts,)}, for each axis of the rows."""
    nothing = np.zeros(count)
    return np.stack(
        [values.get(form.elastic, nothing) for form in rows for _ in range(form.count(dimension))], axis=1
    )


@dataclass(frozen=True, eq=False)
class Compatibility:
    """C, g and the weights. Rows are distributed with the contacts, each contact once, with its lower-numbered disk."""

    bonds: BondForms
    C: object  # PETSc.Mat, one row per form and contact
    g: np.ndarray  # (rows,) local, of a unit amplitude of the load
    g_size: np.ndarray  # (rows,) local, ≥ |g|: sum of the sizes of its terms, which under a rotation cancel
    w_K: np.ndarray  # (rows,) local weights of a² in K
    w_B: np.ndarray  # (rows,) local weights of a² in B
    size_K: np.ndarray  # (rows,) |w_K| and what rounding may do to it, in ε: an overlap is off by ε σ
    reach_K: np.ndarray  # (n_local,) Σ |w_K| C² over the contacts of each unknown,
    reach_B: np.ndarray  # and Σ w_B C² + drag; see `reach`
    force: np.ndarray  # (n_local,) external forces of a unit amplitude of the load: c = Cᵀ W g − force
    force_size: np.ndarray  # (n_local,) ≥ |force|: sum of the sizes of its terms
    is_pushed: (
        np.ndarray
    )  # (n_local,) which unknowns external forces act on: displacements that are not pinned
    drag: np.ndarray  # (n_local,) kτ₁ times the drag on displacements and spins, which contacts do not add
    drag_gg: float  # the part of b_γγ that does not come from contacts, kτ₁ η_F V 2 s′:s″
    viscosity: float  # kτ₁ η_F

    @property
    def network(self) -> DistributedNetwork:
        """The network."""
        return self.bonds.network

    @property
    def rows(self) -> tuple:
        """Forms of a contact, of `forms.FORMS`."""
        return self.bonds.rows

    @property
    def forms(self) -> int:
        """Rows per contact: a∥, D − 1 of a⊥ and, where disks roll, as many of a⊥ᶜ."""
        return len(self.bonds.forms)

    def axes_of(self, weight: str) -> list[int]:
        """Which of a contact's rows belong to the form with this weight."""
        names = [form.weight for form in self.rows for _ in range(form.count(self.network.dimension))]
        return [number for number, name in enumerate(names) if name == weight]

    def under(self, load: Load) -> "Compatibility":
        """The same under another load; C is shared."""
        g, g_size = self.bonds.under(load)
        force, force_size = self.bonds.external_forces(load, self.is_pushed)
        return replace(
            self, g=g, g_size=g_size, force=force, force_size=force_size, drag_gg=self.fluid_gg(load, load)
        )

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


def stacked(forms):
    """`linear_forms` of M bonds as coefficients of both disks' unknowns, (M, forms, 2 dofs)."""
    return np.stack([np.hstack(ends) for ends in forms], axis=1)


def build_compatibility(bonds: BondForms, pins, load: Load) -> Compatibility:
    """C of the contacts under a load, with zero columns for pinned unknowns. Collective."""
    network, law, w, once = bonds.network, bonds.law, bonds.weights, bonds.once
    i, j = network.contacts.i[once], network.contacts.j[once]
    d = network.dofs(law)
    m, f = len(i), len(bonds.forms)
    size_K = np.abs(w[once].real) + bonds.weight_rounding[once]
    rows = stacked(bonds.forms)
    at = (np.abs(w.real) + 1j * w.imag)[:, None, :] @ rows[..., :d] ** 2
    reach = bonds.sum_of_disks(at[:, 0]).ravel()
    unknowns = np.arange(network.first * d, network.last * d)
    is_pinned = np.isin(unknowns, pins)
    reach[is_pinned] = 0.0
    is_pushed = ~is_pinned & (unknowns % d < network.dimension)
    drag = np.tile(drag_of(network, law), network.last - network.first)
    reach += 1j * drag
    w, values = w[once], rows[once]
    columns = np.concatenate((i[:, None] * d + np.arange(d), j[:, None] * d + np.arange(d)), axis=1)
    columns = np.broadcast_to(columns[:, None, :], values.shape)
    values[np.isin(columns, pins)] = 0.0
    local = csr_array(
        (values.ravel(), columns.ravel(), np.arange(m * f + 1) * 2 * d), shape=(m * f, network.n * d)
    )
    local.sort_indices()
    C = distributed_matrix(network.comm, local, local.data, (network.last - network.first) * d)
    viscosity = network.damping(law) * law.eta_f
    of_fluid = viscosity * network.volume * fluid_dissipation(load, load)
    return Compatibility(
        bonds, C, *bonds.under(load), w.real.ravel(), w.imag.ravel(), size_K.ravel(), reach.real,
        reach.imag, *bonds.external_forces(load, is_pushed), is_pushed, drag, of_fluid, viscosity,
    )  # fmt: skip


def drag_of(network: DistributedNetwork, law: Law):
    """kτ₁ times the drag of the fluid on each unknown of a disk, (dofs,)."""
    return (
        network.damping(law)
        * np.array(law.on_disks(network.dimension, network.diameter))[: network.dofs(law)]
    )
