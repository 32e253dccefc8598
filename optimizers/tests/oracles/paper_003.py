"""IEPSO, PSO, SPSO, GA and DE on a Field, written from Lv et al. (2019) and the methods' own articles."""
from field import BOX

N, T = 6, 4


def linear(start, end, t):
    return start + (end - start) * (t - 1) / (T - 1)


def particles(field, inertia, c1, c2, exchange=None, eliminated=0):
    draw = field.draw
    x = field.crowd(N)
    own = list(x)
    v = [[0.5 * (a - b) for a, b in zip(field.anywhere(), p)] for p, _ in x]
    for t in range(1, T + 1):
        w, c3 = linear(*inertia, t), linear(2.0, 0.0, t)
        best = field.best[0]
        for i in range(N):
            for d in range(len(BOX)):
                r1, r2 = draw.unit(), draw.unit()
                here, mine = x[i][0][d], own[i][0][d]
                v[i][d] = w * v[i][d] + c1 * r1 * (mine - here) + c2 * r2 * (best[d] - here)
                if exchange:
                    gap = best[d] - mine
                    v[i][d] += c3 * draw.unit() * (abs(gap) if exchange == "printed" else gap)
        x = [field.ask([a + b for a, b in zip(p, s)]) for (p, _), s in zip(x, v)]
        own = [min(o, p, key=lambda q: q[1]) for o, p in zip(own, x)]
        last = sorted(range(N), key=lambda i: -x[i][1])[:eliminated]
        for i, place in zip(last, [field.anywhere() for _ in last]):
            x[i] = own[i] = field.ask(place)
            v[i] = [0.0] * len(BOX)


def pso(field, printed):
    particles(field, (1.0, 1.0), 2.0, 2.0)


def spso(field, printed):
    particles(field, (0.729, 0.729), 1.494, 1.494)


def iepso(field, printed):
    particles(field, (0.9, 0.4), 2.0, 2.0, "printed" if printed else "signed", eliminated=2)


def ga(field, printed, alpha=0.5, chance=0.3, share=0.1):
    draw = field.draw
    people = field.crowd(N)
    for _ in range(T):
        young = []
        for _ in range(N - 1):
            parents = []
            for _ in range(2):
                a, b = people[draw.index(N)], people[draw.index(N)]
                parents.append(b[0] if b[1] < a[1] else a[0])
            child = []
            for a, b, (low, high) in zip(*parents, BOX):
                a, b = min(a, b), max(a, b)
                gene = draw.within(a - alpha * (b - a), b + alpha * (b - a))
                if draw.unit() < chance:
                    gene += share * (high - low) * draw.normal()
                child.append(gene)
            young.append(child)
        people = [min(people, key=lambda p: p[1])] + [field.ask(child) for child in young]


def de(field, printed, factor=0.5, cr=0.6):
    draw = field.draw
    people = field.crowd(N)
    for _ in range(T):
        trials = []
        for i, (x, _) in enumerate(people):
            chosen = [i]
            for _ in range(3):
                chosen.append(draw.other(N, chosen))
            a, b, c = (people[j][0] for j in chosen[1:])
            sure = draw.index(len(x))
            trials.append([])
            for d, v in enumerate(x):
                take = draw.unit() < cr or d == sure
                trials[-1].append(a[d] + factor * (b[d] - c[d]) if take else v)
        for i, trial in enumerate(trials):
            tried = field.ask(trial)
            if tried[1] <= people[i][1]:
                people[i] = tried
