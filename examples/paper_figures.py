"""Draw this project's own versions of all figures of Lowther and Mai, and measure what their text claims.

python examples/paper_figures.py [--out DIR] [--quick]

Every `figure_...` returns a picture and the numbers that it shows. Lengths are in mesh units throughout.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from paper_meshes import (
    DENSITY,
    ENOUGH,
    FULL,
    ONLY_OVERLAPS,
    PEAK,
    QUADRILATERAL,
    QUICK,
    RATE,
    area,
    circle_inside,
    converged,
    cost,
    density_near,
    find_jump,
    l_shape,
    mean_distance,
    node_at,
    node_density,
    nodes_on_sides,
    on_segment,
    overturned,
    peak,
    quadrilateral,
    rings,
    searched,
    slope,
    study_epochs,
    study_points,
    study_rates,
    training_points,
    two_regions,
    unchecked,
)

import kohonen_adapt as ka
from kohonen_adapt.plotting import draw_mesh

BLUE, ORANGE, GREEN, VERMILION, SKY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#56b4e9"  # Okabe and Ito's


def figure_1_neighbourhoods(effort):
    """The neurons within R rings of a winner, on a start mesh made by a mapping."""
    mesh = quadrilateral(14, 9)
    winner, _ = node_at(mesh, (2.0, 1.15))
    figure, panels = page(1, 3, 13, 3.6)
    members = []
    for radius, axes in enumerate(panels):
        draw_mesh(axes, mesh, unit="")
        found = rings(mesh, winner, radius)
        for ring, colour, label in zip(found, (VERMILION, BLUE, ORANGE), ("winner", "ring 1", "ring 2"), strict=False):
            axes.plot(*mesh.p[:, ring], "o", color=colour, ms=6, zorder=3, label=label)
        members.append(sum(map(len, found)))
        axes.set_title(f"R = {radius}: {members[-1]} neurons learn" if radius else "R = 0: the winner learns")
    figure.legend(*panels[2].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure, {"members": members}


def figure_2_density(effort):
    """The wanted density and a training set drawn from it, two points per neuron."""
    start, points, _, _ = converged(effort)
    fine = quadrilateral(90, 60)
    figure, panels = page(1, 2, 12, 3.8)
    shades = panels[0].tripcolor(*fine.p, fine.t.T, DENSITY(fine.p), shading="gouraud", cmap="viridis")
    figure.colorbar(shades, ax=panels[0], label="density / density far from the peak")
    panels[0].set_title("Density of training points")
    panels[1].plot(*points, ".", color=BLUE, ms=2)
    panels[1].set_title(f"Training set: {points.shape[1]} points for {start.p.shape[1]} neurons")
    for axes in panels:
        draw_sides(axes)
    inside = np.mean(np.hypot(*(points.T - PEAK).T) < 1.0)
    return figure, {"points": points.shape[1], "neurons": start.p.shape[1], "share_within_two_widths": float(inside)}


def figure_3_corner_jump(effort):
    """One training point that makes the neurons change their places at a corner."""
    before, after, point, corner = find_jump(quadrilateral(6, 4))
    n3, n2 = node_at(before, corner)[0], node_at(after, corner)[0]
    near = np.unique(np.concatenate(rings(before, n3, 2)))
    figure, panels = page(1, 2, 11, 4.6)
    for axes, mesh, title in zip(panels, (before, after), ("a) before", "b) after the update"), strict=True):
        draw_mesh(axes, mesh, unit="")
        label_outline(axes, mesh, before, (n2, n3), corner)
        axes.plot(*point, "x", color=VERMILION, ms=10, mew=2.5, zorder=5)
        note(axes, point, "$T_p$", (7, 7))
        shown = np.column_stack([point, before.p[:, near]])
        zoom(axes, shown.min(axis=1) - 0.4, shown.max(axis=1) + 0.4)
        axes.set_title(title)
    panels[1].annotate("", after.p[:, n3], corner, arrowprops={"arrowstyle": "->", "color": VERMILION, "lw": 2})
    facts = {
        "nodes_on_sides": [nodes_on_sides(mesh) for mesh in (before, after)],
        "corner_distance": node_at(after, corner)[1],
        "changed": n2 != n3,
        "overturned": int(overturned(after, before).sum()),
    }
    return figure, facts


def label_outline(axes, mesh, before, pair, corner):
    """Mark the two sides at a corner, and n1 to n4 along them as they were numbered before."""
    n2, n3 = pair
    number = int(np.flatnonzero((corner == QUADRILATERAL.T).all(axis=1))[0])
    for other, colour in zip((number - 1, (number + 1) % 4), (BLUE, ORANGE), strict=True):
        end = QUADRILATERAL[:, other]
        axes.plot(*np.stack([corner, end], axis=1), color=colour, lw=3, alpha=0.6)
        side = sorted(on_segment(before, corner, end), key=lambda v: np.hypot(*(before.p[:, v] - corner)))
        names = {side[1]: "$n_2$", side[2]: "$n_1$"} if side[1] == n2 else {side[1]: "$n_4$"}
        for node, name in {**names, n3: "$n_3$"}.items():
            axes.plot(*mesh.p[:, node], "o", color="black", ms=6, zorder=4)
            outward = mesh.p[:, node] - QUADRILATERAL.mean(axis=1)
            note(axes, mesh.p[:, node], name, 22 * outward / np.hypot(*outward) - 6)


def figure_4_search(effort):
    """A search that the walk ends at a neuron that only the check of the circle can better."""
    mesh, found = searched(effort)
    edges = set(map(tuple, mesh.facets.T.tolist()))
    bettered = [(x, path) for x, path in found if len(path) > 1 and tuple(sorted(path[-2:].tolist())) not in edges]
    whole = [(x, path) for x, path in bettered if circle_inside(mesh, x, mesh.p[:, path[-2]])]
    x, path = min(whole, key=lambda pair: abs(len(pair[1]) - 10))
    figure, panels = page(1, 2, 13, 4.8)
    radius = np.hypot(*(mesh.p[:, path[-2]] - x))
    for axes in panels:
        draw_mesh(axes, mesh, unit="")
        draw_path(axes, mesh, x, path)
        axes.add_patch(Circle(x, radius, fill=False, color=GREEN, lw=2, label="circle that is checked"))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    panels[0].set_title(f"Search from a random neuron: {len(path) - 1} steps")
    zoom(panels[1], x - 2.2 * radius, x + 2.2 * radius)
    panels[1].set_title("The circle around $T_p$ through the walk's last neuron")
    return figure, {"steps": len(path) - 1, "bettered": len(bettered) / len(found)}


def draw_path(axes, mesh, x, path):
    """The visited neurons numbered, the start as a square, the jump of the circle check dashed."""
    way = mesh.p[:, path]
    axes.plot(*way[:, :-1], "-", color=BLUE, lw=2, label="walk")
    axes.plot(*way[:, -2:], "--", color=GREEN, lw=2)
    for number, at in enumerate(way[:, 1:-1].T, 1):
        axes.text(*at, number, color="white", fontsize=7, ha="center", va="center", zorder=6, clip_on=True,
                  bbox={"boxstyle": "circle,pad=0.15", "fc": BLUE, "ec": "none"})  # fmt: skip
    axes.plot(*way[:, 0], "s", color=ORANGE, ms=9, label="start", zorder=3)
    axes.plot(*way[:, -1], "o", color=GREEN, ms=9, label="winner $N_c$", zorder=4)
    axes.plot(*x, "x", color=VERMILION, ms=9, mew=2.5, label="training point $T_p$", zorder=5)


def figure_5_converged(effort):
    """The start mesh, the mesh when the stopping criterion is reached, and the error on the way."""
    start, points, end, errors = converged(effort)
    figure, panels = page(1, 3, 16, 3.8)
    draw_mesh(panels[0], start, unit="")
    panels[0].set_title(f"Start mesh, {start.p.shape[1]} neurons")
    draw_mesh(panels[1], end, unit="")
    panels[1].set_title(f"Stopped after {len(errors)} epochs")
    first = mean_distance(start, points)
    draw_errors(panels[2], np.array(errors) / first, effort.epochs)
    logs = np.log(node_density(end)), np.log(DENSITY(end.p))
    facts = {
        "epochs": len(errors),
        "most_epochs": sum(effort.epochs),
        "error": mean_distance(end, points) / first,
        "overturned": int(overturned(end, start).sum()),
        "min_quality": float(ka.quality(end).min()),
        "mean_quality": float(ka.quality(end).mean()),
        "correlation": float(np.corrcoef(logs)[0, 1]),
        "nodes_on_sides": [nodes_on_sides(mesh) for mesh in (start, end)],
    }
    return figure, facts


def draw_errors(axes, errors, epochs):
    """The error of every epoch, over bands of the radii."""
    axes.plot(np.arange(1, len(errors) + 1), errors, color=BLUE, zorder=3)
    axes.axhline(ENOUGH, color=VERMILION, ls="--", label="stopping criterion")
    draw_bands(axes, epochs, len(errors))
    axes.set(xlabel="epoch", ylabel="$e / e_0$ while learning", ylim=(0, None), title="Sum of minimum distances")


def draw_bands(axes, epochs, last_epoch):
    """A shade for the epochs of each radius."""
    ends = np.minimum(np.cumsum((0, *epochs)), last_epoch)
    for radius, first, last, colour in zip((2, 1, 0), ends, ends[1:], (ORANGE, SKY, GREEN), strict=False):
        if last > first:
            axes.axvspan(first + 0.5, last + 0.5, color=colour, alpha=0.2, lw=0, label=f"R = {radius}")
    axes.set_xlim(0.5, last_epoch + 0.5)
    axes.legend()
    axes.grid(color="0.9")


def figure_6_epochs(effort):
    """The paper's study of parameters: epochs at R = 2 and R = 1, points per neuron, learning rate."""
    mesh = quadrilateral(effort.study_columns, 2 * effort.study_columns // 3)
    figure, panels = page(1, 3, 17, 4.8)
    ratio = study_epochs(mesh, effort)
    draw_ratio(figure, panels[0], ratio, effort.study_epochs)
    own, held_out = study_points(mesh, effort)
    draw_study(panels[1], effort.points_per_neuron, own, held_out, "training points per neuron")
    panels[1].axvline(2, color="0.6", ls=":", label="the paper's choice")
    rate_own, rate_held_out = study_rates(mesh, effort)
    draw_study(panels[2], effort.rates, rate_own, rate_held_out, f"first learning rate (last: {RATE[1]})")
    panels[1].legend(loc="lower right")
    panels[2].legend(loc="lower right")
    facts = {
        "ratio": ratio.tolist(),
        "by_radius_1": float(np.mean(ratio[:, 0] - ratio[:, -1])),
        "by_radius_2": float(np.mean(ratio[0] - ratio[-1])),
        "points": {"own": own, "held_out": held_out},
        "rates": {"own": rate_own, "held_out": rate_held_out},
    }
    return figure, facts


def draw_ratio(figure, axes, ratio, counts):
    """e / e0 as colours with their numbers; R = 2 is the abscissa, as in the paper."""
    colours = axes.imshow(ratio.T, origin="lower", cmap="viridis", aspect="auto")
    middle = 0.5 * (ratio.min() + ratio.max())
    for (two, one), value in np.ndenumerate(ratio):
        axes.text(two, one, f"{value:.2f}", ha="center", va="center", color="black" if value > middle else "white")
    ticks = range(len(counts))
    axes.set(xticks=ticks, xticklabels=counts, yticks=ticks, yticklabels=counts)
    axes.set(xlabel="epochs at R = 2", ylabel="epochs at R = 1", title="$e / e_0$ before any epoch at R = 0")
    figure.colorbar(colours, ax=axes, label="$e / e_0$")


def draw_study(axes, values, own, held_out, label):
    """Two curves of e / e0 over a parameter."""
    axes.semilogx(values, own, "o-", color=BLUE, label="points of the training set")
    axes.semilogx(values, held_out, "s--", color=VERMILION, label="points that were not shown")
    axes.set_xticks(values, [f"{value:g}" for value in values])
    axes.minorticks_off()
    axes.set(xlabel=label, ylabel="$e / e_0$", title="R = 2, 1, 0 for 3, 20, 10 epochs", ylim=(0, None))
    axes.grid(color="0.9")


def figure_7_overlapping(effort):
    """The same training without the check of the topology: overlaps come at R = 2 and 0; those of R = 0 stay."""
    start, end, counts = unchecked(effort)
    bad = overturned(end, start)
    figure, panels = page(1, 3, 18, 4.0)
    for axes in panels[:2]:
        draw_mesh(axes, end, unit="")
        fill_elements(axes, end, np.flatnonzero(bad), VERMILION)
    panels[0].plot(*end.p[:, end.t[:, bad]].mean(axis=1), "o", color=VERMILION, ms=9, fillstyle="none")
    panels[0].set_title(f"{bad.sum()} of {len(bad)} elements overturned after {len(counts)} epochs")
    largest = end.p[:, end.t[:, np.argmax(np.where(bad, area(end), 0))]]
    middle, reach = largest.mean(axis=1), 0.4 * np.ptp(largest, axis=1).max() + 0.15
    zoom(panels[1], middle - reach * np.array([1.5, 1]), middle + reach * np.array([1.5, 1]))
    panels[1].set_title("The largest of them from near by")
    panels[2].plot(np.arange(1, len(counts) + 1), counts, color=VERMILION, zorder=3)
    draw_bands(panels[2], effort.epochs, len(counts))
    panels[2].set(
        xlabel="epoch", ylabel="overturned elements", title="Overturned elements over the epochs", ylim=(0, None)
    )
    panels[2].yaxis.set_major_locator(MaxNLocator(integer=True))
    facts = {"overturned": counts, "overlapping_area": float(area(end)[bad].sum() / area(start).sum())}
    return figure, facts


def figure_8_l_shape(effort):
    """An L whose lower right corner is filled stepwise, as trained and after one Delaunay pass."""
    start = l_shape(effort.l_rows)
    som = ka.KohonenMap(start, topology="fixed", min_quality=ONLY_OVERLAPS)
    rng = np.random.default_rng(5)
    for height in (5, 20, 80):
        wanted = peak((2.0, 0.0), height, 0.35)
        points = training_points(start, wanted, 2 * start.p.shape[1], rng)
        som.train(points, ka.Schedule.paper((5, 15, 10), RATE))
    delaunay = ka.relocate(
        som.mesh, np.ones(start.t.shape[1]), topology="flip", schedule=ka.Schedule(()), min_quality=0.0
    )
    figure, panels = page(1, 3, 16, 4.6)
    meshes = (start, som.mesh, delaunay)
    facts = {"overturned": int(overturned(som.mesh, start).sum()), "area": [float(area(m).sum()) for m in meshes]}
    for axes, mesh, title in zip(panels, meshes, ("Start mesh", "Fixed topology", "Its Delaunay pass"), strict=True):
        quality = ka.quality(mesh)
        shades = axes.tripcolor(*mesh.p, mesh.t.T, facecolors=quality, cmap="Oranges_r", vmin=0, vmax=1)
        draw_mesh(axes, mesh, unit="")
        axes.set_title(f"{title}: quality $\\geq$ {quality.min():.3f}, mean {quality.mean():.2f}")
    figure.colorbar(shades, ax=panels, label="quality (1: equilateral)")
    facts["min_quality"] = [float(ka.quality(mesh).min()) for mesh in meshes]
    facts["mean_quality"] = [float(ka.quality(mesh).mean()) for mesh in meshes]
    return figure, facts


def figure_9_two_regions(effort):
    """An inner and an outer region, remeshed at once towards a peak in the lower left part."""
    start = two_regions(effort.quarter)
    points = training_points(start, peak((1.1, 0.5), 25, 0.35), 2 * start.p.shape[1], np.random.default_rng(7))
    som = ka.KohonenMap(start, topology="fixed", min_quality=ONLY_OVERLAPS)
    som.train(points, ka.Schedule.paper((5, 30, 15), RATE))
    end = som.mesh
    figure, panels = page(1, 3, 17, 3.8)
    for axes, mesh in zip(panels, (start, start, end), strict=True):
        fill_elements(axes, mesh, mesh.subdomains["inner"], "#cfe8f8")
    draw_mesh(panels[0], start, unit="")
    panels[0].set_title(f"Start mesh, {start.p.shape[1]} neurons, two regions")
    draw_sides(panels[1])
    panels[1].plot(*points, ".", color=BLUE, ms=2)
    panels[1].set_title("Training points")
    draw_mesh(panels[2], end, unit="")
    panels[2].set_title("After 50 epochs")
    facts = {
        "overturned": int(overturned(end, start).sum()),
        "areas_of_inner": [float(area(mesh)[mesh.subdomains["inner"]].sum()) for mesh in (start, end)],
        "mean_density_at_peak": [density_near(mesh, (1.1, 0.5), 0.4) for mesh in (start, end)],
    }
    return figure, facts


def figure_10_cost(effort):
    """Steps of the search per training point and processor seconds per epoch over the number of neurons."""
    rows = [cost(count) for count in effort.neurons]
    n = np.array([row["neurons"] for row in rows])
    figure, panels = page(1, 2, 12, 4.8)
    steps = {
        "from a random neuron (the paper's first epoch)": [row["random"] for row in rows],
        "first epoch, from the element it was drawn from": [row["first"] for row in rows],
        "later epochs, from its last winner": [row["later"] for row in rows],
    }
    for (label, values), style, colour in zip(
        steps.items(), ("^:", "s--", "o-"), (ORANGE, VERMILION, BLUE), strict=True
    ):
        panels[0].loglog(n, values, style, color=colour, label=f"{label}: $N^{{{slope(n, values):.2f}}}$")
    panels[0].set(xlabel="neurons N", ylabel="steps per training point", title="Search for the winner")
    panels[0].set_ylim(0.1, 3000)
    facts = {
        "neurons": n.tolist(),
        "steps": {name: [row[name] for row in rows] for name in ("random", "first", "later")},
    }
    facts["step_slopes"] = {name: slope(n, values) for name, values in facts["steps"].items()}
    for radius, style, colour in zip((2, 1, 0), ("^:", "s--", "o-"), (ORANGE, VERMILION, BLUE), strict=True):
        seconds = [row["seconds"][radius] for row in rows]
        panels[1].loglog(n, seconds, style, color=colour, label=f"R = {radius}: $N^{{{slope(n, seconds):.2f}}}$")
        facts[f"seconds_{radius}"], facts[f"time_slope_{radius}"] = seconds, slope(n, seconds)
    panels[1].loglog(n, rows[0]["seconds"][0] * n / n[0] / 3, color="0.6", label="O(N)")
    panels[1].set(xlabel="neurons N", ylabel="processor seconds per epoch of 2N points", title="Time of an epoch")
    for axes in panels:
        axes.legend(fontsize=8)
        axes.grid(which="major", color="0.9")
    return figure, facts


def page(rows, columns, width, height):
    """A figure and its panels."""
    figure = Figure(figsize=(width, height), dpi=130, layout="compressed")
    return figure, figure.subplots(rows, columns)


def draw_sides(axes):
    """The outline of the quadrilateral alone."""
    axes.fill(*QUADRILATERAL, fill=False, lw=1.2)
    axes.set(aspect="equal", xlabel="x", ylabel="y")


def fill_elements(axes, mesh, elements, colour):
    """Colour some elements."""
    shades = ListedColormap([colour])
    axes.tripcolor(*mesh.p, mesh.t.T[elements], facecolors=np.ones(len(elements)), cmap=shades, edgecolors="face")


def zoom(axes, low, high):
    """Show a part of the picture."""
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


def note(axes, x, text, offset):
    """A label beside a point."""
    box = {"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.8}
    axes.annotate(text, x, offset, textcoords="offset points", fontsize=13, bbox=box, zorder=6, annotation_clip=True)


FIGURES = (
    figure_1_neighbourhoods,
    figure_2_density,
    figure_3_corner_jump,
    figure_4_search,
    figure_5_converged,
    figure_6_epochs,
    figure_7_overlapping,
    figure_8_l_shape,
    figure_9_two_regions,
    figure_10_cost,
)


def main(out, quick=False):
    """Write every figure as a PNG into the folder `out`; returns the numbers of each by its name."""
    out, facts = Path(out), {}
    out.mkdir(parents=True, exist_ok=True)
    for draw in FIGURES:
        figure, facts[draw.__name__] = draw(QUICK if quick else FULL)
        figure.savefig(out / f"{draw.__name__}.png", bbox_inches="tight")
    return facts


def parsed():
    """What was asked for on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default="paper_figures", help="folder for the PNGs (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="small meshes and few epochs")
    return parser.parse_args()


if __name__ == "__main__":
    options = parsed()
    for name, numbers in main(options.out, options.quick).items():
        print(f"{Path(options.out) / name}.png")
        for quantity, value in numbers.items():
            print(f"    {quantity.replace('_', ' ')}: {value}")
