"""Users, passwords, sessions and the throttle of sign-in attempts."""
