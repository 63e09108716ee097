"""The tutorials of the site are notebooks: their pieces of python run in Jupyter, and their output follows each piece.

The files in docs/tutorials are the source. What they print and draw is in the site only, and beside each page the
executed notebook. A cell that fails or warns ends the building of the site.
"""

import base64
import re
import tempfile
from pathlib import PurePosixPath

FOLDER = "tutorials"


def cells(markdown) -> list:
    """[(kind, text)] of a page in its order: "markdown" or "code", the blocks of python."""
    parts = re.split(r"```python\n(.*?)```\n", markdown, flags=re.DOTALL)
    kinds = ("markdown", "code")
    return [(kinds[row % 2], part.strip("\n")) for row, part in enumerate(parts) if part.strip()]


def executed(markdown, name):
    """The notebook of a page after all its cells have run. Raises RuntimeError for a cell that writes to stderr."""
    import nbclient
    import nbformat.v4 as v4

    make = {"markdown": v4.new_markdown_cell, "code": v4.new_code_cell}
    parts = [("code", "%matplotlib inline"), *cells(markdown)]
    notebook = v4.new_notebook(cells=[make[kind](text) for kind, text in parts])
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    with tempfile.TemporaryDirectory() as folder:
        nbclient.NotebookClient(
            notebook, timeout=1800, startup_timeout=300, resources={"metadata": {"path": folder}}
        ).execute()
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if output.get("name") == "stderr":
                raise RuntimeError(f"{name}: a cell warns:\n{output.text}\n{cell.source}")
    return notebook


def page(notebook, name):
    """(markdown of the page with the output of its cells, {name of a picture: its bytes})."""
    title, _, rest = notebook.cells[1].source.partition("\n")
    notebook.cells[1].source = f"{title}\n\n[This page as a notebook]({name}.ipynb){{ .md-button }}\n{rest}"
    text, pictures = "", {}
    for cell in notebook.cells[1:]:  # the first is of notebooks only
        text += f"```python\n{cell.source}\n```\n\n" if cell.cell_type == "code" else f"{cell.source}\n\n"
        for output in cell.get("outputs", []):
            image = output.get("data", {}).get("image/png")
            if image:
                picture = f"{name}-{len(pictures) + 1}.png"
                pictures[picture] = base64.b64decode(image)
                text += f"![what the cell draws]({picture})\n\n"
            elif output.output_type == "stream":
                text += f"```text\n{output.text}```\n\n"
    return text, pictures


def on_files(files, config):
    """Run the pages of the folder, and put the notebooks and their pictures among the files of the site."""
    import nbformat
    from mkdocs.structure.files import File

    for source in list(files.documentation_pages()):
        path = PurePosixPath(source.src_uri)
        if path.parts[0] != FOLDER or "```python" not in source.content_string:
            continue
        notebook = executed(source.content_string, path.stem)
        original = nbformat.writes(notebook)
        text, pictures = page(notebook, path.stem)
        files.remove(source)
        files.append(File.generated(config, source.src_uri, content=text))
        files.append(File.generated(config, f"{FOLDER}/{path.stem}.ipynb", content=original))
        for name, content in pictures.items():
            files.append(File.generated(config, f"{FOLDER}/{name}", content=content))
    return files
