"""Where things lie on a picture: panels, captions, colour bars and notes neither cover each other nor leave it."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from drawn import figure_of, require_inside
from samples import published

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.state import measure
from jampetsc.plots import fields, packing
from jampetsc.plots.periodic import extent, frame_cell
from jampetsc.plots.style import COLUMN, PAGE, figure

CELLS = {
    "square": (4.0, 0.0, 4.0),
    "tilted": (4.0, 1.5, 3.0),
    "tall": (1.0, 0.0, 4.0),
    "flat": (6.0, -1.0, 1.5),
}
TALLEST = 2.5  # heights in widths


def cell_of(name):
    width, shift, height = CELLS[name]
    return np.array([[width, 0.0], [shift, height]])


def inches(box, page):
    left, bottom, width, height = np.multiply(box, (page.width, page.height) * 2)
    return left, bottom, left + width, bottom + height


def apart(one, other):
    """How far two boxes (x0, y0, x1, y1) are from each other, negative where they overlap."""
    return max(max(one[0], other[0]) - min(one[2], other[2]), max(one[1], other[1]) - min(one[3], other[3]))


def check_panels(boxes, page, cell):
    """Panels of one size and of the shape of the cell, beside or above each other, with room for words below."""
    sizes = np.array([(x1 - x0, y1 - y0) for x0, y0, x1, y1 in boxes])
    np.testing.assert_allclose(sizes, np.broadcast_to(page.panel, sizes.shape))
    width, height = extent(cell)
    assert page.panel[1] / page.panel[0] == pytest.approx(min(height / width, TALLEST))
    for one, other in combinations(boxes, 2):
        assert apart(one, other) >= 0.06 - 1e-9
    for x0, y0, x1, y1 in boxes:
        assert x0 >= 0.06 - 1e-9 and x1 <= page.width - 0.06 + 1e-9
        assert y0 >= 0.2 - 1e-9 and y1 <= page.height - 0.2 + 1e-9  # words below, a title above
        below = [other[3] for other in boxes if other[3] <= y0 and other[0] == x0]
        assert not below or y0 - max(below) >= 0.26 - 1e-9


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("coloured", [False, True])
def test_panels_of_fields_at_several_frequencies(name, count, coloured):
    """Frequencies go to the right; Re is left of Im for one of them, above it for several; the bar is at the right."""
    cell = cell_of(name)
    page, noted = (fields._Page(cell, count, coloured, note) for note in (False, True))
    boxes = {(f, part): inches(page.box(f, part), page) for f in range(count) for part in (0, 1)}
    check_panels(list(boxes.values()), page, cell)
    assert page.width == (COLUMN if count <= 2 else PAGE)
    assert noted.height == pytest.approx(page.height + 0.2) and noted.panel == page.panel
    for f in range(count):
        re, im = boxes[f, 0], boxes[f, 1]
        assert (re[0] < im[0] and re[1] == im[1]) if count == 1 else (re[1] > im[3] and re[0] == im[0])
        if f:
            np.testing.assert_allclose(boxes[f, 0][0] - boxes[f - 1, 0][2], 0.06)
    top = max(box[3] for box in boxes.values())
    assert page.height - top == pytest.approx(0.2)
    assert min(box[1] for box in boxes.values()) == pytest.approx(0.2)  # nothing but the words below
    assert min(box[0] for box in boxes.values()) == pytest.approx(0.06 + 0.18 * (count > 1))  # names of rows
    assert page.width - max(box[2] for box in boxes.values()) == pytest.approx(0.06 + 0.42 * coloured)
    if coloured:
        x0, y0, x1, y1 = bar = inches(page.bar_box, page)
        assert all(apart(bar, box) > 0.1 for box in boxes.values()) and page.width - x1 > 0.2
        assert x1 - x0 == pytest.approx(0.08) and y1 - y0 == pytest.approx(min(1.4, page.panel[1]))
        bottom = min(box[1] for box in boxes.values())
        assert 0.5 * (y0 + y1) == pytest.approx(0.5 * (top + bottom) - 0.08)  # its title is above it


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_panels_in_a_row(name, count):
    cell = cell_of(name)
    page, noted = (fields._Row(cell, count, note) for note in (False, True))
    boxes = [inches(page.box(column), page) for column in range(count)]
    check_panels(boxes, page, cell)
    assert page.width == (COLUMN if count <= 2 else PAGE) and page.height == pytest.approx(
        page.panel[1] + 0.4
    )
    assert noted.height == pytest.approx(page.height + 0.2)
    assert inches(noted.box(0), noted)[1] == pytest.approx(0.4)
    edges = [0.0, *(x for box in boxes for x in (box[0], box[2])), page.width]
    np.testing.assert_allclose(np.diff(edges)[::2], 0.06)


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize(
    "page", [lambda c: fields._Row(c, 3, False), lambda c: fields._Page(c, 2, True, True)]
)
def test_lengths_on_paper_are_those_that_widths_of_lines_follow(name, page):
    """Points per length as the axes have it, but for the margin around the cell."""
    cell = cell_of(name)
    page = page(cell)
    with figure(page.width, page.height) as fig:
        ax = fig.add_axes(page.box(0, 0) if isinstance(page, fields._Page) else page.box(0))
        frame_cell(ax, cell)
        ax.apply_aspect()
        (x0, y0), (x1, y1) = ax.transData.transform([(0, 0), (1, 1)]) * 72 / fig.dpi
    assert x1 - x0 == pytest.approx(page.points_per_length / 1.02, rel=1e-6) and y1 - y0 == pytest.approx(
        x1 - x0
    )


@pytest.mark.parametrize("name", CELLS)
def test_a_frame_shows_the_whole_cell_and_little_else(name):
    cell = cell_of(name)
    with figure(3, 3) as fig:
        ax = fig.add_axes((0, 0, 1, 1))
        outline = frame_cell(ax, cell, linewidth=0.4)
        corners = outline.get_xy()[:4]
        np.testing.assert_allclose(corners, [(0, 0), cell[0], cell[0] + cell[1], cell[1]])
        low, high = corners.min(axis=0), corners.max(axis=0)
        np.testing.assert_allclose(
            np.transpose([ax.get_xlim(), ax.get_ylim()]),
            [low - 0.01 * (high - low), high + 0.01 * (high - low)],
        )
        np.testing.assert_allclose(extent(cell), high - low)
        assert ax.get_aspect() == 1.0 and not ax.axison and outline.get_linewidth() == 0.4


def test_a_note_is_there_where_not_every_disk_has_an_arrow(monkeypatch):
    disks = published()
    u = np.random.default_rng(1).normal(size=(1, 16, 2)) + 0j
    arguments = (disks, [("", u[0].real)], np.arange(16))
    plain = [
        figure_of(fields.plot_panels, *arguments, symbol="u"),
        figure_of(fields.plot_fields, disks, np.ones(1), u, None, np.arange(16)),
    ]
    monkeypatch.setattr(fields, "ARROWS", 16)  # as many as there are disks: each has its arrow
    same = (
        figure_of(fields.plot_panels, *arguments, symbol="u"),
        figure_of(fields.plot_fields, disks, np.ones(1), u, None, np.arange(16)),
    )
    for before, after in zip(plain, same, strict=True):
        assert after.get_figheight() == before.get_figheight() and not after.texts
        assert not after.axes[0].collections[0].get_rasterized()
    monkeypatch.setattr(fields, "ARROWS", 9)
    some = [
        figure_of(fields.plot_panels, *arguments, symbol="u"),
        figure_of(fields.plot_fields, disks, np.ones(1), u, None, np.arange(16)),
    ]
    for before, after in zip(plain, some, strict=True):
        assert not before.texts and after.get_figheight() == pytest.approx(before.get_figheight() + 0.2)
        (note,) = after.texts
        count = int(note.get_text().split()[2])
        assert note.get_text() == f"arrows on {count} of 16 disks" and 4 <= count <= 9
        arrows = after.axes[0].collections[1]
        assert after.axes[0].collections[0].get_rasterized()
        assert len(np.unique(np.round(np.hypot(arrows.U, arrows.V), 9))) == count
        box = after.axes[0].get_position()
        assert note.get_position()[1] * after.get_figheight() < box.y0 * after.get_figheight() - 0.2


@pytest.mark.parametrize("count", [1, 3])
def test_the_bar_of_rotations_stands_in_its_place(count):
    """With ticks at the ends of its colours and in their middle."""
    disks, omega = published(), np.geomspace(0.1, 1.0, count)
    u, spin = np.ones((count, 16, 2)) + 1j, np.ones((count, 16)) + 0.5j
    fig = figure_of(fields.plot_fields, disks, omega, u, spin, np.arange(16))
    require_inside(fig)
    *_, bar = fig.axes
    assert len(fig.axes) == 2 * count + 1 and bar.get_title() == r"$\theta/\theta_{\rm rms}$"
    np.testing.assert_allclose(
        bar.get_position().bounds, fields._Page(disks.cell, count, True, False).bar_box
    )
    assert bar.get_yticks().tolist() == [-2.0, 0.0, 2.0] and bar.get_ylim() == (-2.0, 2.0)


@pytest.mark.parametrize("spin", [None, np.zeros(15), np.linspace(-3.0, 3.0, 15)])
def test_disks_are_coloured_by_how_far_they_turn(spin):
    """Up to twice the rms to either side; disks that have no rotation are white, as all are where there is none."""
    disks, particles = published(), np.arange(1, 16)
    with figure(3, 3) as fig:
        ax = fig.add_axes((0, 0, 1, 1))
        picture = fields._Picture(disks, particles, 30.0)
        words = picture.draw(ax, np.zeros((15, 2)), spin)
        faces = ax.collections[0].get_facecolors()
    rows = picture.images[0]
    assert words.startswith(r"$\tilde u/\gamma=0$") and (r"\theta_{\rm rms}" in words) == (spin is not None)
    assert (faces[rows == 0] == 1.0).all() and len(ax.collections) == 1
    if spin is None:
        assert (faces == 1.0).all()
    else:
        rms = np.sqrt(np.mean(spin**2)) or 1.0
        for row, turn in zip(particles, spin, strict=True):
            expected = fields._colours()(0.5 + turn / (4 * rms))
            here = faces[rows == row]
            np.testing.assert_allclose(here, np.tile(expected, (len(here), 1)))


@pytest.mark.parametrize(
    ("length", "spacing", "factor"),
    [
        (1.0, 1.0, 1.5),
        (1.6, 1.0, 1.0),
        (1.61, 1.0, 0.7),
        (0.32, 1.0, 5.0),
        (0.016, 1.0, 100.0),
        (1.0, 0.5, 0.7),
    ],
)
def test_arrows_are_a_round_number_of_times_the_field(length, spacing, factor):
    """The largest for which long ones, nine of ten being shorter, reach 1.6 distances of arrows."""
    u = np.zeros((101, 2))
    u[:, 0] = length * np.minimum(np.linspace(0.1, 1.1, 101), 1.0)
    u[-5:, 1] = 50.0 * length  # a few that are longer do not matter
    assert fields._factor(u, spacing) == pytest.approx(factor)
    assert fields._factor(0 * u, spacing) == 0.0


@pytest.mark.parametrize("count", [1, 2, 4])
def test_packings_stand_side_by_side_with_their_captions_below(count):
    disks = published()
    panels = [(f"title {n}" if count > 1 else "", disks) for n in range(count)]
    fig = figure_of(packing.plot_flowing, panels)
    wide, tall = fig.get_size_inches()
    assert wide == pytest.approx(count * COLUMN) and len(fig.axes) == count
    width, height = extent(disks.cell)
    assert tall == pytest.approx(COLUMN * height / width + 0.38 + 0.22 * (count > 1))
    boxes = [np.multiply(ax.get_position(original=True).extents, (wide, tall) * 2) for ax in fig.axes]
    for n, (x0, y0, x1, y1) in enumerate(boxes):
        assert (x0 + x1) / 2 == pytest.approx((n + 0.5) * COLUMN) and x1 - x0 == pytest.approx(0.98 * COLUMN)
        assert y0 == pytest.approx(0.38) and y1 == pytest.approx(tall - 0.22 * (count > 1))
    captions, titles = (
        [text for text in fig.texts if text.get_text().startswith(word)] for word in ("$N", "title")
    )
    for n, caption in enumerate(captions):
        assert caption.get_position() == pytest.approx(((n + 0.5) / count, 0.19 / tall))
    assert [title.get_text() for title in titles] == [title for title, _ in panels if title]
    for n, title in enumerate(titles):
        assert title.get_position() == pytest.approx(((n + 0.5) / count, 1 - 0.11 / tall))


def test_a_packing_of_many_disks_takes_the_page_and_is_drawn_as_pixels(monkeypatch):
    disks = published()
    for many, width in ((16, COLUMN), (15, PAGE)):
        monkeypatch.setattr(packing, "MANY", many)
        fig = figure_of(packing.plot_packing, disks)
        assert fig.get_figwidth() == width
        assert [one.get_rasterized() for one in fig.axes[0].collections] == [width == PAGE] * 2
        assert fig.axes[0].collections[0].get_linewidth()[0] == (0.3 if width == COLUMN else 0.1)
    assert figure_of(packing.plot_flowing, [("", disks)] * 2).get_figwidth() == 2 * COLUMN


def test_a_high_cell_is_shrunk_to_two_and_a_half_widths():
    disks = Disks.from_positions(np.array([[0.5, 0.5], [0.5, 3.5]]), np.full(2, 0.3), np.diag([1.0, 4.0]))
    fig = figure_of(packing.plot_packing, disks)
    assert fig.get_figheight() == pytest.approx(2.5 * COLUMN + 0.38)


@pytest.mark.parametrize(("unit", "wide"), [(1.0, 1.0), (100.0, 1.0), (1.0, 6.0)])
def test_the_line_of_a_mean_force_is_a_fixed_part_of_a_disk(unit, wide):
    """0.09 mean diameters as they are on paper, two points at most; twice the force is twice as wide."""
    disks = published()
    disks = Disks.from_positions(unit * disks.positions, unit * disks.radii, unit * wide * disks.cell)
    fig = figure_of(packing.plot_flowing, [("", disks)])
    ax = fig.axes[0]
    ax.apply_aspect()
    (a, _), (b, _) = ax.transData.transform([(0, 0), (2 * disks.radii.mean(), 0)]) * 72 / fig.dpi
    contacts = packing.touching(disks)[0]
    lines = ax.collections[1]
    drawn = np.array([end - begin for begin, end in lines.get_segments()])
    for vector, width in zip(drawn, lines.get_linewidths(), strict=True):
        row = np.linalg.norm(contacts.r - vector, axis=1).argmin()
        expected = min(2.0, 0.09 * (b - a) * 1.02) * contacts.force[row] / contacts.force.mean()
        assert width == pytest.approx(expected, rel=1e-3)


def test_rattlers_are_hollow_walls_dark_and_both_are_told():
    disks = published()
    radii = disks.radii * np.where(np.arange(16) == 5, 0.5, 1.0)
    disks = Disks.from_positions(disks.positions, radii, disks.cell)
    state = measure(disks)
    assert state.rattlers.sum() == 3
    figures = [figure_of(packing.plot_packing, disks)]
    loose = replace(disks, record={"walls": 3})
    figures.append(figure_of(packing.plot_flowing, [("", loose)]))
    for fig, hollow, walls in zip(figures, (state.rattlers, packing.touching(loose)[2]), (0, 3), strict=True):
        rows, _ = packing.disk_images(packing.wrap(disks.positions, disks.cell), disks.radii, disks.cell)
        faces = fig.axes[0].collections[0].get_facecolors()
        for row, face in zip(rows, faces, strict=True):
            assert face[0] == (0.45 if row < walls else 1.0 if hollow[row] else 0.88)
        said = fig.texts[0].get_text()
        assert ("dark: walls" in said) == bool(walls) and f"$N={disks.n - walls}$" in said
        assert ("hollow: " in said) == hollow.any()
    said = figures[0].texts[0].get_text()
    rattlers = np.count_nonzero(state.rattlers)
    assert (
        f"hollow: {rattlers} rattler{'s' * (rattlers > 1)}" in said
        and f"$Z={state.coordination:.3f}$" in said
    )


def test_alone_are_disks_without_contact_that_are_no_wall():
    disks = published()
    spread = Disks.from_positions(disks.positions, 0.5 * disks.radii, disks.cell, record={"walls": 4})
    contacts, number, alone = packing.touching(spread)
    assert not len(contacts) and not number.any() and alone.tolist() == [False] * 4 + [True] * 12
    fig = figure_of(packing.plot_flowing, [("", spread)])
    assert "no load-bearing contacts;  hollow: 12 without contact;  dark: walls" in fig.texts[0].get_text()
    assert len(fig.axes[0].collections) == 1


@pytest.mark.parametrize("arrows", [16, 6])
def test_arrows_begin_at_their_disks(monkeypatch, arrows):
    """Of the particles that have a field, all or those that are chosen; images start a cell further."""
    monkeypatch.setattr(fields, "ARROWS", arrows)
    disks, particles = published(), np.array([2, 3, 5, 7, 8, 9, 11, 13, 15])
    u = np.random.default_rng(2).normal(size=(9, 2))
    ax = figure_of(fields.plot_panels, disks, [("", u)], particles, symbol="u").axes[0]
    drawn = ax.collections[1]
    vectors, starts = np.column_stack((drawn.U, drawn.V)), np.column_stack((drawn.X, drawn.Y))
    centres = packing.wrap(disks.positions, disks.cell)
    chosen = set()
    for start, vector in zip(starts, vectors, strict=True):
        directions = u @ vector / np.linalg.norm(u, axis=1) / np.linalg.norm(vector)
        row = int(np.argmax(directions))
        assert directions[row] == pytest.approx(1.0)
        images = (start - centres[particles[row]]) @ np.linalg.inv(disks.cell)
        np.testing.assert_allclose(images, np.round(images), atol=1e-9)
        chosen.add(row)
    assert len(chosen) == 9 if arrows == 16 else 3 <= len(chosen) <= 6


def test_a_panel_is_large_enough_for_its_arrows():
    """An inch and more where most fields stand side by side; arrows of many disks a few points apart."""
    row = fields._Row(np.eye(2), fields.COLUMNS, False)
    page = fields._Page(np.eye(2), fields.COLUMNS, True, False)
    assert min(row.panel[0], page.panel[0]) > 1.0
    single = fields._Row(np.eye(2), 1, True)
    rng = np.random.default_rng(1)
    picture = fields._Picture(
        Disks.from_positions(rng.random((30_000, 2)) * 150, np.full(30_000, 0.4), 150 * np.eye(2)),
        np.arange(30_000), 72 * single.panel[0] / 150,
    )  # fmt: skip
    assert 3.0 < picture.spacing * picture.points < 7.0
    assert picture.note == f"arrows on {len(picture.arrows)} of 30000 disks"
