"""Compares the laboratory's statistics with SciPy and lifelines.

Standard input is JSON: samples and pairs of samples, each with what the laboratory found. Fails at the first difference;
otherwise prints how many samples, pairs and intervals of pairs were compared.
"""

import json
import math
import sys
import warnings
from types import SimpleNamespace

import numpy
import pandas
from lifelines import KaplanMeierFitter
from lifelines.statistics import logrank_test
from lifelines.utils import median_survival_times, restricted_mean_survival_time
from scipy import stats

EXACT = {"rel_tol": 1e-9, "abs_tol": 1e-9}
# Largest distance of a share of 20,000 draws from the share of all, in standard errors.
ERRORS = 5.0


def same(found, expected, what, **tolerance):
    assert math.isclose(found, expected, **(tolerance or EXACT)), f"{what}: {found}, not {expected}"


def compare_sample(sample):
    values = numpy.array(sample["values"])
    estimate = sample["estimate"]
    interval = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    same(estimate["mean"], values.mean(), "mean")
    same(estimate["half_width"], (interval.high - interval.low) / 2, "half width")
    assert estimate["n"] == len(values)

    for p, found in sample["quantiles"]:
        same(found, numpy.quantile(values, p), f"quantile {p}")
    steps = stats.ecdf(values).cdf
    assert [step["value"] for step in sample["ecdf"]] == list(steps.quantiles)
    for step, share in zip(sample["ecdf"], steps.probabilities, strict=True):
        same(step["share"], share, "distribution function")

    same(sample["dominance"], numpy.sign(values).mean(), "Cliff's delta")
    compare_sign_flip(values, sample["sign_flip"])
    compare_interval(values, sample)


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


def compare_interval(values, sample):
    found = sample["bootstrapped"]
    low, high = found["interval"]["bca"]["low"], found["interval"]["bca"]["high"]
    same(found["value"], values.mean(), "mean of the bootstrap")

    drawn = distribution(sample["resampled"], values.mean())
    expected = stats.bootstrap(
        (values,), numpy.mean, method="BCa", n_resamples=0, bootstrap_result=drawn
    ).confidence_interval
    same(low, expected.low, "BCa of the same resamples, low")
    same(high, expected.high, "BCa of the same resamples, high")

    own = stats.bootstrap((values,), numpy.mean, method="BCa", n_resamples=10_000, rng=1).confidence_interval
    # The share below an end varies by a few thousandths, with it the end by a few hundredths of the width; with few values,
    # resamples take few different ones.
    width = expected.high - expected.low
    tolerance = (0.1 if len(values) > 3 else 0.35) * width
    same(low, own.low, "BCa of other resamples, low", abs_tol=tolerance)
    same(high, own.high, "BCa of other resamples, high", abs_tol=tolerance)


def distribution(resampled, value):
    """The resamples as SciPy takes them. It compares them with the value to the last bit, in which equal ones may differ."""
    resampled = numpy.array(resampled)
    resampled[numpy.isclose(resampled, value, rtol=1e-12, atol=1e-12)] = value
    return SimpleNamespace(bootstrap_distribution=resampled)


def fit(times):
    return KaplanMeierFitter().fit([time for time, _ in times], [is_event for _, is_event in times])


def compare_pair(pair):
    """Returns whether there is an interval of the difference in restricted means."""
    arm, baseline = pair["arm"], pair["baseline"]
    compare_survival(fit(arm), pair["survival"])

    expected = logrank_test(
        [time for time, _ in arm],
        [time for time, _ in baseline],
        [is_event for _, is_event in arm],
        [is_event for _, is_event in baseline],
    )
    same(pair["log_rank"]["chi_square"], expected.test_statistic, "log-rank")
    same(pair["log_rank"]["p"], expected.p_value, "p of the log-rank test")

    share = numpy.mean([is_event for _, is_event in arm]) - numpy.mean([is_event for _, is_event in baseline])
    same(pair["share"], share, "share of events")
    until = pair["until_s"]
    longest = max(time for time, _ in arm + baseline)
    assert until == min(longest, known_until(arm), known_until(baseline))
    same(pair["restricted_mean_s"], restricted_mean_survival_time(fit(arm), until), "restricted mean")
    return compare_restricted(arm, baseline, until, pair)


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

    bands = expected.confidence_interval_
    for time, step in curve.iterrows():
        same(step["share"], expected.survival_function_["KM_estimate"][time], f"share at {time}")
        # lifelines has 1 where the share is 0, and the variance is not defined.
        if step["share"] > 1e-9:
            same(step["low"], bands.iloc[:, 0][time], f"low at {time}")
            same(step["high"], bands.iloc[:, 1][time], f"high at {time}")

    # lifelines compares with one half to the last bit.
    shares = expected.survival_function_["KM_estimate"]
    shares = shares.mask(numpy.isclose(shares, 0.5), 0.5)
    same(open_time(found["median_s"]), median_survival_times(shares), "median")
    limits = median_survival_times(bands[shares > 1e-9]).iloc[0]
    ends = [open_time(found["median_low_s"]), open_time(found["median_high_s"])]
    if curve["share"].iloc[-1] < 1e-9 and math.isinf(limits.iloc[0]):
        # The lower band falls to one half only where the share is 0.
        limits.iloc[0] = curve.index[-1]
    same(ends[0], limits.iloc[0], "lower end of the median")
    same(ends[1], limits.iloc[1], "upper end of the median")


def open_time(time):
    return math.inf if time is None else time


def compare_restricted(arm, baseline, until, pair):
    def difference(indices):
        resampled = [fit([times[index] for index in indices]) for times in (arm, baseline)]
        means = [restricted_mean_survival_time(times, until) for times in resampled]
        return means[0] - means[1]

    found = pair["restricted"]
    indices = numpy.arange(len(arm))
    same(found["value"], difference(indices), "difference of restricted means")
    if found["interval"] == "all_equal":
        assert numpy.ptp(pair["restricted_resampled"]) < 1e-9
        return False

    drawn = distribution(pair["restricted_resampled"], difference(indices))
    expected = stats.bootstrap(
        (indices,), difference, method="BCa", n_resamples=0, bootstrap_result=drawn, vectorized=False
    ).confidence_interval
    ends = found["interval"]["bca"]
    same(ends["low"], expected.low, "BCa of restricted means, low")
    same(ends["high"], expected.high, "BCa of restricted means, high")
    return True


def main():
    # lifelines warns of small samples, and SciPy of samples with ties.
    warnings.simplefilter("ignore")
    found = json.load(sys.stdin)
    for sample in found["samples"]:
        compare_sample(sample)
    intervals = [compare_pair(pair) for pair in found["pairs"]]
    print(json.dumps({"samples": len(found["samples"]), "pairs": len(intervals), "intervals": sum(intervals)}))


if __name__ == "__main__":
    main()
