"""Independent implementations of three optimisers on the same moved benchmark functions as ours.

Usage: optimisers_mealpy.py BENCHMARKS

BENCHMARKS is the built example (`cargo build --release -p taustream-optimizers --example benchmarks`), which says where
the optimum is and what our runs find. mealpy's programs share no line with this project. SMA and DE are the same
methods there, and are held to it: medians within a factor of three, and the rank test of Mann and Whitney (two-sided)
above 0.001 where the factor is not within one and a half. Its GWO keeps a move only when it is better, ours always; it
is held to a factor of five. Its PSO also keeps a place only when it is better, and then hardly moves at all (a median of
0.2 on F2 where particles that move reach 2e-5): it is another method, and not asked. Each line is a check; one that
fails ends in status 1.
"""

import logging
import subprocess
import sys

import numpy as np
from mealpy import DE, GWO, SMA, FloatVar
from scipy.stats import mannwhitneyu

DIMENSIONS, EVALUATIONS, RUNS = 5, 4000, 11  # small: mealpy's slime mould takes a minute as it is
HALF = {"F2": 100.0, "F3": 32.0, "F6": 600.0}
FAILED = []


def step(x):
    return float(np.sum(x**2))


def ackley(x):
    waves = np.exp(np.mean(np.cos(2 * np.pi * x)))
    return float(20 + np.e - 20 * np.exp(-0.2 * np.sqrt(np.mean(x**2))) - waves)


def griewank(x):
    return float(1 + np.sum(x**2) / 4000 - np.prod(np.cos(x / np.sqrt(np.arange(1, len(x) + 1)))))


FUNCTIONS = {"F2": step, "F3": ackley, "F6": griewank}


def model(name):
    """mealpy's program of a method, with our population and the iterations that our evaluations allow."""
    population = 50 if name in ("sma", "gwo") else 40
    size = {"epoch": (EVALUATIONS - population) // population, "pop_size": population}
    return {
        "sma": lambda: SMA.OriginalSMA(**size, p_t=0.04),
        "gwo": lambda: GWO.OriginalGWO(**size),
        "de": lambda: DE.OriginalDE(**size, wf=0.5, cr=0.9, strategy=0),
    }[name]()


def ours(program, method, function):
    words = [program, method, function, str(DIMENSIONS), str(EVALUATIONS), str(RUNS)]
    lines = subprocess.run(words, check=True, capture_output=True, text=True).stdout.splitlines()
    optimum = np.array([float(x) for x in lines[0].split()])
    return optimum, [float(line.split()[0]) for line in lines[1:]]


def theirs(name, function, optimum):
    half = HALF[function]
    problem = {
        "obj_func": lambda x: FUNCTIONS[function](x - optimum),
        "bounds": FloatVar(lb=(-half,) * DIMENSIONS, ub=(half,) * DIMENSIONS),
        "minmax": "min",
        "log_to": None,
    }
    return [model(name).solve(problem, mode="swarm", seed=seed).target.fitness for seed in range(1, RUNS + 1)]


def main(program):
    logging.disable(logging.CRITICAL)
    for name in ("sma", "gwo", "de"):
        for function in FUNCTIONS:
            optimum, we = ours(program, name, function)
            they = theirs(name, function, optimum)
            # A run that ends at the last bits of a function says nothing about speed.
            factor = (np.median(we) + 1e-12) / (np.median(they) + 1e-12)
            p = mannwhitneyu(we, they).pvalue
            if name in ("sma", "de"):
                holds = 1 / 3 < factor < 3 and (2 / 3 < factor < 1.5 or p > 0.001)
            else:
                holds = 1 / 5 < factor < 5
            print(f"{'ok    ' if holds else 'FAILED'} {name} {function}: median {np.median(we):.3g}, mealpy "
                  f"{np.median(they):.3g}, factor {factor:.2f}, p {p:.3g}", flush=True)
            if not holds:
                FAILED.append((name, function))
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
