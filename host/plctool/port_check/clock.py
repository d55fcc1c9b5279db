"""How fast a controller's clock goes against the host's, from readings over a link.

Each reading is late by an unknown part of its round trip, so the quickest of its time slot counts (the minimum-delay
filter of NTP). The clock of a simulated board stands still while the host gives it no processor, and a host stalls,
too: that makes steps, not a slope. So slopes are taken within windows, and the drift is the mean of those that agree;
the windows with a step in them are outliers. A short window is hit by few steps, but blurred by round trips; the
shortest one that is sharp enough counts. A clock that loses ticks all the time loses them in every window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean, median, pstdev

SLOT = 0.025  # s; one reading of each counts
WINDOWS = (0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # s
MIN_WINDOWS = 16  # of one length

_DEVIATION_OF_MAD = 1.4826  # standard deviation of a normal distribution in median absolute deviations
_OUTLIER = 2.5  # standard deviations from the median
_CERTAINTY = 2.0  # standard deviations: 95 %


@dataclass(frozen=True)
class Reading:
    """The controller's time, the host's at the middle of the question, and how long question and answer took [s]."""

    device: float
    host: float
    trip: float


@dataclass(frozen=True)
class Rate:
    """`drift` is 0.01 for a clock that is 1 % fast, known to +-`uncertainty`; `lost` is the share of the time that the
    clock stood still besides (negative: leapt forward)."""

    drift: float
    uncertainty: float
    lost: float


def measure(readings: Sequence[Reading], sharpness: float) -> Rate:
    """The rate of a clock, from the shortest window that gives an uncertainty of at most `sharpness`, or else from the
    one that gives the least. It is infinite when there are too few readings."""
    kept = _quickest(readings)
    rates = [rate for window in WINDOWS if (rate := _in_windows(kept, window))]
    sharp = (rate for rate in rates if rate[1] <= sharpness)
    drift, uncertainty = next(sharp, min(rates, key=lambda rate: rate[1], default=(0.0, math.inf)))
    return Rate(drift, uncertainty, drift - _slope(kept[0], kept[-1]) if rates else 0.0)


def _slope(first: Reading, last: Reading) -> float:
    """How much faster than the host's the clock went in between."""
    return (last.device - first.device) / (last.host - first.host) - 1


def _quickest(readings: Sequence[Reading]) -> list[Reading]:
    """Of each time slot the reading with the shortest round trip, in their order."""
    best: dict[int, Reading] = {}
    for reading in readings:
        slot = int((reading.host - readings[0].host) / SLOT)
        if slot not in best or reading.trip < best[slot].trip:
            best[slot] = reading
    return list(best.values())


def _in_windows(readings: Sequence[Reading], window: float) -> tuple[float, float] | None:
    """Drift and uncertainty from all windows of a length; None when there are too few, or most are outliers."""
    drifts: list[float] = []
    end = 0
    for first in readings:
        while end < len(readings) and readings[end].host - first.host < window:
            end += 1
        if end == len(readings):
            break
        drifts.append(_slope(first, readings[end]))
    if len(drifts) < MIN_WINDOWS or len(usual := _without_outliers(drifts)) < len(drifts) / 2:
        return None
    count = len(usual) / 2  # each reading begins one window and ends another
    return mean(usual), _CERTAINTY * pstdev(usual) / math.sqrt(count)


def _without_outliers(values: list[float]) -> list[float]:
    """The values around the median, again and again until none is far from the others."""
    while True:
        middle = median(values)
        deviation = _DEVIATION_OF_MAD * median(abs(value - middle) for value in values)
        inside = [value for value in values if abs(value - middle) <= _OUTLIER * deviation]
        if len(inside) == len(values):
            return values
        values = inside
