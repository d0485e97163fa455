"""Whole-body methods: from a tool twist and a posture to the velocity of every actuator. Pure: no clock, no wire."""
