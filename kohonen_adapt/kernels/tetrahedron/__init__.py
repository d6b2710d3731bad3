"""Move, swap and exchange the nodes of meshes of tetrahedra in compiled loops."""
