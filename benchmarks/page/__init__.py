"""The page in a real browser, its load on the machine, and its pictures."""
