"""What every loop over pairs inlines: vectors of D = 2 or 3 components, and the formulas of `strain` and `potentials`.

A vector is a tuple of its components, and vectors of many pairs are a tuple of D arrays. numba knows the length of a
tuple when it compiles, so that one source gives the code of each dimension, without a test in it.
"""

import numpy as np
from numba import types
from numba.extending import intrinsic, overload, register_jitable

from jampetsc.packing import elementary, potentials, strain
from jampetsc.packing.compiled import FAST, nested

# what compiled functions call by the same names as others
for _function in (
    elementary.split_exponential,
    elementary.exp,
    elementary.expm1,
    elementary.cosine_of_third,
):
    register_jitable(fastmath=False)(_function)
# `elementary.power` rounds as it does in numpy, in a loop that may be FAST
register_jitable(fastmath=False, error_model="numpy", forceinline=True)(elementary.power)
register_jitable(fastmath=False)(potentials.exponent_of)
_inlined = nested(FAST, cache=False, forceinline=True)
simple_shear, growth_and_shear = _inlined(strain.simple_shear), _inlined(strain.growth_and_shear)
growth_and_tilts = _inlined(strain.growth_and_tilts)
bond_vector, displace, strained = map(_inlined, (strain.bond_vector, strain.displace, strain.strained))
secant, tangent_ratio = _inlined(potentials.secant_stiffness), _inlined(potentials.tangent_ratio)
energy_term, exponent_of = _inlined(potentials.energy_term), _inlined(potentials.exponent_of)
# not FAST: whether a list serves is decided in exact order
_exact = nested(False, cache=False)
register_jitable(fastmath=False)(strain.gradient_over)
norms, strain_between, gradient_over = map(
    _exact, (strain.norms, strain.strain_between, strain.gradient_over)
)


@intrinsic
def _cast(typing_context, value):
    """The bits of a double as a whole number, or the other way round."""
    result = types.int64 if isinstance(value, types.Float) else types.float64

    def generate(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], context.get_value_type(result))

    return result(types.float64 if result == types.int64 else types.int64), generate


@overload(elementary.bits_of, jit_options={"forceinline": True})
def _bits_of(x):
    return lambda x: _cast(x)


@overload(elementary.from_bits, jit_options={"forceinline": True})
def _from_bits(bits):
    return lambda bits: _cast(bits)


@_inlined
def box_strain(box, like):
    """`strain.cell_strain` of an array; like: a tuple of length D."""
    if len(like) == 3:
        return growth_and_tilts(box[0], box[1], box[2], box[3])
    return growth_and_shear(box[0], box[1])


@_inlined
def entry(arrays, q):
    """Vector q of a tuple of D arrays."""
    if len(arrays) == 3:
        return arrays[0][q], arrays[1][q], arrays[2][q]
    return arrays[0][q], arrays[1][q]


@_inlined
def zero(like):
    """A vector of zeros; like: a tuple of length D."""
    if len(like) == 3:
        return 0.0, 0.0, 0.0
    return 0.0, 0.0


@_inlined
def put(arrays, q, a):
    """Make the vector a entry q of a tuple of D arrays."""
    arrays[0][q] = a[0]
    arrays[1][q] = a[1]
    if len(a) == 3:
        arrays[2][q] = a[2]


@_inlined
def row(rows, a, like):
    """Row a of an array (N, D) as a vector; like: a tuple of length D."""
    if len(like) == 3:
        return rows[a, 0], rows[a, 1], rows[a, 2]
    return rows[a, 0], rows[a, 1]


@_inlined
def difference(rows, a, b, like):
    """Row b less row a of an array (N, D) as a vector; like: a tuple of length D."""
    if len(like) == 3:
        return rows[b, 0] - rows[a, 0], rows[b, 1] - rows[a, 1], rows[b, 2] - rows[a, 2]
    return rows[b, 0] - rows[a, 0], rows[b, 1] - rows[a, 1]


@_inlined
def set_row(rows, a, vector):
    """Make a vector row a of an array (N, D)."""
    rows[a, 0] = vector[0]
    rows[a, 1] = vector[1]
    if len(vector) == 3:
        rows[a, 2] = vector[2]


@_inlined
def add_to_row(rows, a, vector):
    """Add a vector to row a of an array (N, D)."""
    rows[a, 0] += vector[0]
    rows[a, 1] += vector[1]
    if len(vector) == 3:
        rows[a, 2] += vector[2]


@_inlined
def subtract_from_row(rows, a, vector):
    """Subtract a vector from row a of an array (N, D)."""
    rows[a, 0] -= vector[0]
    rows[a, 1] -= vector[1]
    if len(vector) == 3:
        rows[a, 2] -= vector[2]


@_inlined
def inner(a, b):
    """a · b."""
    if len(a) == 3:
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return a[0] * b[0] + a[1] * b[1]


@_inlined
def scaled(c, a):
    """c a."""
    if len(a) == 3:
        return c * a[0], c * a[1], c * a[2]
    return c * a[0], c * a[1]


@_inlined
def added(a, b):
    """a + b."""
    if len(a) == 3:
        return a[0] + b[0], a[1] + b[1], a[2] + b[2]
    return a[0] + b[0], a[1] + b[1]


@_inlined
def cross(a, b):
    """a × b in three dimensions."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nested(False)
def pair_energy(r, sigma, potential):
    """V of one pair with the bond vector r; potential: `Potential.constants`."""
    overlap = sigma - np.sqrt(inner(r, r))
    if overlap <= 0.0:
        return 0.0
    force = secant(overlap, sigma, potential) * overlap
    return energy_term(force, overlap, sigma, potential) / exponent_of(potential)
