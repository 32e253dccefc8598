"""IWO on a Field, written from Sengupta et al. (2011) and Mehrabian and Lucas's article."""
from math import floor

from field import BOX

T, FIRST, MOST = 4, 4, 6
S_MIN, S_MAX, SIGMA_MAX, SIGMA_MIN, POWER = 0, 3, 0.1, 0.00004, 3


def iwo(field, printed):
    weeds = field.crowd(FIRST)
    for it in range(1, T + 1):
        sigma = ((T - it) / T) ** POWER * (SIGMA_MAX - SIGMA_MIN) + SIGMA_MIN
        fit = [f for _, f in weeds]
        seeds = []
        for x, f in weeds:
            part = (max(fit) - f) / (max(fit) - min(fit)) if max(fit) > min(fit) else 1.0
            for _ in range(floor(S_MIN + (S_MAX - S_MIN) * part)):
                seeds.append([v + sigma * (high - low) * field.draw.normal() for v, (low, high) in zip(x, BOX)])
        weeds = sorted(weeds + [field.ask(s) for s in seeds], key=lambda w: w[1])[:MOST]
