r"""What the controller tells of the process it was tuned for: how far a valve moves its output.

In closed loop a process and the noise beside it can stand in for each other: where noise alone
moves a loop, PV is explained as well by a valve that does nothing and noise of another colour.
Whoever tuned the controller knew better. With the controller's gain :math:`K_c` and reset time
:math:`T_i`, the answer :math:`S` of PV to a step of the valve after three reset times is

.. math:: K_c S(3 T_i) = q, \qquad \log q \sim N(\log 0.9, (\log 3)^2)

for all loops from a flow to a level: by the SIMC rules (Skogestad, J. Process Control 13, 2003)
q is .2 to 2 where a process settles, and 12 where it integrates. So q is a figure of the prior and
chosen with the others. A response of the other sign is no process: it is the controller seen
backwards, through samples that were averaged or held.
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.closed_loop.closed_loop import op_cycles, paired
from stiction_ros.identification.closed_loop.scaled_loop import scaled
from stiction_ros.identification.linear.response_prior import Reach
from stiction_ros.records.record import Record
from stiction_ros.signals.polynomials import largest_root

RESETS = 3.0  # reset times after which the answer is looked at
LEAST_FIT = 0.5  # R² of a controller whose gain is believed: rounded and held PV make it too small


@dataclasses.dataclass(frozen=True)
class Tuning:
    """The controller between an output and a valve."""

    valve: int  # index
    # K_c, of OP over its standard deviation per PV over its own; signed such that the process has
    # the same sign
    gain: float
    time: float  # 3 T_i, samples

    def reach(self, rate: int, pv_shrunk: float, edges: IntArray) -> Reach:
        """Return what it says of a response in rows.

        Args:
            rate: samples per row.
            pv_shrunk: standard deviation of the rows of PV over that of its samples.
            edges: of the groups of taps, shape (r + 1,).
        """
        taps, rows = float(edges[-1]), max(self.time / rate, 1.0)
        heights = np.clip(min(rows, taps) - edges[:-1], 0.0, np.diff(edges))
        seen = min(1.0, taps / rows)
        return Reach(self.valve, heights, seen / (self.gain * pv_shrunk))

    def holds(self, rate: int, pv_shrunk: float, taps: FloatArray) -> bool:
        """Return whether the loop of this controller and a process comes to rest.

        Its poles are the roots of (1 − q⁻¹) + K ((1 + 1 / T_i) − q⁻¹) H(q⁻¹), in rows. A loop that
        was recorded did not grow without end: a process behind which it would is none.

        Args:
            rate: samples per row.
            pv_shrunk: standard deviation of the rows of PV over that of its samples.
            taps: of the response of the scaled output to the scaled stem, shape (M,).
        """
        resets = self.time / RESETS / rate
        law = self.gain * pv_shrunk * np.array([1.0 + 1.0 / resets, -1.0])
        poles = np.convolve(law, np.append(0.0, taps))
        poles[:2] += [1.0, -1.0]
        return largest_root(poles) < 1.0


def tunings(record: Record) -> tuple[Tuning | None, ...]:
    """Return for each output the controller that reads it; None where none is believed."""
    none: list[Tuning | None] = [None] * len(record.outputs)
    loop = scaled(record, record.op)
    if loop is None:
        return tuple(none)
    for j, (i, law) in enumerate(paired(loop, op_cycles(loop)[1])):
        if i >= 0 and law.r_squared > LEAST_FIT and np.isfinite(law.integral_time):
            none[i] = Tuning(j, law.gain, RESETS * law.integral_time)
    return tuple(none)
