#!/usr/bin/env python3
"""Walks every optimiser a few iterations on a little problem, in plain Python written from the papers.

Prints what tests/optimisers_walk.rs compares with: a line a walk with the cost of every evaluation in its order.
`python3 walks.py > walks.txt` makes the file again; `python3 walks.py --check` says whether it is the same.
"""
import pathlib
import sys

import paper_000
import paper_001
import paper_003
import paper_004
from field import Field

SEEDS = range(1, 5)


def walks():
    single = {"boa": paper_001.boa, "gwo": paper_001.gwo, "ssa": paper_001.ssa, "pso": paper_003.pso,
              "spso": paper_003.spso, "ga": paper_003.ga, "de": paper_003.de, "iwo": paper_004.iwo}
    double = {"sma": paper_001.sma, "isma": paper_001.isma, "iepso": paper_003.iepso}
    for name, walk in {**single, **double}.items():
        for printed in (False, True) if name in double else (False,):
            yield name, printed, walk
    elites = {"bfoa": "nobody", "ibfoa": "healthiest", "bso": "nobody", "bso-step": "nobody"}
    for name, elite in elites.items():
        for printed in (False, True):
            yield name, printed, bacteria(name, elite)
    yield "ibfoa-best", False, bacteria("ibfoa", "best")
    yield "bfoa-elite", False, bacteria("bfoa", "healthiest")
    yield "greedy-bfoa", False, bacteria("greedy-bfoa", "best")
    yield "sampling", False, paper_000.sampling


def bacteria(method, elite):
    return lambda field, printed: paper_000.colony(field, method, printed, elite)


def lines():
    for name, printed, walk in walks():
        for seed in SEEDS:
            field = Field(seed)
            walk(field, printed)
            costs = " ".join(f"{c:.12g}" for c in field.costs)
            yield f"{name} {'printed' if printed else 'corrected'} {seed}: {costs}\n"


if __name__ == "__main__":
    text = "".join(lines())
    if sys.argv[1:] == ["--check"]:
        same = pathlib.Path(__file__).with_name("walks.txt").read_text() == text
        print("walks.txt is what the scripts make" if same else "walks.txt differs from what the scripts make")
        sys.exit(0 if same else 1)
    sys.stdout.write(text)
