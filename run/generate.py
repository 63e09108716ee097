"""Writes what follows from the code: the reference of functions, commands and files, and signatures for editors.

    .venv/bin/python run/generate.py

Run it after a change of a parameter, a docstring or a format. A test says which file is not up to date.
"""

from pathlib import Path

import files_page
import reference
import stubs

ROOT = Path(__file__).parents[1]
PAGES = {  # in docs/reference: name -> function of the present text
    "api.md": reference.api_page,
    "commands.md": reference.commands_page,
    "files.md": files_page.page,
}
STUB = ROOT / "jampetsc" / "__init__.pyi"


def generated() -> dict[Path, str]:
    """{file: its text as the code has it}. What stands above the entries of a page is kept."""
    texts = {}
    for name, page in PAGES.items():
        path = ROOT / "docs" / "reference" / name
        texts[path] = page(path.read_text())
    return texts | {STUB: stubs.stub()}


if __name__ == "__main__":
    for path, text in generated().items():
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
            print(f"written: {path.relative_to(ROOT)}")
