"""Puts pictures of figures into papers/gallery: those of the table below, in 32 colours, a third of their size.

run/figure bt-fig3 --kept
.venv/bin/python -m papers.show figures/bt-fig3-kept [figures/bt-fig5-kept …]
"""

import io
import sys
from pathlib import Path

GALLERY = Path(__file__).resolve().parent / "gallery"
COLOURS = 32
SHOWN = {  # figure -> {picture in its folder: name in the gallery}
    "above-jamming": {"above-jamming": "above-jamming"},
    "bt-fig1": {"bt-fig1": "bt-fig1", "bt-fig1-fields": "bt-fig1-fields"},
    "bt-fig3": {"3a": "bt-fig3a", "3b": "bt-fig3b", "bt-fig3-exponents": "bt-fig3-exponents"},
    "bt-fig4": {"bt-fig4a": "bt-fig4a", "bt-fig4b": "bt-fig4b"},
    "bt-fig5": {"5": "bt-fig5", "5-local-exponents": "bt-fig5-exponents"},
    "bt-fig6": {"6a": "bt-fig6a", "6b": "bt-fig6b", "bt-fig6-logarithm": "bt-fig6-logarithm"},
    "bt-fig7": {"bt-fig7a": "bt-fig7a", "7b": "bt-fig7b", "bt-fig7cd": "bt-fig7cd"},
    "bt-fig7-contact": {"pressures": "bt-fig7-contact"},
    "bt-fig8": {"8a": "bt-fig8a", "bt-fig8b": "bt-fig8b", "bt-viscosity-ratio": "bt-viscosity-ratio"},
    "bt-modes": {"lowest-modes": "bt-modes", "bt-modes-levels": "bt-modes-levels"},
    "compression": {"compression": "compression"},
    "contact-lifetimes": {"lifetimes": "contact-lifetimes"},
    "crystals": {"crystals": "crystals"},
    "finite-size-flow": {"finite-size-flow": "finite-size-flow"},
    "first-changes": {"first-changes": "first-changes"},
    "inertia": {"soft": "inertia"},
    "inertia-start": {"inertia-start": "inertia-start"},
    "large-oscillations": {"moduli": "large-oscillations", "lissajous": "lissajous"},
    "overdamped-limit": {"overdamped": "overdamped-limit"},
    "paper1": {"densities": "paper1"},
    "paper2": {"paper2": "paper2"},
    "paper3": {"pressures": "paper3"},
    "paper4": {"regimes": "paper4"},
    "paper5": {"models-at-phi_J": "paper5"},
    "preparation": {"preparation": "preparation"},
    "sharp-transition": {"transition": "sharp-transition"},
    "step-strain": {"step_strain": "step-strain"},
    "three-dimensions": {"collapse-no-prestress": "three-dimensions", "medians": "three-dimensions-medians"},
    "three-dimensions-flow": {
        "flow-curves": "three-dimensions-flow",
        "branches": "three-dimensions-branches",
    },
    "three-dimensions-jamming": {"random": "three-dimensions-jamming"},
    "vagberg-fig4.6-4.7": {"vagberg-fig4.6-4.7": "vagberg-fig4.6-4.7"},
    "vagberg-fig4.8": {
        "4.8a": "vagberg-fig4.8a",
        "4.8b": "vagberg-fig4.8b",
        "4.8a-at-phi_J": "vagberg-fig4.8a-at-phi_J",
    },
    "vagberg-fig5.1": {"vagberg-fig5.1": "vagberg-fig5.1"},
    "vagberg-fig5.1-slow": {"5.1-slow": "vagberg-fig5.1-slow"},
    "vagberg-flow-curves": {
        "flow-curves": "vagberg-flow-curves",
        "flow-curves-at-phi_J": "vagberg-flow-curves-at-phi_J",
    },
    "walls": {"walls": "walls"},
}


def reduced(path) -> bytes:
    """The picture with COLOURS colours."""
    from PIL import Image

    small = io.BytesIO()
    Image.open(path).convert("RGB").quantize(COLOURS).save(small, "PNG", optimize=True)
    return small.getvalue()


def main():
    for folder in map(Path, sys.argv[1:]):
        for picture, name in SHOWN[folder.resolve().name.rpartition("-")[0]].items():
            path = folder / f"{picture}.png"
            if not path.exists():
                print(f"{path}: not made; {name} stays as it is")
                continue
            target = GALLERY / f"{name}.png"
            target.write_bytes(reduced(path))
            print(f"{target}: {target.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
