"""What `jampetsc info` and the commands that make a network say of it, as aligned text."""

import numpy as np

from jampetsc.commands.describe import cell_text, number, table
from jampetsc.packing.contacts import BALANCED
from jampetsc.packing.spring_network import Network


def network(name, network: Network) -> str:
    """Cell, bonds, forces and record of a network."""
    bonds = network.linear_bonds
    alone = int(np.count_nonzero(network.isolated))
    record = {key: value for key, value in network.record.items() if key != "protocol"}
    return table(
        [
            (f"{name}: network of {network.n} nodes and {len(bonds)} bonds",),
            ("made by", str(network.record.get("protocol", "unknown"))),
            ("cell", f"{cell_text(network.cell)}, V = {network.volume:.9g}"),
            ("bonds", f"{2 * len(bonds) / network.n:.6g} for each node; {alone} nodes have none"),
            ("lengths", _range(bonds.distance)),
            ("stiffness", f"{_range(bonds.stiffness)}, unit k = {network.k:g}"),
            ("forces", _forces(network)),
            ("radii", "none: nodes do not roll" if network.radii is None else _range(network.radii)),
            *((key, number(value)) for key, value in sorted(record.items()) if value is not None),
        ]
    )


def _range(values):
    low, high = float(values.min()), float(values.max())
    return f"{low:.6g}" if high - low <= 1e-12 * abs(high) else f"{low:.6g} to {high:.6g}"


def _forces(network):
    if not network.tension.any():
        return "none: every bond is at rest"
    push, pull = (int(np.count_nonzero(sign * network.tension > 0)) for sign in (-1, 1))
    balance = network.imbalance
    state = "balanced" if balance <= BALANCED else f"not balanced, max |F| / mean |T| = {balance:.1e}"
    return f"{push} bonds push, {pull} pull; p = {network.pressure:.6g}; {state}"
