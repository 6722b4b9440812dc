"""Reference results of the galvanostat, from the laws of its README on plain numbers.

Run ``python -m studies.references.galvanostat`` after changing a default value; its output is in
the component's folder ``reference``.
"""

import math
from collections.abc import Sequence

from studies.references.files import Reference

LIMIT = 1.3
COMPLIANCE = 15.0
RECOVERY = 50  # protection periods
PERIOD = 0.01  # s
STEP = 0.025  # s, two and a half protection periods
STOP = 20.0  # s
INPUTS = ("current_command", "voltage", "voltage_limit")
OUTPUTS = ("current", "saturated", "recovering")


def stimulus(time: float) -> tuple[float, float, float]:
    """Return a command up to 1.6 A and a voltage in stairs that passes the limit.

    The limit is lowered; then comes the compliance.
    """
    command = 1.6 * math.sin(0.9 * (time // 0.25) * 0.25)
    if time < 14.0:
        voltage = 1.2 * math.sin(0.7 * (time // 0.5) * 0.5)
        return command, voltage, 1.0 if time < 7.0 else 0.8
    return command, 18.0 if time < 14.5 else -16.0 if time < 17.0 else 12.0, 100.0


def instrument(
    inputs: Sequence[float], waiting: int, share: float, sampled: float
) -> tuple[float, int, int]:
    """Return outputs from the inputs and what the samples left.

    These are: periods to wait, share of the current, voltage.
    """
    command = inputs[0]
    high = LIMIT * share if sampled > 0 else LIMIT
    low = -LIMIT * share if sampled < 0 else -LIMIT
    current = 0.0 if waiting else min(max(command, low), high)
    return current, int(command > high or command < low), int(waiting > 0)


def main() -> None:
    """Write the files."""
    reference = Reference("galvanostat", INPUTS, OUTPUTS, STEP)
    waiting = 0
    share = 1.0
    sampled = 0.0
    taken = 0
    for k in range(round(STOP / STEP) + 1):
        now = stimulus(round(k * STEP, 9))
        left = waiting, share, sampled
        reference.add(round(k * STEP, 9), now, lambda u, left=left: instrument(u, *left))
        # samples from here up to the next communication point, which belongs to the next step
        while 5 * (k + 1) > 2 * taken:
            if waiting > 1:
                waiting -= 1
            else:
                waiting = RECOVERY if abs(now[1]) > now[2] else 0
            share = min(
                1.0, max(1e-6, share * min(2.0, COMPLIANCE / abs(now[1]) if now[1] else 2.0))
            )
            sampled = now[1]
            taken += 1
    reference.write("galvanostat", STOP, "event by event")


if __name__ == "__main__":
    main()
