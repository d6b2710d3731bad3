"""Ritz functional of a P1 function around a node, by place and value there."""

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD, REDUCED, TWELFTH_COEFFICIENT
from kohonen_adapt.kernels.tetrahedron.geometry import cubed_of, others, sum_of_squares
from kohonen_adapt.kernels.tetrahedron.polish.applied_field import follows_field, rise_at, work_around
from kohonen_adapt.kernels.tetrahedron.polish.energy import shifted, sixth_flux, source_around, value_at
from kohonen_adapt.kernels.tetrahedron.polish.slivers import slivers_around
from kohonen_adapt.kernels.vectors import cofactors, combined, dot, from_to, plus, plus_dot, point, times

TRIES = 4  # halvings of a Newton step of a value in nonlinear material


@inner_kernel
def parabola(mesh, trial, v, x, w, rise):
    """Return functional, derivatives by w (first, second), and worst cubed quality.

    Node v is at x with its value changed by w, in reduced regions by w + rise. Values are relative to the value of v as
    in `derivatives`. Without laws the functional is a parabola in w.
    """
    position, star, data = mesh.position, mesh.star, trial.data
    total = by_w = ww = 0.0
    worst = 2.0
    for row in range(star.start[v], star.start[v + 1]):
        i, j, k = others(star, row)
        region = mesh.elements.region[star.element[row]]
        law, change = trial.laws.number[region], w + data[region, REDUCED] * rise
        a, b, c = from_to(x, position, i), from_to(x, position, j), from_to(x, position, k)
        own = value_at(trial, region, v) + change
        alpha, beta = value_at(trial, region, i) - own, value_at(trial, region, j) - own
        gamma = value_at(trial, region, k) - own
        p, q, r = cofactors(a, b, c)
        six = dot(a, p)
        quality = cubed_of(six, sum_of_squares(a, b, c))
        if not quality >= worst:
            worst = quality
        s, n = plus(plus(p, q), r), combined(alpha, p, beta, q, gamma, r)
        m = shifted(trial, region, six, n)
        square, along = dot(m, m), dot(m, s)
        load, flux = source_around(trial, region, v) * six, sixth_flux(trial, region)
        weight = 2.0 * data[region, TWELFTH_COEFFICIENT] / six
        if law >= 0:
            density, rate, curve = energy_density(trial.laws, law, square / (six * six))
            weight = rate / (3.0 * six)
            total += six * density / 6.0
            ww += 2.0 * curve * along * along / (3.0 * six * six * six)
        else:
            total += 0.5 * weight * square
        total -= plus_dot(load * (alpha + beta + gamma + 4.0 * change), flux, n)
        by_w -= plus_dot(weight * along + load, times(-1.0, flux), s)
        ww += weight * dot(s, s)
    return total, by_w, ww, worst


@inner_kernel
def with_slivers(mesh, trial, v, x, w, curved):
    rise = rise_at(mesh, trial, v, x)
    c, r, k, worst = parabola(mesh, trial, v, x, w, rise)
    if trial.surface.shape[0] > 0:
        c, r = c - trial.surface[v, LOAD] * (w + rise), r - trial.surface[v, LOAD]
    if follows_field(trial, v):
        work, by_w = work_around(mesh, trial, v, x, w + rise)
        c, r = c - work, r - by_w
    if curved:
        c, r, k = plus((c, r, k), slivers_around(mesh, trial, v, x, w))
    return c, r, k, worst


@inner_kernel
def best_value(mesh, trial, v, x, w, nonlinear, curved):
    # The least functional of the star, the value change, and the quality. For nonlinear material the candidates are w
    # and one Newton step from w.
    c, r, k, worst = with_slivers(mesh, trial, v, x, w, curved)
    further = w - r / k
    least = c - 0.5 * r * r / k
    if nonlinear:
        least = with_slivers(mesh, trial, v, x, further, curved)[0]
        if not least < c:
            return c, w, worst
    return least, further, worst


@inner_kernel
def improve_value(mesh, trial, v, curved):
    x = point(mesh.position, v)
    c, r, k, _ = with_slivers(mesh, trial, v, x, 0.0, curved)
    w = -r / k
    for _ in range(TRIES):
        least = with_slivers(mesh, trial, v, x, w, curved)[0]
        if least <= c:
            trial.value[v] += w
            return c - least
        w *= 0.5
    return 0.0


@inner_kernel
def least_near(mesh, trial, v, x, w):
    # by one Newton step of the value from w
    c, r, k, _ = with_slivers(mesh, trial, v, x, w, False)
    return c - 0.5 * r * r / k
