"""Parts of a mesh that threads may train side by side, and training points sorted by them."""

from kohonen_adapt.kernels.compilation import kernel


@kernel
def mark_deep(star, part, rings, deep, queue):
    """Mark the nodes that have only nodes of their own part within so many rings, (n,).

    `part` numbers the parts, (n,); `queue` (n,) is scratch.
    """
    last = 0
    for v in range(part.shape[0]):
        deep[v] = True
        for k in range(star.start[v], star.start[v + 1]):
            if part[star.ahead[k]] != part[v] or part[star.behind[k]] != part[v]:
                deep[v] = False
        if not deep[v]:
            queue[last] = v
            last += 1
    first = 0
    for _ in range(rings - 1):
        end = last
        for j in range(first, last):
            v = queue[j]
            for k in range(star.start[v], star.start[v + 1]):
                for other in (star.ahead[k], star.behind[k]):
                    if deep[other]:
                        deep[other] = False
                        queue[end] = other
                        end += 1
        first, last = last, end


@kernel
def sort_into_tiles(winners, rank, deep, count, tiles, rng, cuts, order):
    """Sort training points by the tile of their winner, those with deep winners first, in random order in a tile.

    Points ``order[cuts[i] : cuts[i + 1]]`` have deep winners in tile i, those from ``cuts[tiles + i]`` on the others.
    The tiles cut the curve on which `rank` is the place of each of the `count` neurons.
    """
    cuts[:] = 0
    for t in range(winners.shape[0]):
        v = winners[t]
        cuts[rank[v] * tiles // count + (1 if deep[v] else tiles + 1)] += 1
    for i in range(2 * tiles):
        cuts[i + 1] += cuts[i]
    cursor = cuts[:-1].copy()
    for t in range(winners.shape[0]):
        v = winners[t]
        i = rank[v] * tiles // count + (0 if deep[v] else tiles)
        order[cursor[i]] = t
        cursor[i] += 1
    for i in range(2 * tiles):
        for t in range(cuts[i + 1] - 1, cuts[i], -1):
            other = rng.integers(cuts[i], t + 1)
            order[t], order[other] = order[other], order[t]
