"""Where a legend covers no data, and its entries beside the entries of an earlier picture on the same axes."""

from matplotlib.colors import to_rgba_array
from matplotlib.path import Path

_CORNERS = (
    "lower right", "upper left", "center right", "lower left", "upper right", "upper center", "lower center"
)  # fmt: skip


def with_earlier(ax, settings) -> dict:
    """Entries and title of a legend, after the entries of an earlier picture on the same axes."""
    earlier = ax.get_legend()
    if earlier is None:
        return {}
    handles, labels = settings["handles"], settings["labels"]
    own = [(label, _colour(handle)) for handle, label in zip(handles, labels, strict=True)]
    # matplotlib renamed them in version 3.7
    handles_before = earlier.legend_handles if hasattr(earlier, "legend_handles") else earlier.legendHandles
    texts = (text.get_text() for text in earlier.get_texts())
    earlier_entries = [
        pair for pair in zip(handles_before, texts, strict=True) if (pair[1], _colour(pair[0])) not in own
    ]
    title = settings["title"] or earlier.get_title().get_text() or None
    before = {
        "handles": [handle for handle, _ in earlier_entries] + handles,
        "labels": [text for _, text in earlier_entries] + labels,
    }
    return before | {"title": title}


def _colour(handle):
    """The colour of an entry of a legend, (r, g, b, a), of its line or its face; bars are a container."""
    artist = handle[0] if isinstance(handle, tuple) else handle
    shades = to_rgba_array(artist.get_color() if hasattr(artist, "get_color") else artist.get_facecolor())
    return tuple(shades[0]) if len(shades) else ()


def clear_corner(ax, first, settings) -> str | None:
    """The corner in which a legend with these settings lies on no line, bar or text of `ax`; None where all do."""
    outlines, texts = _outlines(ax), [text.get_window_extent() for text in ax.texts]
    for corner in dict.fromkeys((first, *_CORNERS)):
        box = ax.legend(loc=corner, **settings).get_window_extent().padded(2.0 * ax.figure.dpi / 72)
        if not any(_covers(box, *outline) for outline in outlines) and not any(map(box.overlaps, texts)):
            return corner
    return None


def _outlines(ax):
    """[(path in pixels, whether its corners are joined by a line)] of all lines and error bars of `ax`."""
    outlines = []
    for line in ax.get_lines():
        path = line.get_transform().transform_path(line.get_path()).cleaned(remove_nans=True)
        path = Path(path.vertices[:-1], path.codes[:-1])  # without what says that it ends
        if len(path):
            outlines.append((path, line.get_linestyle() not in ("None", "", " ")))
    for bars in (bar for container in ax.containers for bar in container.lines[2]):
        outlines += [(bars.get_transform().transform_path(path), True) for path in bars.get_paths()]
    return outlines


def _covers(box, path, joined):
    return box.count_contains(path.vertices) or (joined and path.intersects_bbox(box, filled=False))
