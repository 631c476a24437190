"""Heading drift: how far a sensor's heading has moved since its neutral pose, estimated in the dance.

A Kalman filter follows three numbers: the drift that is left (degrees), its rate (degrees a second), and how
far this dancer's arm is off the habit of the show's phrases (degrees, constant). It hears three witnesses:

- a sensor that lies (no dancer holds an arm that still) shows its rate by itself;
- a dancer that stands as in the neutral pose most often faces the front as well;
- a dancing arm points where the habit of its tilt says, as far as the body faces the front.

A body may face elsewhere, for a bar or for minutes. Each witness therefore counts with the probability that
it is one (probabilistic data association, Bar-Shalom and Tse 1975): far from what is expected it counts for
nothing. A body that turns aside as slowly as sensors drift cannot be told from drift: MOST_RATE bounds the
harm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from appliance.pose.turns import Quaternion, dot
from appliance.sensor.heading_habit import HeadingHabit, up_of
from appliance.sensor.neutral import NeutralPose, turned

SAMPLE_S = 0.2  # from one look at the newest reading to the next
MOST_RATE = 5.0 / 60.0  # degrees a second that a correction moves: a sensor drifts by 3 a minute at most
_CORRECT_S = 1.0  # from one step of the correction to the next
_SURE = 0.5  # standard deviations that a drift must exceed: what is below stays

# Assumed before anything is measured; degrees and seconds.
_RATE = 2.2 / 60.0  # standard deviation of a rate that is not known yet
_HIGHEST_RATE = 4.0 / 60.0
_RATE_WALK = (0.7 / 60.0) ** 2 / 1800.0  # with the temperature: 0.7 degrees a minute in half an hour
_OFF_HABIT = 35.0  # standard deviation between dancers: 20 were measured, strangers to the phrases are common
_AT_NEUTRAL = 1.0  # standard deviation right after a neutral pose
_AFTER_GAP = 5.0  # after a heading that was carried over, or reset by a person

_WINDOW_S = 2.0  # one witness of a dance: shorter ones are noisier, in longer ones the body turns
_STEADY = 0.8  # resultant of a window whose arm points one way, of what its tilts promise
_LEAST_KNOWN = 0.2  # mean length of the habit's directions in a window
_DANCE = 16.0  # standard deviation of a window, a body that faces the front
_USUAL = _DANCE**2, 0.6 * _DANCE**2, 0.7, 0.35  # statistics of the windows, until they are learned
_LEARNED = 1.0 / 150.0  # each window counts so much in these statistics
_LIKE = 0.4, 0.97  # least and most correlation
_LEAST_PEAK = 0.02
_FACING = 0.5  # share of the time in which a dancer faces the front
_STANDS_S = 1.5
_STANDS_LIKE = math.cos(math.radians(10.0))  # tilt against the neutral pose's
_STANDING = 9.0  # standard deviation of where a standing dancer faces
_LIES_S = 30.0
_LIES_LIKE = math.cos(math.radians(0.3))  # no arm keeps its tilt so well
_LYING_NOISE = 0.15  # a lying sensor reads its heading with this noise
_ANY = 1.0, 0.0, 0.0, 0.0


class HeadingDrift:
    """The drift of one sensor. Time is an argument; the state is plain numbers.

    corrected: degrees taken out since the last neutral pose, heading reset or power-on.
    """

    SNAPSHOT = (
        *("corrected", "_drift", "_rate", "_off", "_spread", "_looked_at", "_updated_at", "_corrected_at"),
        *("_stood", "_window", "_samples", "_surprise", "_means", "_lies_since", "_lies_as"),
    )
    TIMES = ("_looked_at", "_updated_at", "_corrected_at", "_lies_since")

    def __init__(self, habit: HeadingHabit | None = None, at_neutral: Sequence[float] = (1.0, 0.0, 0.0, 0.0)):
        """habit: of the joint that the sensor holds; None: unknown. at_neutral: as in `neutral.Mounting`."""
        self._habit = habit
        w, x, y, z = (float(part) for part in at_neutral)
        self._neutral_inverse = w, -x, -y, -z
        self.corrected = 0.0
        self._drift = self._rate = self._off = 0.0
        self._spread = [
            0.0
        ] * 6  # covariance: drift drift, drift rate, drift off, rate rate, rate off, off off
        self._looked_at = self._updated_at = self._corrected_at = -math.inf
        self._stood = False
        self._window = [0.0] * 3  # sum of directions against the habit (real, imaginary), of their lengths
        self._samples = 0
        self._surprise = 0.0  # the one before
        self._means = list(_USUAL)  # squares and neighbours' products of surprises, shares, curvatures
        self._lies_since, self._lies_as = -math.inf, _ANY
        self.restart()

    @property
    def uncertainty(self) -> float:
        """Standard deviation of the drift that is left, degrees."""
        return math.sqrt(self._spread[0])

    @property
    def rate(self) -> float:
        """The sensor's drift as estimated, degrees a minute."""
        return 60.0 * self._rate

    def restart(self) -> None:
        """Another power-on or another wearable: nothing is known of its rate."""
        self._rate, self._spread[3] = 0.0, _RATE**2
        self.take_neutral()

    def take_front(self, uncertainty: float = _AFTER_GAP) -> None:
        """The heading was set, so exactly (degrees); the estimates of the rate and of the habit stay."""
        self.corrected = self._drift = 0.0
        self._spread = [uncertainty**2, 0.0, 0.0, self._spread[3], 0.0, self._spread[5]]
        self._forget_window()
        self._stood, self._lies_since = True, -math.inf  # this stillness has been heard

    def take_neutral(self) -> None:
        """A neutral pose was taken: perhaps of another dancer."""
        self._off, self._spread[5] = 0.0, _OFF_HABIT**2
        self.take_front(_AT_NEUTRAL)

    def look(
        self,
        reading: Quaternion,
        joint: Sequence[float],
        pose: NeutralPose | None,
        still_s: float,
        now: float,
    ) -> float:
        """Hear the newest reading (sensor axes) and its joint's orientation (w, x, y, z; at_neutral's frame).

        Degrees by which `pose.heading` is to grow now, mostly 0. Call it after every frame; it works every
        SAMPLE_S. pose: None while none is in force. still_s: as neutral.Stillness counts.
        """
        if now - self._looked_at < SAMPLE_S:
            return 0.0
        if now - self._looked_at > _WINDOW_S:  # silence: nothing was seen
            self._forget_window()
            self._lies_since = -math.inf
        if self._updated_at == -math.inf:
            self._updated_at = self._corrected_at = now
        self._looked_at = now
        self._hear_lying(reading, now)
        if pose is None:
            return 0.0
        self._hear_standing(reading, pose, still_s, now)
        if still_s < 1.0 and self._habit is not None:
            self._hear_dance(self._habit, joint, now)
        else:
            self._forget_window()
        return self._correction(now)

    def _hear_lying(self, reading: Quaternion, now: float) -> None:
        """A sensor that lies: the change of its heading is drift."""
        up = _vertical(reading)
        if self._lies_since == -math.inf or dot(up, _vertical(self._lies_as)) < _LIES_LIKE:
            self._lies_since, self._lies_as = now, reading
            return
        lain_s = now - self._lies_since
        change = math.degrees(turned(self._lies_as, reading) or 0.0)
        if abs(change) > _LYING_NOISE * 4.0 + _HIGHEST_RATE * lain_s:  # turned by hand
            self._lies_since, self._lies_as = now, reading
        elif lain_s >= _LIES_S:
            self._predict(now)
            self._update((0.0, 1.0, 0.0), change / lain_s - self._rate, 2.0 * (_LYING_NOISE / lain_s) ** 2)
            self._lies_since, self._lies_as = now, reading

    def _hear_standing(self, reading: Quaternion, pose: NeutralPose, still_s: float, now: float) -> None:
        """A dancer that stands as in the neutral pose, once in each stillness."""
        if still_s < _STANDS_S:
            self._stood = False
        elif not self._stood and dot(_vertical(reading), _vertical(pose.orientation)) > _STANDS_LIKE:
            self._stood = True
            self._predict(now)
            heading = math.degrees((turned(pose.orientation, reading) or 0.0) - pose.heading)
            surprise = math.remainder(heading - self._drift, 360.0)
            self._weigh((1.0, 0.0, 0.0), surprise, _STANDING**2, 1.0)

    def _hear_dance(self, habit: HeadingHabit, joint: Sequence[float], now: float) -> None:
        """A sample of the arm's direction against its habit; a full window is a witness."""
        w, y = _turn_of(joint, self._neutral_inverse)
        length = math.hypot(w, y) or 1.0
        w, y = w / length, y / length
        expected = habit.expected(up_of(joint))
        against = complex(w * w - y * y, 2.0 * w * y) * expected.conjugate()
        window = self._window
        window[0] += against.real
        window[1] += against.imag
        window[2] += abs(expected)
        self._samples += 1
        if self._samples < round(_WINDOW_S / SAMPLE_S):
            return
        resultant = math.hypot(window[0], window[1])
        if window[2] > _LEAST_KNOWN * self._samples and resultant > _STEADY * window[2]:
            self._predict(now)
            heading = math.degrees(math.atan2(window[1], window[0]))
            surprise = math.remainder(heading - self._drift - self._off, 360.0)
            self._weigh((1.0, 0.0, 1.0), surprise, _DANCE**2, self._repeats(surprise))
        self._forget_window()

    def _repeats(self, surprise: float) -> float:
        """How many windows like this one say as much as one independent witness.

        Neighbours say nearly the same (their correlation, of an autoregressive process): a body that faces
        elsewhere for long says it once. And all together say only as much as their distribution has a peak at
        the front (the mean curvature of its logarithm): a body that faces everywhere says nothing.
        """
        share = _share(surprise, _DANCE**2)
        curvature = share * (1.0 - (1.0 - share) * surprise**2 / _DANCE**2)
        seen = surprise * surprise, surprise * self._surprise, share, curvature
        self._surprise = surprise
        for place, value in enumerate(seen):
            self._means[place] += _LEARNED * (value - self._means[place])
        squares, products, shares, curvatures = self._means
        likeness = min(max(products / squares, _LIKE[0]), _LIKE[1])
        peak = max(curvatures / shares, _LEAST_PEAK)
        return (1.0 + likeness) / ((1.0 - likeness) * peak)

    def _forget_window(self) -> None:
        self._window[:] = 0.0, 0.0, 0.0
        self._samples = 0

    def _correction(self, now: float) -> float:
        """The next step, once a second: so much of the drift as is sure, no faster than bounded."""
        elapsed = now - self._corrected_at
        if elapsed < _CORRECT_S:
            return 0.0
        self._predict(now)
        self._corrected_at = now
        sure = max(0.0, abs(self._drift) - _SURE * self.uncertainty)
        step = math.copysign(min(sure, MOST_RATE * min(elapsed, 2.0 * _CORRECT_S)), self._drift)
        self._drift -= step
        self.corrected += step
        return step

    def _predict(self, now: float) -> None:
        """The drift goes on at its rate, and the rate walks."""
        elapsed = max(0.0, now - self._updated_at)
        self._updated_at = now
        self._drift += elapsed * self._rate
        dd, dr, do, rr, ro, oo = self._spread
        walk = _RATE_WALK * elapsed
        self._spread = [
            dd + elapsed * (2.0 * dr + elapsed * rr) + walk * elapsed**2 / 3.0,
            dr + elapsed * rr + walk * elapsed / 2.0,
            do + elapsed * ro,
            min(rr + walk, _RATE**2),
            ro,
            oo,
        ]

    def _weigh(
        self, seen: tuple[float, float, float], surprise: float, variance: float, repeats: float
    ) -> None:
        """Update by a witness that is one with the probability that its surprise has."""
        share = _share(surprise, variance + self._variance(seen))
        if share > 0.01:
            self._update(seen, surprise, variance * repeats / share)

    def _update(self, seen: tuple[float, float, float], surprise: float, variance: float) -> None:
        """Kalman's step: seen = how the three numbers enter the witness."""
        dd, dr, do, rr, ro, oo = self._spread
        d, r, o = seen
        to_drift, to_rate = d * dd + r * dr + o * do, d * dr + r * rr + o * ro
        to_off = d * do + r * ro + o * oo
        total = variance + d * to_drift + r * to_rate + o * to_off
        self._drift += to_drift * surprise / total
        rate = self._rate + to_rate * surprise / total
        self._rate = min(max(rate, -_HIGHEST_RATE), _HIGHEST_RATE)
        self._off += to_off * surprise / total
        self._spread = [
            max(dd - to_drift**2 / total, 0.0),
            dr - to_drift * to_rate / total,
            do - to_drift * to_off / total,
            max(rr - to_rate**2 / total, 0.0),
            ro - to_rate * to_off / total,
            max(oo - to_off**2 / total, 0.0),
        ]

    def _variance(self, seen: tuple[float, float, float]) -> float:
        dd, dr, do, rr, ro, oo = self._spread
        d, r, o = seen
        return d * d * dd + r * r * rr + o * o * oo + 2.0 * (d * r * dr + d * o * do + r * o * ro)


def _share(surprise: float, variance: float) -> float:
    """The probability that a witness is one: that the body faces the front."""
    near = _FACING * math.exp(-0.5 * surprise**2 / variance) / math.sqrt(math.tau * variance)
    return near / (near + (1.0 - _FACING) / 360.0)


def _vertical(reading: Quaternion) -> tuple[float, float, float]:
    """The vertical (+z of the room) as seen from a sensor, unit."""
    w, x, y, z = reading
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _turn_of(joint: Sequence[float], neutral_inverse: Quaternion) -> tuple[float, float]:
    """w and y of the turn from the neutral orientation to the joint's: its heading is 2 atan2(y, w)."""
    aw, ax, ay, az = joint
    bw, bx, by, bz = neutral_inverse
    return aw * bw - ax * bx - ay * by - az * bz, aw * by - ax * bz + ay * bw + az * bx
