"""What a field must tell for forces, torques and linkages to be worked out from it."""

from typing import Protocol

from skfem import MeshTri

from kohonen_adapt.arrays import Floats

__all__ = ["SolvedField"]


class SolvedField(Protocol):
    """The part of `Field` that its own methods hand on: so these need not know where they are called from."""

    @property
    def mesh(self) -> MeshTri:
        """The mesh, in metres."""

    @property
    def axisymmetric(self) -> bool:
        """Whether it is the half-plane of an axis."""

    @property
    def depth(self) -> float | None:
        """In m; None: results are per metre."""

    @property
    def volume(self) -> Floats:
        """Of every element, (nelements,): per metre of depth or in all."""

    @property
    def unknown(self) -> Floats:
        """What is linear in every element, (nnodes,)."""

    @property
    def mean_unknown(self) -> Floats:
        """Its mean over every element, (nelements,)."""

    @property
    def flux_density(self) -> Floats:
        """B, (2, nelements) in T."""

    @property
    def reluctivity(self) -> Floats:
        """|H + Hc| / |B|, (nelements,) in m/H."""

    @property
    def remanence(self) -> Floats:
        """Br, (2, nelements) in T."""

    @property
    def current_density(self) -> Floats:
        """J, (nelements,) in A/m^2."""

    @property
    def energy(self) -> float:
        """In J/m, or J."""
