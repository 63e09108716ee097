"""Pictures that only one figure of the papers needs; -m papers.draw chooses them by name.

A module has functions under `@drawn(NAME)`, which draw on a `jampetsc.plots.page.Page` from the folder of a figure.
"""
