"""Pruning rules by the name of the system that the vines are trained in."""

from perception.config import RuleConfig
from perception.keep_out import ANYWHERE, KeepOut
from perception.plant import Array, Spur
from perception.rule import Decision, decide
from perception.rule_guyot import decide_guyot

RULES = {"spur": decide, "guyot": decide_guyot}


def apply_rule(spur: Spur, config: RuleConfig, beside: Array | None = None, keep_out: KeepOut = ANYWHERE) -> Decision:
    """What the configured rule says about one spur; arguments as of `perception.rule.decide`."""
    return RULES[config.system](spur, config, beside, keep_out)
