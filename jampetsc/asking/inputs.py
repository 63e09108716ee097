"""What jobs refuse of several inputs together: the same one twice."""

import os
from pathlib import Path

from jampetsc.errors import InputError


def refuse_repeated(sources) -> None:
    """Raise InputError where two sources are one file, also through links, or one object: it would count twice."""
    seen = {}
    for source in sources:
        one = os.path.realpath(source) if isinstance(source, str | Path) else id(source)
        told = getattr(source, "path", source)
        if one in seen:
            again = f"is {seen[one]}, which" if str(told) != str(seen[one]) else "this file"
            raise InputError(f"{told}: {again} is given already: name each file once")
        seen[one] = told


def refuse_one_packing(results) -> None:
    """Raise InputError where two results come from one packing, by its sha256: it would count twice.

    results: `io.results.Result`, each with `path` and `attributes`.
    """
    seen = {}
    for result in results:
        sha256 = result.attributes.get("packing_sha256")
        if sha256 in seen:
            raise InputError(
                f"{result.path}: comes from the same packing as {seen[sha256].path.name} "
                f"(sha256 {sha256[:12]}…): an average takes each packing once"
            )
        if sha256 is not None:
            seen[sha256] = result
