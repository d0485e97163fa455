"""How hard the blades must press, from how thick the wood is."""

import math

#: Shear stress at which a cane parts under a flat-edged blade (Pa): Sessiz, Eliçin and Bayhan, "Cutting force and
#: energy requirement of Boğazkere grape cane", Scientific Papers B, Horticulture LXIII, 2019, in the pruning season.
#: Other cultivars and seasons in these authors' papers lie between 9.6 and 22 MPa.
CUTTING_STRENGTH = 9.34e6


def cutting_force(radius: float) -> float:
    """Force (N) that parts round wood of this radius (m): strength times cross-section."""
    return CUTTING_STRENGTH * math.pi * radius**2
