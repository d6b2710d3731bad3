"""Points of a magnetisation curve of steel."""

# (flux density in T, field strength in A/m)
STEEL = [(0.4, 60.0), (0.9, 120.0), (1.3, 300.0), (1.5, 1000.0), (1.7, 5000.0), (1.9, 17e3), (2.1, 75e3), (2.25, 17e4)]
