"""Pruning rules by the name of the system that the vines are trained in."""

from perception.config import RuleConfig
from perception.plant.model import Array, Spur
from perception.rules.guyot import decide_guyot
from perception.rules.keep_out import ANYWHERE, KeepOut
from perception.rules.spur import Decision, decide

RULES = {"spur": decide, "guyot": decide_guyot}


def apply_rule(spur: Spur, config: RuleConfig, beside: Array | None = None, keep_out: KeepOut = ANYWHERE) -> Decision:
    """What the configured rule says about one spur; arguments as of `perception.rules.spur.decide`."""
    return RULES[config.system](spur, config, beside, keep_out)
