#!/usr/bin/env python3
"""The arm of Sengupta et al. (2011) as point masses along its links, and its price of a via point (plain Python). Prints what
tests/papers_two_link.rs holds: kinetic and potential energy, and prices."""
from math import cos, degrees, exp, pi, sin, sqrt

L, M, H, G = 5.0, 1.0, 20.0, 9.81


def points(theta, phi, alpha):
    elbow = (L * sin(theta) * cos(alpha), L * sin(theta) * sin(alpha), L * cos(theta))
    return elbow, (elbow[0] + L * cos(phi), elbow[1] + L * sin(phi), elbow[2])


def energy(theta, phi, v, w, alpha):
    """Three point masses a link, weighted as Simpson does: exact, since the energy density is a parabola along it."""
    kinetic = potential = 0.0
    ve = (L * cos(theta) * cos(alpha) * v, L * cos(theta) * sin(alpha) * v, -L * sin(theta) * v)
    vt = (-L * sin(phi) * w, L * cos(phi) * w, 0.0)
    elbow, tip = points(theta, phi, alpha)
    for share, weight in ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6)):
        first = [share * x for x in ve]
        second = [x + share * y for x, y in zip(ve, vt)]
        kinetic += 0.5 * M * weight * (sum(x * x for x in first) + sum(x * x for x in second))
        potential += M * G * weight * (H + share * elbow[2] + H + elbow[2])
    return kinetic, potential


def price(theta, phi, in_degrees):
    unit = degrees(1.0) if in_degrees else 1.0
    elbow, tip = points(theta, phi, pi / 2)
    spheres = [[k * x for x in elbow] for k in (0.1, 0.3, 0.5, 0.7, 0.9)]
    spheres += [[e + k * (t - e) for e, t in zip(elbow, tip)] for k in (0.1, 0.3, 0.5, 0.7, 0.9)]
    contact, total = 0.5 + sqrt(3) / 2 * 1.5, 10 * unit * (abs(pi / 2 - theta) + abs(pi / 2 - phi))
    for s in spheres:
        for o in ((3, 8, 3), (3, 9.5, 3), (3, 8, 4.5), (3, 9.5, 4.5)):
            x = sqrt(sum((a - b) ** 2 for a, b in zip(s, o)))
            total += 100 * exp(-x / contact) if x < contact else 0.0
    return total + 10000 * ((not 0 <= theta <= pi / 2) + (not 0 <= phi <= pi))


for case in ((0.3, 0.8, 1.2, -0.7, pi / 2), (1.1, 2.5, -0.4, 2.0, 0.6)):
    print(case, [f"{x:.12g}" for x in energy(*case)])
for case in ((0.0, 0.0), (0.9, 1.0), (0.8, 0.9), (1.6, -0.1)):
    print(case, [f"{price(*case, unit):.12g}" for unit in (False, True)])
