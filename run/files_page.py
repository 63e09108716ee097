"""The tables of docs/reference/files.md, from the declaration of the formats (`jampetsc.io.formats`).

`run/generate.py` writes them.
"""

import re

from jampetsc.io.formats import FORMATS
from jampetsc.io.provenance import PROVENANCE

HEADS = {False: "| attribute | type | unit | meaning |", True: "| dataset | shape | type | unit | meaning |"}
COMMON = "## Every result"
GROUPS = {  # of datasets that are one line each
    "state/": "what `jampetsc` needs to continue the run; not for analysis",
    "no_prestress/": "as the datasets without this prefix, of K without pre-stress",
}
_TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def table(declared, of_datasets: bool) -> str:
    """A table in Markdown of the rows of a `declaration.Table`."""
    head = HEADS[of_datasets]
    lines, groups = [head, "|---" * (head.count("|") - 1) + "|"], []
    for names, *cells in declared.lines:
        group = next((prefix for prefix in GROUPS if of_datasets and names.startswith(prefix)), None)
        if group:
            groups += [group] if group not in groups else []
            continue
        cells[of_datasets] = cells[of_datasets].replace("?", ", optional")
        lines.append(f"| {', '.join(f'`{name}`' for name in names.split(', '))} | {' | '.join(cells)} |")
    lines += [f"| `{group}*` | | | | {GROUPS[group]} |" for group in groups]
    return re.sub(r" +\|", " |", "\n".join(lines)) + "\n"


def page(text: str) -> str:
    """The page with its tables as the formats are declared. Raises ValueError where a section lacks a table."""
    sections = re.split(r"(?m)^(?=## )", text)
    for number, section in enumerate(sections):
        title = section.partition("\n")[0]
        kind = re.search(r"`(jampetsc-[\w-]+)`", title)
        if title == COMMON:
            new_tables = [table(PROVENANCE, False)]
        elif kind:
            format = FORMATS[kind[1]]
            new_tables = [table(format.datasets, True), table(format.attributes, False)]
        else:
            continue
        tables = list(_TABLE.finditer(section))[: len(new_tables)]
        if len(tables) < len(new_tables):
            raise ValueError(f"{title}: {len(tables)} tables, must be {len(new_tables)}")
        for old, new in reversed(list(zip(tables, new_tables, strict=True))):
            section = section[: old.start()] + new + section[old.end() :]
        sections[number] = section
    return "".join(sections)
