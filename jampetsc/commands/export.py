"""Packings, modes, fields and flows for OVITO, ASE, LAMMPS, ParaView and HOOMD."""

from dataclasses import dataclass
from typing import ClassVar

from jampetsc.errors import InputError, named
from jampetsc.io import frames
from jampetsc.io.exporters import check_format, write_frames, write_network_export
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILE, optional_parameter, parameter
from jampetsc.options.values import PACKING, PACKING_NETWORK_OR_RESULT, input_name, load_source
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network

KINDS = {Packing: "packing", Network: "network"}  # of what has no format of a result
OWNERS = {"mode": ("modes",), "field": ("sweep",), "packing": ("modes", "sweep", "quasistatic")}


@dataclass(frozen=True, eq=False)
class Export(Job):
    """Write packings, modes, fields and flows for OVITO, ASE, LAMMPS, ParaView, HOOMD and numpy.

    Of a packing: radius, coordination, rattlers and stress of every disk and, in data, vtp, npz and gsd, its contacts
    with force and overlap. Of modes, a sweep's fields or slow shear: the motion as vectors on the packing. Of a flow:
    the snapshots with their velocities, as frames of one file (xyz, dump, gsd). Of a network: nodes and bonds (data,
    vtp, npz). The ending of the name chooses the format.
    """

    scalar: ClassVar = None
    FORMAT: ClassVar = "exported"
    OUT_HELP: ClassVar = "file to write: .xyz, .dump, .data, .vtp, .npz or .gsd"
    GIVES: ClassVar = "the name of the file, a Path"
    EPILOG: ClassVar = """examples:
  jampetsc export p.h5 --out p.vtp
  jampetsc export modes.h5 --mode 3 --out mode3.xyz
  jampetsc export sweep.h5 --field 1e-3 --out field.dump
  jampetsc export rd0.h5 --out rd0.xyz                  # the snapshots of a flow"""

    file: Packing = parameter(
        help="packing, network, modes, sweep with fields, quasistatic or flow file",
        place=FILE,
        value_type=PACKING_NETWORK_OR_RESULT,
    )
    mode: int | None = optional_parameter("modes file: number of the mode, from 1 (default 1)", metavar="I")
    field: float | None = optional_parameter(
        "sweep: frequency of the field", above=0.0, high=1e300, metavar="OMEGA"
    )
    packing: Packing | str | None = optional_parameter(
        "file of the packing of a result (default: as the result records it)", value_type=PACKING
    )

    def check_outputs(self, to):
        """Refuse an unknown ending, and an output that may not be replaced."""
        to.require_file()
        check_format(to.path)
        super().check_outputs(to)

    def work(self, to):
        loaded = load_source(self.file)
        kind = KINDS.get(type(loaded)) or loaded.format.removeprefix("jampetsc-")
        self._check_options(kind)
        exported = self._frames(loaded, kind)
        if isinstance(exported, list) and isinstance(exported[0], frames.NetworkFrame):
            write_network_export(to.path, exported[0])
            return f"{to}: {len(exported[0].network.bonds)} bonds of {input_name(self.file)}"
        count = write_frames(to.path, exported)
        return f"{to}: {count} frame{'s' * (count != 1)} of {input_name(self.file)}"

    def python_result(self, to):
        return to.path

    def _check_options(self, kind):
        """Raise InputError for options of other kinds of files."""
        for option, owners in OWNERS.items():
            if getattr(self, option) is not None and kind not in owners:
                raise InputError(
                    f"{named(option)}: an option of {' or '.join(owners)} files, but {input_name(self.file)} is a "
                    f"{kind} "
                    "file. Leave it out."
                )

    def _frames(self, loaded, kind):
        """The frames to export. Raises InputError for a file that has none."""
        name = input_name(self.file)
        match kind:
            case "network":
                return [frames.NetworkFrame(loaded)]
            case "packing":
                return [frames.packing_frame(loaded)]
            case "flow":
                return frames.flow_frames(loaded)
            case "modes":
                return [frames.mode_frame(loaded, 1 if self.mode is None else self.mode, self.packing)]
            case "quasistatic":
                return [frames.slow_frame(loaded, self.packing)]
            case "sweep":
                if self.field is None:
                    frequencies = ", ".join(f"{omega:g}" for omega in loaded.fields.omega)
                    raise InputError(
                        f"{named('field')}: missing. Give a frequency of the fields in {name}: {frequencies}."
                    )
                return [frames.field_frame(loaded, self.field, self.packing)]
        raise InputError(
            f"{name}: export of {kind} files is not supported. Give a packing, network, modes, sweep, quasistatic or "
            "flow file."
        )
