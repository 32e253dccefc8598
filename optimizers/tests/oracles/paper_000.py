"""The bacteria on a Field, written from Wang et al. (2022) and Passino's and Biswas's articles, not from the Rust code."""
from math import exp, floor, sqrt

S, NC, NS, NRE, NED, SR, STEP, PED = 4, 3, 2, 1, 3, 3, 0.4, 0.7
D, WA, H, WR = 0.1, 20.0, 0.3, 100.0
W, C1, C2 = 0.9, 1.2, 0.5
W_STEP, C_STEP = 0.729, 1.494


def unit_vector(v):
    n = sqrt(sum(a * a for a in v))
    return [a / n for a in v]


def colony(field, method, printed, elite):
    draw = field.draw
    theta = field.crowd(S)
    speed = [[0.0] * len(theta[0][0]) for _ in range(S)]
    own = list(theta)

    def j_ar(i):
        total = 0.0
        for other in theta:
            gap = sum((a - b) ** 2 for a, b in zip(theta[i][0], other[0]))
            total += -D * exp(-WA * gap) + H * exp(-WR * gap)
        return total

    def heading(i):
        x = theta[i][0]
        if method == "bso":
            for m in range(len(x)):
                r1, r2 = draw.unit(), draw.unit()
                speed[i][m] = (W * speed[i][m] + C1 * r1 * (own[i][0][m] - x[m])
                               + C2 * r2 * (field.best[0][m] - x[m]))
            if any(speed[i]):
                return unit_vector(speed[i])
        return unit_vector([draw.within(-1.0, 1.0) for _ in x])

    def move(i, delta, j_last):
        here = theta[i]
        theta[i] = field.ask([a + STEP * b for a, b in zip(theta[i][0], delta)])
        if theta[i][1] < own[i][1]:
            own[i] = theta[i]
        now = theta[i][1] + j_ar(i)
        if method == "greedy-bfoa" and not now < j_last:
            theta[i] = here
        return now

    n, total = 0, NC * NRE * NED
    for ell in range(NED):
        for kappa in range(NRE):
            health = [0.0] * S
            for j in range(NC):
                for i in range(S):
                    j_last = theta[i][1] + j_ar(i)
                    health[i] += j_last
                    delta = heading(i)
                    now = move(i, delta, j_last)
                    for m in range(NS):
                        if not now < j_last:
                            break
                        j_last = now
                        now = move(i, delta, j_last)
                for i in range(S) if method == "bso-step" else ():
                    x = theta[i][0]
                    speed[i] = [W_STEP * v + C_STEP * draw.unit() * (g - a)
                                for v, g, a in zip(speed[i], field.best[0], x)]
                    theta[i] = field.ask([a + v for a, v in zip(x, speed[i])])
                n += 1
            for i in range(S):
                health[i] += theta[i][1] + j_ar(i)
            decay = exp((1 - n) / total) if method == "ibfoa" else 1.0
            order = sorted(range(S), key=lambda i: health[i])
            alive = min(max(floor(SR * decay + 0.5), 1), S)
            order = [order[i % alive] for i in range(S)]
            theta, own = [theta[i] for i in order], [own[i] for i in order]
            speed = [list(speed[i]) for i in order]
        if ell == NED - 1 and not printed:
            break
        exempt = {"nobody": None, "healthiest": 0, "best": min(range(S), key=lambda i: theta[i][1])}[elite]
        for i in range(S):
            if i != exempt and draw.unit() < PED * decay:
                theta[i] = field.ask(field.anywhere())
                own[i], speed[i] = theta[i], [0.0] * len(theta[i][0])


def sampling(field, printed):
    """Five populations of six."""
    for _ in range(5):
        field.crowd(6)
