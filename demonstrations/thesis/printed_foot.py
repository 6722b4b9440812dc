"""Eqs. 5.11 and 5.12 as printed: the thesis's M-file (appendix A4) with its errors.

This is a reproduction; ``statics.py`` has correct equations (``docs/errata.md``, rows 12 and 13).
The M-file uses inches. Its results depend on the unit by two constants: 0.0001, which keeps the
square root of the plantar actuator from zero, and 0.001 as a small coupling to the
tarsal-metatarsal joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MILLIMETRES_PER_INCH = 25.4


@dataclass(frozen=True)
class Printed:
    """Matrices that the M-file prints.

    Attributes
    ----------
    compliance : ndarray, shape (2, 2)
        C_x of eq. 5.11 in mm/N.
    damping : ndarray, shape (2, 2)
        D_x of eq. 5.12 in N s/mm.
    """

    compliance: np.ndarray
    damping: np.ndarray


def printed(unit: float = 1.0, offset: float = 1e-4) -> Printed:
    """Return the results of the M-file.

    Parameters
    ----------
    unit : float
        Factor of lengths: 1 for inches as printed, :data:`MILLIMETRES_PER_INCH` for millimetres.
    offset : float
        Addend of the length of the plantar actuator, in the unit of lengths.

    Returns
    -------
    Printed

    Raises
    ------
    ValueError
        If a length is not positive, or the plantar triangle is singular without an offset.
    """
    if unit <= 0.0 or offset <= 0.0:
        raise ValueError(
            f"unit {unit:g} and offset {offset:g} must be positive: at 0 the plantar triangle is"
            " singular"
        )
    both = _joint_to_cartesian(unit) @ _actuator_to_joint(unit, offset)
    return Printed(compliance=both @ both.T / 9.1, damping=both @ both.T * 1700.0)


def _joint_to_cartesian(unit: float) -> np.ndarray:
    """Return the matrix of the M-file, which differs from eq. 5.3: sines, and missing terms."""
    l1 = 2.00 * unit
    l2 = 2.46 * unit
    l3 = 0.93 * unit
    b_pf, b_df = np.radians([49.03, 30.896])
    s = l2 * np.sin(b_pf + b_df)
    return np.array(
        [
            [-l1 * np.sin(b_pf) - s - l3, s - l3, -l3],
            [-l1 * np.cos(b_pf) - s, -s, 0.0],
        ]
    )


def _actuator_to_joint(unit: float, offset: float) -> np.ndarray:
    """Return the matrix dtheta/dl of the M-file."""
    b_po, b_an = np.radians([57.66, 50.71])
    g_po, g_an, g_do = np.radians([12.901, 6.126, 15.064])
    pl = 5.48 * unit  # the other lengths cancel
    r_an = 0.71 * unit
    r_po = 1.64 * unit
    r_do = 0.91 * unit
    r_pl = 0.64 * unit
    to_joint = np.zeros((3, 4))
    to_joint[0, 0] = -1.0 / (r_an * np.sin(b_an - g_an))
    to_joint[0, 1] = 1.0 / (r_po * np.sin(b_po - g_po))
    to_joint[1, 2:] = -0.001, 0.001
    to_joint[2, 2] = -1.0 / (r_do * np.sin(g_do))
    lengthened = pl + offset
    to_joint[2, 3] = lengthened * r_pl / np.sqrt(lengthened**2 - pl**2)
    return to_joint
