"""Compares the laboratory's statistics with SciPy and lifelines.

Standard input is JSON: samples, pairs of samples, and shares, each with what the laboratory found. Fails at the first difference;
otherwise prints how many of each were compared.
"""

import json
import math
import sys
import warnings

import numpy
import pandas
from lifelines import KaplanMeierFitter
from lifelines.utils import median_survival_times, restricted_mean_survival_time
from scipy import optimize, stats

EXACT = {"rel_tol": 1e-9, "abs_tol": 1e-9}
# Largest distance of a share of 20,000 draws from the share of all, in standard errors.
ERRORS = 5.0


def same(found, expected, what, **tolerance):
    assert math.isclose(found, expected, **(tolerance or EXACT)), f"{what}: {found}, not {expected}"


def compare_sample(sample):
    values = numpy.array(sample["values"])
    ends = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    same_estimate(sample["difference"], values.mean(), ends, len(values))
    hall = hall_interval(values)
    most = 2 * (ends[1] - values.mean())
    ends = (min(ends[0], max(hall[0], values.mean() - most)), max(ends[1], min(hall[1], values.mean() + most)))
    same_estimate(sample["mean"], values.mean(), ends, len(values))

    for p, found in sample["quantiles"]:
        same(found, numpy.quantile(values, p), f"quantile {p}")
    steps = stats.ecdf(values).cdf
    assert [step["value"] for step in sample["ecdf"]] == list(steps.quantiles)
    for step, share in zip(sample["ecdf"], steps.probabilities, strict=True):
        same(step["share"], share, "distribution function")

    same(sample["dominance"], numpy.sign(values).mean(), "Cliff's delta")
    compare_sign_flip(values, sample["sign_flip"])


def same_estimate(found, value, ends, n, **tolerance):
    same(found["value"], value, "value", **tolerance)
    assert (found["n"], found["interval"]) == (n, "ends")
    same(found["low"], ends[0], "low", **tolerance)
    same(found["high"], ends[1], "high", **tolerance)


def hall_interval(values):
    """The means at which Hall's transformed statistic, which rises with the mean that is not there, is the quantile of t."""
    n = len(values)
    deviation = values.std(ddof=1)
    skewness = stats.skew(values, bias=False)
    quantile = stats.t.ppf(0.975, n - 1) / math.sqrt(n)

    def transformed(mean):
        t = (values.mean() - mean) / deviation
        return t + skewness * t**2 / 3 + skewness**2 * t**3 / 27 + skewness / (6 * n)

    far = 1e3 * deviation
    return [
        optimize.brentq(lambda mean: transformed(mean) - end, values.mean() - far, values.mean() + far, xtol=1e-13)
        for end in (quantile, -quantile)
    ]


def compare_sign_flip(values, found):
    assert found["is_exact"] == (len(values) <= 14)
    # With 65 values, no machine computes all signs.
    draws = math.inf if len(values) <= 16 else 100_000
    expected = stats.permutation_test(
        (values,), numpy.mean, permutation_type="samples", n_resamples=draws, vectorized=True, batch=10_000, rng=1
    ).pvalue

    if found["is_exact"]:
        same(found["p"], expected, "sign flip")
        return
    error = math.sqrt(expected * (1 - expected) * (1 / 20_000 + 1 / draws)) + 1 / 20_000
    assert abs(found["p"] - expected) < ERRORS * error, f"sign flip: {found}, not {expected}"


def fit(times):
    return KaplanMeierFitter().fit([time for time, _ in times], [is_event for _, is_event in times])


def compare_pair(pair):
    arm, baseline = pair["arm"], pair["baseline"]
    compare_survival(fit(arm), pair["survival"])

    until = pair["until_s"]
    longest = max(time for time, _ in arm + baseline)
    assert until == min(longest, known_until(arm), known_until(baseline))
    compare_times(arm + baseline, until, pair["differences_s"])


def compare_times(both, until, differences):
    """The differences of pseudo-values of restricted means (Andersen, Hansen and Klein 2004)."""
    n = len(both)
    whole = restricted_mean_survival_time(fit(both), until)
    values = []
    for index in range(n):
        others = both[:index] + both[index + 1 :]
        values.append(n * whole - (n - 1) * restricted_mean_survival_time(fit(others), until))
    expected = numpy.array(values[: n // 2]) - numpy.array(values[n // 2 :])
    for found, difference in zip(differences, expected, strict=True):
        same(found, difference, "difference of times", rel_tol=1e-7, abs_tol=1e-7)


def known_until(times):
    """Up to which time the curve is known: without an end if it reaches zero."""
    curve = fit(times).survival_function_["KM_estimate"]
    return math.inf if curve.iloc[-1] < 1e-9 else curve.index[-1]


def compare_survival(expected, found):
    table = expected.event_table.iloc[1:]
    curve = pandas.DataFrame(found["curve"]).set_index("time_s")
    if 0.0 in curve.index:
        # lifelines puts times of 0 into the row from which every curve begins.
        table = expected.event_table
    assert list(curve.index) == list(table.index)
    for column, name in [("at_risk", "at_risk"), ("events", "observed"), ("censored", "censored")]:
        assert list(curve[column]) == list(table[name]), column
    assert (found["n"], found["events"]) == (int(curve["at_risk"].iloc[0]), int(curve["events"].sum()))

    # Greenwood's variance as a share of the square of the curve, and the number of runs without censoring that have it.
    greenwood = 0.0
    effective = len(curve)
    for time, step in curve.iterrows():
        at_risk, events, share = step["at_risk"], step["events"], step["share"]
        same(share, expected.survival_function_["KM_estimate"][time], f"share at {time}")
        if events < at_risk:
            greenwood += events / (at_risk * (at_risk - events))
        if share > 1 - 1e-12:
            effective = at_risk
        elif share > 1e-9:
            effective = (1 - share) / (share * greenwood)
        # At the ends 0 and 1 the interval is given by its formula as well.
        low, high = wilson(max(share, 0.0), effective)
        same(step["low"], max(low, 0.0), f"low at {time}")
        same(step["high"], min(high, 1.0), f"high at {time}")

    # lifelines compares with one half to the last bit.
    shares = expected.survival_function_["KM_estimate"]
    shares = shares.mask(numpy.isclose(shares, 0.5), 0.5)
    same(open_time(found["median_s"]), median_survival_times(shares), "median")
    for end, name in [("low", "median_low_s"), ("high", "median_high_s")]:
        reached = [time for time, value in curve[end].items() if value <= 0.5 + 1e-9]
        same(open_time(found[name]), min(reached, default=math.inf), name)


def wilson(share, n):
    """The shares whose score is the quantile of the normal distribution: the roots of a quadratic equation."""
    z = stats.norm.ppf(0.975)
    roots = numpy.roots([1 + z**2 / n, -(2 * share + z**2 / n), share**2])
    return sorted(float(root.real) for root in roots)


def open_time(time):
    return math.inf if time is None else time


def compare_share(share):
    n, more, fewer = share["n"], share["only_arm"], share["only_baseline"]
    interval = stats.binomtest(more, n).proportion_ci(method="wilson")
    same_estimate(share["share"], more / n, interval, n)
    ends = tango(more, fewer, n)
    same_estimate(share["difference"], (more - fewer) / n, ends, n, rel_tol=1e-5, abs_tol=1e-5)


def tango(more, fewer, n):
    """The differences whose score is the quantile of the normal distribution, the other parameter by maximum likelihood."""

    def score(difference):
        low, high = max(0.0, -difference), (1 - difference) / 2

        def unlikely(only_baseline):
            shares = [only_baseline + difference, only_baseline, 1 - 2 * only_baseline - difference]
            counts = [more, fewer, n - more - fewer]
            return -sum(count * math.log(max(share, 1e-300)) for count, share in zip(counts, shares) if count)

        only_baseline = optimize.minimize_scalar(unlikely, bounds=(low, high), options={"xatol": 1e-14}, method="bounded").x
        variance = n * (2 * only_baseline + difference * (1 - difference))
        return (more - fewer - n * difference) / math.sqrt(max(variance, 1e-300))

    value = (more - fewer) / n
    z = stats.norm.ppf(0.975)
    low = -1.0 if value == -1 else optimize.brentq(lambda difference: score(difference) - z, -1 + 1e-9, value, xtol=1e-12)
    high = 1.0 if value == 1 else optimize.brentq(lambda difference: score(difference) + z, value, 1 - 1e-9, xtol=1e-12)
    return low, high


def main():
    # lifelines warns of small samples, and SciPy of samples with ties.
    warnings.simplefilter("ignore")
    found = json.load(sys.stdin)
    for sample in found["samples"]:
        compare_sample(sample)
    for pair in found["pairs"]:
        compare_pair(pair)
    for share in found["shares"]:
        compare_share(share)
    print(json.dumps({kind: len(found[kind]) for kind in ("samples", "pairs", "shares")}))


if __name__ == "__main__":
    main()
