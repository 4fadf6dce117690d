"""Numbers that the paper prints, as printed, and as they must be meant."""

import numpy as np

THETA_1_A = (-1.281, -0.1107, 0.413)
THETA_1_B = (0.0030, 0.0073, 0.0099)
THETA_1_DELAY = 5  # θ̂ of Example 1
TABLE_1_POLES = (1.0, -4.5130, -8.1438, -7.3452, 3.3117, -0.5969)
TABLE_1_MENDED_POLES = (1.0, -4.5130, 8.1438, -7.3452, 3.3117, -0.5969)
# numerators of g11, g12, g21, g22, highest power first
TABLE_1 = (
    (
        (0.0024, -0.0086, 0.01167, -0.0070, 0.0016),
        (-9.0795e-6, 3.2188e-5, -4.2938, 2.5550, -5.7232e-6),
    ),
    ((-0.0169, 0.0608, -0.0823, 0.0494, -0.0111), (0.0281, -0.1014, 0.1371, -0.0823, 0.0185)),
)
TABLE_2_POLES = (
    (1.0, -0.1111, -0.1135, -0.1432, -0.1436, -0.1584),
    (1.0, -0.2079, -0.2279, -0.1270, -0.1125, -0.1104),
)
TABLE_2 = (
    ((0.0022, 0.0020, 0.0009, 0.0014, 0.0015), (-0.0168, -0.0111, -0.0075, -0.044, -0.0010)),
    ((-0.0160, 0.0168, 0.0213, -0.0229, 0.0007), (0.0905, -0.0653, 0.0495, 0.0590, -0.0699)),
)
# numerators of g12 and g21 interchanged, and −0.0044 for −0.044
TABLE_2_MENDED = (
    (TABLE_2[0][0], TABLE_2[1][0]),
    ((-0.0168, -0.0111, -0.0075, -0.0044, -0.0010), TABLE_2[1][1]),
)


def responses(numerator: tuple[float, ...], poles: tuple[float, ...], samples: int) -> np.ndarray:
    """Return the unit step response of numerator / poles, powers of z, shape (samples,)."""
    from scipy.signal import lfilter

    padded = np.concatenate([np.zeros(len(poles) - len(numerator)), numerator])
    return np.asarray(lfilter(padded, poles, np.ones(samples)))


def gain(numerator: tuple[float, ...], poles: tuple[float, ...]) -> float:
    """Return the gain at steady state."""
    return float(sum(numerator) / sum(poles))
