"""Measurements anyone can repeat, each a subcommand of `rolling-panda bench`."""
