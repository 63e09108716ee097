"""A picture of a packing by OVITO (python -m pip install ovito): disks by their number of contacts, contacts as lines.

jampetsc pack --n 256 --pressure 1e-2 --out p.h5
python examples/ovito_picture.py p.h5 packing.png

LAMMPS data files have contacts as bonds; .xyz and .dump give OVITO coordination, rattlers and stress of every disk.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from ovito.io import import_file
from ovito.modifiers import ColorCodingModifier
from ovito.vis import TachyonRenderer, Viewport

import jampetsc


def count_contacts(frame, data):
    """Give the disks the property that they are coloured by, and let the lines on them be seen."""
    ends = data.particles.bonds.topology[...].ravel()
    data.particles_.create_property("Contacts", data=np.bincount(ends, minlength=data.particles.count))
    data.particles_.create_property("Transparency", data=np.full(data.particles.count, 0.5))


with tempfile.TemporaryDirectory() as folder:
    pipeline = import_file(str(jampetsc.export(sys.argv[1], out=Path(folder) / "packing.data")))
    lines = pipeline.compute().particles.bonds.vis
    lines.width, lines.color, lines.coloring_mode = 0.08, (0, 0, 0), lines.ColoringMode.Uniform
    pipeline.modifiers.append(count_contacts)
    pipeline.modifiers.append(ColorCodingModifier(property="Contacts"))
    pipeline.add_to_scene()
    view = Viewport(type=Viewport.Type.Top)
    view.zoom_all((600, 600))
    flat = TachyonRenderer(ambient_occlusion=False, shadows=False)
    view.render_image(filename=sys.argv[2], size=(600, 600), renderer=flat)
