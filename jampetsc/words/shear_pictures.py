"""Pictures of steady and quasistatic shear, of which packings jam, and of exponents."""

from jampetsc.words.picture import Picture, count, entering

PICTURES: dict[str, Picture] = {}
picture = entering(PICTURES)


@picture("flow", "flow")
def _flow(args, items):
    from jampetsc.plots.flowcurves import plot_flow_curves
    from jampetsc.plots.shearing import plot_series

    rates = {float(item.attributes["rate"]) for item in items}
    if len(rates) > 1:
        plot_flow_curves(items, args.out)
        return f"flow curves of {count(items, 'run', 'runs')} at {len(rates)} rates"
    plot_series(items, args.out)
    return f"stress and pressure of {count(items, 'run', 'runs')} over the strain"


@picture("strain", "shear")
def _strain(args, items):
    from jampetsc.plots.slowly import plot_slow_shear

    plot_slow_shear(items, args.out)
    return f"energy, stress, pressure and coordination of {count(items, 'run', 'runs')} over the strain"


@picture("phi", "flow")
def _phi(args, items):
    from jampetsc.plots.flowcurves import plot_against_phi

    plot_against_phi(items, args.out)
    return f"stress, pressure and coordination of {count(items, 'run', 'runs')} against phi"


@picture("snapshot", "flow")
def _snapshot(args, items):
    from jampetsc.plots.packing import plot_flowing
    from jampetsc.plots.shearing import kind_of, labels_of
    from jampetsc.storage.snapshots import snapshot

    titles = labels_of([kind_of(item) for item in items]) if len(items) > 1 else [""]
    panels, shown = [], []
    for title, item in zip(titles, items, strict=True):
        snapshot(item)  # there is one
        strain = item["snapshots/strain"]
        rows = (0, -1) if strain[0] == 0 else (-1,)  # the start, where it was kept, beside the end
        for row in rows:
            disks, at = snapshot(item, row), rf"$\gamma={strain[row]:.4g}$" if len(rows) > 1 else ""
            panels.append((", ".join(filter(None, (title, at))), disks))
            shown.append(f"{disks.n - disks.record.get('walls', 0)} disks at strain {strain[row]:.4g}")
    plot_flowing(panels, args.out)
    return f"contacts of {', '.join(shown)}"


@picture("regimes", "flow")
def _regimes(args, items):
    from jampetsc.plots.regimes import plot_regimes

    plot_regimes(items, args.out)
    return f"exponents and clusters of {count(items, 'run', 'runs')} against Q"


@picture("order", "flow")
def _order(args, items):
    from jampetsc.plots.order import plot_order

    plot_order(items, args.out)
    return f"six-fold order of {count(items, 'run', 'runs')} over the strain"


@picture("profile", "flow")
def _profile(args, items):
    from jampetsc.plots.profiles import plot_profiles

    plot_profiles(items, args.out)
    return f"velocity between walls of {count(items, 'run', 'runs')} in windows of strain"


@picture("minimum", "shear", single=True)
def _minimum(args, items):
    from jampetsc.plots.packing import plot_packing
    from jampetsc.plots.slowly import last_minimum

    disks = last_minimum(items[0])
    plot_packing(disks, args.out)
    return f"{disks.n} disks at strain {items[0]['strain'][-1]:.4g}"


@picture("velocities", "flow", single=True)
def _velocities(args, items):
    import numpy as np

    from jampetsc.plots.fields import plot_panels
    from jampetsc.storage.snapshots import snapshot

    (result,) = items
    disks = snapshot(result)
    field = result["snapshots/velocities"][-1] / float(result.attributes["rate"])
    strain = result["snapshots/strain"][-1]
    plot_panels(disks, [(rf"$\gamma={strain:.4g}$", field)], np.arange(disks.n), args.out, r"u/\dot\gamma")
    return f"non-affine velocities at strain {strain:.4g}"


@picture("lanes", "velocity-correlation", "flow")
def _lanes(args, items):
    from jampetsc.plots.shearing import plot_lanes

    plot_lanes(items, args.out)
    return f"g_y of {count(items, 'file', 'files')}"


@picture("fraction", "jam", "shear", mixed=True)
def _fraction(args, items):
    from jampetsc.plots.jamming import plot_fraction

    plot_fraction(items, args.out)
    return f"f(phi), the share of samples that jam, of {count(items, 'file', 'files')}"


@picture("pressures", "jam", "shear", mixed=True)
def _pressures(args, items):
    from jampetsc.plots.jamming import plot_pressures

    plot_pressures(items, args.out)
    return f"P(p) of the jammed samples of {count(items, 'file', 'files')}"


@picture("phi_J", "jam")
def _jamming_densities(args, items):
    from jampetsc.plots.jamming import plot_jamming_densities

    plot_jamming_densities(items, args.out)
    return f"distribution of phi_J of {count(items, 'file', 'files')}"


@picture("scaling", "collapse", single=True)
def _scaling(args, items):
    from jampetsc.plots.scaling import plot_scaling

    (result,) = items
    plot_scaling(result, args.out)
    return f"collapse of the {result.attributes['observable']} at {len(result['phi'])} points"


@picture("branches", "collapse", single=True)
def _branches(args, items):
    from jampetsc.plots.branches import plot_branches

    (result,) = items
    plot_branches(result, args.out)
    return f"two branches of the {result.attributes['observable']} at {len(result['phi'])} points"
