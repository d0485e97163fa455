"""Mutation testing of what safety rests on."""
