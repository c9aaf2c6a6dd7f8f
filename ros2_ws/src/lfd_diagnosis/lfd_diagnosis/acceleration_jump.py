"""When the accelerometer jumped, and by how much: the means of some samples before and after."""

from math import sqrt

import numpy as np

from lfd_diagnosis.noise import LEARNT_NOISE, deviation, learn_noise, start_noise
from lfd_mpc.compiled import inner

WINDOWS, CLEARLY = (20, 40), 0.7
"""Steps that may be averaged before and after a jump: the shorter, the less the slope changes
meanwhile; the longer, the less its vibration matters. The longer ones are taken where so small a
share of the shorter ones' variance is left."""

LEAST_BEFORE = 20
"""Steps before a jump that it takes to see one."""

LOOKED_AT = 160
"""Steps that are looked at for a jump."""

NOISE, NOISE_MEMORY = (0.12, 0.03, 1.0), 100
"""What two means differ by though nothing jumped: deviations in m/s^2 at first, at least, and at
most; and samples that they are learnt from, few, since some roads are worse than others."""

AROUND, NEAR, AT_ONCE_SHARE = 10, 3, 0.6
"""Steps that are averaged to tell whether a change came at once, steps around where the values
divide best in which it may have come, and share of it that must have."""

AFTER, BEFORE, JUST_NOW, OF_LATE = 15, 75, 0.7, 0.6
"""Steps that are averaged after a change, most steps until before it, and share of it that must
have come meanwhile: a manoeuvre hides what the accelerometer made of it by a rare coincidence
only; share of it that came lately."""

JUMP = np.dtype(
    [
        ("values", "f8", (LOOKED_AT,)),
        ("derivatives", "f8", (LOOKED_AT,)),
        ("next", "i8"),
        ("count", "i8"),
        ("noise", LEARNT_NOISE, (len(WINDOWS),)),
        ("before", "f8"),
        ("total", "f8"),
        ("steps", "i8"),
        ("window", "i8"),
        ("found", "?"),
    ],
    align=True,
)
"""The last differences in m/s^2 between accelerometer and speed, the `derivatives` of the speed in
them, what `noise` the difference of two of their means has, and a jump that was `found`: the number
of the `window`, the mean `before`, and `total` and `steps` since."""


@inner
def start_jump(jump, learn):
    """Begin with nothing."""
    for noise in jump.noise:
        start_noise(noise, NOISE, learn, NOISE_MEMORY)
    restart_jump(jump)


@inner
def restart_jump(jump):
    """Nothing from before counts but what was learnt."""
    jump.next = jump.count = 0
    forget_jump(jump)


@inner
def forget_jump(jump):
    """None was found."""
    jump.found = False
    jump.before = jump.total = 0.0
    jump.window = jump.steps = 0


@inner
def follow_difference(jump, value, derivative):
    """Take one step's difference, and the speed's derivative in it (m/s^2)."""
    jump.values[jump.next] = value
    jump.derivatives[jump.next] = derivative
    jump.next = (jump.next + 1) % LOOKED_AT
    jump.count = min(jump.count + 1, LOOKED_AT)
    if jump.found and jump.steps < WINDOWS[jump.window]:
        jump.total += value
        jump.steps += 1


@inner
def learn_jump_noise(jump):
    """From a healthy step: by how much the mean differs though nothing jumped."""
    for i in range(len(WINDOWS)):
        window = WINDOWS[i]
        if jump.count >= 2 * window:
            last, former = _sum(jump, 0, window), _sum(jump, window, 2 * window)
            learn_noise(jump.noise[i], (last - former) / window, 0.0)


@inner
def least_beyond(jump, steps):
    """By how much the last differences all left those before to the same side (m/s^2), else 0."""
    if jump.count < steps + LEAST_BEFORE:
        return 0.0
    reference = _sum(jump, steps, steps + LEAST_BEFORE) / LEAST_BEFORE
    least = jump.values[jump.next - 1] - reference
    side = 1.0 if least > 0.0 else -1.0
    for ago in range(1, steps):
        off = jump.values[jump.next - 1 - ago] - reference
        if off * side < least * side:
            least = off
    return least if least * side > 0.0 else 0.0


@inner
def came_at_once(jump, change):
    """Whether what changed the differences by `change` (m/s^2) jumps to and fro as a sensor does,
    not as a road bends; also where nothing tells."""
    split, least = _best_split(jump), AT_ONCE_SHARE * abs(change)
    if not split:
        return True
    if jump.count < LOOKED_AT:
        # What is not among the differences since a silence came in it.
        newest, oldest = _sum(jump, 0, AROUND), _sum(jump, jump.count - AROUND, jump.count)
        if abs(newest - oldest) < AROUND * least:
            return True
    for ago in range(max(split - NEAR, 1), min(split + NEAR, jump.count - AROUND) + 1):
        window = min(ago, AROUND)
        after = _sum(jump, ago - window, ago) / window
        if abs(after - _sum(jump, ago, ago + AROUND) / AROUND) > least:
            return True
    return False


@inner
def came_lately(jump, change):
    """Whether the differences changed by most of `change` (m/s^2) since the oldest of them."""
    if jump.count < AFTER + LEAST_BEFORE:
        return False
    before = _sum(jump, jump.count - LEAST_BEFORE, jump.count) / LEAST_BEFORE
    changed = _sum(jump, 0, AFTER) / AFTER - before
    return changed * change >= OF_LATE * change * change


@inner
def own_share(jump, change):
    """The share that the accelerometer made of what changed the differences by about `change`
    (m/s^2), zero where it was the derivative alone; NaN where that did not come just now."""
    oldest = min(BEFORE + LEAST_BEFORE, jump.count)
    newest = oldest - LEAST_BEFORE
    if newest < 2 * AFTER:
        return np.nan
    changed = _sum(jump, 0, AFTER) / AFTER - _sum(jump, newest, oldest) / LEAST_BEFORE
    if changed * change < JUST_NOW * change * change:
        return np.nan
    after = _sum_of(jump, jump.derivatives, 0, AFTER) / AFTER
    before = _sum_of(jump, jump.derivatives, newest, oldest) / LEAST_BEFORE
    return 1.0 + (after - before) / changed


@inner
def steps_since(jump):
    """How many steps ago what changed just now did so, as far as that can be told."""
    return min(_best_split(jump), BEFORE)


@inner
def _sum(jump, newest, oldest):
    """Of the differences from `newest` steps ago to before `oldest` steps ago."""
    return _sum_of(jump, jump.values, newest, oldest)


@inner
def _sum_of(jump, values, newest, oldest):
    total = 0.0
    for ago in range(newest, oldest):
        total += values[jump.next - 1 - ago]
    return total


@inner
def _best_split(jump):
    """How many steps ago the last values divide best into those before and after; 0: nowhere."""
    split, after, best = 0, 0.0, 0.0
    before = _sum(jump, 1, 1 + LEAST_BEFORE) if jump.count > LEAST_BEFORE else 0.0
    for steps in range(1, jump.count - LEAST_BEFORE):
        after += jump.values[jump.next - steps]
        step = after / steps - before / LEAST_BEFORE
        clear = abs(step) * sqrt(steps / (steps + LEAST_BEFORE))
        if clear > best:
            best, split = clear, steps
        before += jump.values[jump.next - 1 - steps - LEAST_BEFORE]
        before -= jump.values[jump.next - 1 - steps]
    return split


@inner
def find_jump(jump):
    """Begin to measure a jump where the last values divide best into those before and after: of its
    two means the latter grows until its window is full."""
    forget_jump(jump)
    jump.steps = _best_split(jump)
    if not jump.steps:
        return
    jump.found = True
    for i in range(1, len(WINDOWS)):
        if jump.noise[i].variance < CLEARLY * jump.noise[jump.window].variance:
            jump.window = i
    window = WINDOWS[jump.window]
    oldest = min(jump.steps + window, jump.count)
    jump.before = _sum(jump, jump.steps, oldest) / (oldest - jump.steps)
    newest = max(jump.steps - window, 0)
    jump.total = _sum(jump, newest, jump.steps)
    jump.steps -= newest


@inner
def is_measured(jump):
    """Whether the jump is known well enough."""
    return jump.found and jump.steps == WINDOWS[jump.window]


@inner
def jump_noise(jump):
    """How well a jump may be known, in m/s^2."""
    return deviation(jump.noise[jump.window])


@inner
def jump_deviation(jump):
    """How well a jump is known that was found, in m/s^2: of what came after it the mean grows."""
    shorter = WINDOWS[jump.window] / jump.steps
    return jump_noise(jump) * sqrt(0.5 * (1.0 + shorter))


@inner
def jump_size(jump):
    """Of a jump that was found, in m/s^2."""
    return jump.total / jump.steps - jump.before
