"""Curves and surfaces as users write them, known by their projections only."""

import numpy as np


class Ellipse:
    """(a cos t, b sin t): the nearest point by Newton's method in t."""

    def __init__(self, a, b):
        self.axes = np.array([[a], [b]])

    def project(self, x):
        t, (a, b) = np.arctan2(x[1] / self.axes[1], x[0] / self.axes[0]), self.axes[:, 0]
        for _ in range(30):
            sine, cosine = np.sin(t), np.cos(t)
            rate = (b**2 - a**2) * sine * cosine + a * x[0] * sine - b * x[1] * cosine
            change = (b**2 - a**2) * (cosine**2 - sine**2) + a * x[0] * cosine + b * x[1] * sine
            t = t - rate / change
        return self.axes * np.stack([np.cos(t), np.sin(t)])
