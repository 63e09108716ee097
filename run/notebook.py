"""The page docs/tutorial.md of the site is a notebook: its pieces of python run in Jupyter, and their output follows.

The file is the source. What it prints and draws is in the site only, and beside it the executed notebook. A cell that
fails or warns ends the building of the site.
"""

import base64
import re
import tempfile

PAGE = "tutorial.md"
NOTEBOOK = "tutorial.ipynb"


def cells(markdown) -> list:
    """[(kind, text)] of a page in its order: "markdown" or "code", the blocks of python."""
    parts = re.split(r"```python\n(.*?)```\n", markdown, flags=re.DOTALL)
    kinds = ("markdown", "code")
    return [(kinds[row % 2], part.strip("\n")) for row, part in enumerate(parts) if part.strip()]


def executed(markdown):
    """The notebook of a page after all its cells have run. Raises RuntimeError for one that writes to stderr."""
    import nbclient
    import nbformat.v4 as v4

    make = {"markdown": v4.new_markdown_cell, "code": v4.new_code_cell}
    parts = [("code", "%matplotlib inline"), *cells(markdown)]
    notebook = v4.new_notebook(cells=[make[kind](text) for kind, text in parts])
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    with tempfile.TemporaryDirectory() as folder:
        nbclient.NotebookClient(
            notebook, timeout=600, startup_timeout=300, resources={"metadata": {"path": folder}}
        ).execute()
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if output.get("name") == "stderr":
                raise RuntimeError(f"{PAGE}: a cell warns:\n{output.text}\n{cell.source}")
    return notebook


def page(notebook):
    """(markdown of the page with the output of its cells, {name of a picture: its bytes})."""
    text, pictures = f"[This page as a notebook]({NOTEBOOK})\n\n", {}
    for cell in notebook.cells[1:]:  # the first is of notebooks only
        text += f"```python\n{cell.source}\n```\n\n" if cell.cell_type == "code" else f"{cell.source}\n\n"
        for output in cell.get("outputs", []):
            image = output.get("data", {}).get("image/png")
            if image:
                name = f"tutorial-{len(pictures) + 1}.png"
                pictures[name] = base64.b64decode(image)
                text += f"![what the cell draws]({name})\n\n"
            elif output.output_type == "stream":
                text += f"```text\n{output.text}```\n\n"
    return text, pictures


def on_files(files, config):
    """Run the page, and put the notebook and its pictures among the files of the site."""
    import nbformat
    from mkdocs.structure.files import File

    source = files.get_file_from_path(PAGE)
    notebook = executed(source.content_string)
    text, pictures = page(notebook)
    files.remove(source)
    files.append(File.generated(config, PAGE, content=text))
    files.append(File.generated(config, NOTEBOOK, content=nbformat.writes(notebook)))
    for name, content in pictures.items():
        files.append(File.generated(config, name, content=content))
    return files
