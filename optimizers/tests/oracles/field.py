"""The little problem that every method walks on, and what they all share: a box, a best, a list of costs."""
from math import sin

from draws import Draw

BOX = [(-3.0, 2.0), (-1.0, 4.0), (0.5, 2.5)]
CENTRE = [-1.2, 2.3, 1.1]


def cost(x):
    return sum(0.1 * (i + 1) * (v - c) ** 2 + 0.05 * sin(3.0 * v) for i, (v, c) in enumerate(zip(x, CENTRE)))


class Field:
    """A point is (list of coordinates, cost)."""

    def __init__(self, seed):
        self.draw, self.costs, self.best = Draw(seed), [], None

    def ask(self, x):
        """Clamps, evaluates, remembers."""
        x = [min(max(v, low), high) for v, (low, high) in zip(x, BOX)]
        f = cost(x)
        self.costs.append(f)
        if self.best is None or f < self.best[1]:
            self.best = (x, f)
        return (x, f)

    def anywhere(self):
        return [self.draw.within(low, high) for low, high in BOX]

    def crowd(self, count):
        """All are drawn before the first is evaluated."""
        return [self.ask(x) for x in [self.anywhere() for _ in range(count)]]
