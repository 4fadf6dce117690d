"""The figures of one valve, from what the rates show and from its closed loop."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.identification.closed_loop.closed_loop import ClosedLoop
from stiction_ros.identification.evidence.echoes import echo
from stiction_ros.identification.evidence.rates import Agreement, Look
from stiction_ros.identification.judgement.figures import Figures

ENDLESS = 100.0  # ratio that stands for a movement that grows without end
FEW = 2.0
"""Nats added to a gain of which a ratio is taken: what two parameters gain by chance."""


def figures_of(
    seen: Sequence[Look], silent: Sequence[float], agreed: Agreement, valve: int, closed: ClosedLoop
) -> Figures:
    """Return the figures of one valve.

    Args:
        seen: each rate.
        silent: −2 log likelihood at each where PV does not answer the valve.
        agreed: the rates that agree best on its friction.
        valve: index.
        closed: the loops, closed again with the best friction.
    """
    gains = [_gain(look, loss, valve) for look, loss in zip(seen, silent, strict=True)]
    sees = [look for look in seen if look.sees_process(valve)] or list(seen)
    material = [0.5 * look.accepted[valve].material_gain for look in sees]
    repeated = max(echo(look.problem, look.found.without[valve]) for look in seen)
    loop = closed.valves[valve]
    output = next((one for one in closed.outputs if one.name == loop.output), closed.outputs[0])
    beyond = 0.5 * min(agreed.gain, 2.0 * max(gains))
    return Figures(
        gain=beyond if agreed.alike else min(beyond, 0.0),
        ruled_out=-min(material),
        repeats=0.5 * repeated / (max(gains) + FEW),
        loop_gone=loop.gone,
        moves=float(np.count_nonzero(np.diff(agreed.look.found.best.stems[valve]))),
        controller_fit=0.0 if loop.controller is None else loop.controller.r_squared,
        band_share=min(loop.band_share, ENDLESS),
        cycle_share=0.0 if output.oscillation is None else output.oscillation.share,
    )


def _gain(look: Look, silent: float, valve: int) -> float:
    """Return the nats by which friction beats an ideal valve and a PV that does not answer."""
    return 0.5 * min(look.accepted[valve].gain, silent - look.found.best.loss)
