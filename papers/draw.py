"""Draws a picture that one figure of the papers alone needs; the name of the file says which.

.venv/bin/python -m papers.draw figures/bt-fig7-kept --picture bt-fig7a.png
"""

from benchmarks.common import saved_page
from papers.pictures import cells, correlations, drag, events, flows, inertia, jamming, modes, moduli, sizes  # noqa: F401  they enter their pictures
from papers.pictures.shared import PICTURES
from papers.programs import folder_and_picture


def main():
    args = folder_and_picture(__doc__, f"one of {', '.join(PICTURES)}, with the ending .png, .pdf or .svg")
    with saved_page(args.picture) as page:
        PICTURES[args.picture.stem](page, args.folder)
    print(f"{args.picture}: {PICTURES[args.picture.stem].__doc__}")


if __name__ == "__main__":
    main()
