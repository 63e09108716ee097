"""Pictures of papers/gallery and the table of claims, which pages of the site show though they stand beside docs/.

Links of the pages are as in the repository, ../../papers/gallery/NAME.png.
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHOWN = "papers/gallery/*.png", "papers/kept/claims.csv"


def on_files(files, config):
    """The files of the site and of papers/; mkdocs calls it."""
    from mkdocs.structure.files import File

    for path in sorted(path for pattern in SHOWN for path in ROOT.glob(pattern)):
        name = path.relative_to(ROOT).as_posix()
        files.append(File.generated(config, name, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown, **_):
    """A page with its links to papers/ as the site has them; mkdocs calls it."""
    return markdown.replace("](../../papers/", "](../papers/")
