"""ISMA, SMA, BOA, GWO and SSA on a Field, written from Li, Xing and Qin (2025) and the methods' own articles."""
from math import atanh, copysign, e, exp, floor, log, log10, tan, tanh

from field import BOX

N, T = 6, 4
Z, PT, MU, LAMBDA = 0.15, 0.5, 0.1, 0.4  # of SMA and ISMA; z is raised so that a short walk meets it


def slime_move(field, mould, t, printed, vc):
    """The common move of SMA and ISMA; vc() gives the factor of the second branch."""
    draw = field.draw
    mould.sort(key=lambda m: m[1])
    bf, wf = mould[0][1], mould[-1][1]
    a = atanh(1.0 - t / T)
    goals = []
    for rank, (x, f) in enumerate(mould):
        if draw.unit() < Z:
            if printed:
                r = draw.unit()
                goals.append([low + r * (high - low) for low, high in BOX])
            else:
                goals.append(field.anywhere())
            continue
        p = (tan if printed else tanh)(abs(f - field.best[1]))
        smell = log10((bf - f) / (bf - wf) + 1.0)
        goal = []
        for m, v in enumerate(x):
            if draw.unit() < p:
                xa, xb = mould[draw.index(N)][0][m], mould[draw.index(N)][0][m]
                r = draw.unit()
                weight = 1.0 + r * smell if rank < N / 2 else 1.0 - r * smell
                goal.append(field.best[0][m] + draw.within(-a, a) * (weight * xa - xb))
            else:
                goal.append(vc() * v)
        goals.append(goal)
    return [field.ask(goal) for goal in goals]


def sma(field, printed):
    mould = field.crowd(N)
    for t in range(1, T + 1):
        b = 1.0 - t / T
        mould = slime_move(field, mould, t, printed, lambda: field.draw.within(-b, b))


def bernoulli(draw, x, mu=0.4):
    x = x / (1.0 - mu) if x <= 1.0 - mu else (x - 1.0 + mu) / mu
    return x if 0.0 < x < 1.0 else draw.unit()


def isma(field, printed):
    draw = field.draw
    chain, start = 0.0, []
    for _ in range(N):
        point = []
        for low, high in BOX:
            chain = bernoulli(draw, chain)
            point.append(low + (high - low) * chain)
        start.append(point)
    mould = [field.ask(x) for x in start]
    for t in range(1, T + 1):
        vc = ((exp((T - t) / (T - 1)) - 1.0) / (e - 1.0)) ** 4
        mould = slime_move(field, mould, t, printed, lambda: vc if printed else draw.within(-vc, vc))

        # Crossover: every pair of children is made before the first is evaluated; the best is the one of then.
        children = {}
        for i, (x, _) in enumerate(mould):
            if draw.unit() < PT:
                r = draw.unit()
                if printed:
                    share = MU - LAMBDA * log(r) if r <= 0.5 else MU + LAMBDA * log(r)
                elif r <= 0.5:
                    share = MU + LAMBDA * log(2.0 * r)
                else:
                    share = MU - LAMBDA * log(2.0 * (1.0 - r))
                best = field.best[0]
                children[i] = [[share * v + (1 - share) * b for v, b in zip(x, best)],
                               [share * b + (1 - share) * v for v, b in zip(x, best)]]
        for i, pair in children.items():
            mould[i] = min([mould[i]] + [field.ask(x) for x in pair], key=lambda m: m[1])

        bees = []
        for i, (x, _) in enumerate(mould):
            j = draw.index(len(x))
            k = draw.other(N, [i])
            phi, omega = draw.within(-1.0, 1.0), draw.within(0.0, 1.5)
            bee = list(x)
            bee[j] = x[j] + phi * (x[j] - mould[k][0][j]) + omega * (field.best[0][j] - x[j])
            bees.append(bee)
        mould = [min(m, field.ask(bee), key=lambda m: m[1]) for m, bee in zip(mould, bees)]

        tops = []
        for _ in range(N):
            i = draw.index(N)
            (x, fx), (y, fy), (z, fz) = mould[i], mould[draw.other(N, [i])], field.best
            tops.append([vertex((p, fx), (q, fy), (r, fz), printed) for p, q, r in zip(x, y, z)])
        mould = [min(m, field.ask(top), key=lambda m: m[1]) for m, top in zip(mould, tops)]


def vertex(x, y, z, printed):
    """The vertex of the parabola through three points: eq. 32 to the letter, or by divided differences.

    z's coordinate stays where there is none; corrected, also where the vertex is the highest point.
    """
    (p, fp), (q, fq), (r, fr) = x, y, z
    if printed:
        below = 2.0 * ((r - q) * fp + (p - r) * fq + (q - p) * fr)
        above = (r**2 - q**2) * fp + (p**2 - r**2) * fq + (q**2 - p**2) * fr
        return above / below if below != 0.0 else r
    if p == q or q == r or p == r:
        return r
    first, second = (fq - fp) / (q - p), (fr - fq) / (r - q)
    curve = (second - first) / (r - p)
    return 0.5 * (p + q - first / curve) if curve > 0.0 else r


def gwo(field, printed):
    draw = field.draw
    wolves, ever = field.crowd(N), []
    for t in range(T):
        ever = sorted(ever + wolves, key=lambda w: w[1])[:3]
        a = 2.0 - 2.0 * t / T
        goals = []
        for x, _ in wolves:
            goal = []
            for m, v in enumerate(x):
                moves = []
                for lead, _ in ever:
                    r1, r2 = draw.unit(), draw.unit()
                    distance = abs(2.0 * r2 * lead[m] - v)
                    moves.append(lead[m] - (2.0 * a * r1 - a) * distance)
                goal.append(sum(moves) / 3.0)
            goals.append(goal)
        wolves = [field.ask(goal) for goal in goals]


def boa(field, printed):
    draw, c = field.draw, 0.01
    swarm = field.crowd(N)
    for _ in range(T):
        goals = []
        for x, f in swarm:
            smell = c * abs(f) ** 0.1
            to_best, r = draw.unit() < 0.8, draw.unit()
            if to_best:
                goals.append([v + (r * r * b - v) * smell for v, b in zip(x, field.best[0])])
            else:
                j = draw.index(N)
                k = draw.other(N, [j])
                goals.append([v + (r * r * s - u) * smell for v, s, u in zip(x, swarm[j][0], swarm[k][0])])
        swarm = [min(b, field.ask(goal), key=lambda b: b[1]) for b, goal in zip(swarm, goals)]
        c += 0.025 / (c * T)


def ssa(field, printed, producers=2, watchers=2, safety=0.5):
    draw = field.draw
    flock = field.crowd(N)
    for _ in range(T):
        flock.sort(key=lambda s: s[1])
        r2 = draw.unit()
        goals = []
        for i in range(1, producers + 1):
            x = flock[i - 1][0]
            if r2 < safety:
                alpha = 1.0 - draw.unit()
                goals.append([v * exp(-i / (alpha * T)) for v in x])
            else:
                q = draw.normal()
                goals.append([v + q for v in x])
        new = [field.ask(goal) for goal in goals]
        lead, worst = min(new, key=lambda s: s[1])[0], flock[-1][0]
        goals = []
        for i in range(producers + 1, N + 1):
            x = flock[i - 1][0]
            if i > N / 2:
                q = draw.normal()
                goals.append([q * exp((w - v) / i**2) for v, w in zip(x, worst)])
            else:
                signs = [-1.0 if draw.unit() < 0.5 else 1.0 for _ in x]
                # A+ = A^T (A A^T)^-1 = A^T / d, so |X - Xp| A+ is one number, which L spreads over all coordinates.
                shift = sum(s * abs(v - b) for s, v, b in zip(signs, x, lead)) / len(x)
                goals.append([b + shift for b in lead])
        new += [field.ask(goal) for goal in goals]
        flock = [min(old, young, key=lambda s: s[1]) for old, young in zip(flock, new)]

        best, worst = min(flock, key=lambda s: s[1]), max(flock, key=lambda s: s[1])
        who, goals = [], []
        for _ in range(watchers):
            i = draw.other(N, who)
            who.append(i)
            x, f = flock[i]
            if f > best[1]:
                beta = draw.normal()
                goals.append([b + beta * abs(v - b) for v, b in zip(x, best[0])])
            else:
                k = draw.within(-1.0, 1.0)
                goals.append([v + k * (abs(v - w) / (f - worst[1] + 1e-50)) for v, w in zip(x, worst[0])])
        for i, goal in zip(who, goals):
            young = field.ask(goal)
            if young[1] < flock[i][1]:
                flock[i] = young
