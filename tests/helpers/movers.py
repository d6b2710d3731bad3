"""All that moves the nodes of a mesh, by (mesh, density per element, options) -> mesh."""

import numpy as np

import kohonen_adapt as ka


def movers_with(problem, stretch):
    """By name: with a problem for those that solve, and a tensor that makes densities metrics."""

    def relocated(mesh, density, options):
        return ka.relocate(mesh, density, **options)

    def in_metric(mesh, density, options):
        return ka.relocate(mesh, density[:, None, None] * np.asarray(stretch), **options)

    def polished(mesh, density, options):
        more = {name: options[name] for name in ("min_quality", "pinned", "seed")}
        return ka.polish(mesh, problem, topology=options["topology"].replace("recycle", "flip"), **more)

    def adapted(mesh, density, options):
        return ka.adapt(mesh, problem, passes=1, **options).history[-1].mesh

    def trained(mesh, density, options):
        rules = {name: options[name] for name in ("min_quality", "pinned")}
        som = ka.KohonenMap(mesh, topology=options["topology"].replace("recycle", "flip"), **rules)
        points, weights = mesh.p[:, mesh.t].mean(axis=1), density / density.max()
        before = points.tobytes(), weights.tobytes()
        som.train(points, weights=weights, seed=options["seed"])
        assert before == (points.tobytes(), weights.tobytes())
        return som.mesh

    return {"relocate": relocated, "metric": in_metric, "polish": polished, "adapt": adapted, "map": trained}
