"""Elements of order 3 and 4 on tetrahedra for scikit-fem."""

from math import comb
from typing import Any

import numpy as np
from skfem.element import DiscreteField, ElementH1
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, FloatsPair, Ints
from kohonen_adapt.mesh.elements.functions import EQUIDISTANT, inner_order, nodes, parts, rank_of, reference_functions

__all__ = ["ElementTetP3", "ElementTetP4"]

DIM = 3


class _ElementTet(ElementH1):
    # Functions of nodal values. scikit-fem does not sort the corners of a `MeshTet`, so that the nodes inside edges and
    # faces are numbered in the order of ascending corners.
    refdom = RefTet
    nodal_dofs = 1

    def __init_subclass__(cls) -> None:
        order = cls.maxdeg
        cls.edge_dofs, cls.facet_dofs, cls.interior_dofs = (comb(order - 1, size) for size in (1, 2, 3))
        cls.doflocs = nodes(order, DIM, order > EQUIDISTANT)[:, 1:]
        cls.dofnames = ["u"] * (1 + cls.edge_dofs + cls.facet_dofs + cls.interior_dofs)

    def __init__(self) -> None:
        self._known: tuple[Any, FloatsPair] | None = None  # the last points, and all functions there

    def gbasis(self, mapping: Any, X: Floats, i: int, tind: Ints | None = None) -> tuple[DiscreteField]:
        t = mapping.mesh.t if tind is None else mapping.mesh.t[:, tind]
        number = self._number(t, i)
        values, slopes = self._functions(X)
        if X.ndim == 2:
            value, slope = values[number], slopes[number].swapaxes(0, 1)
        else:
            each = np.arange(number.size)
            value, slope = values[number, each], slopes[number, :, each].swapaxes(0, 1)
        return (DiscreteField(value=value, grad=np.einsum("ijkl,ikl->jkl", mapping.invDF(X, tind), slope)),)

    def lbasis(self, X: Floats, i: int) -> FloatsPair:
        values, slopes = self._functions(X)
        return values[i], slopes[i]

    def _functions(self, X: Floats) -> FloatsPair:
        # values (k, ...) and slopes (k, 3, ...)
        if self._known is None or self._known[0] is not X:
            last = X.reshape(DIM, -1)
            values, slopes = reference_functions(np.vstack([1.0 - last.sum(axis=0), last]).T, self.maxdeg)
            shape = X.shape[1:]
            self._known = X, (values.reshape(-1, *shape), slopes.reshape(-1, DIM, *shape))
        return self._known[1]

    def _number(self, t: Ints, i: int) -> Ints:
        # the function of elements that is number i in the order of ascending corners, (nelements,)
        first = DIM + 1
        for size in (2, 3):
            inner = comb(self.maxdeg - 1, size - 1)
            for corners in parts(DIM, size):
                if first <= i < first + inner:
                    own = np.argsort(inner_order(self.maxdeg, size), axis=1)[rank_of(t[list(corners)])]
                    return np.asarray(first + own[:, i - first])
                first += inner
        return np.full(t.shape[1], i)


class ElementTetP3(_ElementTet):
    """Piecewise cubic element on tetrahedra, for `skfem.Basis`.

    The default quadrature of scikit-fem has fewer points than an element has functions, which suffices for products of
    gradients. Products of values, as in mass matrices, need ``intorder=7``, with `ElementTetP4` ``intorder=9``.

    The corners of elements may have any order. The positions ``basis.doflocs`` of unknowns inside edges and faces are
    right if they ascend, as after ``dataclasses.replace(mesh, sort_t=True)``.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.elements import ElementTetP3
    >>> basis = skfem.Basis(skfem.MeshTet().refined(1), ElementTetP3(), intorder=7)
    >>> u = basis.project(lambda x: x[0] ** 3 - x[1] * x[2])
    >>> np.allclose(basis.interpolator(u)(np.array([[0.3], [0.6], [0.1]])), 0.3**3 - 0.06)
    True
    """

    maxdeg = 3


class ElementTetP4(_ElementTet):
    """Piecewise quartic element on tetrahedra, for `skfem.Basis`.

    The nodes inside edges are Gauss-Lobatto points. Quadrature and the order of corners are as for `ElementTetP3`.

    Examples
    --------
    >>> import skfem
    >>> from kohonen_adapt.elements import ElementTetP4
    >>> int(skfem.Basis(skfem.MeshTet(), ElementTetP4()).N)
    115
    """

    maxdeg = 4
