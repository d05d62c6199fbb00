#!/usr/bin/env python3
"""Trains a waiter by the cross-entropy method: where to go, by where it stands. ``python3 learn.py`` prints what it learns.

A policy is a field of directions: nine weights for x and nine for y, of bumps on a grid of 3 by 3.
"""

from __future__ import annotations

import sys
from typing import Any

import cars
import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
SCENARIO = "waiter"
RUNS, BEST, GENERATIONS = 64, 10, 30
CENTERS = np.stack(np.meshgrid([0.2, 0.5, 0.8], [0.2, 0.5, 0.8]), -1).reshape(-1, 2)


def act(weights: Numbers, observations: Any) -> Numbers:
    """Where each copy goes: ``weights`` and ``observations`` have a row for each."""
    places = observations[:, None, 1:3] - CENTERS
    bumps = np.exp(-np.square(places).sum(-1) / 0.05)
    return np.asarray(np.tanh(np.einsum("ab,abc->ac", bumps, weights)))


def play(weights: Numbers, seed: int) -> Numbers:
    """What each copy serves in a run with its weights."""
    env = cars.vector_env(SCENARIO, ["Rosie"], num_envs=len(weights), threads=2, reward="served", serves="wanted", bodies=0)
    observations, _ = env.reset(seed=seed)
    served = np.zeros(len(weights))
    over = np.zeros(len(weights), bool)
    while not over.all():
        observations, rewards, ended, cut, _ = env.step(act(weights, observations))
        served += rewards
        over |= ended | cut
    return served


def train(seed: int = 1) -> tuple[Numbers, list[float]]:
    """The weights that were learned, and the mean of what was served in each generation."""
    random = np.random.default_rng(seed)
    mean, spread = np.zeros((9, 2)), np.full((9, 2), 1.5)
    history = []
    for generation in range(GENERATIONS):
        tried = random.normal(mean, spread, (RUNS, 9, 2))
        served = play(tried, seed=1000 * seed + RUNS * generation)
        best = tried[np.argsort(-served, kind="stable")[:BEST]]
        mean, spread = best.mean(0), best.std(0) + 0.05
        history.append(float(served.mean()))
    return mean, history


def compare(weights: Numbers, runs: int = 32, seed: int = 500_000) -> tuple[Numbers, Numbers]:
    """What is served with the weights, and with random directions, in runs with the same seeds, which training did not see."""
    learned = play(np.broadcast_to(weights, (runs, 9, 2)), seed)
    return learned, play(np.random.default_rng(seed).normal(0, 1.5, (runs, 9, 2)), seed)


if __name__ == "__main__":
    learned_weights, means = train()
    print("served by generation:", *(f"{mean:.1f}" for mean in means))
    learned, random_ones = compare(learned_weights)
    print(f"served with what was learned: {learned.mean():.1f}; with random fields: {random_ones.mean():.1f}")
    sys.exit(0)
