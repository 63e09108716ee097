"""Files of flows: the run that one continues, and the disk space that one needs."""

import json
import shutil

import numpy as np

from jampetsc.commands.run_files import STATE, split_state
from jampetsc.errors import InputError, named
from jampetsc.flows.flow_run import FlowRun
from jampetsc.flows.trajectory import Trajectory
from jampetsc.io.atomic import follow
from jampetsc.io.hdf5 import reading
from jampetsc.io.result_formats import FLOW

MAX_SKIN = 10.0  # of a state that is read, in units of the largest diameter
ORIGIN_ATTRIBUTES = (
    "units",
    "seed",
    "sizes",
    "packing",
    "packing_sha256",
    "walls",
)  # which a continued run keeps


def continued_run(earlier, strain: float) -> tuple[FlowRun, dict]:
    """(run that continues an earlier flow by `strain`, attributes of the origin of its disks).

    earlier     `io.results.Result`

    Raises InputError where the flow cannot be continued.
    """
    disks, attributes, path = earlier.listed, earlier.attributes, earlier.path
    for name, row in FLOW.datasets.rows.items():
        if name.startswith(STATE) and name not in earlier and not row.optional:
            raise InputError(f"{path}: dataset {name}: missing. Make the file again.")
    with reading(path):
        arrays, state = split_state(earlier)
        diameter = 2.0 * float(state["radii"].max())
        for name, array in state.items():
            if not _is_sound(name, array, diameter):
                raise InputError(
                    f"{path}: dataset {STATE}{name}: not the state of a flow. Make the file again."
                )
        trajectory, run = (
            Trajectory.of(arrays),
            FlowRun.of_settings(json.loads(attributes["settings"]), disks),
        )
    if run.schedule.rows != len(trajectory):
        raise InputError(
            f"{path}: {len(trajectory)} rows, but settings of {run.schedule.rows}. Make the file again."
        )
    origin = {name: attributes[name] for name in ORIGIN_ATTRIBUTES if name in attributes}
    return run.extended(trajectory, state, strain), origin


def _is_sound(name, array, diameter) -> bool:
    """Whether an array of a state can be what a run has written; diameter: that of the largest disk."""
    if name == "order":  # loops over disks use it without a look
        return np.array_equal(np.sort(array), np.arange(len(array)))
    if name == "skin":
        return bool(0.0 < array <= MAX_SKIN * diameter)
    if np.ndim(array) == 0:
        return bool(array >= 0) or name == "sorted_at"
    return bool(np.isfinite(array).all())


def check_space(to, disks: int, snapshots: int) -> None:
    """Raise InputError where the snapshots of a run do not fit on the disk where `to`, an Outlet, puts them."""
    for out in {to.path, to.checkpoint_path} - {None}:
        needed = 2 * snapshots * (disks * 7 + 5) * 8  # twice with the checkpoint
        free = shutil.disk_usage(follow(out).parent).free
        if needed > free:
            raise InputError(
                f"{named('snapshots')} {snapshots}: of {disks} particles need {needed / 1e9:.3g} GB with the "
                f"checkpoint, and {free / 1e9:.3g} GB are free where {out} is to be. Ask for fewer."
            )
